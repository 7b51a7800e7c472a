"""Shape of a bed: from an object, a file, a sample, or the formed surface; its removal."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from .. import bridge
from ..compat import bpy
from ..core.shapes.fitting import pack
from ..core.shapes.request import LENGTHS, UPWARDS, Shape
from ..core.shapes.source_file import KINDS, list_shapes
from ..exchange import shape_show
from ..roles import bed_of
from ..sessions import running
from ..settings import properties
from ..settings.declared import choice, number, title
from ..settings.shown_units import to_si
from ..ui_text import localize
from .action import Action, FileAction, Needs, action, millimeters
from .poll_messages import baked, linked, no_bed, no_shape, session_runs

DEFAULT = Shape()
FITS = (
    ("contain", "Whole", "As large as the bed allows, all of it on the bed"),
    ("cover", "Fill the Bed", "As small as fills the bed; what stands out is left away"),
    ("stretch", "Stretch", "Exactly as large as the bed, whatever its proportions"),
    ("actual", "Own Size", "As large as it is, in the middle of the bed"),
    ("placed", "Where It Is", "As large and where it is; what is below the floor or above the stroke is cut"),
)
RELIEFS = (
    ("rise", "Given Rise", "From its lowest to its highest point by the rise given"),
    ("stroke", "Whole Stroke", "Its highest point at the end of the stroke"),
    ("true", "True", "As high as its plan is large: proportions are kept"),
)
LENGTH = {"soft_min": -100.0, "soft_max": 100.0, "min": -1e5, "max": 1e5, "step": 20}


class Shaped(Action):
    """Mixin of the operators that display a shape: its placement, and the report."""

    bl_options = {"REGISTER", "UNDO"}
    needs: Needs = (
        no_bed,
        session_runs.reworded("Stop the session first: the bed is going to be shaped anew"),
        baked,
        linked,
    )

    #: Displays the shape on a bed; returns what `shape_show` does.
    display: Callable[[Any, Any], Any]
    fit: choice("Size", "Placement on the bed", items=FITS, default=DEFAULT.fit)
    scale: number("Times", "Scale of the plan", default=1.0, min=1e-3, max=1e3)
    x: millimeters("Right", DEFAULT.x, "Shift of its middle from the bed's along x", **LENGTH)
    y: millimeters("Back", DEFAULT.y, "Shift of its middle from the bed's along y", **LENGTH)
    relief: choice("Height", "Height of the shape", items=RELIEFS, default=DEFAULT.relief)
    rise: millimeters(
        "Rise", DEFAULT.rise, "From its lowest to its highest point; negative turns it over", **LENGTH
    )
    foot: millimeters("Foot", DEFAULT.foot, "Where its lowest point lies above the bed at rest", **LENGTH)

    def perform(self, context: Any) -> None:
        """Display the shape, and report its parts beyond the bed."""
        bed = bed_of(context)
        context.view_layer.update()
        laid, off = self.display(context, bed)
        lost = laid.too_low + laid.too_high + laid.overhanging
        words = localize("{}; displayed to within {:.2g} µm", laid.describe(), off * 1e6)
        running.set_message(words, bed.session_uid)
        self.report({"WARNING" if lost else "INFO"}, words)

    def shape(self, file: str, bed: Any, **more: Any) -> Shape:
        """Return how the shape of a file or an object is laid onto the bed, with more fields of `Shape`."""
        more |= {name: to_si(getattr(self, name), 3) for name in ("x", "y", "rise", "foot")}
        before, scale = bed.digiclay.shape, float(f"{self.scale:.7g}")
        return Shape(
            file=file, fit=self.fit, scale=scale, relief=self.relief, **more,
            refresh=before.refresh, surfaces=before.surfaces,
        )  # fmt: skip


def _others(context: Any, bed: Any) -> list[Any]:
    """Return the selected objects with a surface that are no part of a bed."""
    return [thing for thing in context.selected_objects if thing != bed and shape_show.has_surface(thing)]


def _not_two(context: Any) -> str:
    """Not one other object with a surface is selected."""
    count = len(_others(context, bed_of(context)))
    if count > 1:
        return localize("Select one object besides the bed, not {}", count)
    return "" if count else "Select the object first, then the bed with Shift: its upper side is displayed"


class ShapeFromObject(Shaped, bpy.types.Operator):
    """Display the upper side of another selected object on the active bed, driving the pins there"""

    bl_idname = "digiclay.shape_from_object"
    bl_label = "Shape from Object"
    needs = (*Shaped.needs, _not_two)

    def display(self, context: Any, bed: Any) -> Any:
        (thing,) = _others(context, bed)
        relief = shape_show.read_relief(thing, bed, context.evaluated_depsgraph_get())
        return shape_show.show_relief(bed, relief, self.shape(thing.name, bed))


class ShapeFromFile(Shaped, FileAction, bpy.types.Operator):
    """Display a mesh, a picture (bright is high) or a .npy file of heights on the active bed"""

    bl_idname = "digiclay.shape_from_file"
    bl_label = "Shape from File"

    filepath: bpy.props.StringProperty(subtype="FILE_PATH")
    filter_glob: bpy.props.StringProperty(default=";".join(f"*{kind}" for kind in KINDS), options={"HIDDEN"})
    up: choice(
        "Up", "Upward direction of a mesh; automatic: y in a glTF file, else z",
        items=[("auto", "Automatic", ""), *((way, way.upper(), "") for way in UPWARDS)],
    )  # fmt: skip
    unit: choice(
        "Unit", "Unit of length of a mesh; automatic: meters in a glTF file, else millimeters",
        items=[("auto", "Automatic", ""), *((unit, unit, "") for unit in LENGTHS)],
    )  # fmt: skip

    def display(self, context: Any, bed: Any) -> Any:
        path = str(Path(bpy.path.abspath(self.filepath)))
        return shape_show.show_file(bed, self.shape(path, bed, up=self.up, unit=self.unit))


class ShapeSample(Shaped, bpy.types.Operator):
    """Display a sample shape of Digital Clay on the active bed"""

    bl_idname = "digiclay.shape_sample"
    bl_label = "Sample Shape"

    sample: choice("Shape", items=[(name, title(name), "") for name in list_shapes()])

    def display(self, context: Any, bed: Any) -> Any:
        return shape_show.show_file(bed, self.shape(self.sample, bed))


@action("digiclay.shape_keep", "Keep Formed as Shape", no_bed, session_runs, options=("UNDO",))
def keep_shape(operator: Any, context: Any) -> None:
    """Make the formed surface the bed's shape: sessions begin with it, elastic and viscous beds keep to it"""
    bed = bed_of(context)
    scene = properties.scene_of(bed)
    heights = bridge.read_cells(bed.data)["height"]
    shape = replace(scene.shape or DEFAULT, file="Formed", fit="placed", heights=pack(heights))
    properties.write_scene(bed, replace(scene, shape=shape))
    words = localize("{} has a shape of {} heights: sessions begin with it", bed.name, heights.size)
    operator.report({"INFO"}, words)


@action("digiclay.shape_remove", "Remove Shape", no_bed, session_runs, no_shape, options=("UNDO",))
def remove_shape(operator: Any, context: Any) -> None:
    """Remove the bed's shape: sessions begin at rest; the formed surface stays until then"""
    settings = bed_of(context).digiclay
    settings.use_shape = False
    settings.shape.heights = ""
    settings.shape.file = DEFAULT.file
