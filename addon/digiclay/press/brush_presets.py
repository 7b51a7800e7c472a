"""Brush presets of the Press tool: files of settings, and pictures of what each forms."""

import ast
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy.utils.previews
import numpy as np

from ..compat import OperatorProperties, bpy
from ..core.base.arrays import Floats
from ..core.base.errors import DigiclayError, one_line
from ..core.base.modes import COLORS, Mode
from ..core.control.blister import Blister
from ..core.files.tables import Record, show_value
from ..core.model.fingertip import Fingertip
from ..core.model.layout import Layout, make_grid
from ..live import beds
from ..settings import devices
from ..strokes.falloff import Falloff
from ..strokes.nominal import LIMITS, Device, find_nominal
from ..strokes.stroke import LOCKS, Brush, lay_line, lay_ring
from .brush import OPERATOR, bed_in_use, find_path, lay_stroke
from .ghost import find_colors, find_light

#: Folder of the presets below ``presets``, here and in the user's own folder.
SUBFOLDER = "digiclay_press"
#: Names that the lines of a preset begin with.
DEFINES = (
    "wm = bpy.context.window_manager",
    'settings = bpy.context.workspace.tools.from_space_view3d_mode("OBJECT").operator_properties('
    f'"{OPERATOR}")',
)
#: Name by which they have the fingertip.
FINGER = "digiclay_finger"
#: Folder with a folder ``presets``.
HOME = str(Path(__file__).parents[1])


def list_settings(settings: OperatorProperties) -> list[str]:
    """Return the names of all settings of the tool, the brush before those that come with it."""
    return [
        shown.identifier
        for shown in settings.bl_rna.properties
        if not shown.is_hidden and shown.identifier != "rna_type"
    ]


def read_preset(file: Path, settings: OperatorProperties) -> Record:
    """Return the settings of a preset, the tool's defaults where it has none. Raises DigiclayError."""
    try:
        lines = ast.parse(file.read_text(encoding="utf-8")).body
        chosen = {
            line.targets[0].attr: ast.literal_eval(line.value)
            for line in lines
            if isinstance(line, ast.Assign) and isinstance(line.targets[0], ast.Attribute)
        }
        finger = _make_finger(chosen.pop(FINGER)) if FINGER in chosen else None
    except (DigiclayError, OSError, TypeError, ValueError, SyntaxError) as error:
        raise DigiclayError(f"{file.name} cannot be read: {one_line(error)}") from None
    shown = {name: settings.bl_rna.properties[name] for name in list_settings(settings)}
    for name, value in chosen.items():
        if name not in shown:
            rule = "must be a setting of the Press tool"
            raise DigiclayError(f"{file.name}: a key {rule} (got {show_value(name)}).")
        if not _fits(shown[name], value):
            rule = "must be a value of that setting"
            raise DigiclayError(f"{file.name}: {name} {rule} (got {show_value(value)}).")
    defaults = {name: setting.default for name, setting in shown.items()}
    return defaults | chosen | {FINGER: finger}


def _fits(setting: Any, value: Any) -> bool:
    """Tell whether a setting can have a value."""
    if type(value) is not type(setting.default):
        return False
    if setting.type == "ENUM":
        return value in setting.enum_items
    numeric = setting.type in ("FLOAT", "INT")
    return not numeric or bool(setting.hard_min <= value <= setting.hard_max)


def apply_preset(settings: OperatorProperties, chosen: Record) -> None:
    """Give the tool the settings of a preset."""
    for name in list_settings(settings):
        setattr(settings, name, chosen[name])
    if chosen[FINGER]:
        _resize(chosen[FINGER])


def preset_values(settings: OperatorProperties) -> list[str]:
    """Return what a preset keeps: the form of the fingertip, and every setting of the tool."""
    return [f"wm.{FINGER}", *(f"settings.{name}" for name in list_settings(settings))]


#: Pixels along a side of a picture, each a pin, their pitch, m, and height of the pins at rest, m.
SIDE, PITCH, REST = 96, 0.8e-3, 40e-3
#: Color of the surface; what is formed has that of its ghost in the view.
CLAY = np.array([0.86, 0.83, 0.78])
#: Path in a picture (k, 2), m, by the path that is set.
ALONG = np.linspace(-24e-3, 24e-3, 33)
PATHS = {
    "FREE": np.column_stack([ALONG, 8e-3 * np.sin(ALONG / 8e-3)]),
    "LINE": lay_line((-24e-3, -8e-3), (24e-3, 8e-3)),
    "RING": lay_ring((0.0, 0.0), (18e-3, 0.0)),
    "STAMP": lay_line((0.0, 0.0), (24e-3, 0.0)),
}
#: Brushes that change what is formed.
CHANGING = (Brush.LEVEL, Brush.FLATTEN, Brush.SMOOTH, Brush.ERASE, *LOCKS)


def draw_picture(chosen: Record) -> Floats:
    """Return the picture (SIDE, SIDE, 4), the lower row first, of what a preset's stroke leaves."""
    settings = SimpleNamespace(**chosen | {"center_x": 0.0, "center_y": 0.0})
    kind = Brush(settings.brush)
    path = PATHS[find_path(settings, kind)]
    if settings.symmetry != "NONE":  # smaller, and beside the center
        path = 0.5 * path + (16e-3, 0.0)
    finger = chosen[FINGER] or Fingertip()
    blister = devices.scale_blister(Blister(), finger.width / Fingertip().width)
    grid = make_grid(Layout(SIDE, SIDE, PITCH))
    height = np.full(grid.count, REST)
    if kind in CHANGING:  # two ridges
        height += 6e-3 * np.exp(-(((np.abs(grid.x) - 12e-3) / 5e-3) ** 2))
    device = Device(grid, finger, blister, 2.0 * REST, rest=REST)
    stroke = lay_stroke(settings, path, kind)
    if not (kind in LIMITS or stroke.placed):  # what valves sweep is what a full ring leaves
        stroke = replace(stroke, brush=Brush.ERASE, falloff=Falloff.CONSTANT)
    nominal = find_nominal(stroke, device, height)
    after = height if kind in LOCKS else nominal.height
    light = find_light(grid.layout, after)
    ghost = find_colors(light, after - height)
    colors = ghost[:, :3] + (1.0 - ghost[:, 3:]) * light[:, None] * CLAY
    if kind in LOCKS:
        colors[nominal.near] = COLORS[Mode.LOCKED]
    return np.column_stack([colors, np.ones(grid.count)]).reshape(SIDE, SIDE, 4)


#: Pictures that are shown, by file and the time of its last change; Blender's store of them is
#: there while the extension is.
SHOWN = SimpleNamespace(previews=None)


def find_icon(file: Path, settings: OperatorProperties) -> int:
    """Return Blender's number of the picture of a preset; 0 for a file that is none."""
    try:
        name = f"{file} {file.stat().st_mtime_ns}"
        if name not in SHOWN.previews:
            picture = draw_picture(read_preset(file, settings))
            preview = SHOWN.previews.new(name)
            preview.image_size = SIDE, SIDE
            preview.image_pixels_float.foreach_set(picture.ravel().astype(np.float32))
        return int(SHOWN.previews[name].icon_id)
    except (DigiclayError, OSError):
        return 0


def register() -> None:
    """Let Blender find the presets that come along, and presets the fingertip."""
    bpy.types.WindowManager.digiclay_finger = bpy.props.FloatVectorProperty(
        name="Fingertip (mm)",
        description="Length, width and height of the fingertip that the Press tool is about, in mm",
        size=3,
        get=lambda _: _read_finger(),
        set=lambda _, axes: _resize(_make_finger(axes)),
    )
    bpy.utils.register_preset_path(HOME)
    SHOWN.previews = bpy.utils.previews.new()


def unregister() -> None:
    """Undo `register`."""
    bpy.utils.previews.remove(SHOWN.previews)
    bpy.utils.unregister_preset_path(HOME)
    del bpy.types.WindowManager.digiclay_finger


def _read_finger() -> tuple[float, float, float]:
    """Return the fingertip's length, width and height, mm; that of a new bed without one."""
    bed = bed_in_use(bpy.context)
    finger = Fingertip() if bed is None else devices.read_finger(devices.find_first(bed))
    return 2e3 * finger.length, 2e3 * finger.width, 2e3 * finger.height


def _make_finger(axes: Sequence[float]) -> Fingertip:
    """Return the fingertip of a length, width and height, mm."""
    length, width, height = (round(5e-4 * float(axis), 9) for axis in axes)
    return Fingertip(length, width, height)


def _resize(finger: Fingertip) -> None:
    """Give the fingertip that the tool is about another size."""
    bed = bed_in_use(bpy.context)
    if bed is not None and not beds.find_obstacle(bpy.context, bed, beds.Use.CHANGE):
        devices.resize(devices.find_first(bed), finger)
