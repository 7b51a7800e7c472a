"""The folder of a sweep or a batch: begun once, gone on with, and worked in by one process at a time."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .errors import OutputError
from .file_lock import held
from .run_folder import busy, inside, lock_beside
from .unfinished import is_unfinished, remove_abandoned
from .whole_files import as_json, read_json, write_whole

__all__ = ["Kind", "series"]

#: The lock of whoever works in the folder.
LOCK = ".lock"


@dataclass(frozen=True)
class Kind:
    """What a series is called, the file by which its folder is known, and the folders in it."""

    name: str
    mark: str
    folders: Sequence[str]


@contextmanager
def series(
    path: Path, kind: Kind, known: Mapping[str, Any], refuse_another: Callable[[Any], None] | None = None
) -> Iterator[None]:
    """Make a series' folder, or go on with one; nobody else may work in it until the block ends.

    A description that cannot be read counts as none where nothing has been done: the disk was full.

    Parameters
    ----------
    path : Path
    kind : Kind
    known : mapping
        The description, which is written to the file `kind.mark`.
    refuse_another : callable, optional
        Told the description that is there, None where it cannot be read; raises OutputError when the
        folder cannot be gone on with. By default any of this kind can.

    Raises
    ------
    OutputError
        When it holds other things, cannot be written, leads elsewhere, or somebody else works in it.
    """
    with ExitStack() as until_the_end:
        with ExitStack() as while_it_is_made:
            try:
                _made(path, kind, while_it_is_made, until_the_end)
                there = read_json(path / kind.mark)
                if refuse_another is not None and (there is not None or not _is_bare(path, kind)):
                    refuse_another(there)
                if there != known:
                    write_whole(path / kind.mark, as_json(known))
                for name in kind.folders:
                    inside(path, name).mkdir(exist_ok=True)
                    remove_abandoned(path / name)
                remove_abandoned(path)
            except OSError as error:
                raise OutputError(f"{path} cannot be used: {error.strerror or error}.") from None
        yield


def _made(path: Path, kind: Kind, while_it_is_made: ExitStack, until_the_end: ExitStack) -> None:
    """Make the folder, if there is none, and lock it."""
    if path.exists() and not path.is_dir():
        raise OutputError(f"{path} is a file: choose another folder with --out.")
    above = [folder for folder in (path, *path.resolve().parents) if not folder.exists()]
    if not path.exists() or os.access(path.resolve().parent, os.W_OK):
        # A run of this name cannot end in between, nor one begin.
        while_it_is_made.enter_context(held(lock_beside(path), busy(path, "being written")))
    for folder in reversed(above):  # the innermost goes first
        until_the_end.callback(_remove_empty, folder)
    path.mkdir(parents=True, exist_ok=True)
    if any(path.iterdir()) and not _is_ours(path, kind):
        raise OutputError(f"{path} holds other things than a {kind.name}: choose another folder with --out.")
    until_the_end.enter_context(held(path / LOCK, busy(path, "being worked in")))


def _remove_empty(folder: Path) -> None:
    """Take away a folder that nothing was written into."""
    with suppress(OSError):
        folder.rmdir()


def _is_ours(path: Path, kind: Kind) -> bool:
    """Tell whether a folder is of this kind, or is left of one that did not come so far."""
    return (path / kind.mark).is_file() or _is_bare(path, kind)


def _is_bare(path: Path, kind: Kind) -> bool:
    """Tell whether nothing has been done in a folder: there is but the frame of a series."""
    for found in path.iterdir():
        frame = found.name in (LOCK, kind.mark) or is_unfinished(found)
        if not frame and not (found.name in kind.folders and found.is_dir() and not any(found.iterdir())):
            return False
    return True
