"""Settings of the Press tool: properties of its operator."""

from ..press import brush, pointer
from ..settings.declared import choice, flag, integer, number, text
from ..strokes.stroke import DEEPEST, FEWEST, MOST
from .action import millimeters

#: Range of a place on the bed, mm.
PLACE = {"soft_min": -100.0, "soft_max": 100.0, "step": 100}


class PressSettings:
    """Settings of the tool: properties of the operator, which the header shows and presets store."""

    brush: choice(
        "Brush",
        "What a stroke does to the surface",
        items=brush.BRUSH_ITEMS,
        default="LOWER",
        translation_context="Brush",
        update=brush.take_brush,
    )
    former: text("Former Brush", default="LOWER", options={"HIDDEN"})
    depth: millimeters(
        "Depth",
        4e-3,
        "How far a stroke of Lower, or a stamp with Ctrl, goes below the surface, in mm",
        min=0.1,
        max=1e3 * DEEPEST,
        soft_max=10.0,
        step=25,
    )
    height: millimeters(
        "Height",
        6e-3,
        "How far a stroke of Raise, or a stamp, goes above the surface, in mm",
        min=0.1,
        max=1e3 * DEEPEST,
        soft_max=30.0,
        step=100,
    )
    strength: number(
        "Strength",
        "Share of the depth, of the height, or of the way to the level that a stroke reaches, "
        "and strength of Smooth; pen pressure scales it further",
        default=1.0,
        min=0.01,
        max=1.0,
        subtype="FACTOR",
        precision=2,
    )
    symmetry: choice(
        "Symmetry",
        "Mirrored or rotated images of a stroke, formed at the same time as one undo step",
        items=brush.SYMMETRY_ITEMS,
        default="NONE",
    )
    radial: integer("Radial Count", "Number of images", default=6, min=FEWEST, max=MOST)
    center_x: millimeters("Center X", 0.0, "Center of the symmetry", **PLACE)
    center_y: millimeters("Center Y", 0.0, "Center of the symmetry", **PLACE)
    axis: number("Axis", "Turn of the mirror's axes", default=0.0, subtype="ANGLE", step=1000)
    stamp: choice("Stamp", "Shape that is stamped", items=brush.STAMP_ITEMS, default="heart")
    stamp_file: text("File", "Mesh, picture or .npy file that is stamped", subtype="FILE_PATH")
    falloff: choice(
        "Falloff",
        "Flanks of Raise, Lower and Level, and effect of brushes in the ring",
        items=brush.FALLOFF_ITEMS,
        default="DEVICE",
    )
    accumulate: flag(
        "Accumulate",
        "Build on the surface as it is: where strokes meet, or one returns, heights and depths add. "
        "Else Raise and Lower count from the base",
        default=False,
    )
    combine: choice(
        "Combine",
        "What Level and Stamp leave where something is formed already",
        items=brush.COMBINE_ITEMS,
        default="USUAL",
    )
    use_limit: flag("Limit", "Form nothing below and above two heights", default=False)
    limit_low: millimeters(
        "Lowest", -10e-3, "Height above rest below which nothing is formed", **PLACE
    )
    limit_high: millimeters(
        "Highest", 10e-3, "Height above rest above which nothing is formed", **PLACE
    )
    finish: choice(
        "Finish",
        "What becomes of the pins when the fingertip of Lower, Raise or Level has left",
        items=brush.FINISH_ITEMS,
        default="NOMINAL",
    )
    project: choice(
        "Project",
        "What the mouse moves over as it draws",
        items=brush.PROJECT_ITEMS,
        default=brush.SURFACE,
    )
    path: choice("Stroke", "Path of a stroke", items=brush.PATH_ITEMS, default="FREE")
    stabilizer: millimeters(
        "Stabilizer",
        0.0,
        "Length, in mm, by which a free stroke lags behind the mouse, so that it becomes smoother; "
        "its end is reached. 0: none",
        min=0.0,
        max=50.0,
        soft_max=15.0,
        precision=1,
        step=50,
    )
    use_pressure: flag(
        "Pen Pressure",
        "Pen pressure scales depth, height and strength, up to their values",
        default=True,
    )
    pressure_curve: choice(
        "Pressure Curve",
        "Share of the values that a pen reaches with part of its pressure",
        items=pointer.CURVE_ITEMS,
        default="LINEAR",
    )
    use_tilt: flag(
        "Pen Tilt",
        "The fingertip leans with the pen, by up to 60 degrees, until the stroke ends",
        default=True,
    )


for _name in brush.OWN:
    _setting = PressSettings.__annotations__[_name]
    _hidden = _setting.function(**_setting.keywords | {"options": {"HIDDEN"}})
    PressSettings.__annotations__ |= {
        brush.own_name(_name, each.value): _hidden for each in brush.BRUSH_WORDS
    }
