"""Settings of the Press tool: brush, finger and presets, and the text beside the cursor."""

import math
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Any

from ..compat import Context, Event, Object, OperatorProperties, bpy
from ..core.base.arrays import Floats
from ..core.files.tables import Record
from ..core.model.fingertip import Fingertip
from ..core.shapes.fitting import list_shapes
from ..live import beds
from ..roles import bed_of, is_bed
from ..settings import devices
from ..strokes.falloff import Falloff
from ..strokes.stamps import load_stamp
from ..strokes.stroke import (
    COMBINATIONS,
    LOCKS,
    STAMPS,
    Brush,
    Combine,
    Image,
    Place,
    Stroke,
    lay_path,
    make_images,
    start,
)
from ..ui_text import localize
from .aim import PLANE, SURFACE

#: Semi-axes that differ by less are the same, m.
SAME = 1e-6


@dataclass(frozen=True)
class FingerKind:
    """Preset finger: name, ellipsoid, and where its measures come from."""

    label: str
    finger: Fingertip
    source: str


FINGERS: Mapping[str, FingerKind] = {
    "fingertip": FingerKind(
        "Fingertip", Fingertip(), "the tip of an index finger, as the device has it"
    ),
    "thumb": FingerKind(
        "Thumb",
        Fingertip(14e-3, 11.5e-3, 11e-3),
        "23 mm broad and 22 mm thick, about the median of men's thumbs; its length is assumed",
    ),
    "palm": FingerKind("Palm", Fingertip(30e-3, 25e-3, 20e-3), "the heel of a hand; assumed"),
    "stylus": FingerKind(
        "Stylus", Fingertip(3e-3, 3e-3, 8e-3), "the rounded end of a pen; assumed"
    ),
    "ball": FingerKind("Ball Tool", Fingertip(6e-3, 6e-3, 6e-3), "a ball of 12 mm; assumed"),
}


def find_kind(finger: Fingertip) -> FingerKind | None:
    """Return the preset finger of the same semi-axes, or None."""
    axes = astuple(finger)
    same = (kind for kind in FINGERS.values() if math.dist(astuple(kind.finger), axes) < SAME)
    return next(same, None)


#: Names by which Blender knows the tool, and the operator whose properties are its settings.
TOOL, OPERATOR = "digiclay.press_tool", "digiclay.press"
#: Modal operators that change the settings, and draw them themselves.
ADJUSTING = {
    "DIGICLAY_OT_press_size",
    "DIGICLAY_OT_press_depth",
    "DIGICLAY_OT_press_strength",
    "DIGICLAY_OT_press_center",
}
#: Context of its translation: as a brush, "Smooth" is what is done, elsewhere what something is.
CONTEXT = "Brush"
LABELS = {brush: brush.value.replace("_", " ").title() for brush in Brush}
BRUSH_WORDS = {
    Brush.LOWER: "Press a valley of the given depth, to which the valves bring the pins in the end, "
    "unless Finish is As Left. With Ctrl: Raise",
    Brush.RAISE: "Press lightly, lift the blister by the given height, and draw it along: a ridge, "
    "to whose nominal form the valves bring the pins in the end, unless Finish is As Left. "
    "With Ctrl: Lower",
    Brush.LEVEL: "Bring hills and hollows to the height of the surface under the first touch, to which "
    "the valves bring the pins in the end, unless Finish is As Left",
    Brush.FLATTEN: "Bring the pins in the ring to the plane that fits them best, without a touch; "
    "none moves farther than the depth",
    Brush.CREASE: "Cut a sharp crease of the given depth, without a touch. With Ctrl: a sharp crest",
    Brush.SMOOTH: "Drive the pins in the ring to smoothed heights, without a touch. "
    "Shift and drag: with any brush",
    Brush.ERASE: "Drive the pins in the ring back to rest, without a touch",
    Brush.LOCK: "Shut the valves of the pins in the ring, so that nothing moves them. With Ctrl: Unlock",
    Brush.STAMP: "Put a shape onto the surface: click for the size of the ring, or drag from the middle to "
    "the right side. With Ctrl: pressed in",
}
BRUSH_ITEMS = tuple((brush.value, LABELS[brush], words) for brush, words in BRUSH_WORDS.items())
SYMMETRY_ITEMS = (
    ("NONE", "No Symmetry", "Form only the stroke"),
    ("X", "X", "Form the stroke and its mirror image across the axis along the bed's y"),
    ("Y", "Y", "Form the stroke and its mirror image across the axis along the bed's x"),
    ("XY", "X and Y", "Form the stroke and its three mirror images"),
    ("RADIAL", "Radial", "Form the stroke and its images rotated about the center"),
)
FALLOFF_ITEMS = tuple(
    (kind.value, kind.value.title(), words)
    for kind, words in {
        Falloff.DEVICE: "Profile of the blister; of brushes that press nothing, their own falloff",
        Falloff.SMOOTH: "Rounded at both ends",
        Falloff.SPHERE: "Rounded, steep at the rim",
        Falloff.ROOT: "Broad, steep at the rim",
        Falloff.SHARP: "Pointed, flat at the rim",
        Falloff.LINEAR: "Straight",
        Falloff.CONSTANT: "Full up to the rim",
    }.items()
)
#: Settings of a placed symmetry, and the shortest drag that turns its axis, m.
PLACED, SHORT = ("symmetry", "center_x", "center_y", "axis"), 1e-3


def find_images(settings: OperatorProperties) -> tuple[Image, ...]:
    """Return a stroke's path and its images, by the settings of the tool."""
    center = 1e-3 * settings.center_x, 1e-3 * settings.center_y
    return make_images(settings.symmetry, settings.radial, center, settings.axis)


def read_center(settings: OperatorProperties) -> Record:
    """Return the settings that `put_center` and `turn_axis` change."""
    return {name: getattr(settings, name) for name in PLACED}


def put_center(settings: OperatorProperties, x: float, y: float) -> None:
    """Place the center of symmetry, m; without symmetry from now on with one axis."""
    settings.center_x, settings.center_y = 1e3 * x, 1e3 * y
    if settings.symmetry == "NONE":
        settings.symmetry = "X"


def turn_axis(settings: OperatorProperties, x: float, y: float) -> None:
    """Turn the first axis of symmetry into a direction."""
    if math.hypot(x, y) >= SHORT:
        upright = math.pi / 2.0 if settings.symmetry == "X" else 0.0
        settings.axis = math.remainder(math.atan2(y, x) - upright, math.pi)


#: What is stamped: a sample shape, or a file.
FILE = "FILE"
STAMP_ITEMS = (
    *((name, name.replace("_", " ").title(), "") for name in list_shapes()),
    (FILE, "File", "A mesh, a picture (bright is high) or a .npy file of heights"),
)
FINISH_ITEMS = (
    (
        "NOMINAL",
        "Nominal",
        "When the fingertip has left, the valves bring the pins to the nominal surface of the "
        "stroke, which has exactly its depth or height",
    ),
    (
        "AS_LEFT",
        "As Left",
        "The pins stay as the finger and the control method have left them: off nominal by tenths "
        "of a millimeter rms, at single pins by several millimeters. Laboratory says by how much",
    ),
)
#: Settings that each brush has for itself, and where a bed has the fingertip of each.
OWN, FINGER_OF = ("strength", "falloff", "combine"), "digiclay_brushes"
PATH_ITEMS = (
    ("FREE", "Free", "Drag to draw the path"),
    ("LINE", "Line", "Drag from one end of the line to the other; it is formed on release"),
    ("RING", "Ring", "Drag from the center of the ring to its rim; it is formed on release"),
)
PROJECT_ITEMS = (
    (
        SURFACE,
        "Surface",
        "Where the mouse is on the surface that is seen. In an orthographic top view both are the same",
    ),
    (
        PLANE,
        "Rest Plane",
        "Where the mouse is on the plane of the pins at rest: a line that is straight in the view is "
        "straight on the bed, whatever stands there",
    ),
)

COMBINE_ITEMS = (
    ("USUAL", "As Usual", "Level replaces the surface, Stamp adds to it"),
    ("HIGHEST", "Highest", "The higher one of the surface and of what is formed on the base"),
    ("LOWEST", "Lowest", "The lower one of the surface and of what is formed on the base"),
    ("ADD", "Add", "What is formed on the base is put onto the surface"),
    ("REPLACE", "Replace", "What is formed on the base replaces the surface"),
)
#: How Raise and Lower combine unless they accumulate.
EXTREMES = {Brush.RAISE: Combine.HIGHEST, Brush.LOWER: Combine.LOWEST}


def find_options(settings: OperatorProperties, brush: Brush) -> dict[str, Any]:
    """Return what the settings of the tool say of a stroke beside its path: fields of `Stroke`."""
    combine = Combine.USUAL
    if brush in EXTREMES:
        combine = combine if settings.accumulate else EXTREMES[brush]
    elif brush in COMBINATIONS:
        combine = Combine(settings.combine)
    falloff = Falloff(read_own(settings, "falloff", brush))
    if (brush, falloff) == (Brush.SMOOTH, Falloff.DEVICE):  # Smooth has one in any case
        falloff = Falloff.SMOOTH
    options = {"accumulate": settings.accumulate, "falloff": falloff, "combine": combine}
    options["as_left"] = settings.finish == "AS_LEFT"
    if settings.use_limit:
        low, high = sorted((1e-3 * settings.limit_low, 1e-3 * settings.limit_high))
        options["limits"] = low, high
    return options


def lay_stroke(
    settings: OperatorProperties, path: Floats | list[Place], kind: Brush, **more: Any
) -> Stroke:
    """Return the stroke along a path (k, 2), m, as the tool's settings have it; `more`: of `Stroke`."""
    share = float(read_own(settings, "strength", kind))
    depth = 1e-3 * share * getattr(settings, amount_name(kind))
    options = find_options(settings, kind) | more
    if kind in STAMPS and "stamp" not in more:
        file = bpy.path.abspath(settings.stamp_file)
        options["stamp"] = load_stamp(file if settings.stamp == FILE else settings.stamp)
    (x, y), images = path[0], find_images(settings)
    return lay_path(start(0, x, y, depth, images, kind, share, **options), path)


def tool_settings(context: Context) -> OperatorProperties | None:
    """Return the settings of the Press tool, or None while another tool is in use."""
    tool = context.workspace.tools.from_space_view3d_mode("OBJECT", create=False)
    return tool.operator_properties(OPERATOR) if tool is not None and tool.idname == TOOL else None


def find_bed(context: Context, uid: int) -> Object | None:
    """Return the bed of a `session_uid`, fetched anew, since undo invalidates what is kept."""
    return next((thing for thing in context.scene.objects if thing.session_uid == uid), None)


def bed_in_use(context: Context) -> Object | None:
    """Return the bed that the tool's settings are about: active, in a session, or the only one seen."""
    active = beds.active_session(context)
    bed = bed_of(context) or (active and active[0])
    if bed is not None:
        return bed
    seen = [thing for thing in context.visible_objects if is_bed(thing)]
    return seen[0] if len(seen) == 1 else None


def own_name(name: str, brush: str) -> str:
    """Return the name of the setting by which a brush has another one while it is not in hand."""
    return f"{brush.lower()}_{name}"


def read_own(settings: OperatorProperties, name: str, brush: Brush) -> Any:
    """Return a setting that each brush has for itself; what Ctrl makes of it has its settings."""
    if Brush(settings.brush) not in (brush, brush.inverse):
        name = own_name(name, (brush if brush in BRUSH_WORDS else brush.inverse).value)
    return getattr(settings, name)


def take_brush(settings: OperatorProperties, context: Context) -> None:
    """Bring back what the chosen brush has for itself, and store that of the one before."""
    former, settings.former = settings.former, settings.brush
    if former == settings.brush:
        return
    for name in OWN:
        setattr(settings, own_name(name, former), getattr(settings, name))
        setattr(settings, name, getattr(settings, own_name(name, settings.brush)))
    bed = bed_in_use(context)
    if bed is not None and tool_settings(context) is not None:
        take_finger(context, bed, former)


def take_finger(context: Context, bed: Object, former: str = "") -> None:
    """Give a bed the fingertip that it had under the brush in hand, and store that of the one before.

    `former`: that one, for a bed that has none stored; by default there was no other.
    """
    settings = tool_settings(context)
    if settings is None or beds.find_obstacle(context, bed, beds.Use.CHANGE):
        return
    stored = bed.get(FINGER_OF)
    fingers = stored.to_dict() if stored else {"brush": former or settings.brush}
    if fingers["brush"] != settings.brush:
        first = devices.find_first(bed)
        fingers[fingers["brush"]] = astuple(devices.read_finger(first))
        fingers["brush"] = settings.brush
        if settings.brush in fingers:
            devices.resize(first, Fingertip(*fingers[settings.brush]))
        bed[FINGER_OF] = fingers


def choose_brush(name: str, event: Event) -> Brush:
    """Return the brush of a stroke that an event begins: Shift smooths, Ctrl inverts the tool's brush."""
    brush = Brush.SMOOTH if event.shift else Brush(name)
    return brush.inverse if event.ctrl else brush


def find_press(context: Context, event: Event) -> tuple[int, int]:
    """Return where the mouse went down, pixels of the region; a CLICK_DRAG comes from a place further on."""
    if event.value != "CLICK_DRAG":
        return event.mouse_region_x, event.mouse_region_y
    return event.mouse_prev_press_x - context.region.x, event.mouse_prev_press_y - context.region.y


def find_path(settings: OperatorProperties, brush: Brush) -> str:
    """Return the path of a stroke: that of the settings, or STAMP."""
    return "STAMP" if brush in STAMPS else str(settings.path)


def amount_name(brush: Brush) -> str:
    """Return which of the tool's settings says how far a brush goes: depth or height."""
    return "height" if brush.rises else "depth"


def describe_brush(finger: Fingertip, brush: Brush, depth: float, strength: float = 1.0) -> str:
    """Return size, brush, and depth or height (m) times strength, as shown beside the cursor."""
    return localize(
        "Size {:.3g} mm   {}", 2e3 * finger.width, describe_stroke(brush, depth, strength)
    )


def localize_label(brush: Brush) -> str:
    """Return the name of a brush in the language of the interface."""
    return localize(LABELS[brush], context=CONTEXT)


def describe_stroke(brush: Brush, depth: float, strength: float) -> str:
    """Return a brush, and its depth or height (m) times strength, in mm."""
    if brush in (*LOCKS, Brush.SET_BASE):
        return localize_label(brush)
    if not brush.has_amount:
        return f"{localize_label(brush)} {100.0 * strength:.0f} %"
    share = f" × {100.0 * strength:.0f} %" if strength < 1.0 else ""
    return f"{localize_label(brush)}, {localize(amount_name(brush))} {1e3 * depth:.3g} mm{share}"


def describe_queue(brush: Brush, waiting: int, seconds: float | None) -> str:
    """Return what is being formed, how many strokes wait, and about how long all take, s; None: not known."""
    more = f" + {waiting}" if waiting else ""
    left = "" if seconds is None else localize(", {:.0f} s", math.ceil(seconds))
    return localize("   Forming: {}", localize_label(brush)) + more + left
