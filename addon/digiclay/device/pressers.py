"""Mesh objects that press a bed: the undersides of their evaluated meshes over its pins."""

import numpy as np
from numpy.typing import NDArray

from .. import bridge
from ..compat import Context, Object
from ..core.base.arrays import Array, Floats
from ..core.base.errors import DigiclayError
from ..core.engine.bodies import UNIT
from ..core.model.layout import Grid
from ..core.model.underside import rasterize
from ..core.scene.schema import Scene
from ..core.shapes.body import MOST_TRIANGLES
from ..roles import list_pressers
from ..ui_text import localize


def find_fault(context: Context, presser: Object) -> str:
    """Return why the mesh of a presser cannot be read now, or an empty text."""
    if presser.mode == "EDIT" or presser.data.is_editmode:
        return localize("{} is being edited: go back to Object Mode to go on", presser.name)
    if not presser.visible_get(view_layer=context.view_layer):
        return localize(
            "{} is hidden: show it to go on, as wire in its Viewport Display, say", presser.name
        )
    return ""


def read_undersides(
    context: Context, bed: Object, scene: Scene, grid: Grid
) -> NDArray[np.int32] | None:
    """Return the undersides of all pressers over the pins, (b, n), in `UNIT`; None without any."""
    rows = []
    for presser, each in zip(list_pressers(bed), scene.bodies, strict=True):
        vertices, triangles = read_cage(context, bed, presser)
        try:
            under = rasterize(
                vertices, triangles, grid, each.body.samples, each.body.tip_radius, scene.ceiling
            )
        except DigiclayError as error:
            raise DigiclayError(f"{presser.name}: {error}") from None
        rows.append(np.rint(np.minimum(under, scene.ceiling) / UNIT).astype(np.int32))
    return np.stack(rows) if rows else None


def read_cage(context: Context, bed: Object, presser: Object) -> tuple[Floats, Array]:
    """Return vertices (v, 3), m, in the space of a bed, and triangles (t, 3) of a presser as it is now.

    Modifiers that are off in the viewport have no part in it: Subdivision, say.
    """
    posed = presser.evaluated_get(context.evaluated_depsgraph_get())
    mesh = posed.data
    mesh.calc_loop_triangles()
    vertices = np.empty(3 * len(mesh.vertices), np.float32)
    triangles = np.empty(3 * len(mesh.loop_triangles), np.int32)
    if not 0 < len(mesh.loop_triangles) <= MOST_TRIANGLES:
        rule = "must have from 1 to {:,} triangles to press the pins (got {:,})"
        count = len(mesh.loop_triangles)
        raise DigiclayError(presser.name + " " + localize(rule, MOST_TRIANGLES, count))
    mesh.vertices.foreach_get("co", vertices)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    bridge.uniform(bed)
    matrix = np.array(bed.matrix_world.inverted() @ posed.matrix_world)
    points = vertices.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    return points / bridge.SCALE, triangles.reshape(-1, 3)
