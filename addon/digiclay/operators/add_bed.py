"""Add > Mesh > Digital Clay: a bed of pins at rest and its fingertip."""

# No postponed annotations here: Blender reads an operator's properties from them.
from typing import Any

from .. import view
from ..compat import bpy
from ..core.actuator import Actuator
from ..core.errors import DigiclayError
from ..core.layout import Layout
from ..instant import Instant

__all__ = ["AddBed", "entry", "select_only", "stand_at_cursor"]

DEFAULT = Layout()
#: Beyond this a bed is a matter of scene files: the redo panel would stall on every change.
MOST = 400


class AddBed(bpy.types.Operator):  # type: ignore[misc]
    """Add a Digital Clay device: a bed of pins that a fingertip forms"""

    bl_idname = "mesh.digital_clay_add"
    bl_label = "Digital Clay"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

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

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A bed is an object: it cannot be added inside another object's edit mode."""
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave Edit Mode first: the device is an object of its own")
            return False
        return True

    def execute(self, context: Any) -> set[str]:
        """Build the device at the 3D cursor."""
        try:
            layout = Layout(
                rows=self.rows, columns=self.columns, pitch=self.pitch * 1e-3, arrangement=self.arrangement
            )
            instant = Instant.at_rest(layout)
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        bed = view.build(instant, context.collection, lowest=0.0)
        stand_at_cursor(context, bed)
        select_only(context, bed)
        return {"FINISHED"}


def stand_at_cursor(context: Any, bed: Any) -> None:
    """Put the housing's underside on the 3D cursor."""
    bed.location = context.scene.cursor.location
    bed.location.z -= view.underside(bed)


def select_only(context: Any, bed: Any) -> None:
    """Leave the new bed selected and active, as Blender's own Add operators do."""
    for other in context.selected_objects:
        other.select_set(False)
    bed.select_set(True)
    context.view_layer.objects.active = bed


def entry(menu: Any, context: Any) -> None:
    """Draw the entry in Add > Mesh."""
    menu.layout.operator(AddBed.bl_idname, icon="MESH_GRID")
