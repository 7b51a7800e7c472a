"""Settings of the Press tool: where they are, and the text that shows them beside the cursor."""

from __future__ import annotations

from typing import Any

from ..core.model.fingertip import Fingertip
from ..device import view
from ..live import waiting

__all__ = [
    "ADJUSTING", "OPERATOR", "SYMMETRY_ITEMS", "TOOL", "bed_in_use", "describe_brush", "find_bed",
    "tool_settings",
]  # fmt: skip

#: Names by which Blender knows the tool, and the operator whose properties are its settings.
TOOL, OPERATOR = "digiclay.press_tool", "digiclay.press"
#: Modal operators that change the settings, and draw them themselves.
ADJUSTING = frozenset({"DIGICLAY_OT_press_size", "DIGICLAY_OT_press_depth", "DIGICLAY_OT_press_strength"})
SYMMETRY_ITEMS = (
    ("NONE", "No Symmetry", "Form the stroke alone"),
    ("X", "X", "Form the stroke, then its mirror image across the bed's YZ plane"),
    ("Y", "Y", "Form the stroke, then its mirror image across the bed's XZ plane"),
    ("XY", "X and Y", "Form the stroke, then its three mirror images"),
)


def tool_settings(context: Any) -> Any | None:
    """Return the settings of the Press tool, or None while another tool is in use."""
    tool = context.workspace.tools.from_space_view3d_mode("OBJECT", create=False)
    return tool.operator_properties(OPERATOR) if tool is not None and tool.idname == TOOL else None


def find_bed(context: Any, uid: int) -> Any | None:
    """Return the bed of a `session_uid` in the scene, fetched anew since undo invalidates what is kept.

    Parameters
    ----------
    context : bpy.types.Context
    uid : int
    """
    return next((thing for thing in context.scene.objects if thing.session_uid == uid), None)


def bed_in_use(context: Any) -> Any | None:
    """Return the bed that the tool's settings are about: active, in a session, or the only one seen."""
    active = waiting.active_session(context)
    bed = view.bed_of(context) or (active and active[0])
    if bed is not None:
        return bed
    seen = [thing for thing in context.visible_objects if view.is_bed(thing)]
    return seen[0] if len(seen) == 1 else None


def describe_brush(finger: Fingertip, depth: float, strength: float = 1.0) -> str:
    """Return size and depth in mm, as shown beside the cursor.

    Parameters
    ----------
    finger : Fingertip
    depth : float
        m.
    strength : float, optional
        Share of the depth.
    """
    share = f" × {100.0 * strength:.0f} %" if strength < 1.0 else ""
    return f"Size {2e3 * finger.width:.3g} mm   Depth {1e3 * depth:.3g} mm{share}"
