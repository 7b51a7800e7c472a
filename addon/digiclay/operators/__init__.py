"""Operators and menus: a class of a module here that has a `bl_idname` is registered.

No module here postpones its annotations: Blender reads an operator's properties from them.
"""

from __future__ import annotations

from ..compat import bpy
from . import (
    add_bed,
    bake_session,
    export_mesh,
    make_mesh,
    open_scene,
    pin_view,
    presets,
    press_adjust,
    press_presets,
    press_shape,
    press_stroke,
    session_actions,
    session_loop,
    shapes,
    take_actions,
    take_replay,
)

MODULES = (
    add_bed,
    presets,
    pin_view,
    press_stroke,
    press_shape,
    press_adjust,
    press_presets,
    export_mesh,
    make_mesh,
    session_loop,
    session_actions,
    shapes,
    open_scene,
    take_actions,
    take_replay,
    bake_session,
)
CLASSES: tuple[type, ...] = tuple(
    kind
    for module in MODULES
    for kind in vars(module).values()
    if isinstance(kind, type) and kind.__module__ == module.__name__ and "bl_idname" in vars(kind)
)
#: Entries in Blender's own menus: the menu, and the function that draws the entry.
MENUS = (
    ("VIEW3D_MT_mesh_add", add_bed.entry),
    ("VIEW3D_MT_mesh_add", open_scene.samples_entry),
    ("TOPBAR_MT_file_import", open_scene.import_entry),
    ("TOPBAR_MT_file_export", export_mesh.entry),
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
