"""Size, depth and strength of the Press tool: by the mouse as in Blender's radial control, and by presets.

The mouse goes sideways, or a value is typed; outlines on the pins show it at true size.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from bl_operators.presets import AddPresetBase  # type: ignore[import-not-found]

from .. import bridge
from ..compat import Area, Context, Event, Menu, Object, Operator, OperatorProperties, bpy
from ..core.base.arrays import Floats
from ..core.model.fingertip import Fingertip
from ..core.surface.pointing import find_contact_outline
from ..live.beds import Use, find_obstacle
from ..overlay import views
from ..panels.base import menu
from ..press import aim, brush, brush_presets, tool
from ..press.brush import FINGERS
from ..roles import fingertip_of
from ..settings import devices
from ..settings.declared import choice, number
from ..strokes.stroke import DEEPEST, SHALLOWEST, Brush, Place
from ..ui_text import localize
from .action import Action, Drawing, Polled, Result, action, inform, show_status
from .poll_messages import no_finger, no_tool_in_view

#: Factor of the mouse's way with Shift held down.
PRECISE = 0.1
#: Events that are Blender's: timers, on which sessions go on, and the ways to turn the view.
PASSED = ("TIMER", "MIDDLEMOUSE", "WHEEL", "TRACKPAD", "NDOF")
KEYS = (
    "{}  |  Move sideways or type a value  |  Ctrl: steps, Shift: precise  |  "
    "Enter or click: confirm  |  Esc or right click: cancel"
)


class AdjustMixin(Drawing):
    """Mixin of an operator that changes one number by the mouse or the keyboard.

    A subclass reads, writes, parses and names its number, in SI, of a bed or of the settings of the
    tool.
    """

    needs = no_tool_in_view, no_finger
    #: Range of the number, the steps it takes with Ctrl held down, and its change a pixel at a UI
    #: scale of 1.
    low: float
    high: float
    snap: float
    pixel: float
    #: The setting of the tool that it is, and what 1 in SI is there.
    setting: str
    factor: float
    #: Returns the number with its name and unit.
    describe: Callable[[float], str]
    #: Returns outlines (k, 2), m, about the place pointed at, by fingertip, its turn (wxyz), depth,
    #: value.
    outlines: Callable[[Fingertip, Any, float, float], list[Any]]

    def read(self, bed: Object, settings: OperatorProperties) -> float:
        """Return the number."""
        return float(getattr(settings, self.setting)) / self.factor

    def write(self, bed: Object, settings: OperatorProperties, value: float) -> None:
        """Set the number."""
        setattr(settings, self.setting, self.factor * value)

    def parse(self, text: str) -> float:
        """Return the number of a typed text; a ValueError tells that it is none."""
        return float(bpy.utils.units.to_value("METRIC", "LENGTH", text, str_ref_unit="mm"))

    def rate(self, context: Context, bed: Object) -> float:
        """Return the change of the number for a pixel."""
        return self.pixel / float(context.preferences.system.ui_scale)

    def prepare(self, context: Context, event: Event) -> None:
        """Begin at the place under the mouse; beside a bed, in the middle of the one it is about."""
        bed, self.center = _find_place(context, (event.mouse_region_x, event.mouse_region_y))
        self.uid = bed.session_uid
        self.start = self.value = self.read(bed, brush.tool_settings(context))
        self.before, self.text, self.snapped = event.mouse_x, "", False
        self._show(context)

    def modal(self, context: Context, event: Event) -> Result:
        """Follow the mouse or the keyboard, until confirmed or cancelled."""
        bed = brush.find_bed(context, self.uid)
        if bed is None or not self.poll(context):
            return self.end(context, "CANCELLED", "PASS_THROUGH")
        if event.type.startswith(PASSED):
            return {"PASS_THROUGH"}
        self.snapped = event.ctrl
        if event.type == "MOUSEMOVE":
            self._move(context, bed, event)
        elif event.value == "PRESS" and event.type in ("LEFTMOUSE", "RET", "NUMPAD_ENTER"):
            value = self._shown()
            if value != self.start:
                self.write(bed, brush.tool_settings(context), value)
            return self.end(context, "FINISHED" if value != self.start else "CANCELLED")
        elif event.value == "PRESS" and event.type in ("ESC", "RIGHTMOUSE"):
            return self.end(context, "CANCELLED")
        elif event.value == "PRESS" and event.type == "BACK_SPACE":
            self.text = self.text[:-1]
        elif event.value == "PRESS" and event.ascii and event.ascii.isprintable():
            self.text += event.ascii
        self._show(context)
        return {"RUNNING_MODAL"}

    def _move(self, context: Context, bed: Object, event: Event) -> None:
        """Follow the mouse sideways; a typed value has precedence."""
        pixels, self.before = event.mouse_x - self.before, event.mouse_x
        if not self.text:
            share = PRECISE if event.shift else 1.0
            with context.temp_override(region=self.region):
                rate = self.rate(bpy.context, bed)
            self.value = min(max(self.value + pixels * share * rate, self.low), self.high)

    def _shown(self) -> float:
        """Return the number as it is shown, and would be set."""
        if self.text:
            try:
                value = self.parse(self.text)
            except ValueError:
                return self.start
        else:
            value = round(self.value / self.snap) * self.snap if self.snapped else self.value
        return min(max(value, self.low), self.high) if np.isfinite(value) else self.start

    def _show(self, context: Context) -> None:
        """Show the number in the status bar, and draw it."""
        self.words = self.describe(self._shown()) + (f"   [{self.text}]" if self.text else "")
        show_status(context, localize(KEYS, self.words))
        views.redraw()

    def draw_view(self, area: Area) -> None:
        """Draw outline and number in the view the operator was called in."""
        context = bpy.context
        bed = brush.find_bed(context, self.uid)
        tip = bed and fingertip_of(bed)
        if tip is None or context.area != area or not self.poll(context):
            return
        settings = brush.tool_settings(context)
        depth = 1e-3 * settings.depth if settings else DEEPEST
        finger = devices.read_finger(devices.find_first(bed))
        rims = self.outlines(finger, bridge.pose(tip)[3:], depth, self._shown())
        places = [
            tool.close(np.column_stack([rim, np.zeros(len(rim))]) + self.center) for rim in rims
        ]
        middle = bridge.project(context, bed, self.center[None])[0]
        tool.draw_on_bed(context, bed, places, self.words, (middle[0], middle[1]))


def _find_place(context: Context, xy: Place) -> tuple[Any, Any]:
    """Return the bed under a pixel of the region and the place there, m; or the bed in use and its middle."""
    settings = brush.tool_settings(context)
    target = aim.find_target(context, xy, settings.project if settings else aim.SURFACE)
    tip = target and fingertip_of(target.bed)
    if target is not None and tip is not None and not find_obstacle(context, target.bed, Use.FORM):
        return target.bed, target.point
    bed: Object = brush.bed_in_use(context)
    height = bridge.read_cells(bed.data)["height"]
    return bed, np.array([0.0, 0.0, float(height.mean())])


class AdjustSize(AdjustMixin, Operator):
    """Set the size of the fingertip: move the mouse sideways, or type a width"""

    bl_idname = "digiclay.press_size"
    bl_label = "Fingertip Size"
    bl_options = {"UNDO", "BLOCKING"}
    low, high, snap = devices.SMALLEST, devices.LARGEST, 1e-3

    def read(self, bed: Object, settings: OperatorProperties) -> float:
        return devices.read_size(bed)

    def write(self, bed: Object, settings: OperatorProperties, value: float) -> None:
        devices.set_size(bed, value)

    def rate(self, context: Context, bed: Object) -> float:
        """Return the meters per pixel at which the outline's side keeps up with the mouse."""
        points = self.center + 1e-3 * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        middle, along, across = bridge.project(context, bed, points)[:, 0]
        # Half the width on the screen of a circle of 1 mm about the place.
        pixels = float(np.hypot(along - middle, across - middle))
        return 2e-3 / pixels if np.isfinite(pixels) and pixels > 0.0 else 0.0

    def describe(self, value: float) -> str:
        return localize("Size {:.2f} mm", 1e3 * value)

    def outlines(self, finger: Fingertip, turn: Floats, depth: float, value: float) -> list[Any]:
        """Return the widest section of the fingertip, and what of it touches."""
        scaled = devices.scale_tip(finger, value / (2.0 * finger.width))
        return [
            find_contact_outline(scaled, turn, np.inf),
            find_contact_outline(scaled, turn, depth),
        ]


class AdjustDepth(AdjustMixin, Operator):
    """Set the depth, or the height of Raise: move the mouse sideways, or type it"""

    bl_idname = "digiclay.press_depth"
    bl_label = "Press Depth"
    bl_options = {"BLOCKING"}
    low, high, snap, pixel, factor = SHALLOWEST, DEEPEST, 0.5e-3, 0.05e-3, 1e3

    def read(self, bed: Object, settings: OperatorProperties) -> float:
        """Return the depth, or height, of the tool's brush, m."""
        self.setting = brush.amount_name(Brush(settings.brush))
        return super().read(bed, settings)

    def describe(self, value: float) -> str:
        return f"{self.setting.title()} {1e3 * value:.2f} mm"

    def outlines(self, finger: Fingertip, turn: Floats, depth: float, value: float) -> list[Any]:
        """Return what of the fingertip touches at the depth."""
        return [find_contact_outline(finger, turn, value)]


class AdjustStrength(AdjustMixin, Operator):
    """Set the share of the depth that a stroke reaches: move the mouse sideways, or type it: 0.5, or 50 %"""

    bl_idname = "digiclay.press_strength"
    bl_label = "Press Strength"
    bl_options = {"BLOCKING"}
    low, high, snap, pixel = 0.01, 1.0, 0.1, 0.005
    setting, factor = "strength", 1.0

    def parse(self, text: str) -> float:
        """Return the share typed: a number of per cent has their sign, or is above 1."""
        value = float(bpy.utils.units.to_value("NONE", "NONE", text.rstrip("% ")))
        return value / 100.0 if "%" in text or value > 1.0 else value

    def describe(self, value: float) -> str:
        return localize("Strength {:.0f} %", 100.0 * value)

    def outlines(self, finger: Fingertip, turn: Floats, depth: float, value: float) -> list[Any]:
        """Return what of the fingertip touches at the whole depth, and at the share of it."""
        return [
            find_contact_outline(finger, turn, depth),
            find_contact_outline(finger, turn, depth * value),
        ]


@action(
    "digiclay.press_scale",
    "Scale Fingertip",
    no_finger,
    scalar=number("Factor", "Factor of the size", default=1.1, min=0.1, max=10.0),
)
def scale_size(operator: Operator, context: Context) -> None:
    """Scale the fingertip; its blister follows"""
    bed: Object = brush.bed_in_use(context)
    devices.set_size(bed, devices.read_size(bed) * operator.scalar)


class TakeFinger(Action, Operator):
    """Give the fingertip the form of a finger, a palm or a tool; its blister follows"""

    bl_idname = "digiclay.press_finger"
    bl_label = "Preset Finger"
    bl_options = {"REGISTER", "UNDO"}
    needs = (no_finger,)

    kind: choice(
        "Finger",
        "Form and size of the fingertip",
        items=[(name, kind.label, kind.source) for name, kind in FINGERS.items()],
    )

    @classmethod
    def description(cls, context: Context, chosen: OperatorProperties) -> str:
        """Return measures and source of the chosen finger."""
        kind = FINGERS[chosen.kind]
        axes = (kind.finger.length, kind.finger.width, kind.finger.height)
        measures = " × ".join(f"{2e3 * axis:g}" for axis in axes)
        return localize(
            "{} mm: {}. The blister follows, the contact law stays", measures, kind.source
        )

    def perform(self, context: Context) -> None:
        bed: Object = brush.bed_in_use(context)
        devices.resize(devices.find_first(bed), FINGERS[self.kind].finger)


@menu("DIGICLAY_MT_fingers", "Finger")
def fingers(entries: Menu, context: Context) -> None:
    """Preset fingers."""
    for name, kind in FINGERS.items():
        entries.layout.operator(TakeFinger.bl_idname, text=kind.label).kind = name


@menu("DIGICLAY_MT_pie_brushes", "Brush")
def pie_brushes(entries: Menu, context: Context) -> None:
    """Brushes of the Press tool."""
    pie, settings = entries.layout.menu_pie(), brush.tool_settings(context)
    if settings is None:
        return
    first, last = [item[0] for item in brush.BRUSH_ITEMS[:7]], brush.BRUSH_ITEMS[7:]
    for name in first:
        pie.prop_enum(settings, "brush", name)
    column = pie.column()
    for name, *_ in last:
        column.prop_enum(settings, "brush", name)


@action(
    "digiclay.press_brush",
    "Brush Preset",
    no_tool_in_view,
    no_finger,
    options=("UNDO", "INTERNAL"),
    filepath=bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"}),
)
def apply_brush(operator: Operator, context: Context) -> None:
    """Set fingertip, brush, stroke and symmetry of the Press tool to those of a preset"""
    settings: OperatorProperties = brush.tool_settings(context)
    file = Path(operator.filepath)
    brush_presets.apply_preset(settings, brush_presets.read_preset(file, settings))
    bpy.types.DIGICLAY_PT_press_presets.bl_label = bpy.path.display_name(file.name)


class SaveBrush(AddPresetBase, Polled, Operator):
    """Save fingertip, brush, stroke and symmetry as a preset, or remove the one applied last"""

    bl_idname = "digiclay.press_brush_save"
    bl_label = "Save Brush Preset"
    needs = no_tool_in_view, no_finger
    preset_menu = "DIGICLAY_PT_press_presets"
    preset_subdir = brush_presets.SUBFOLDER
    preset_defines = brush_presets.DEFINES

    def execute(self, context: Context) -> Result:
        """Save it; a folder that cannot be written is told of."""
        folder = Path(bpy.utils.user_resource("SCRIPTS"), "presets", brush_presets.SUBFOLDER)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            return super().execute(context)
        except OSError as error:
            inform(self, "The preset could not be saved: {}", error, level="ERROR")
            return {"CANCELLED"}

    @property
    def preset_values(self) -> list[str]:
        """What the preset stores."""
        return brush_presets.preset_values(brush.tool_settings(bpy.context))
