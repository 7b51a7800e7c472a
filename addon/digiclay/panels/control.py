"""Panel Control: the method and its gains, the sensors it sees by, and how time is cut up."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from .base import Panel, bed_of
from .section import section_panel

__all__ = ["CLASSES", "Control"]


class Control(Panel, bpy.types.Panel):  # type: ignore[misc]
    """How the cells are controlled."""

    bl_idname = "DIGICLAY_PT_control"
    bl_label = "Control"
    bl_order = 30
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: Any) -> None:
        """Draw the choice of the method."""
        settings = bed_of(context).digiclay
        row = self.layout.row()
        row.active = settings.use_control
        row.prop(settings, "method")


CLASSES = (
    Control,
    section_panel("control", Control.bl_idname, 0, words="Gains and Thresholds"),
    section_panel("blister", Control.bl_idname, 1),
    section_panel("sensors", Control.bl_idname, 2),
    section_panel("simulation", Control.bl_idname, 3, words="Time Steps"),
    section_panel("recorder", Control.bl_idname, 4),
)
