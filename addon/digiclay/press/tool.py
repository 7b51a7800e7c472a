"""Press tool in the 3D view's toolbar: its header, and its patch under the mouse, draped over the pins."""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .. import bridge, preferences
from ..compat import (
    Area,
    Context,
    Object,
    OperatorProperties,
    UILayout,
    Window,
    WorkSpaceTool,
    bpy,
    connect,
    disconnect,
)
from ..core.base.arrays import Floats
from ..core.base.modes import COLORS, Mode
from ..core.model.fingertip import Fingertip
from ..core.model.layout import Grid, Layout
from ..core.surface.pointing import find_contact_outline
from ..device.instant import find_ellipsoid
from ..overlay.picture import Color, Line, Words
from ..overlay.sections import LETTERS, place_label
from ..overlay.views import find_free_room
from ..roles import fingertip_of, list_pressers
from ..sessions import running
from ..sessions.running import list_pressing
from ..settings import devices
from ..strokes.nominal import find_radius
from ..strokes.stroke import LOCKS, RINGED, STAMPS, Brush, Place, lay_ring, lay_square
from ..strokes.sweep import estimate_time
from ..ui_text import localize
from . import aim
from .brush import (
    ADJUSTING,
    FILE,
    OPERATOR,
    TOOL,
    amount_name,
    bed_in_use,
    choose_brush,
    describe_brush,
    describe_queue,
    find_images,
    find_kind,
    read_own,
    take_finger,
    tool_settings,
)
from .pointer import HELD

#: A light line on a dark one is seen on everything.
DARK, LIGHT = (0.05, 0.05, 0.05), (1.0, 1.0, 1.0)
#: That of a stroke that smooths has the color of the pins that the device drives.
SMOOTHING = COLORS[Mode.BLISTER]
#: Radius of the mark of a center of symmetry, m, and how many places along an axis lie on pins.
MARK, PARTS = 2e-3, 240


def make_lines(paths: Sequence[Floats], width: float, color: Color = LIGHT) -> list[Line]:
    """Return light lines on dark ones along paths (k, 2), pixels; `width` is that of a thin line, pixels."""
    if not paths:
        return []
    points = np.concatenate([np.repeat(path, 2, axis=0)[1:-1] for path in paths])
    return [Line(points, *look, pairs=True) for look in ((DARK, 4.0 * width), (color, 2.0 * width))]


def make_label(context: Context, text: str, xy: Place, corner: Place = (0.0, 0.0)) -> list[Words]:
    """Return text beside a place, light on a dark edge, where no panel covers it; see `draw_on_bed`."""
    from ..overlay.draw import measure

    if not (text and np.isfinite(xy).all()):
        return []
    scale = float(context.preferences.system.ui_scale)
    left, bottom, right, top = np.add(
        find_free_room(context.area, context.region), 2 * corner
    ).tolist()
    size = LETTERS * scale
    width = measure(text, size)
    # A text that is wider than the room is drawn smaller.
    share = min(1.0, (right - left) / width)
    x, y = place_label(xy, (share * width, size), (left, bottom, right, top), scale)
    size *= share
    edge = [Words(x + i, y + j, size, DARK, text) for i in (-scale, scale) for j in (-scale, scale)]
    return [*edge, Words(x, y, size, LIGHT, text)]


def close(path: Floats) -> Floats:
    """Return a path (k, d) that ends where it begins."""
    return np.concatenate([path, path[:1]])


def map_paths(change: Callable[[Floats], Floats], paths: Sequence[Floats]) -> list[Floats]:
    """Return what a function makes of the places of all paths at once, path by path."""
    lengths = [len(path) for path in paths]
    return np.split(change(np.concatenate(paths)), np.cumsum(lengths)[:-1]) if paths else []


def draw_on_bed(
    context: Context,
    bed: Object,
    paths: Sequence[Floats],
    text: str,
    xy: Place,
    color: Color = LIGHT,
    corner: Place = (0.0, 0.0),
) -> None:
    """Draw paths (k, 3), m, of a bed's space, and text beside a place; pixels from a corner of the region."""
    from ..overlay.draw import cursor

    system = context.preferences.system
    lines = map_paths(
        lambda places: np.asarray(corner) + bridge.project(context, bed, places), paths
    )
    shown = [line for line in lines if np.isfinite(line).all()]
    cursor(make_lines(shown, system.pixel_size, color), make_label(context, text, xy, corner))


#: Widths from which on a header names popovers in full, and has a button for each brush, in pixels
#: at a resolution scale of 1.
WIDE, WIDEST = 1000, 1640
#: Widths of what it holds, in Blender's units of 20 pixels.
BRUSH, SIZE, AMOUNT, STRENGTH = 4.6, 6.6, 6.6, 5.4


def draw_header(context: Context, layout: UILayout, settings: OperatorProperties) -> None:
    """Draw the tool's settings into the header."""
    width = context.region.width / context.preferences.system.ui_scale
    wide = width >= WIDE
    brush = Brush(settings.brush)
    row = layout.row(align=True)
    if width >= WIDEST:
        row.prop(settings, "brush", expand=True)
    else:
        row.ui_units_x = BRUSH
        row.prop(settings, "brush", text="")
    bed = bed_in_use(context)
    if bed is not None:
        row = layout.row(align=True)
        _number(row, bed.digiclay, "size", SIZE)
        row.prop(bed.digiclay, "blister_follows", text="", icon="LINKED")
    if brush.has_amount:
        _number(layout, settings, amount_name(brush), AMOUNT)
    if brush in LOCKS:
        row = layout.row(align=True)
        for change in ("Invert", "Clear"):
            row.operator("digiclay.press_locks", text=change).change = change.upper()
        row.menu("DIGICLAY_MT_locks", text="", icon="DOWNARROW_HLT")
    else:
        _number(layout, settings, "strength", STRENGTH)
    if brush in STAMPS:
        layout.prop(settings, "stamp", text="")
        if settings.stamp == FILE:
            layout.prop(settings, "stamp_file", text="")
    if bed is not None:
        kind = find_kind(devices.read_finger(devices.find_first(bed)))
        label = kind.label if kind else "Finger"
        layout.menu(
            "DIGICLAY_MT_fingers", text=label if wide else "", icon="NONE" if wide else "VIEW_PAN"
        )
    layout.popover("DIGICLAY_PT_press_stroke", text="Stroke" if wide else "", icon="CURVE_BEZCURVE")
    layout.popover("DIGICLAY_PT_press_pen", text="Pen" if wide else "", icon="STYLUS_PRESSURE")
    if wide and brush not in STAMPS:  # that has no room for them
        draw_presets(layout)
    layout.operator("digiclay.skin_toggle", text="", icon="SURFACE_DATA")


def draw_curves(layout: UILayout) -> None:
    """Draw what forms strokes along curves, and stamps filled ones. `layout` bpy.types.UILayout."""
    layout.operator("digiclay.press_curves", icon="CURVE_DATA").fill = False
    row = layout.operator("digiclay.press_curves", text="Stamp Filled Curves", icon="CURVE_NCIRCLE")
    row.fill = True


def draw_presets(layout: UILayout) -> None:
    """Draw what opens the presets. `layout` bpy.types.UILayout."""
    words = bpy.types.DIGICLAY_PT_press_presets.bl_label
    layout.popover("DIGICLAY_PT_press_presets", text=words, icon="PRESET")


def _number(layout: UILayout, owner: OperatorProperties, name: str, units: float) -> None:
    """Draw a number no wider than it needs."""
    row = layout.row(align=True)
    row.ui_units_x = units
    row.prop(owner, name)


def find_outline(
    middle: Floats, finger: Fingertip, turn: Floats, depth: float, brush: Brush, layout: Layout
) -> Floats:
    """Return the rim of what a brush would form about a place (2,), m, at a depth, m, (k, 2), m."""
    radius = find_radius(finger, layout)
    if brush in STAMPS:
        return middle + lay_square((0.0, 0.0), (radius, 0.0))[:-1]
    if brush in RINGED:
        finger, depth = Fingertip(radius, radius, radius), radius
    return middle + find_contact_outline(finger, turn, depth)


def _draw_cursor(context: Context, tool: WorkSpaceTool, xy: tuple[int, int]) -> None:
    """Draw the patch under the mouse; Blender hands the place over in pixels of the window."""
    from ..overlay.draw import cursor

    region = context.region
    if region is None or region.type != "WINDOW" or context.mode != "OBJECT":
        return
    if any(operator.bl_idname in ADJUSTING for operator in context.window.modal_operators):
        return
    corner = region.x, region.y
    settings = tool.operator_properties(OPERATOR)
    target, hider = aim.look_at(context, (xy[0] - region.x, xy[1] - region.y), settings.project)
    if target is None:
        return
    if hider is not None:
        cursor([], make_label(context, name_hider(target.bed, hider), xy, corner))
        return
    tip = fingertip_of(target.bed)
    if tip is None:
        return
    brush, amount, _ = find_shown(target.bed, settings)
    depth = 1e-3 * settings.depth if brush.rises else amount
    finger, turn = devices.read_finger(devices.find_first(target.bed)), bridge.pose(tip)[3:]
    layout = target.grid.layout
    rim = close(find_outline(target.point[:2], finger, turn, depth, brush, layout))
    rims = [np.column_stack(image.place(*rim.T)) for image in find_images(settings)]
    paths = map_paths(partial(drape, target.grid, target.height), [*rims, *_trail(target)])
    paths += find_axes(target.grid, target.height, settings)
    text = describe(target.bed, settings) if preferences.get(context).show_cursor_text else ""
    color = SMOOTHING if brush in RINGED else LIGHT
    draw_on_bed(context, target.bed, paths, text, xy, color, corner)


def name_hider(bed: Object, hider: Object) -> str:
    """Return what is said of an object that hides a bed; nothing of a presser, which belongs there."""
    return "" if hider in list_pressers(bed) else localize("{} hides the bed", hider.name)


def describe(bed: Object, settings: OperatorProperties) -> str:
    """Return what is shown beside the cursor: what the press does, and what the bed's session forms."""
    finger = devices.read_finger(devices.find_first(bed))
    words = describe_brush(finger, *find_shown(bed, settings))
    if settings.project == aim.PLANE:
        words += localize("   Rest Plane")
    session = running.find(bed)
    if session is None or not session.strokes:
        return words
    speed = 0.0 if session.paused else session.clock.factor
    left = estimate_time(session.strokes) / speed if speed else None
    return words + describe_queue(session.strokes[0].brush, len(session.strokes) - 1, left)


def find_axes(grid: Grid, height: Floats, settings: OperatorProperties) -> list[Floats]:
    """Return axes and center of the tool's symmetry, lying on pins at heights (n,), m; (k, 3), m."""
    if settings.symmetry == "NONE":
        return []
    center = 1e-3 * np.array([settings.center_x, settings.center_y])
    axis = float(settings.axis)
    lines = [lay_ring(tuple(center), (center[0] + MARK, center[1]))]
    right, up = np.abs(grid.x).max(), np.abs(grid.y).max()
    parts = np.linspace(-2.0, 2.0, PARTS)[:, None] * np.hypot(right, up)
    for kind, angle in (("Y", axis), ("X", axis + math.pi / 2.0)):
        if kind in settings.symmetry:
            line = center + parts * (math.cos(angle), math.sin(angle))
            lines.append(line[(np.abs(line) <= (right, up)).all(axis=1)])
    return [drape(grid, height, line) for line in lines if len(line) > 1]


def find_shown(bed: Object, settings: OperatorProperties) -> tuple[Brush, float, float]:
    """Return brush, depth or height, m, and strength of the stroke that is drawn, or of a press now."""
    session = running.find(bed)
    stroke = session.strokes[-1] if session is not None and session.strokes else None
    if stroke is not None and stroke.held:
        sample = stroke.samples[-1]
        if sample.share:
            return stroke.brush, sample.depth / sample.share, sample.share
    brush = choose_brush(settings.brush, HELD)
    return (
        brush,
        1e-3 * getattr(settings, amount_name(brush)),
        read_own(settings, "strength", brush),
    )


def _trail(target: aim.Target) -> list[Floats]:
    """Return what fingertips have still to go along, and their rims where they are, (k, 2), m; or none."""
    session = running.find(target.bed)
    if session is None or not session.strokes:
        return []
    first, finger = session.strokes[0], find_ellipsoid(session.scene)
    paths = [path for stroke in session.strokes for path in stroke.ahead]
    if not first.parts:
        paths[0] = np.concatenate([session.poses[:1, :2], paths[0]])
    layout = target.grid.layout
    for pose in session.poses[list_pressing(session)]:
        depth = float(target.height.max()) - pose[2]
        paths.append(close(find_outline(pose[:2], finger, pose[3:], depth, first.brush, layout)))
    return [path for path in paths if len(path) > 1]


def _scale_key(key: str, scalar: float) -> tuple[str, dict[str, Any], dict[str, Any]]:
    """Return the entry of the keymap by which a key scales the fingertip."""
    event = {"type": key, "value": "PRESS", "repeat": True}
    return "digiclay.press_scale", event, {"properties": [("scalar", scalar)]}


class PressTool(bpy.types.WorkSpaceTool):
    """Sculpt with the fingertip under the mouse."""

    bl_space_type = "VIEW_3D"
    bl_context_mode = "OBJECT"
    bl_idname = TOOL
    bl_label = "Press"
    bl_description = (
        "Press the fingertip into a bed of Digital Clay.\n"
        "Drag to sculpt; Shift smooths; Ctrl inverts Lower and Raise; F, Shift F and Ctrl F set size, "
        "strength, and depth or height; a pen presses by itself"
    )
    bl_icon = str(Path(__file__).with_suffix("").with_name("press_tool"))
    bl_keymap = (
        # The first two leave the press to each other: Blender keeps no order among them.
        ("digiclay.press_shape", {"type": "LEFTMOUSE", "value": "PRESS"}, None),
        ("digiclay.press_shape", {"type": "LEFTMOUSE", "value": "PRESS", "ctrl": True}, None),
        (OPERATOR, {"type": "LEFTMOUSE", "value": "PRESS"}, None),
        # Shift and a click form a line, Shift and a drag smooths: Blender tells the two apart.
        ("digiclay.press_line", {"type": "LEFTMOUSE", "value": "CLICK", "shift": True}, None),
        ("digiclay.press_shape", {"type": "LEFTMOUSE", "value": "CLICK_DRAG", "shift": True}, None),
        (OPERATOR, {"type": "LEFTMOUSE", "value": "CLICK_DRAG", "shift": True}, None),
        (OPERATOR, {"type": "LEFTMOUSE", "value": "PRESS", "ctrl": True}, None),
        # Keys that are pressed or let go while another operator has the events are found by the
        # next move.
        *(
            ("digiclay.press_keys", {"type": kind, "value": "ANY", "any": True}, None)
            for kind in ("LEFT_CTRL", "RIGHT_CTRL", "LEFT_SHIFT", "RIGHT_SHIFT", "MOUSEMOVE")
        ),
        ("digiclay.press_size", {"type": "F", "value": "PRESS"}, None),
        ("digiclay.press_strength", {"type": "F", "value": "PRESS", "shift": True}, None),
        ("digiclay.press_depth", {"type": "F", "value": "PRESS", "ctrl": True}, None),
        (
            "wm.call_menu_pie",
            {"type": "E", "value": "PRESS"},
            {"properties": [("name", "DIGICLAY_MT_pie_brushes")]},
        ),
        ("digiclay.press_base", {"type": "Y", "value": "PRESS"}, None),
        ("digiclay.press_locks_area", {"type": "B", "value": "PRESS"}, None),
        (
            "digiclay.press_locks_area",
            {"type": "LEFTMOUSE", "value": "CLICK_DRAG", "shift": True, "ctrl": True},
            {"properties": [("shape", "LASSO")]},
        ),
        ("digiclay.skin_toggle", {"type": "S", "value": "PRESS", "alt": True}, None),
        _scale_key("LEFT_BRACKET", 1.0 / 1.1),
        _scale_key("RIGHT_BRACKET", 1.1),
    )
    draw_cursor = staticmethod(_draw_cursor)

    @staticmethod
    def draw_settings(context: Context, layout: UILayout, tool: WorkSpaceTool) -> None:
        """Draw the tool's settings into the header."""
        draw_header(context, layout, tool.operator_properties(OPERATOR))


def settle_finger() -> None:
    """Give the bed in use the fingertip of the brush in hand again: undo brings back that of another one."""
    bpy.context.view_layer.update()  # what undo has brought back has no place in the world before
    bed = bed_in_use(bpy.context)
    if bed is not None and tool_settings(bpy.context) is not None:
        take_finger(bpy.context, bed)


@bpy.app.handlers.persistent
def _settle_soon(*_: object) -> None:
    """Settle it when Blender has evaluated what undo has brought back."""
    if not (bpy.app.background or bpy.app.timers.is_registered(settle_finger)):
        bpy.app.timers.register(settle_finger)


#: Handlers by the names of Blender's lists.
HANDLERS = dict.fromkeys(("undo_post", "redo_post"), _settle_soon)


def register() -> None:
    """Add the tool at the end of the toolbar."""
    bpy.utils.register_tool(PressTool, separator=True)
    connect(HANDLERS)


def unregister() -> None:
    """Remove the tool; where it is in use, the first tool replaces it."""
    disconnect(HANDLERS)
    if bpy.app.timers.is_registered(settle_finger):
        bpy.app.timers.unregister(settle_finger)
    _put_down()
    bpy.utils.unregister_tool(PressTool)


def take_up(context: Context) -> None:
    """Take the tool in hand in the 3D views of the context's workspace."""
    _choose_tool(context.window, (context.area, *context.window.screen.areas), TOOL)


def _put_down() -> None:
    """Take up the first tool in every window where this one is in hand: else its cursor is still drawn."""
    for window in bpy.context.window_manager.windows:
        tool = window.workspace.tools.from_space_view3d_mode("OBJECT", create=False)
        if tool is not None and tool.idname == TOOL:
            _choose_tool(window, window.screen.areas, "builtin.select_box")


def _choose_tool(window: Window, areas: Iterable[Area | None], name: str) -> None:
    """Take a tool in hand in the first of some areas that is a 3D view."""
    views = [area for area in areas if area and area.type == "VIEW_3D"]
    if views:
        region = next(region for region in views[0].regions if region.type == "WINDOW")
        with bpy.context.temp_override(window=window, area=views[0], region=region):
            bpy.ops.wm.tool_set_by_id(name=name, space_type="VIEW_3D")


#: Standard deviation of the weights, and how far they reach, in pitches.
SPREAD, REACH = 1.0, 3


def drape(cells: Grid, height: Floats, places: Floats) -> Floats:
    """Return places (k, 2) with the mean height of the pins about each, (k, 3), m, weighted normally."""
    # Smoothed, a step between two pins makes no spike in a line.
    plan = cells.layout
    x, y = places.T[:, :, None, None]
    row, column = np.divmod(cells.at(x, y), plan.columns)
    step = np.arange(-REACH, REACH + 1)
    rows, columns = row + step[:, None], column + step
    on_bed = (rows >= 0) & (rows < plan.rows) & (columns >= 0) & (columns < plan.columns)
    pins = np.where(on_bed, rows * plan.columns + columns, 0)
    square = (cells.x[pins] - x) ** 2 + (cells.y[pins] - y) ** 2
    # Relative to the nearest pin: far beyond the edge all weights would be 0.
    nearest = np.where(on_bed, square, np.inf).min(axis=(1, 2), keepdims=True)
    weight = np.where(on_bed, np.exp((nearest - square) / (2.0 * (SPREAD * plan.pitch) ** 2)), 0.0)
    mean = (weight * height[pins]).sum(axis=(1, 2)) / weight.sum(axis=(1, 2))
    return np.column_stack([places, mean])
