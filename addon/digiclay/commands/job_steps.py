"""Steps of a job: the session, its errors, meshes, pictures and films; its log."""

import argparse
import hashlib
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from ..core.base.errors import DigiclayError, OutputError, one_line
from ..core.files import run_folder
from ..core.files.tables import Record
from ..core.scene.scene_source import load, load_recorded
from ..core.scene.schema import Scene
from ..core.session.finished_run import Run, has_files, is_whole, read_run, require_surface
from ..core.session.render_settings import format_range, list_missing, name_frame, read_range
from ..core.session.run_scene import run, save
from ..core.studies.job_table import JOB, MOVING, SCENE, Outputs, read_outputs
from ..core.version import __version__
from ..plugins.method_loader import CODE, describe_origin
from .arguments import formats
from .export import exported
from .gallery import of_heights, of_picture
from .refusals import refuse_without_blender
from .render import ARRAYS, draw_moving, draw_still, stage_moving

#: Where a series keeps its runs, beside its jobs; what each took; and in there, the size of each
#: file.
RUNS, TIMING, FILES = "runs", "timing.json", "files"
#: Seconds to wait for another process that makes or notes another film of the same run.
PATIENCE = 20.0


class RunState(Enum):
    """State of a job's run, without regard to its films."""

    ABSENT = "absent"
    CHANGED = "of another definition"
    INCOMPLETE = "incomplete"
    WHOLE = "whole"


def judge_run(job: Path, run: Path) -> RunState:
    """Return what there is of a run. `job`: the folder of the job's files; `run`: the folder of its run."""
    if not run.is_dir() or not any(run.iterdir()):
        return RunState.ABSENT
    if not all((run / name).is_file() for name in (SCENE, JOB)):
        return RunState.INCOMPLETE
    if not (
        _is_same(job / SCENE, run / SCENE, load) and _is_same(job / JOB, run / JOB, read_outputs)
    ):
        return RunState.CHANGED
    if _read_code(job) != _read_code(run):
        return RunState.CHANGED
    timing = run_folder.read_json(run / TIMING)
    if timing is None:
        return RunState.INCOMPLETE
    sizes = timing.get(FILES)
    whole = (
        has_files(run, sizes)
        if isinstance(sizes, dict)
        else is_whole(run, load_recorded(run / SCENE))
    )
    return RunState.WHOLE if whole else RunState.INCOMPLETE


def _read_code(folder: Path) -> bytes | None:
    """Return the code of a method of one's own in a folder; None without one."""
    try:
        return (folder / CODE).read_bytes()
    except FileNotFoundError:
        return None


def _is_same(first: Path, other: Path, read: Callable[[Path], object]) -> bool:
    """Return whether two files say the same; older versions wrote it otherwise."""
    try:
        return first.read_bytes() == other.read_bytes() or read(first) == read(other)
    except (OSError, DigiclayError):
        return False


def list_lacking(run: Path, outputs: Outputs) -> list[str]:
    """Return those of `MOVING` that are wanted and not there."""
    files = (run_folder.read_json(run / TIMING) or {}).get(FILES)
    # Older runs have not noted their files.
    there = files if isinstance(files, Mapping) else {path.name for path in run.iterdir()}
    return [kind for kind in MOVING if getattr(outputs, kind) and f"{kind}.mp4" not in there]


def is_done(job: Path, run: Path) -> bool:
    """Return whether a job is done, its films too. `job`, `run`: as for `judge_run`."""
    try:
        return judge_run(job, run) is RunState.WHOLE and not list_lacking(
            run, read_outputs(job / JOB)
        )
    except (OSError, DigiclayError):
        return False


def note_film(run: Path, kind: str, seconds: float, *, encoded: bool) -> None:
    """Note in a run what was drawn for one of its films, and its file once there is one."""
    with run_folder.lock_name(run / TIMING, PATIENCE):
        timing: Record = run_folder.read_json(run / TIMING) or {}
        timing[kind] = (timing.get(kind) or 0.0) + seconds
        if encoded and isinstance(timing.get(FILES), dict):
            name = f"{kind}.mp4"
            timing[FILES] = {**timing[FILES], name: (run / name).stat().st_size}
        run_folder.write_whole(run / TIMING, run_folder.format_json(timing))


#: What the lines begin with that are meant for the series.
PROGRESS, ERROR = "@ ", "! "
#: Bytes read at the end of a log.
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
    errors = [line.removeprefix(ERROR) for line in lines if line.startswith(ERROR)]
    return one_line(errors[-1]) if errors else ""


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


def check_outputs(scene: Scene, outputs: Outputs) -> None:
    """Refuse, before any work, what is bound to fail after it."""
    if outputs.export:
        try:
            formats(",".join(outputs.export))
        except argparse.ArgumentTypeError as error:
            raise OutputError(f"export: {error}.") from None
        require_surface(scene, "export")
    if (outputs.needs_blender or outputs.export) and scene.recorder is None:
        raise OutputError(
            "Pictures and exports need a recorder, and the scene has recorder = 'absent'."
        )
    if outputs.needs_blender:
        refuse_without_blender()


def find_frames(run: Path, kind: str) -> Path:
    """Return the folder of a film's frames, its own for each definition and each version of digiclay."""
    parts = [__version__.encode(), *((run / name).read_bytes() for name in (SCENE, JOB))]
    return run / f"frames-{kind}-{hashlib.sha256(b'|'.join(parts)).hexdigest()[:12]}"


#: Gets a step, and how much of the whole job is done.
Tell = Callable[[str, float], None]


@dataclass(frozen=True)
class Work:
    """A job that is being done."""

    #: Folder of the job's files, and that of its run.
    job: Path
    run: Path
    outputs: Outputs
    #: Returns whether to stop. All steps raise KeyboardInterrupt then; what is drawn is kept.
    stopped: Callable[[], bool]
    tell: Tell

    def make_outputs(self, scene: Scene, outputs: Outputs, out: Path, timing: Record) -> None:
        """Run the session, and make all outputs in a folder; `timing` gets the seconds of each step."""
        names = ["run", *(n for n in ("errors", "export", "still", *MOVING) if getattr(outputs, n))]
        drawn, stopped = 0.0, self.stopped

        @contextmanager
        def step(name: str) -> Iterator[Callable[[int, int], None]]:
            """Time a step; give the callback of its progress."""

            def progress(done: int, total: int) -> None:
                nonlocal drawn
                if time.monotonic() - drawn >= PAUSE:
                    drawn = time.monotonic()
                    self.tell(name, (names.index(name) + done / total) / len(names))

            if stopped():
                raise KeyboardInterrupt
            began = time.perf_counter()
            yield progress
            timing[name] = time.perf_counter() - began

        with step("run") as progress:
            versions = describe_origin(scene)
            result = run(scene, progress=progress, stopped=stopped, versions=versions)
            if result.incomplete:
                raise KeyboardInterrupt
        if outputs.errors:
            with step("errors") as progress:
                judged = result.estimate_errors(progress, stopped)
                if judged is None:
                    raise KeyboardInterrupt
                result = judged
        else:
            result = result.without_errors(f"errors = false in {JOB}")
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
        for kind in MOVING:
            if looks := getattr(outputs, kind):
                with step(kind) as progress:
                    if not draw_moving(
                        scene, history, looks, out / f"{kind}.mp4", progress, stopped
                    ):
                        raise KeyboardInterrupt
        with step("thumbnail"):
            if outputs.still:
                of_picture(out / "still.png", out)
            else:
                of_heights(history["height"][-1], scene.layout.rows, scene.layout.columns, out)

    def make_frames(self, kind: str, text: str) -> bool:
        """Draw the missing frames of a range of a film, see `read_range`; return whether there were any."""
        looks, run = self._find_looks(kind), self.run
        if kind not in list_lacking(run, self.outputs):
            return False
        frames = read_range(text, looks.count(read_run(run, "time").history["time"]))
        folder = find_frames(run, kind)
        if not list_missing(folder, frames):
            return False
        refuse_without_blender()
        began = time.perf_counter()
        with run_folder.lock_name(run_folder.make_folder(folder) / format_range(frames)):
            self._draw(read_run(run, *ARRAYS), looks, kind, frames, folder)
        note_film(run, kind, time.perf_counter() - began, encoded=False)
        return True

    def make_film(self, kind: str) -> bool:
        """Make the film of its frames, and draw those that are missing; return whether there was none yet."""
        looks, run, out = self._find_looks(kind), self.run, self.run / f"{kind}.mp4"
        if kind not in list_lacking(run, self.outputs):
            return False
        refuse_without_blender()
        from ..compat import scratch
        from ..pictures.film import encode_film

        began = time.perf_counter()
        with run_folder.claim_files([out], PATIENCE):
            finished = read_run(run, *ARRAYS)
            frames = range(looks.count(finished.history["time"]))
            folder = run_folder.make_folder(find_frames(run, kind))
            self._draw(finished, looks, kind, frames, folder)
            with scratch():
                encode_film([name_frame(folder, frame) for frame in frames], out, looks)
            note_film(run, kind, time.perf_counter() - began, encoded=True)
            shutil.rmtree(folder, ignore_errors=True)
        return True

    def make_films(self, outputs: Outputs) -> bool:
        """Make those films of some outputs that the run lacks; return whether there were any."""
        films = [self.make_film(kind) for kind in list_lacking(self.run, outputs)]
        return any(films)

    def _find_looks(self, kind: str) -> Any:
        """Return the settings of a film; refuse one that the job does not have, or that has no run yet."""
        looks = getattr(self.outputs, kind)
        if looks is None:
            raise OutputError(f"{self.job / JOB} has no section [{kind}].")
        state = judge_run(self.job, self.run)
        if state is not RunState.WHOLE:
            rule = f"the run in {self.run} is {state.value}: do 'digiclay job {self.job} --only run' first"
            raise OutputError(f"--only {kind} needs a finished run, and {rule}.")
        return looks

    def _draw(self, run: Run, looks: Any, kind: str, frames: range, folder: Path) -> None:
        """Draw those frames that are missing; what killed processes have left of others is removed."""
        run_folder.remove_abandoned(folder)
        if not list_missing(folder, frames):
            return
        from ..pictures.film import draw_frames

        def progress(done: int, total: int) -> None:
            self.tell(kind, done / total)

        out = self.run / f"{kind}.mp4"
        with stage_moving(run.scene, run.history, looks) as shots:
            if not draw_frames(
                shots, list_missing(folder, frames), folder, out, progress, self.stopped
            ):
                raise KeyboardInterrupt
