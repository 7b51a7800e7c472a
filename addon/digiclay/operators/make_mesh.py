"""Make Mesh: what was formed in a bed as new mesh objects, to go on with in Blender."""

# No postponed annotations here: Blender reads an operator's properties from them.
from typing import Any

import numpy as np

from .. import bridge
from ..compat import bpy
from ..core.errors import DigiclayError
from ..core.export_model import bodies
from ..exchange import body_mesh, formed_bed
from .add_bed import select_only
from .reasons import allowed, edited, no_surface
from .surface_options import SurfaceOptions, chosen

__all__ = ["MakeMesh"]

#: Space between the bed and what is put beside it, in widths of the bed.
GAP = 0.35


class MakeMesh(SurfaceOptions, bpy.types.Operator):  # type: ignore[misc]
    """Make a mesh object of what was formed in the active bed, with its features as vertex groups"""

    bl_idname = "mesh.digital_clay_make"
    bl_label = "Make Mesh"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    beside: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Beside the Bed",
        description="Put the mesh beside the bed, and not where its surface is",
        default=True,
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A bed is needed, and no edit mode of another object."""
        why = edited(context, "Leave Edit Mode first: the mesh is an object of its own")
        return allowed(cls, why or no_surface(context))

    def draw(self, context: Any) -> None:
        """Draw the redo panel."""
        self.layout.use_property_split = True
        self.draw_surface(self.layout)
        self.layout.prop(self, "beside")

    def execute(self, context: Any) -> set[str]:
        """Make the objects, and select them."""
        try:
            bed = chosen(context)
            formed = formed_bed.formed(bed)
            made = bodies(formed, self.model(bed), self.finding())
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        smooth = self.skin != "bilinear" and self.kind != "pins"
        where = bed.matrix_world.copy()
        if self.beside:
            width = float(np.ptp(formed.position[:, 0])) * bridge.SCALE
            where.translation += where.to_3x3() @ where.translation.__class__(((1.0 + GAP) * width, 0.0, 0.0))
        things = []
        for body in made:
            name = f"{bed.name} {body.name if self.kind == 'features' else self.kind}"
            new = body_mesh.thing(body, name, smooth=smooth)
            context.collection.objects.link(new)
            new.matrix_world = where
            things.append(new)
        select_only(context, things[0])
        for new in things[1:]:
            new.select_set(True)
        groups = f" with vertex groups {', '.join(made[0].groups)}" if made[0].groups else ""
        self.report({"INFO"}, f"Made {', '.join(new.name for new in things)}{groups}")
        return {"FINISHED"}
