"""Panel Finger: its size, and how its pulp presses back."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from .base import Panel, bed_of
from .section import section_panel

__all__ = ["CLASSES", "Finger"]


class Finger(Panel, bpy.types.Panel):  # type: ignore[misc]
    """The finger that forms the bed."""

    bl_idname = "DIGICLAY_PT_finger"
    bl_label = "Finger"
    bl_order = 20
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: Any) -> None:
        """Say when there is none."""
        if not bed_of(context).digiclay.use_fingertip:
            self.layout.label(text="Left out: nothing touches the bed", icon="INFO")


CLASSES = (
    Finger,
    section_panel("fingertip", Finger.bl_idname, 0, words="Size"),
    section_panel("contact", Finger.bl_idname, 1),
    section_panel("relaxation", Finger.bl_idname, 2),
)
