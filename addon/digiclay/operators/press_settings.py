"""Settings of the Press tool: properties of its operator, which the header shows and presets keep."""

from ..compat import bpy
from ..live.stroke import DEEPEST
from ..press import brush, pen


class PressSettings:
    """Mixin of the operator with its properties."""

    brush: bpy.props.EnumProperty(
        name="Brush",
        description="What a stroke does to the surface",
        items=brush.BRUSH_ITEMS,
        default="LOWER",
        translation_context="Brush",
    )
    depth: bpy.props.FloatProperty(
        name="Depth (mm)",
        description="How far a stroke of Lower goes below the surface, in mm",
        default=4.0,
        min=0.1,
        max=1e3 * DEEPEST,
        soft_max=10.0,
        precision=2,
        step=25,
    )
    height: bpy.props.FloatProperty(
        name="Height (mm)",
        description="How far a stroke of Raise goes above the surface, in mm",
        default=15.0,
        min=0.1,
        max=1e3 * DEEPEST,
        soft_max=30.0,
        precision=2,
        step=100,
    )
    strength: bpy.props.FloatProperty(
        name="Strength",
        description=(
            "Share of the depth, of the height, or of the way to the level that a stroke reaches, and "
            "strength of Smooth; pen pressure scales it further"
        ),
        default=1.0,
        min=0.01,
        max=1.0,
        subtype="FACTOR",
        precision=2,
    )
    symmetry: bpy.props.EnumProperty(
        name="Symmetry",
        description=(
            "Mirror images of a stroke about the middle of the bed. The device has one finger: "
            "it forms them one after the other, as one undo step"
        ),
        items=brush.SYMMETRY_ITEMS,
        default="NONE",
    )
    path: bpy.props.EnumProperty(
        name="Stroke",
        description="Path of a stroke",
        items=brush.PATH_ITEMS,
        default="FREE",
    )
    stabilizer: bpy.props.FloatProperty(
        name="Stabilizer (mm)",
        description=(
            "Length, in mm, by which a free stroke lags behind the mouse, so that it becomes smoother; "
            "its end is reached. 0: none"
        ),
        default=0.0,
        min=0.0,
        max=50.0,
        soft_max=15.0,
        precision=1,
        step=50,
    )
    use_pressure: bpy.props.BoolProperty(
        name="Pen Pressure",
        description="Pen pressure scales depth, height and strength, up to their values",
        default=True,
    )
    pressure_curve: bpy.props.EnumProperty(
        name="Pressure Curve",
        description="Share of the values that a pen reaches with part of its pressure",
        items=pen.CURVE_ITEMS,
        default="LINEAR",
    )
    use_tilt: bpy.props.BoolProperty(
        name="Pen Tilt",
        description="The fingertip leans with the pen, by up to 60 degrees, until the stroke ends",
        default=True,
    )
