"""Files for a render farm in the folder of a job series: ``digiclay batch JOBS --submit FORMAT``.

No network is contacted: what is printed in the end is how the files are handed to the farm.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Sequence
from pathlib import Path, PureWindowsPath
from typing import NamedTuple

from ..core.base.errors import OutputError
from ..core.files.run_folder import make_safe_name, resolve_inside, write_whole
from ..farms import series_plan
from ..farms.series_plan import Task, plan_series, split_frames
from .batch_folder import Folder
from .evaluation_pool import read_count
from .worker import find_program, start_blender

#: Frames of a film that a task draws unless told otherwise.
CHUNK = 50


class Submission(NamedTuple):
    """Series as a farm gets it: its name, folder and tasks, and the program with its first arguments."""

    name: str
    series: str
    tasks: Sequence[Task]
    program: Sequence[str]

    def show(self, *words: str) -> str:
        """Return a command as it is typed into a terminal."""
        return series_plan.join_words(words, windows=os.name == "nt")

    def find(self, name: str) -> str:
        """Return the path of a file in the folder of the series."""
        return os.path.join(self.series, name)


#: What a format makes: the text of each file by its path in the folder, and how they are submitted.
Written = tuple[dict[str, str], list[str]]


def _write_openjd(made: Submission) -> Written:
    """Return the job template."""
    name = "openjd.json"
    template = series_plan.format_template(made.name, made.tasks, made.program[1:])
    given = ["-p", f"{series_plan.name_program(made.program[1:])}={made.program[0]}"]
    return {name: template}, [
        f"check: {made.show('openjd', 'check', made.find(name))}",
        f"run on this machine: {made.show('openjd', 'run', made.find(name), *given)}",
    ]


def _write_flamenco(made: Submission) -> Written:
    """Return the job type and the job."""
    script, job = f"flamenco/{series_plan.SCRIPT.name}", "flamenco/job.json"
    files = {
        script: series_plan.SCRIPT.read_text(encoding="utf-8"),
        job: series_plan.format_job(made.name, made.tasks, made.program, made.series),
    }
    post = ("curl", "--header", "Content-Type: application/json", "--data-binary", f"@{made.find(job)}")
    return files, [
        f"once: put {made.find(script)} into the folder 'scripts' beside flamenco-manager, and restart it",
        f"submit: {made.show(*post, 'http://MANAGER:8080/api/v3/jobs')}",
    ]


def _write_cuecmd(made: Submission) -> Written:
    """Return the lists of commands."""
    lists = series_plan.format_lists(made.tasks, made.program, made.series)
    files = {f"cuecmd/{name}": text for name, text in lists.items()}
    said = [made.show("cuecmd", made.find(name)) for name in files]
    return files, ["submit each when the one before has ended:", *said]


#: The formats by their names.
FORMATS: dict[str, Callable[[Submission], Written]] = {
    "openjd": _write_openjd,
    "flamenco": _write_flamenco,
    "cuecmd": _write_cuecmd,
}


def add_options(parser: argparse.ArgumentParser, exclusive: argparse._MutuallyExclusiveGroup) -> None:
    """Add the options of a submission. `exclusive`: of options of which one may be given."""
    exclusive.add_argument(
        "--submit", metavar="FORMAT", choices=FORMATS,
        help=f"write the files of the jobs and those of a render farm: {', '.join(FORMATS)}; run none",
    )  # fmt: skip
    parser.add_argument(
        "--program", metavar="PATH",
        help="with --submit: digiclay, its Python or Blender on the machines there; default: the one running",
    )  # fmt: skip
    parser.add_argument(
        "--chunk", metavar="N", type=read_count,
        help=f"with --submit: frames of a film that a task draws; default {CHUNK}",
    )  # fmt: skip


def refuse_alone(arguments: argparse.Namespace) -> None:
    """Refuse the options of a submission without one."""
    for name in ("program", "chunk"):
        if getattr(arguments, name) is not None and arguments.submit is None:
            raise OutputError(f"--{name} must be given with --submit only.")


def write_farm_files(folder: Folder, form: str, program: str | None, chunk: int | None) -> list[str]:
    """Write the files of a farm, and return what is to be printed.

    `folder`: with the files of its jobs; `form`: of `FORMATS`; `program`: path on the machines of the farm;
    `chunk`: frames of a film that a task draws. Raises DigiclayError when a film cannot be made, or a path
    cannot be written down. No file is written then.
    """
    tasks = plan_series(folder.batch, chunk or CHUNK)
    made = Submission(make_safe_name(folder.batch.name), find_full(folder.path), tasks, find_start(program))
    files, said = FORMATS[form](made)
    for word in (made.series, *made.program):
        try:
            word.encode()
        except UnicodeEncodeError:
            raise OutputError(f"{word!r} is no valid text: choose another folder with --out.") from None
    _remove_former(folder.path, files)
    for name, text in files.items():
        path = resolve_inside(folder.path, *name.split("/"))
        path.parent.mkdir(exist_ok=True)
        write_whole(path, text.encode())
    count = len(split_frames(tuple(tasks)))
    return [f"{count} tasks written to {', '.join(str(folder.path / name) for name in files)}", *said]


def _remove_former(folder: Path, files: dict[str, str]) -> None:
    """Remove lists of commands of an earlier submission that this one does not have."""
    for path in folder.glob("cuecmd/[0-9]-*.txt"):
        if any(name.startswith("cuecmd/") for name in files) and f"cuecmd/{path.name}" not in files:
            path.unlink()


def find_full(path: Path) -> str:
    """Return a full path without ``..``, through the links by which the user named it where that is right."""
    full = os.path.abspath(path)
    return full if os.path.exists(full) and os.path.samefile(full, path) else os.path.realpath(path)


def find_start(program: str | None) -> list[str]:
    """Return a program of the farm, or this process's, and its arguments before those of digiclay."""
    if program is None:
        return find_program()[0]
    if not program.strip():
        raise OutputError("--program must be the path of digiclay or Blender (got an empty one).")
    # The paths of the farm need not be those of this system; this kind knows both separators.
    kind = PureWindowsPath(program).stem.lower()
    if kind.startswith("blender"):
        return start_blender(program)
    return [program, "-m", "digiclay"] if kind.startswith("python") else [program]
