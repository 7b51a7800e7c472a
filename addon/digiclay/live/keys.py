"""Keys of a running session in the 3D view, to be changed in Blender's preferences like all others."""

from __future__ import annotations

from typing import Any

from ..compat import bpy

__all__ = ["KEYS", "register", "unregister"]

#: Operator, key, and whether Shift is held. Without a session the operators decline, and the key does what
#: it always does.
KEYS = (
    ("digiclay.session_pause", "P", False),
    ("digiclay.session_step", "P", True),
    ("digiclay.session_rewind", "BACK_SPACE", False),
    ("digiclay.session_reset", "BACK_SPACE", True),
)
_ADDED: list[tuple[Any, Any]] = []


def register() -> None:
    """Add the keys; without a window there is no keymap to add them to."""
    configuration = bpy.context.window_manager.keyconfigs.addon
    if configuration is None:
        return
    view = configuration.keymaps.new(name="3D View", space_type="VIEW_3D")
    for operator, key, shift in KEYS:
        item = view.keymap_items.new(operator, key, "PRESS", shift=shift)
        if operator == "digiclay.session_reset":
            item.properties.running_only = True
        _ADDED.append((view, item))


def unregister() -> None:
    """Undo `register`."""
    for view, item in _ADDED:
        view.keymap_items.remove(item)
    _ADDED.clear()
