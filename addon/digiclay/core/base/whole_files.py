"""Atomic file writing, and small JSON files."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from .errors import OutputError
from .unfinished import name_unfinished


def write_whole(path: Path, content: bytes) -> None:
    """Write a file whole or not at all: to a temporary name beside it, then renamed.

    Raises OutputError when the file cannot be written.
    """
    with open_whole(path) as file:
        file.write(content)


@contextmanager
def open_whole(path: Path) -> Iterator[BinaryIO]:
    """Open a file under a temporary name to write into; it becomes `path` when the block ends without error.

    Raises OutputError when the file cannot be written.
    """
    part = name_unfinished(path)
    try:
        with part.open("wb") as file:
            yield file
        part.replace(path)
    except BaseException as error:
        with suppress(OSError):  # what went wrong first is what the user has to hear
            part.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OutputError(f"Cannot write {path}: {error.strerror or error}.") from error
        raise


def read_json(path: Path) -> dict[str, Any] | None:
    """Return the content of a small JSON file; None where it cannot be read."""
    try:
        read = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return None
    return read if isinstance(read, dict) else None


def format_json(value: object) -> bytes:
    """Return a value as JSON with a line's end."""
    return (json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()
