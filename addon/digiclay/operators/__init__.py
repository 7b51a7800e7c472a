"""Operators and menus: a class with a `bl_idname` is registered, in whichever module here it is.

No module here postpones its annotations: Blender reads an operator's properties from them.
"""

import importlib
import pkgutil

from ..compat import bpy
from . import add_bed, add_fingers, add_pressers, export_mesh, press_curves, session_loop

MODULES = [
    importlib.import_module(f"{__name__}.{module.name}")
    for module in pkgutil.iter_modules(__path__)
]
CLASSES: tuple[type, ...] = tuple(
    kind
    for module in MODULES
    for kind in vars(module).values()
    if isinstance(kind, type) and kind.__module__ == module.__name__ and "bl_idname" in vars(kind)
)
#: Entries in Blender's own menus: the menu, and the function that draws the entry.
MENUS = (
    ("VIEW3D_MT_mesh_add", add_bed.entry),
    ("VIEW3D_MT_mesh_add", add_bed.samples_entry),
    ("VIEW3D_MT_mesh_add", add_fingers.entries),
    ("TOPBAR_MT_file_import", add_bed.import_entry),
    ("TOPBAR_MT_file_export", export_mesh.entry),
    ("VIEW3D_MT_object", press_curves.entry),
    ("VIEW3D_MT_object", add_pressers.entry),
    ("VIEW3D_MT_editor_menus", session_loop.leave_entry),
)


def register() -> None:
    """Register the operators and hang them into Blender's menus."""
    for operator in CLASSES:
        bpy.utils.register_class(operator)
    for menu, entry in MENUS:
        getattr(bpy.types, menu).append(entry)


def unregister() -> None:
    """Undo `register` in the opposite order."""
    for menu, entry in reversed(MENUS):
        getattr(bpy.types, menu).remove(entry)
    for operator in reversed(CLASSES):
        bpy.utils.unregister_class(operator)
