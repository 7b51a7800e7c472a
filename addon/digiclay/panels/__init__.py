"""Panels of the tab "Digital Clay" in the 3D view's sidebar."""

from ..compat import bpy
from . import display, parameters, press_options, session, shape_exchange

#: A panel before its sub-panels: Session (with Shapes and Takes), Show and Export for a sculptor,
#: and the Laboratory for a researcher.
CLASSES: tuple[type, ...] = (
    *session.CLASSES,
    *display.CLASSES,
    *shape_exchange.CLASSES,
    *parameters.CLASSES,
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
