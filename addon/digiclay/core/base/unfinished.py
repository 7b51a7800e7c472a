"""Temporary names of unfinished files, and removal of those of ended processes."""

from __future__ import annotations

import os
import re
import shutil
from contextlib import suppress
from pathlib import Path

from .processes import find_host, may_have_made

#: ``.NAME.PID@HOST.KIND``: what becomes NAME, what NAME was, a film's frames. Older versions name no host.
UNFINISHED = re.compile(r"\.(?P<name>.+)\.(?P<pid>\d{1,10})(?:@(?P<host>[\w-]+))?\.(?P<kind>part|old|frames)")


def name_unfinished(target: Path, kind: str = "part") -> Path:
    """Return the name under which this process prepares a file or folder, beside it.

    `kind`: what becomes the target; what the target was; the frames of a film.
    """
    return target.with_name(f".{target.name}.{os.getpid()}@{find_host()}.{kind}")


def is_unfinished(path: Path) -> bool:
    """Return whether a name is that of an unfinished file or folder."""
    return UNFINISHED.fullmatch(path.name) is not None


def remove_abandoned(folder: Path, name: str = "") -> None:
    """Take away what processes of this machine that are gone have left unfinished.

    What was moved aside to be replaced is put back when nothing has come in its place. What other
    machines prepare on a shared drive stays: nothing here tells whether they are at it.

    `folder`: nothing happens when there is none; `name`: of what it was to become; by default anything.
    """
    try:
        found = sorted(folder.iterdir())
    except OSError:
        return
    for path in found:
        known = UNFINISHED.fullmatch(path.name)
        if known is None or (name and known["name"] != name) or known["host"] not in (None, find_host()):
            continue
        with suppress(OSError):
            if may_have_made(int(known["pid"]), path.lstat().st_mtime):
                continue
            target = path.with_name(known["name"])
            if known["kind"] == "old" and not os.path.lexists(target):
                path.rename(target)
            elif path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink()
