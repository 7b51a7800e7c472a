"""Keys of a live session, adjustable in Blender's preferences."""

from __future__ import annotations

from typing import Any

from ..compat import bpy

__all__ = ["KEYS", "register", "unregister"]

#: Blender's keymaps: their names and the editors they are of.
VIEW, WINDOW = ("3D View", "VIEW_3D"), ("Window", "EMPTY")
#: Keymap, operator, key, and whether Shift is held: None, whatever is held. Without a session the operators
#: decline, and the key does what it always does.
KEYS = (
    (VIEW, "digiclay.session_pause", "P", False),
    (VIEW, "digiclay.session_step", "P", True),
    (VIEW, "digiclay.session_rewind", "BACK_SPACE", False),
    (VIEW, "digiclay.session_reset", "BACK_SPACE", True),
    (WINDOW, "digiclay.session_escape", "ESC", None),
)
_ADDED: list[tuple[Any, Any]] = []


def register() -> None:
    """Add the keys; without a window there is no keymap to add them to."""
    configuration = bpy.context.window_manager.keyconfigs.addon
    if configuration is None:
        return
    for (name, space), operator, key, shift in KEYS:
        keymap = configuration.keymaps.new(name=name, space_type=space)
        held = {"any": True} if shift is None else {"shift": shift}
        item = keymap.keymap_items.new(operator, key, "PRESS", **held)
        if operator == "digiclay.session_reset":
            item.properties.running_only = True
        _ADDED.append((keymap, item))


def unregister() -> None:
    """Undo `register`."""
    for keymap, item in _ADDED:
        keymap.keymap_items.remove(item)
    _ADDED.clear()
