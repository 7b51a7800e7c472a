"""Series: pieces of work in one folder, such as a sweep's points or the jobs of a JOBS file.

Its folder is made once, continued after a stop, and used by one process at a time. The result of
each piece is stored at once.
"""

import os
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from ..base.errors import DigiclayError, OutputError, explain_os_error, one_line
from ..files import run_folder
from ..files.file_lock import hold_lock
from ..files.tables import Table

#: The lock of the process that works in the folder.
LOCK = ".lock"

Piece = TypeVar("Piece")
Outcome = TypeVar("Outcome")
#: Pieces as they finish, each with a function that returns its outcome or raises its error.
Results = Generator[tuple[Piece, Callable[[], Outcome]], None, None]


@dataclass(frozen=True)
class Kind:
    """Kind of a series: its name, the file that identifies its folder, and the folders in it."""

    name: str
    mark: str
    folders: Sequence[str]


@contextmanager
def open_series(
    path: Path,
    kind: Kind,
    description: Table,
    refuse_another: Callable[[Any], None] | None = None,
) -> Iterator[None]:
    """Make the folder of a series, or continue one; no other process may use it until the block ends.

    An unreadable description in a folder without results counts as missing: the disk was full.
    """
    with ExitStack() as until_the_end:
        with ExitStack() as during_creation, explain_os_error(f"{path} cannot be used"):
            _make_folder(path, kind, during_creation, until_the_end)
            former = run_folder.read_json(path / kind.mark)
            if refuse_another is not None and (former is not None or not _is_bare(path, kind)):
                refuse_another(former)
            if former != description:
                run_folder.write_whole(path / kind.mark, run_folder.format_json(description))
            for name in kind.folders:
                run_folder.resolve_inside(path, name).mkdir(exist_ok=True)
                run_folder.remove_abandoned(path / name)
            run_folder.remove_abandoned(path)
        yield


def _make_folder(
    path: Path, kind: Kind, during_creation: ExitStack, until_the_end: ExitStack
) -> None:
    """Make the folder, if it does not exist, and lock it."""
    if path.exists() and not path.is_dir():
        raise OutputError(f"{path} is a file: choose another folder with --out.")
    if not path.exists() or os.access(path.resolve().parent, os.W_OK):
        # No run of this name can begin or end meanwhile.
        during_creation.enter_context(run_folder.lock_name(path))
    until_the_end.enter_context(run_folder.remove_if_empty(path.resolve() / kind.mark))
    path.mkdir(parents=True, exist_ok=True)
    if not (path / kind.mark).is_file() and not _is_bare(path, kind):
        what = f"contains something other than a {kind.name}"
        raise OutputError(f"{path} {what}: choose another folder with --out.")
    until_the_end.enter_context(
        hold_lock(path / LOCK, run_folder.describe_claim(path, "being used"))
    )


def _is_bare(path: Path, kind: Kind) -> bool:
    """Return whether a folder has no results: only lock, description and empty folders of a series."""
    for entry in path.iterdir():
        if entry.name in (LOCK, kind.mark) or run_folder.is_unfinished(entry):
            continue
        if entry.name not in kind.folders or not entry.is_dir() or any(entry.iterdir()):
            return False
    return True


def finish(
    results: Results[Piece, Outcome],
    keep: Callable[[Piece, Outcome], None],
    fail: Callable[[Piece, str], None],
) -> None:
    """Pass the outcome of each piece of a series to `keep` as it arrives, or its error to `fail`."""
    with closing(results):
        for piece, take in results:
            try:
                outcome = take()
            except Exception as error:  # the other pieces are independent of it
                fail(piece, describe_error(error))
            else:
                keep(piece, outcome)


def describe_error(error: Exception) -> str:
    """Return an error in one line; one that no user can cause begins with its type."""
    if isinstance(error, DigiclayError):
        return one_line(error)
    if isinstance(error, MemoryError):
        return "There is not enough memory: use fewer cells, or a higher recorder.every."
    return f"{type(error).__name__}: {one_line(error)}"
