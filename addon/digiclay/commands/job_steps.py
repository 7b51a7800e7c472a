"""Steps of a job: the session, its errors, meshes, pictures and films; its log."""

from __future__ import annotations

import argparse
import hashlib
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .. import __version__
from ..core.base.errors import OutputError, one_line
from ..core.files.run_folder import claim_files, lock_name, remove_abandoned
from ..core.scene.schema import Scene
from ..core.session.accuracy import estimate_errors, has_every_command
from ..core.session.finished_run import Run, read_run
from ..core.session.render_settings import format_range, list_missing, name_frame, read_range
from ..core.session.run_scene import run, save
from ..core.studies.job_table import JOB, SCENE, Outputs
from ..plugins.method_loader import describe_origin
from .export import exported, formats
from .gallery import of_heights, of_picture
from .render import ARRAYS, draw_film, draw_still, draw_turntable, stage_moving
from .run_state import PATIENCE, RunState, judge_run, list_lacking, note_film
from .stop import refuse_without_blender, require_surface

#: What the lines begin with that are meant for the series.
PROGRESS, ERROR = "@ ", "! "
#: Bytes at a log's end that are looked at for its last line.
TAIL = 4096


def read_tail(log: Path) -> list[str]:
    """Return the last lines of a log; none where it cannot be read."""
    try:
        with log.open("rb") as file:
            file.seek(max(0, log.stat().st_size - TAIL))
            return file.read().decode("utf-8", errors="replace").splitlines()
    except OSError:
        return []


def find_error(lines: list[str]) -> str:
    """Return the error that ended a job, in one line; empty where the lines have none."""
    told = [line.removeprefix(ERROR) for line in lines if line.startswith(ERROR)]
    return one_line(told[-1]) if told else ""


def read_fraction(lines: list[str]) -> float:
    """Return how much of a job is done, from 0 to 1."""
    for line in reversed(lines):
        _, _, number = line.removeprefix(PROGRESS).partition(" ")
        if line.startswith(PROGRESS) and number:
            try:
                return min(1.0, max(0.0, float(number)))
            except ValueError:
                break  # a line that is being written
    return 0.0


#: Seconds between two lines of progress.
PAUSE = 0.2

#: Told of a step, and of how much of the whole job is done.
Tell = Callable[[str, float], None]


def check_outputs(scene: Scene, outputs: Outputs) -> None:
    """Refuse, before any work, what is bound to fail after it."""
    if outputs.export:
        try:
            formats(",".join(outputs.export))
        except argparse.ArgumentTypeError as error:
            raise OutputError(f"export: {error}.") from None
        require_surface(scene, "export")
    if (outputs.needs_blender or outputs.export) and scene.recorder is None:
        raise OutputError("Pictures and exports need a recorder, and the scene has recorder = 'absent'.")
    if outputs.needs_blender:
        refuse_without_blender()


def make_outputs(
    scene: Scene,
    outputs: Outputs,
    out: Path,
    timing: dict[str, Any],
    stopped: Callable[[], bool],
    tell: Tell,
) -> None:
    """Run the session, and make all that belongs to it.

    `out`: the folder; `timing`: gets the seconds of each step; `stopped`: whether to stop; asked all the
    time; `tell`: told of a step, and of how much of the whole job is done. Raises KeyboardInterrupt when it
    was stopped.
    """
    names = ["run", *(n for n in ("errors", "export", "still", "turntable", "film") if getattr(outputs, n))]
    told = 0.0

    @contextmanager
    def step(name: str) -> Iterator[Callable[[int, int], None]]:
        """Time a step; give what is to be called with how much of it is done."""

        def progress(done: int, total: int) -> None:
            nonlocal told
            if time.monotonic() - told >= PAUSE:
                told = time.monotonic()
                tell(name, (names.index(name) + done / total) / len(names))

        if stopped():
            raise KeyboardInterrupt
        began = time.perf_counter()
        yield progress
        timing[name] = time.perf_counter() - began

    with step("run") as progress:
        versions = {"digiclay": __version__, **describe_origin(scene)}
        result = run(scene, progress=progress, stopped=stopped, versions=versions)
        if result.incomplete:
            raise KeyboardInterrupt
    if outputs.errors:
        with step("errors") as progress:
            if has_every_command(scene):
                errors = estimate_errors(scene, result.history, progress=progress, stopped=stopped)
                if errors is None:
                    raise KeyboardInterrupt
                result = result.with_errors(errors)
    with step("save"):
        save(result, out)
    history = result.history
    if not history:
        return
    if outputs.export:
        with step("export"):
            exported(scene, history, -1, outputs.export, out, outputs.mesh)
    if outputs.still:
        with step("still"):
            draw_still(scene, history, outputs.still, out / "still.png")
    if outputs.turntable:
        with step("turntable") as progress:
            path = out / "turntable.mp4"
            if not draw_turntable(scene, history, outputs.turntable, path, progress, stopped):
                raise KeyboardInterrupt
    if outputs.film:
        with step("film") as progress:
            if not draw_film(scene, history, outputs.film, out / "film.mp4", progress, stopped):
                raise KeyboardInterrupt
    with step("thumbnail"):
        if outputs.still:
            of_picture(out / "still.png", out)
        else:
            of_heights(history["height"][-1], scene.layout.rows, scene.layout.columns, out)


def find_frames(run: Path, kind: str) -> Path:
    """Return the folder of a film's frames: another one for each definition, and each version of digiclay.

    `run`: the folder of the job's run; `kind`: of `MOVING`.
    """
    known = [__version__.encode(), *((run / name).read_bytes() for name in (SCENE, JOB))]
    return run / f"frames-{kind}-{hashlib.sha256(b'|'.join(known)).hexdigest()[:12]}"


def make_frames(
    job: Path, run: Path, outputs: Outputs, kind: str, text: str, stopped: Callable[[], bool], tell: Tell
) -> bool:
    """Draw those frames of a range that are missing; return whether there were any.

    `job`: the folder of the job's files; `run`: that of its finished run; `outputs`: of the job; `kind`: of
    `MOVING`; `text`: the range, see `read_range`; `stopped`: asked before each frame; `tell`: told of a step,
    and of how much of it is done. Raises KeyboardInterrupt when it was stopped; frames that are drawn are
    kept. Raises OutputError when there is no finished run, or another process draws the same range.
    """
    looks = _find_looks(job, run, outputs, kind)
    if kind not in list_lacking(run, outputs):
        return False
    found = read_run(run, "time")
    frames = read_range(text, looks.count(found.history["time"]))
    folder = find_frames(run, kind)
    if not list_missing(folder, frames):
        return False
    refuse_without_blender()
    began = time.perf_counter()
    with lock_name(_make_folder(folder) / format_range(frames)):
        _draw(read_run(run, *ARRAYS), looks, frames, folder, run / f"{kind}.mp4", stopped, tell)
    note_film(run, kind, time.perf_counter() - began, encoded=False)
    return True


def make_film(
    job: Path, run: Path, outputs: Outputs, kind: str, stopped: Callable[[], bool], tell: Tell
) -> bool:
    """Make the film of its frames, and draw those that are missing; return whether there was none yet.

    `job`, `run`, `outputs`, `kind`, `stopped`, `tell`: as for `make_frames`.
    """
    looks, out = _find_looks(job, run, outputs, kind), run / f"{kind}.mp4"
    if kind not in list_lacking(run, outputs):
        return False
    refuse_without_blender()
    from ..compat import scratch
    from ..pictures.film import encode_film

    began = time.perf_counter()
    with claim_files([out], PATIENCE):
        found = read_run(run, *ARRAYS)
        frames = range(looks.count(found.history["time"]))
        folder = _make_folder(find_frames(run, kind))
        if list_missing(folder, frames):
            _draw(found, looks, frames, folder, out, stopped, tell)
        with scratch():
            encode_film([name_frame(folder, frame) for frame in frames], out, looks)
        note_film(run, kind, time.perf_counter() - began, encoded=True)
        shutil.rmtree(folder, ignore_errors=True)
    return True


def _find_looks(job: Path, run: Path, outputs: Outputs, kind: str) -> Any:
    """Return the settings of a film; refuse one that the job does not have, or that has no run yet."""
    looks = getattr(outputs, kind)
    if looks is None:
        raise OutputError(f"{job / JOB} has no section [{kind}].")
    state = judge_run(job, run)
    if state is not RunState.WHOLE:
        rule = f"the run in {run} is {state.value}: do 'digiclay job {job} --only run' first"
        raise OutputError(f"--only {kind} needs a finished run, and {rule}.")
    return looks


def _make_folder(folder: Path) -> Path:
    """Make the folder of frames in that of the run, and remove what killed processes have left in it."""
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder} cannot be made: {error.strerror or error}.") from None
    remove_abandoned(folder)
    return folder


def _draw(
    found: Run, looks: Any, frames: range, folder: Path, out: Path, stopped: Callable[[], bool], tell: Tell
) -> None:
    """Draw those frames that are missing; KeyboardInterrupt when it was stopped."""
    from ..pictures.film import draw_frames

    def progress(done: int, total: int) -> None:
        tell(out.stem, done / total)

    with stage_moving(found.scene, found.history, looks) as shots:
        if not draw_frames(shots, list_missing(folder, frames), folder, out, progress, stopped):
            raise KeyboardInterrupt
