"""Mesh objects that press a bed: their evaluated meshes and places."""

from collections.abc import Sequence

import numpy as np

from .. import bridge
from ..compat import Context, Object
from ..core.base.errors import DigiclayError
from ..core.engine.bodies import UNIT, Given, PlacedMesh, find_given
from ..core.engine.system import System
from ..core.model.underside import Mesh, check_vertices, refuse_flat
from ..core.shapes.body import MOST_TRIANGLES
from ..roles import list_pressers
from ..ui_text import localize


def find_fault(context: Context, bed: Object) -> str:
    """Return why the mesh of a presser of a bed cannot be read now, or an empty text."""
    for presser in list_pressers(bed):
        if presser.mode == "EDIT" or presser.data.is_editmode:
            return localize("{} is being edited: go back to Object Mode to go on", presser.name)
        if not presser.visible_get(view_layer=context.view_layer):
            return localize(
                "{} is hidden: show it to go on, as wire in its Viewport Display, say", presser.name
            )
    return ""


def read_pressers(
    context: Context, bed: Object, former: Sequence[Given] | None = None
) -> tuple[PlacedMesh, ...] | None:
    """Return the meshes of all pressers and their places; None without any; see `read_cage`."""
    pressers = list_pressers(bed)
    before = former if former and len(former) == len(pressers) else [None] * len(pressers)
    pairs = zip(pressers, before, strict=True)
    return tuple(read_cage(context, bed, presser, given) for presser, given in pairs) or None


def refuse_sunk(bed: Object, system: System, bodies: Sequence[Given] | None) -> None:
    """Refuse pressers of a bed that begin below its floor, as they were read."""
    given = find_given(system)
    undersides = given.measure(bodies) if given and bodies else ()
    for presser, under in zip(list_pressers(bed), undersides, strict=False):
        if under.min() < 0:
            rule = "{} must begin above the floor of the bed (got {:.3g} mm): lift it"
            raise DigiclayError(localize(rule, presser.name, 1e3 * UNIT * under.min()))


def read_cage(
    context: Context, bed: Object, presser: Object, former: Given | None = None
) -> PlacedMesh:
    """Return mesh and place of a presser now; DigiclayError if it cannot press.

    Modifiers that are off in the viewport have no part in it: Subdivision, say. `former`: as it was
    read before; a mesh, or all of it, that is equal is the former one.
    """
    posed = presser.evaluated_get(context.evaluated_depsgraph_get())
    mesh, place = Mesh(*bridge.read_triangles(posed.data)), bridge.read_place(bed, posed)
    if isinstance(former, PlacedMesh) and all(map(np.array_equal, mesh, former.mesh)):
        if np.array_equal(place, former.matrix):
            return former
        mesh = former.mesh
    count = len(mesh.triangles)
    if not 0 < count <= MOST_TRIANGLES:
        rule = "must have from 1 to {:,} triangles to press the pins (got {:,})"
        raise DigiclayError(presser.name + " " + localize(rule, MOST_TRIANGLES, count))
    cage = PlacedMesh(mesh, place)
    vertices = check_vertices(cage.vertices, presser.name)
    refuse_flat(mesh._replace(vertices=vertices), presser.name)
    return cage
