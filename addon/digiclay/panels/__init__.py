"""Panels of the tab "Digital Clay" in the 3D view's sidebar."""

from __future__ import annotations

from ..compat import bpy
from . import display, parameters, press_options, session, shape_exchange

#: In the order they are drawn, each with a `bl_order` of its own: session 10, finger 20, display 30,
#: shapes 40, takes 50, export 60; then what is technical, device 70 and control 80.
CLASSES: tuple[type, ...] = (
    *parameters.CLASSES,
    *session.CLASSES,
    *display.CLASSES,
    *shape_exchange.CLASSES,
    *press_options.CLASSES,
)


def register() -> None:
    """Register the panels, and the properties of the display."""
    display.register()
    for panel in CLASSES:
        bpy.utils.register_class(panel)


def unregister() -> None:
    """Undo `register` in the opposite order."""
    for panel in reversed(CLASSES):
        bpy.utils.unregister_class(panel)
    display.unregister()
