"""Folder names for user-defined names: valid on every file system, and unique."""

from __future__ import annotations

import hashlib
import os
import re
import unicodedata
from collections.abc import Sequence
from pathlib import Path

#: Bytes of a name in UTF-8; file systems take 255, of which what is unfinished needs some.
LONGEST = 120
#: Names that stand for devices in Windows, whatever follows behind a full stop.
DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³]|conin\$|conout\$)", re.IGNORECASE)


def make_safe_name(text: str) -> str:
    """Return a text as the name of a folder: a word of letters, digits and ``. _ + -``.

    It does not begin or end with a full stop, is no device in Windows, and is short enough.
    """
    name = re.sub(r"[^\w.+-]", "_", unicodedata.normalize("NFC", text))
    name = name.lstrip(".-").rstrip(".") or "scene"
    if DEVICES.fullmatch(name.partition(".")[0]):
        name = f"_{name}"
    if len(name.encode(errors="replace")) <= LONGEST:
        return name
    digest = hashlib.sha256(name.encode(errors="replace")).hexdigest()[:8]
    kept = name.encode(errors="replace")[: LONGEST - 9].decode(errors="ignore")
    return f"{kept}-{digest}"


def find_name(path: Path, general: str = "scene.toml") -> str:
    """Return the name of a file's content: its stem, or its folder's name for a generic stem.

    `path`: however it leads to the file: its own name and its folder's real one count; `general`: the name of
    a file that says nothing.
    """
    full = Path(os.path.abspath(path))
    name = full.parent.name if full.name == general else full.stem
    return name if name.strip(". ") else "scene"


def fold_name(name: str) -> str:
    """Return what names have in common that some file systems take for one: ``a`` and ``A``."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def make_unique_names(texts: Sequence[str]) -> list[str]:
    """Return safe names of texts, in their order; where several would be alike, the later get numbers."""
    names = [make_safe_name(text) for text in texts]
    taken = {fold_name(name) for name in names}
    given: set[str] = set()
    for place, name in enumerate(names):
        number, chosen = 1, name
        while fold_name(chosen) in given or (number > 1 and fold_name(chosen) in taken):
            number += 1
            chosen = make_safe_name(f"{name[:LONGEST]}-{number}")
        names[place] = chosen
        given.add(fold_name(chosen))
    return names
