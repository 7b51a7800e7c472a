"""Copy of a method's code beside what was made with it, so that it can be made again."""

from __future__ import annotations

from pathlib import Path

from ..core.base.whole_files import write_whole
from ..core.control.methods import list_added
from ..core.scene.schema import Scene
from .method_loader import OwnRow
from .method_source import MethodSource

#: The file of a method's code beside a scene file.
CODE = "method.py"


def find_code(scene: Scene) -> MethodSource | None:
    """Return the code of a scene's method; None for a built-in one, or without control."""
    row = list_added().get(scene.method) if scene.control is not None else None
    return row.source if isinstance(row, OwnRow) else None


def describe_origin(scene: Scene) -> dict[str, str]:
    """Return what metrics.json keeps of the origin of a method of one's own; nothing for a built-in one."""
    source = find_code(scene)
    if source is None:
        return {}
    return {"method": f"{source.package or source.label} sha256:{source.digest}"}


def write_code(scene: Scene, folder: Path) -> None:
    """Write the code of a scene's method, where it is a file of one's own; else remove a former one."""
    source = find_code(scene)
    if source is not None and not source.module:
        write_whole(folder / CODE, source.text.encode())
    else:
        (folder / CODE).unlink(missing_ok=True)


def find_word(scene: Scene) -> str:
    """Return what --method takes for a scene's method of one's own in a folder with its code.

    The name of an installed one; empty for a built-in one.
    """
    source = find_code(scene)
    if source is None:
        return ""
    return scene.method if source.module else f"{CODE}:{source.attribute}"


def resolve_word(word: str, folder: Path) -> str:
    """Return a word of --method from the working folder, where it names a file of another folder.

    `folder`: where the file may be.
    """
    return str(folder / word) if (folder / word.rpartition(":")[0]).is_file() else word
