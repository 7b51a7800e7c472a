"""Panel Device: presets, the bed's plan, and the hydraulics under every pin."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..core.scene_table import PRESETS
from ..live import running
from ..settings import own_presets, properties
from ..settings.declared import title
from .base import Panel, bed_of, lines
from .section import section_panel

__all__ = ["CLASSES", "Device", "Presets", "Start"]


class Start(Panel, bpy.types.Panel):  # type: ignore[misc]
    """What the tab shows while no bed is active: how to come by one."""

    bl_idname = "DIGICLAY_PT_start"
    bl_label = "Digital Clay"
    bl_order = 0

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Show it only while no bed is active."""
        return bed_of(context) is None

    def draw(self, context: Any) -> None:
        """Draw the hint, and what was told last: a session may have ended with the file it was of."""
        column = self.layout.column()
        column.label(text="Select a bed or its fingertip,")
        column.label(text="or add a new device:")
        column.operator("mesh.digital_clay_add", text="Add Digital Clay", icon="MESH_GRID")
        lines(self.layout, running.said(), "INFO")


class Presets(bpy.types.Menu):  # type: ignore[misc]
    """The presets of the core, and the user's own."""

    bl_idname = "DIGICLAY_MT_presets"
    bl_label = "Presets"

    def draw(self, context: Any) -> None:
        """Draw one entry a preset."""
        for name in PRESETS:
            self.layout.operator("digiclay.preset_apply", text=title(name)).preset = name
        own = own_presets.names()
        if own:
            self.layout.separator()
        for name in own:
            self.layout.operator("digiclay.preset_apply", text=name).preset = name


class Device(Panel, bpy.types.Panel):  # type: ignore[misc]
    """Which device it is."""

    bl_idname = "DIGICLAY_PT_device"
    bl_label = "Device"
    bl_order = 10
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: Any) -> None:
        """Draw the presets, and what a bed needs that no longer is as its settings say."""
        bed = bed_of(context)
        settings = bed.digiclay
        row = self.layout.row(align=True)
        row.menu(Presets.bl_idname, text=settings.own_preset or title(settings.preset))
        row.operator("digiclay.preset_save", text="", icon="ADD")
        row.operator("digiclay.preset_remove", text="", icon="REMOVE")
        reason = properties.stale(bed)
        if reason:
            column = self.layout.column()
            column.alert = True
            column.label(text=reason, icon="ERROR")
        self.layout.operator("digiclay.rebuild", icon="FILE_REFRESH")


PARTS = ("layout", "actuator", "supply", "fluid", "valve", "conduit", "valve_lag", "delay")
CLASSES = (
    Presets,
    Start,
    Device,
    *(section_panel(section, Device.bl_idname, order) for order, section in enumerate(PARTS)),
)
