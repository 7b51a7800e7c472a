"""A run's folder: it appears whole, under its own name, or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import OutputError

__all__ = ["MARK", "may_be_written", "written"]

#: The file by which a folder is known as a run's.
MARK = "metrics.json"


def may_be_written(out: Path, *, overwrite: bool) -> None:
    """Refuse, before any work is done, an output folder that could not be used in the end.

    Parameters
    ----------
    out : Path
        It may exist if it is empty; with `overwrite` also if a run left it. Any other folder
        is nobody's to delete.
    overwrite : bool

    Raises
    ------
    OutputError
    """
    try:
        filled = out.exists() and (not out.is_dir() or any(out.iterdir()))
    except OSError as error:
        raise OutputError(f"{out} cannot be read: {error.strerror or error}.") from None
    if filled and not out.is_dir():
        raise OutputError(f"{out} is a file: choose another folder with --out.")
    if filled and not (out / MARK).is_file():
        raise OutputError(f"{out} holds other things than a run: choose another folder with --out.")
    if filled and not overwrite:
        raise OutputError(
            f"{out} is not empty: choose another folder with --out, or replace it with --overwrite."
        )
    above = out.resolve().parent
    while not above.exists():
        above = above.parent
    as_who_we_act = os.access in os.supports_effective_ids
    if not above.is_dir() or not os.access(above, os.W_OK | os.X_OK, effective_ids=as_who_we_act):
        raise OutputError(f"{out} cannot be made: {above} cannot be written to.")


@contextmanager
def written(out: Path, *, overwrite: bool) -> Iterator[Path]:
    """Give a folder under a temporary name to write into; on leaving it well, it becomes `out`.

    An older run is replaced only then. When something is raised, all is as it was before.
    """
    may_be_written(out, overwrite=overwrite)
    target = out.resolve()
    staged, former = (target.with_name(f".{target.name}.{os.getpid()}.{word}") for word in ("part", "old"))
    made = [folder for folder in target.parents if not folder.exists()]
    try:
        staged.mkdir(parents=True)
        yield staged
        if target.exists():
            target.rename(former)
        staged.rename(target)
    except OSError as error:
        raise OutputError(f"{out} cannot be written: {error.strerror or error}.") from None
    finally:
        if former.exists() and not target.exists():
            former.rename(target)
        shutil.rmtree(former, ignore_errors=True)
        shutil.rmtree(staged, ignore_errors=True)
        if not target.exists():
            for folder in made:
                with suppress(OSError):  # not made after all, or somebody else put something in
                    folder.rmdir()
