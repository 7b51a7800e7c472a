"""State of a job's run: whether it is there, whole, and of the job's present definition."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum
from pathlib import Path
from typing import Any

from ..core.base.errors import DigiclayError
from ..core.files.run_folder import format_json, lock_name, read_json, write_whole
from ..core.scene.scene_source import load, load_recorded
from ..core.session.finished_run import has_files, is_whole
from ..core.studies.job_table import JOB, MOVING, SCENE, Outputs, read_outputs
from ..plugins.method_loader import CODE

#: Where a series keeps its runs, beside its jobs; what each took; and in there, the size of each file.
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
    if not (_is_same(job / SCENE, run / SCENE, load) and _is_same(job / JOB, run / JOB, read_outputs)):
        return RunState.CHANGED
    if _read_code(job) != _read_code(run):
        return RunState.CHANGED
    timing = read_json(run / TIMING)
    if timing is None:
        return RunState.INCOMPLETE
    sizes = timing.get(FILES)
    whole = has_files(run, sizes) if isinstance(sizes, dict) else is_whole(run, load_recorded(run / SCENE))
    return RunState.WHOLE if whole else RunState.INCOMPLETE


def _read_code(folder: Path) -> bytes | None:
    """Return the code of a method of one's own in a folder; None without one."""
    try:
        return (folder / CODE).read_bytes()
    except FileNotFoundError:
        return None


def _is_same(one: Path, other: Path, read: Callable[[Path], object]) -> bool:
    """Return whether two files say the same; older versions wrote it otherwise."""
    try:
        return one.read_bytes() == other.read_bytes() or read(one) == read(other)
    except (OSError, DigiclayError):
        return False


def list_lacking(run: Path, outputs: Outputs) -> list[str]:
    """Return those of `MOVING` that are wanted and not there."""
    files = (read_json(run / TIMING) or {}).get(FILES)
    # Older runs have not noted their files.
    there = files if isinstance(files, Mapping) else {path.name for path in run.iterdir()}
    return [kind for kind in MOVING if getattr(outputs, kind) and f"{kind}.mp4" not in there]


def is_done(job: Path, run: Path) -> bool:
    """Return whether a job is done, its films too. `job`, `run`: as for `judge_run`."""
    try:
        return judge_run(job, run) is RunState.WHOLE and not list_lacking(run, read_outputs(job / JOB))
    except (OSError, DigiclayError):
        return False


def note_film(run: Path, kind: str, seconds: float, *, encoded: bool) -> None:
    """Note in a run what was drawn for one of its films, and its file once there is one.

    `kind`: of `MOVING`; `seconds`: time it took; added to what is noted already; `encoded`: whether the film
    is there now.
    """
    with lock_name(run / TIMING, PATIENCE):
        timing: dict[str, Any] = read_json(run / TIMING) or {}
        timing[kind] = (timing.get(kind) or 0.0) + seconds
        if encoded and isinstance(timing.get(FILES), dict):
            name = f"{kind}.mp4"
            timing[FILES] = {**timing[FILES], name: (run / name).stat().st_size}
        write_whole(run / TIMING, format_json(timing))
