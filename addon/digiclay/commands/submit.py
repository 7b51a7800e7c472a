"""Files for a render farm in the folder of a job series: ``digiclay batch JOBS --submit FORMAT``.

No network is contacted: what is printed in the end is how the files are handed to the farm.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path, PureWindowsPath

from ..core.base.errors import OutputError
from ..core.files.run_folder import make_safe_name, resolve_inside, write_whole
from ..farms.series_plan import FORMATS, Submission, plan_series, split_frames
from .batch_folder import Folder
from .evaluation_pool import read_count
from .worker import find_program, start_blender

#: Frames of a film that a task draws unless told otherwise.
CHUNK = 50
#: The option that asks for a submission, and those that need it.
SUBMIT = {
    "--submit FORMAT": (
        FORMATS, f"write the files of the jobs and those of a render farm: {', '.join(FORMATS)}; run none",
    ),
}  # fmt: skip
FARM_OPTIONS = {
    "--program PATH":
        "with --submit: digiclay, its Python or Blender on the machines there; default: the one running",
    "--chunk N": (read_count, f"with --submit: frames of a film that a task draws; default {CHUNK}"),
}  # fmt: skip


def refuse_alone(arguments: argparse.Namespace) -> None:
    """Refuse the options of a submission without one."""
    for name in ("program", "chunk"):
        if getattr(arguments, name) is not None and arguments.submit is None:
            raise OutputError(f"--{name} must be given with --submit only.")


def write_farm_files(folder: Folder, form: str, program: str | None, chunk: int | None) -> list[str]:
    """Write the files of a farm, or none in case of an error; return the lines to print."""
    tasks = plan_series(folder.batch, chunk or CHUNK)
    made = Submission(make_safe_name(folder.batch.name), find_full(folder.path), tasks, find_start(program))
    files, lines = FORMATS[form](made)
    for word in (made.series, *made.program):
        try:
            word.encode()
        except UnicodeEncodeError:
            raise OutputError(f"{word!r} is no valid text: choose another folder with --out.") from None
    if form == "cuecmd":  # an earlier submission may have had more lists
        for path in folder.path.glob("cuecmd/[0-9]-*.txt"):
            if f"cuecmd/{path.name}" not in files:
                path.unlink()
    for name, text in files.items():
        path = resolve_inside(folder.path, *name.split("/"))
        path.parent.mkdir(exist_ok=True)
        write_whole(path, text.encode())
    count = len(split_frames(tasks))
    return [f"{count} tasks written to {', '.join(str(folder.path / name) for name in files)}", *lines]


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
