"""Settings of the Press tool: where they are, and the text that shows them beside the cursor."""

from __future__ import annotations

from typing import Any

from ..core.model.fingertip import Fingertip
from ..device import view
from ..live import waiting
from ..live.stroke import Brush
from ..ui_text import localize

#: Names by which Blender knows the tool, and the operator whose properties are its settings.
TOOL, OPERATOR = "digiclay.press_tool", "digiclay.press"
#: Modal operators that change the settings, and draw them themselves.
ADJUSTING = frozenset({"DIGICLAY_OT_press_size", "DIGICLAY_OT_press_depth", "DIGICLAY_OT_press_strength"})
LABELS = {Brush.LOWER: "Lower", Brush.RAISE: "Raise", Brush.LEVEL: "Level", Brush.SMOOTH: "Smooth"}
BRUSH_ITEMS = (
    ("LOWER", LABELS[Brush.LOWER], "Press a valley of the given depth. With Ctrl: Raise"),
    (
        "RAISE",
        LABELS[Brush.RAISE],
        "Press lightly, lift the blister by the given height, and draw it along: a ridge. With Ctrl: Lower",
    ),
    (
        "LEVEL",
        LABELS[Brush.LEVEL],
        "Bring hills and hollows to the height of the surface under the first touch",
    ),
    (
        "SMOOTH",
        LABELS[Brush.SMOOTH],
        "Drive the pins in the ring to smoothed heights, without a touch. Shift and drag: with any brush",
    ),
)
SYMMETRY_ITEMS = (
    ("NONE", "No Symmetry", "Form the stroke alone"),
    ("X", "X", "Form the stroke, then its mirror image across the bed's YZ plane"),
    ("Y", "Y", "Form the stroke, then its mirror image across the bed's XZ plane"),
    ("XY", "X and Y", "Form the stroke, then its three mirror images"),
)
PATH_ITEMS = (
    ("FREE", "Free", "Drag to draw the path"),
    ("LINE", "Line", "Drag from one end of the line to the other; it is formed on release"),
    ("RING", "Ring", "Drag from the center of the ring to its rim; it is formed on release"),
)


def tool_settings(context: Any) -> Any | None:
    """Return the settings of the Press tool, or None while another tool is in use."""
    tool = context.workspace.tools.from_space_view3d_mode("OBJECT", create=False)
    return tool.operator_properties(OPERATOR) if tool is not None and tool.idname == TOOL else None


def find_bed(context: Any, uid: int) -> Any | None:
    """Return the bed of a `session_uid` in the scene, fetched anew since undo invalidates what is kept.

    `context` bpy.types.Context.
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


def choose_brush(name: str, event: Any) -> Brush:
    """Return the brush of a stroke that begins: Shift smooths, Ctrl inverts the tool's brush.

    `name`: of the tool's brush; `event` bpy.types.Event, by which the stroke begins.
    """
    brush = Brush.SMOOTH if event.shift else Brush(name)
    return brush.inverse if event.ctrl else brush


def find_press(context: Any, event: Any) -> tuple[int, int]:
    """Return where the mouse went down, pixels of the region; a drag is told after a move on from there.

    `context` bpy.types.Context; `event` bpy.types.Event, by which the stroke begins.
    """
    if event.value != "CLICK_DRAG":
        return event.mouse_region_x, event.mouse_region_y
    return event.mouse_prev_press_x - context.region.x, event.mouse_prev_press_y - context.region.y


def amount_name(brush: Brush) -> str:
    """Return which of the tool's settings says how far a brush goes: depth or height."""
    return "height" if brush is Brush.RAISE else "depth"


def describe_brush(finger: Fingertip, brush: Brush, depth: float, strength: float = 1.0) -> str:
    """Return size, brush, and depth or height in mm, as shown beside the cursor.

    `depth`: depth or height, m; `strength`: share of it.
    """
    return localize("Size {:.3g} mm   {}", 2e3 * finger.width, describe_stroke(brush, depth, strength))


def describe_stroke(brush: Brush, depth: float, strength: float = 1.0) -> str:
    """Return a brush, and its depth or height in mm. `depth`: depth or height, m; `strength`: share of it."""
    if not brush.has_amount:
        return f"{localize(LABELS[brush])} {100.0 * strength:.0f} %"
    share = f" × {100.0 * strength:.0f} %" if strength < 1.0 else ""
    return f"{localize(LABELS[brush])}, {localize(amount_name(brush))} {1e3 * depth:.3g} mm{share}"
