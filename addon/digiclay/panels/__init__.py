"""Panels of the tab "Digital Clay" in the 3D view's sidebar."""

from __future__ import annotations

from ..compat import bpy
from . import appearance, live_session, parameters, shape_exchange

__all__ = ["register", "unregister"]

#: In the order they are drawn, each with a `bl_order` of its own: device 10, finger 20, control 30,
#: session 40, display 50, shapes 60, takes 70, export 80.
CLASSES: tuple[type, ...] = (
    *parameters.CLASSES,
    *live_session.CLASSES,
    *appearance.CLASSES,
    *shape_exchange.CLASSES,
)


def register() -> None:
    """Register the panels."""
    for panel in CLASSES:
        bpy.utils.register_class(panel)


def unregister() -> None:
    """Undo `register` in the opposite order."""
    for panel in reversed(CLASSES):
        bpy.utils.unregister_class(panel)
