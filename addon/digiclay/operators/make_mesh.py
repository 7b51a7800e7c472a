"""Make Mesh: the formed surface of a bed as new mesh objects."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from .. import bridge
from ..compat import bpy
from ..core.mesh_io.export_model import make_bodies
from ..exchange import body_mesh, formed_bed
from ..ui_text import localize
from .add_bed import select_only
from .mesh_options import SurfaceOptions, chosen_bed

#: Space between the bed and what is put beside it, in widths of the bed.
GAP = 0.35
#: Marks what was made here, so that what is made next is put elsewhere.
MADE = "digiclay_made"


class MakeMesh(SurfaceOptions, bpy.types.Operator):
    """Make a mesh object of the formed surface of the active bed, with its features as vertex groups"""

    bl_idname = "mesh.digital_clay_make"
    bl_label = "Make Mesh"
    bl_options = {"REGISTER", "UNDO"}

    beside: bpy.props.BoolProperty(
        name="Beside the Bed",
        description="Place the mesh beside the bed instead of on its surface",
        default=True,
    )

    def draw(self, context: Any) -> None:
        """Draw the redo panel."""
        self.layout.use_property_split = True
        self.draw_surface(self.layout)
        self.layout.prop(self, "beside")

    def perform(self, context: Any) -> None:
        """Make the objects, and select them."""
        bed = chosen_bed(context)
        formed = formed_bed.read_formed(bed)
        made = make_bodies(formed, self.model(bed), self.finding())
        width = float(np.ptp(formed.position[:, 0])) * bridge.SCALE
        smooth = self.kind != "pins"
        where = _beside(context, bed, width) if self.beside else bed.matrix_world.copy()
        things = []
        for body in made:
            name = f"{bed.name} {body.name if self.kind == 'features' else self.kind}"
            new = body_mesh.make_object(body, name, smooth=smooth)
            new[MADE] = True
            context.collection.objects.link(new)
            new.matrix_world = where
            things.append(new)
        select_only(context, things[0])
        for new in things[1:]:
            new.select_set(True)
        groups = localize(" with vertex groups {}", ", ".join(made[0].groups)) if made[0].groups else ""
        self.report({"INFO"}, localize("Made {}{}", ", ".join(new.name for new in things), groups))


def _beside(context: Any, bed: Any, width: float) -> Any:
    """Return the first place beside a bed, a matrix, that no mesh made before stands in.

    `context` bpy.types.Context; `bed` bpy.types.Object; `width`: of its pins, in its own space.
    """
    step, half = (1.0 + GAP) * width, width / 2
    to_bed = np.array(bed.matrix_world.inverted_safe(), np.float64)
    place = 1
    for low, high in sorted(_spans(context, to_bed, half)):
        if low < place * step + half and place * step - half < high:
            place = int((high + half) // step) + 1
    where = bed.matrix_world.copy()
    where.translation += where.to_3x3() @ where.translation.__class__((place * step, 0.0, 0.0))
    return where


def _spans(context: Any, to_bed: Any, half: float) -> Iterator[tuple[float, float]]:
    """Give from where to where along a bed's x axis the meshes made before stand that lie beside it."""
    for thing in context.scene.objects:
        if not thing.get(MADE):
            continue
        corners = np.column_stack([np.array(thing.bound_box, np.float64), np.ones(8)])
        x, y = (corners @ (to_bed @ np.array(thing.matrix_world, np.float64)).T)[:, :2].T
        if np.isfinite(x).all() and y.min() < half and y.max() > -half:
            yield float(x.min()), float(x.max())
