"""Settings of the Press tool: where they are, and the text that shows them beside the cursor."""

from __future__ import annotations

from typing import Any

from ..core.model.fingertip import Fingertip

__all__ = ["OPERATOR", "SYMMETRY_ITEMS", "TOOL", "describe_brush", "tool_settings"]

#: Names by which Blender knows the tool, and the operator whose properties are its settings.
TOOL, OPERATOR = "digiclay.press_tool", "digiclay.press"
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
