"""Takes: what was recorded, to replay, bake and export."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..live import running
from ..recorded import bake, takes
from .base import Panel, bed_of

__all__ = ["CLASSES", "TakesPanel"]


class TakesPanel(Panel, bpy.types.Panel):  # type: ignore[misc]
    """The takes of the bed and its bake."""

    bl_label = "Takes"
    bl_idname = "DIGICLAY_PT_takes"
    bl_order = 70
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: Any) -> None:
        """Draw the recording, the list of takes, and the bake."""
        layout, bed = self.layout, bed_of(context)
        session = running.of(bed)
        if session is not None and session.recording is not None:
            seconds = (len(session.recording.path) - 1) * session.system.period
            layout.operator("digiclay.take_keep", text=f"Keep Take ({seconds:.1f} s)", icon="CHECKMARK")
        else:
            layout.operator("digiclay.take_record", icon="RECORD_ON")
        for entry in takes.entries(bed):
            row = layout.row(align=True)
            row.label(text=f"{entry.name} ({entry.seconds:.1f} s)", icon="TRACKING")
            row.operator("digiclay.take_replay", text="", icon="PLAY").take = entry.number
            baking = row.operator("digiclay.bake", text="", icon="RENDER_ANIMATION")
            baking.source, baking.take = "TAKE", entry.number
            row.operator("digiclay.take_export", text="", icon="EXPORT").take = entry.number
            row.operator("digiclay.take_remove", text="", icon="X").take = entry.number
        layout.separator()
        if bake.is_baked(bed):
            layout.operator("digiclay.bake_free", icon="TRASH")
        else:
            layout.operator("digiclay.bake", text="Bake Animated Fingertip").source = "FINGERTIP"


CLASSES = (TakesPanel,)
