"""Preset fingers: operator and menu."""

from typing import Any

from ..compat import bpy
from ..press import brush
from ..press.fingers import FINGERS
from ..settings import finger_size
from ..ui_text import localize
from .action import Action
from .radial import no_bed


class TakeFinger(Action, bpy.types.Operator):
    """Give the fingertip the form of a finger, a palm or a tool; its blister follows"""

    bl_idname = "digiclay.press_finger"
    bl_label = "Preset Finger"
    bl_options = {"REGISTER", "UNDO"}

    kind: bpy.props.EnumProperty(
        name="Finger",
        description="Form and size of the fingertip",
        items=[(name, kind.label, kind.source) for name, kind in FINGERS.items()],
    )

    @classmethod
    def description(cls, context: Any, chosen: Any) -> str:
        """Return measures and source of a finger.

        `context` bpy.types.Context; `chosen` bpy.types.OperatorProperties, the operator's settings.
        """
        kind = FINGERS[chosen.kind]
        axes = (kind.finger.length, kind.finger.width, kind.finger.height)
        measures = " × ".join(f"{2e3 * axis:g}" for axis in axes)
        return localize("{} mm: {}. The blister follows, the contact law stays", measures, kind.source)

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed with a fingertip is needed."""
        return no_bed(context)

    def perform(self, context: Any) -> None:
        """Give it the form."""
        bed: Any = brush.bed_in_use(context)
        finger_size.resize(bed.digiclay, FINGERS[self.kind].finger)


class FingerMenu(bpy.types.Menu):
    """Preset fingers."""

    bl_idname = "DIGICLAY_MT_fingers"
    bl_label = "Finger"

    def draw(self, context: Any) -> None:
        """Draw one entry a finger."""
        for name, kind in FINGERS.items():
            entry = self.layout.operator(TakeFinger.bl_idname, text=kind.label)
            entry.kind = name
