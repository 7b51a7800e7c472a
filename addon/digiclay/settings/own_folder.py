"""Methods of the folder in the preferences: loaded, with their properties, and taken back."""

from pathlib import Path

from ..compat import bpy
from ..core.base.errors import one_line
from ..core.control.methods import remove_method
from ..core.scene.schema import import_parameters
from ..plugins.method_loader import FolderMethods, load_folder
from ..ui_text import localize
from .declared import group, title
from .groups import CONTROL, name_pointer

#: Refusal of a folder whose place depends on the file that is open.
RELATIVE = "Own Methods must be a full path (got {!r}): choose the folder again, after the .blend was saved."

#: What is loaded, and the groups of the methods' parameters; Blender's classes are of the process
#: as well.
_present = FolderMethods()
_GROUPS: dict[str, type] = {}


def read_present() -> FolderMethods:
    """Return what is loaded, and what was refused."""
    return _present


def is_full(folder: str) -> bool:
    """Return whether a folder, or none, is the same whatever file is open."""
    return not folder or (Path(folder).is_absolute() and not folder.startswith("//"))


def find_full_path(folder: str) -> str:
    """Return the full path of a folder beside the open file; the folder as it is while that is unsaved."""
    return folder if is_full(folder) or not bpy.data.filepath else str(bpy.path.abspath(folder))


def load(folder: str) -> None:
    """Run the files of a folder, in place of those that were loaded before."""
    global _present
    clear()
    if not folder:
        return
    if not is_full(folder):
        _present = FolderMethods((), (localize(RELATIVE, folder),))
        return
    loaded = load_folder(Path(folder))
    names, refused = [], list(loaded.refused)
    for name in loaded.names:
        try:
            _register_group(name)
        except (
            TypeError,
            ValueError,
            RuntimeError,
            OverflowError,
        ) as error:
            # Blender cannot hold one of its parameters.
            remove_method(name)
            refused.append(
                f"{name}: Blender must be able to hold its parameters (got {one_line(error)})."
            )
        else:
            names.append(name)
    _present = FolderMethods(tuple(names), tuple(refused))


def clear() -> None:
    """Take back what was loaded; beds keep the name and the parameters of their method."""
    global _present
    for name in _present.names:
        remove_method(name)
    for name, kind in _GROUPS.items():
        delattr(CONTROL, name_pointer(name))
        bpy.utils.unregister_class(kind)
    _GROUPS.clear()
    _present = FolderMethods()


def _register_group(name: str) -> None:
    """Make the properties of a method's parameters."""
    kind = group(name_pointer(name), import_parameters("control", name), {})
    bpy.utils.register_class(kind)
    _GROUPS[name] = kind
    setattr(CONTROL, name_pointer(name), bpy.props.PointerProperty(type=kind, name=title(name)))
