"""Add > Mesh > Digital Clay: a bed of pins at rest and its fingertip."""

# No postponed annotations here: Blender reads an operator's properties from them.
from typing import Any

from .. import preferences
from ..compat import bpy
from ..core.actuator import Actuator
from ..core.errors import DigiclayError
from ..core.fingertip import Fingertip
from ..core.layout import Layout
from ..core.methods import METHODS
from ..core.scene import Scene
from ..core.scene_table import PRESETS
from ..device import palettes, view
from ..device.instant import Instant
from ..settings import own_presets, properties
from ..settings.declared import title
from ..settings.devices import device
from ..settings.groups import PRESET_WORDS, method_items
from ..settings.shown_units import SHOWN, si
from .reasons import allowed, edited

__all__ = ["AddBed", "add", "add_shown", "entry", "select_only", "stand_at_cursor"]

DEFAULT = Layout()
#: Beyond this a bed is a matter of scene files: the redo panel would stall on every change.
MOST = 400
#: Blender keeps no reference to the texts of a list that is made on demand: this one does.
OFFERED: list[tuple[str, str, str]] = []


def offered(operator: Any, context: Any) -> list[tuple[str, str, str]]:
    """Return the core's presets and the user's own."""
    OFFERED[:] = [(name, title(name), PRESET_WORDS.get(name, "")) for name in PRESETS]
    OFFERED.extend((name, name, "A preset of your own") for name in own_presets.names())
    return OFFERED


class AddBed(bpy.types.Operator):  # type: ignore[misc]
    """Add a Digital Clay device: a bed of pins that a fingertip forms"""

    bl_idname = "mesh.digital_clay_add"
    bl_label = "Digital Clay"
    bl_options = {"REGISTER", "UNDO", "PRESET"}  # noqa: RUF012

    rows: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Rows", description="Number of rows of pins", default=DEFAULT.rows, min=1, max=MOST
    )
    columns: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Columns", description="Number of pins in a row", default=DEFAULT.columns, min=1, max=MOST
    )
    pitch: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Pitch (mm)",
        description="Distance between neighbouring pins in a row, in mm",
        default=DEFAULT.pitch * 1e3,
        min=Actuator().bore * 1e3,
        soft_max=20.0,
        max=1000.0,
        precision=2,
        step=10,
    )
    arrangement: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Arrangement",
        description="How neighbouring rows stand to each other",
        items=[
            ("aligned", "Aligned", "A square grid"),
            ("staggered", "Staggered", "Every other row shifted by half a pitch, rows one pitch apart"),
            ("hexagonal", "Hexagonal", "Every other row shifted, six neighbours at the same distance"),
        ],
        default=DEFAULT.arrangement,
    )
    method: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Method",
        description="How the cells are controlled",
        items=method_items(),
        default=next(iter(METHODS)),
    )
    preset: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Preset", description="Fluid, valves and whatever else a preset of your own sets", items=offered
    )
    scale: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Scale (cm/mm)",
        description="How large the device is drawn: centimetres in Blender for a millimetre of the device",
        default=1.0,
        min=0.001,
        soft_min=0.1,
        soft_max=10.0,
        max=1000.0,
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A bed is an object: it cannot be added inside another object's edit mode."""
        return allowed(cls, edited(context, "Leave Edit Mode first: the device is an object of its own"))

    def execute(self, context: Any) -> set[str]:
        """Build the device at the 3D cursor."""
        try:
            layout = Layout(
                rows=self.rows,
                columns=self.columns,
                pitch=si(self.pitch, SHOWN["m"][1]),
                arrangement=self.arrangement,
            )
            bed = add(context, device(self.preset, layout, self.method))
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        bed.scale = (self.scale,) * 3
        stand_at_cursor(context, bed)
        select_only(context, bed)
        return {"FINISHED"}


def add(context: Any, scene: Scene) -> Any:
    """Add the device of a scene, at rest, in the context's collection; return its bed."""
    finger = scene.fingertip or Fingertip()
    return add_shown(context, scene, Instant.at_rest(scene.layout, scene.actuator, finger))


def add_shown(context: Any, scene: Scene, instant: Instant) -> Any:
    """Add the device of a scene as it is at an instant, in the context's collection; return its bed."""
    coloured = palettes.worn()
    bed = view.build(instant, context.collection, lowest=0.0)
    if not coloured:
        palettes.wear(preferences.of(context).palette)
    properties.adopt(bed, scene)
    return bed


def stand_at_cursor(context: Any, bed: Any) -> None:
    """Put the housing's underside on the 3D cursor."""
    bed.location = context.scene.cursor.location
    bed.location.z -= view.underside(bed) * bed.scale.z


def select_only(context: Any, bed: Any) -> None:
    """Leave the new bed selected and active, as Blender's own Add operators do."""
    for other in context.selected_objects:
        other.select_set(False)
    bed.select_set(True)
    context.view_layer.objects.active = bed


def entry(menu: Any, context: Any) -> None:
    """Draw the entry in Add > Mesh."""
    menu.layout.operator(AddBed.bl_idname, icon="MESH_GRID")
