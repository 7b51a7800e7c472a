"""Films of a finished run, frame by frame: any range on any machine, then the film of all frames.

The frames lie in the run's folder, in a folder of their own for each definition of the job. A frame is
written whole or not at all, and kept until the film is there: so a stop loses none.
"""

from __future__ import annotations

import hashlib
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .. import __version__
from ..core.base.errors import OutputError
from ..core.base.run_folder import claim_files, lock_name
from ..core.base.unfinished import remove_abandoned
from ..core.session.finished_run import Run, read_run
from ..core.session.frame_files import format_range, list_missing, name_frame, read_range
from ..core.studies.job_outputs import Outputs
from ..core.studies.job_table import JOB, SCENE
from .job_steps import Tell
from .refusals import refuse_without_blender
from .render import ARRAYS, stage_moving
from .run_state import PATIENCE, RunState, judge_run, list_lacking, note_film


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
    from ..pictures.film_file import encode_film

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
