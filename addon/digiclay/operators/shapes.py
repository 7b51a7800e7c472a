"""Shape of a bed: from an object, a file, a sample, or the formed surface; its removal."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from .. import bridge
from ..compat import bpy
from ..core.shapes.fitting import pack
from ..core.shapes.request import LENGTHS, UPWARDS, Shape
from ..core.shapes.source_file import KINDS, list_shapes
from ..device.view import bed_of
from ..exchange import shape_show
from ..live import running
from ..settings import properties
from ..settings.declared import title
from ..settings.shown_units import SHOWN, to_si
from ..ui_text import localize
from .action import Action, FileAction
from .poll_messages import baked, linked, no_bed, session_runs

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


def millimeters(name: str, default: float, words: str) -> Any:
    """Make a property of a length. `default`, m; `words`: its description."""
    return bpy.props.FloatProperty(
        name=f"{name} (mm)", description=words, default=default * 1e3, soft_min=-100.0, soft_max=100.0,
        min=-1e5, max=1e5, precision=2, step=20,
    )  # fmt: skip


class Shaped(Action):
    """Mixin of the operators here: placement of the shape, and report."""

    bl_options = {"REGISTER", "UNDO"}

    fit: bpy.props.EnumProperty(
        name="Size", description="Placement on the bed", items=FITS, default=DEFAULT.fit
    )
    scale: bpy.props.FloatProperty(
        name="Times", description="Scale of the plan", default=1.0, min=1e-3, max=1e3
    )
    x: millimeters("Right", DEFAULT.x, "Shift of its middle from the bed's along x")
    y: millimeters("Back", DEFAULT.y, "Shift of its middle from the bed's along y")
    relief: bpy.props.EnumProperty(
        name="Height", description="Height of the shape", items=RELIEFS, default=DEFAULT.relief
    )
    rise: millimeters("Rise", DEFAULT.rise, "From its lowest to its highest point; negative turns it over")
    foot: millimeters("Foot", DEFAULT.foot, "Where its lowest point lies above the bed at rest")

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed is needed that stands still and is nobody else's."""
        return (
            no_bed(context)
            or session_runs(context, "Stop the session first: the bed is going to be shaped anew")
            or baked(context)
            or linked(context)
            or cls.missing(context, bed_of(context))
        )

    @classmethod
    def missing(cls, context: Any, bed: Any) -> str:
        """Return what else is needed, or an empty text.

        `context` bpy.types.Context; `bed` bpy.types.Object.
        """
        return ""

    def perform(self, context: Any) -> None:
        """Display the shape, and report its parts beyond the bed."""
        bed = bed_of(context)
        context.view_layer.update()
        laid, off = self.displayed(context, bed)
        lost = laid.too_low + laid.too_high + laid.overhanging
        words = localize("{}; displayed to within {:.2g} µm", laid.told(), off * 1e6)
        running.set_message(words, bed.session_uid)
        self.report({"WARNING" if lost else "INFO"}, words)

    def displayed(self, context: Any, bed: Any) -> Any:
        """Display the shape; return what `shape_show` does.

        `context` bpy.types.Context; `bed` bpy.types.Object.
        """
        raise NotImplementedError

    def shape(self, file: str, bed: Any, **known: Any) -> Shape:
        """Return how the shape is laid onto the bed.

        `file`: empty where the shape is none of a file; `bed` bpy.types.Object; `known`: more fields of
        `Shape`.
        """
        known |= {name: to_si(getattr(self, name), SHOWN["m"][1]) for name in ("x", "y", "rise", "foot")}
        before = bed.digiclay.shape
        return Shape(
            file=file, fit=self.fit, scale=float(f"{self.scale:.7g}"), relief=self.relief, **known,
            refresh=before.refresh, surfaces=before.surfaces,
        )  # fmt: skip


class ShapeFromObject(Shaped, bpy.types.Operator):
    """Display the upper side of another selected object on the active bed, driving the pins there"""

    bl_idname = "digiclay.shape_from_object"
    bl_label = "Shape from Object"

    @classmethod
    def missing(cls, context: Any, bed: Any) -> str:
        """One other object is needed that has a surface."""
        count = len(others(context, bed))
        if count == 1:
            return ""
        if count:
            return localize("Select one object besides the bed, not {}", count)
        return "Select the object first, then the bed with Shift: its upper side is displayed"

    def displayed(self, context: Any, bed: Any) -> Any:
        """Display the object."""
        (thing,) = others(context, bed)
        relief = shape_show.read_relief(thing, bed, context.evaluated_depsgraph_get())
        return shape_show.show_relief(bed, relief, self.shape(thing.name, bed))


class ShapeFromFile(Shaped, FileAction, bpy.types.Operator):
    """Display a mesh, a picture (bright is high) or a .npy file of heights on the active bed"""

    bl_idname = "digiclay.shape_from_file"
    bl_label = "Shape from File"

    filepath: bpy.props.StringProperty(subtype="FILE_PATH")
    filter_glob: bpy.props.StringProperty(default=";".join(f"*{kind}" for kind in KINDS), options={"HIDDEN"})
    up: bpy.props.EnumProperty(
        name="Up",
        description="Upward direction of a mesh; automatic: y in a glTF file, else z",
        items=[("auto", "Automatic", ""), *((way, way.upper(), "") for way in UPWARDS)],
    )
    unit: bpy.props.EnumProperty(
        name="Unit",
        description="Unit of length of a mesh; automatic: meters in a glTF file, else millimeters",
        items=[("auto", "Automatic", ""), *((unit, unit, "") for unit in LENGTHS)],
    )

    def displayed(self, context: Any, bed: Any) -> Any:
        """Display the file."""
        path = str(Path(bpy.path.abspath(self.filepath)))
        return shape_show.show_file(bed, self.shape(path, bed, up=self.up, unit=self.unit))


class ShapeSample(Shaped, bpy.types.Operator):
    """Display a sample shape of Digital Clay on the active bed"""

    bl_idname = "digiclay.shape_sample"
    bl_label = "Sample Shape"

    sample: bpy.props.EnumProperty(name="Shape", items=[(name, title(name), "") for name in list_shapes()])

    def displayed(self, context: Any, bed: Any) -> Any:
        """Display the sample."""
        return shape_show.show_file(bed, self.shape(self.sample, bed))


def others(context: Any, bed: Any) -> list[Any]:
    """Return the selected objects with a surface that are no part of a bed.

    `context` bpy.types.Context; `bed` bpy.types.Object.
    """
    return [thing for thing in context.selected_objects if thing != bed and shape_show.has_surface(thing)]


class KeepShape(Action, bpy.types.Operator):
    """Make the formed surface the bed's shape: sessions begin with it, elastic and viscous beds keep to it"""

    bl_idname = "digiclay.shape_keep"
    bl_label = "Keep Formed as Shape"
    bl_options = {"UNDO"}

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed without a running session is needed."""
        return no_bed(context) or session_runs(context)

    def perform(self, context: Any) -> None:
        """Keep the heights."""
        bed = bed_of(context)
        scene = properties.scene_of(bed)
        heights = bridge.read_cells(bed.data)["height"]
        before = scene.shape or Shape()
        shape = replace(before, file="Formed", fit="placed", heights=pack(heights))
        properties.write_scene(bed, replace(scene, shape=shape))
        self.report(
            {"INFO"}, localize("{} has a shape of {} heights: sessions begin with it", bed.name, heights.size)
        )


class RemoveShape(Action, bpy.types.Operator):
    """Remove the bed's shape: sessions begin at rest; the formed surface stays until then"""

    bl_idname = "digiclay.shape_remove"
    bl_label = "Remove Shape"
    bl_options = {"UNDO"}

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed with a shape is needed, and no running session."""
        return no_bed(context) or session_runs(context) or _no_shape(context)

    def perform(self, context: Any) -> None:
        """Forget it."""
        settings = bed_of(context).digiclay
        settings.use_shape = False
        settings.shape.heights = ""
        settings.shape.file = Shape().file


def _no_shape(context: Any) -> str:
    """The bed displays nothing."""
    return "" if bed_of(context).digiclay.use_shape else "The bed has no shape"
