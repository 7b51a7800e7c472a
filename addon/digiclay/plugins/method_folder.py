"""All control methods of a folder of files, as Blender offers them; one mistake hides no other method."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from ..core.base.errors import MethodError
from ..core.control.methods import list_added
from .method_loader import add_class, list_classes, name_method, read_file, run_code


class FolderMethods(NamedTuple):
    """Methods and refused code of a folder.

    Attributes
    ----------
    names : tuple of str
        Of the methods that are known now.
    refused : tuple of str
        Why others are not, in one line each.
    """

    names: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()


def load_folder(folder: Path) -> FolderMethods:
    """Run the files of a folder, in the order of their names, and add their control methods."""
    if not folder.is_dir():
        return FolderMethods(refused=(f"{folder} must be a folder.",))
    names: list[str] = []
    refused: list[str] = []
    for path in sorted(folder.glob("*.py")):
        try:
            names += _load_file(path, refused)
        except MethodError as error:
            refused.append(str(error))
    return FolderMethods(tuple(names), tuple(refused))


def _load_file(path: Path, refused: list[str]) -> list[str]:
    """Add the methods of a file, and return their names; `refused` grows by those that are none."""
    source = read_file(path, "")
    classes = list_classes(run_code(source))
    if not classes:
        refused.append(f"{path.name}: the file must have a class derived from OwnMethod.")
    names: list[str] = []
    for kind in classes:
        name = name_method(kind.__name__)
        label = f"{path.name}:{kind.__name__}"
        try:
            if name in list_added():
                raise MethodError(f"{label}: the method's name {name} must be its own in this folder.")
            add_class(name, source._replace(label=label, attribute=kind.__name__), kind)
        except MethodError as error:
            refused.append(str(error))
        else:
            names.append(name)
    return names
