"""Shape of a bed: from an object, a file, a sample, or the formed surface; its removal."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from .. import bridge
from ..compat import Context, Object, Operator, bpy
from ..core.shapes.fitting import KINDS, list_shapes, pack
from ..core.shapes.request import LENGTHS, UPWARDS, Shape
from ..exchange import shape_show
from ..roles import bed_of
from ..sessions import running
from ..settings import properties
from ..settings.declared import choice, number, title
from ..settings.shown_units import to_si
from ..ui_text import localize
from .action import Action, FileAction, action, file_of, millimeters
from .poll_messages import baked, cannot_change, cannot_form, no_shape, session_runs

DEFAULT = Shape()
FITS = (
    ("contain", "Whole", "As large as the bed allows, all of it on the bed"),
    ("cover", "Fill the Bed", "As small as still fills the bed; what extends beyond it is cut off"),
    ("stretch", "Stretch", "Exactly as large as the bed, whatever its proportions"),
    ("actual", "Own Size", "At its own size, in the middle of the bed"),
    (
        "placed",
        "Where It Is",
        "At its own size and place; what is beyond floor or stroke is cut off",
    ),
)
RELIEFS = (
    ("rise", "Given Rise", "The given rise from its lowest to its highest point"),
    ("stroke", "Whole Stroke", "Its highest point at the end of the stroke"),
    ("true", "True", "Height in proportion to the plan"),
)
LENGTH = {"soft_min": -100.0, "soft_max": 100.0, "min": -1e5, "max": 1e5, "step": 20}


#: Needs of the operators that display a shape.
NEEDS = (
    cannot_form,
    session_runs.reworded("Stop the session first: the bed will be reshaped"),
    baked,
)


class Shaped(Action):
    """Mixin of the operators that display a shape: its placement, and the report."""

    fit: choice("Size", "Placement on the bed", items=FITS, default=DEFAULT.fit)
    scale: number("Times", "Scale of the plan", default=1.0, min=1e-3, max=1e3)
    x: millimeters("Right", DEFAULT.x, "Shift of its middle from the bed's along x", **LENGTH)
    y: millimeters("Back", DEFAULT.y, "Shift of its middle from the bed's along y", **LENGTH)
    relief: choice("Height", "Height of the shape", items=RELIEFS, default=DEFAULT.relief)
    rise: millimeters(
        "Rise",
        DEFAULT.rise,
        "From its lowest to its highest point; a negative value inverts it",
        **LENGTH,
    )
    foot: millimeters(
        "Foot", DEFAULT.foot, "Where its lowest point lies above the bed at rest", **LENGTH
    )

    def tell(self, bed: Object, laid: Any, off: float) -> None:
        """Report what `shape_show` has displayed, and its parts beyond the bed."""
        lost = laid.too_low + laid.too_high + laid.overhanging
        words = localize("{}; displayed to within {:.2g} µm", laid.describe(), off * 1e6)
        running.set_message(words, bed.session_uid)
        self.report({"WARNING" if lost else "INFO"}, words)

    def shape(self, file: str, bed: Object, **more: Any) -> Shape:
        """Return how the shape of a file or an object is laid onto the bed, with more fields of `Shape`."""
        more |= {name: to_si(getattr(self, name), 3) for name in ("x", "y", "rise", "foot")}
        before, scale = bed.digiclay.shape, float(f"{self.scale:.7g}")
        return Shape(
            file=file,
            fit=self.fit,
            scale=scale,
            relief=self.relief,
            **more,
            refresh=before.refresh,
            surfaces=before.surfaces,
        )


def _updated_bed(context: Context) -> Object:
    """Return the active bed, placed as Blender has evaluated it."""
    context.view_layer.update()
    return bed_of(context)


def _others(context: Context, bed: Object) -> list[Object]:
    """Return the selected objects with a surface that are no part of a bed."""
    return [
        thing
        for thing in context.selected_objects
        if thing != bed and shape_show.has_surface(thing)
    ]


def _not_two(context: Context) -> str:
    """Not one other object with a surface is selected."""
    count = len(_others(context, bed_of(context)))
    if count > 1:
        return localize("Select one object besides the bed, not {}", count)
    return (
        ""
        if count
        else "Select the object first, then the bed with Shift: its upper side is displayed"
    )


@action("digiclay.shape_from_object", "Shape from Object", *NEEDS, _not_two, bases=(Shaped,))
def show_object(operator: Operator, context: Context) -> None:
    """Display the upper side of another selected object on the active bed, driving the pins there"""
    bed = _updated_bed(context)
    (thing,) = _others(context, bed)
    relief = shape_show.read_relief(thing, bed, context.evaluated_depsgraph_get())
    operator.tell(bed, *shape_show.show_relief(bed, relief, operator.shape(thing.name, bed)))


@action(
    "digiclay.shape_from_file",
    "Shape from File",
    *NEEDS,
    bases=(Shaped, FileAction),
    **file_of(";".join(f"*{kind}" for kind in KINDS)),
    up=choice(
        "Up",
        "Upward direction of a mesh; automatic: y in a glTF file, else z",
        items=[("auto", "Automatic", ""), *((axis, axis.upper(), "") for axis in UPWARDS)],
    ),
    unit=choice(
        "Unit",
        "Unit of length of a mesh; automatic: meters in a glTF file, else millimeters",
        items=[("auto", "Automatic", ""), *((unit, unit, "") for unit in LENGTHS)],
    ),
)
def show_file(operator: Operator, context: Context) -> None:
    """Display a mesh, a picture (bright is high) or a .npy file of heights on the active bed"""
    bed, path = _updated_bed(context), str(Path(bpy.path.abspath(operator.filepath)))
    shape = operator.shape(path, bed, up=operator.up, unit=operator.unit)
    operator.tell(bed, *shape_show.show_file(bed, shape))


@action(
    "digiclay.shape_sample",
    "Sample Shape",
    *NEEDS,
    bases=(Shaped,),
    sample=choice("Shape", items=[(name, title(name), "") for name in list_shapes()]),
)
def show_sample(operator: Operator, context: Context) -> None:
    """Display a sample shape of Digital Clay on the active bed"""
    bed = _updated_bed(context)
    operator.tell(bed, *shape_show.show_file(bed, operator.shape(operator.sample, bed)))


@action("digiclay.shape_keep", "Keep Formed as Shape", cannot_form, session_runs, options=("UNDO",))
def keep_shape(operator: Operator, context: Context) -> None:
    """Make the formed surface the bed's shape: sessions begin with it, elastic and viscous beds keep to it"""
    bed = bed_of(context)
    scene = properties.scene_of(bed)
    heights = bridge.read_cells(bed.data)["height"]
    shape = replace(scene.shape or DEFAULT, file="Formed", fit="placed", heights=pack(heights))
    properties.write_scene(bed, replace(scene, shape=shape))
    words = localize("{} has a shape of {} heights: sessions begin with it", bed.name, heights.size)
    operator.report({"INFO"}, words)


@action(
    "digiclay.shape_remove",
    "Remove Shape",
    cannot_change,
    session_runs,
    no_shape,
    options=("UNDO",),
)
def remove_shape(operator: Operator, context: Context) -> None:
    """Remove the bed's shape: sessions begin at rest; the formed surface stays until then"""
    settings = bed_of(context).digiclay
    settings.use_shape = False
    settings.shape.heights = ""
    settings.shape.file = DEFAULT.file
