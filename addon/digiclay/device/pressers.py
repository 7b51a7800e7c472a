"""Mesh objects that press a bed: the undersides of their evaluated meshes over its pins."""

import numpy as np
from numpy.typing import NDArray

from .. import bridge
from ..compat import Context, Object
from ..core.base.errors import DigiclayError
from ..core.engine.bodies import UNIT
from ..core.model.layout import Grid
from ..core.model.underside import Mesh, check_vertices, rasterize, refuse_flat
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
        samples, tip_radius = each.body.samples, each.body.tip_radius
        cage = read_cage(context, bed, presser)
        under = rasterize(*cage, grid, samples, tip_radius, scene.ceiling)
        rows.append(np.rint(np.minimum(under, scene.ceiling) / UNIT).astype(np.int32))
    return np.stack(rows) if rows else None


def read_cage(context: Context, bed: Object, presser: Object) -> Mesh:
    """Return the mesh of a presser as it is now, in the space of a bed; DigiclayError if it cannot press.

    Modifiers that are off in the viewport have no part in it: Subdivision, say.
    """
    posed = presser.evaluated_get(context.evaluated_depsgraph_get())
    cage = Mesh(*bridge.read_triangles(bed, posed, posed.data))
    count = len(cage.triangles)
    if not 0 < count <= MOST_TRIANGLES:
        rule = "must have from 1 to {:,} triangles to press the pins (got {:,})"
        raise DigiclayError(presser.name + " " + localize(rule, MOST_TRIANGLES, count))
    check_vertices(cage.vertices, presser.name)
    refuse_flat(cage, presser.name)
    return cage
