"""Copy of a method's code beside what was made with it, so that it can be made again."""

from __future__ import annotations

from pathlib import Path

from ..core.base.whole_files import write_whole
from ..core.control.methods import list_added
from ..core.scene.schema import Scene
from .method_loader import OwnRow
from .method_source import MethodSource

__all__ = ["CODE", "describe_origin", "find_code", "write_code"]

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


def write_code(scene: Scene, folder: Path) -> str:
    """Write the code of a scene's method of one's own; return the word that names it, from the folder.

    Parameters
    ----------
    scene : Scene
    folder : Path

    Returns
    -------
    str
        For --method; the method's name where it is installed, empty for a built-in one.
    """
    source = find_code(scene)
    if source is None:
        return ""
    if source.module:
        return scene.method
    write_whole(folder / CODE, source.text.encode())
    return f"{CODE}:{source.attribute}"
