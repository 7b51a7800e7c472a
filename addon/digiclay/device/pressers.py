"""Mesh objects that press a bed: their evaluated meshes and places; those of a scene's bodies, keyed."""

import math
from collections.abc import Sequence

import numpy as np

from .. import bridge
from ..compat import Context, Object, bpy, curves
from ..core.base.arrays import Floats
from ..core.base.errors import DigiclayError
from ..core.base.spline import compute_inner_slopes
from ..core.engine.bodies import UNIT, Given, PlacedMesh, find_given
from ..core.engine.system import System
from ..core.model.trajectory import Trajectory
from ..core.model.underside import Mesh, check_vertices, refuse_flat
from ..core.scene.schema import Presser
from ..core.shapes.body import MOST_TRIANGLES, Body
from ..roles import PRESSES, list_pressers
from ..settings.declared import fill
from ..settings.groups import PRESSER_FIELDS
from ..ui_text import localize
from .parts import make_body

#: Largest turn between two keys, rad: Blender turns at an uneven speed between them, here by 0.01
#: degrees.
TURN = math.radians(20.0)


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


def make_presser(
    bed: Object, name: str, given: Presser, mesh: Mesh, first: float, rate: float
) -> Object:
    """Make an object of a mesh, m, that presses a bed as a body does, keyed from a frame on; `rate`: 1/s."""
    thing = bpy.data.objects.new(name, make_body(name, mesh))
    thing.parent, thing[PRESSES], thing.rotation_mode = bed, bed, "QUATERNION"
    thing.scale = (given.body.scale,) * 3
    fill(thing.digiclay.presser, Body, PRESSER_FIELDS, vars(given.body))
    for collection in bed.users_collection:
        collection.objects.link(thing)
    path = given.trajectory.trajectory()
    kind = "BEZIER" if path.interpolation == "smooth" else "LINEAR"
    places = path.positions * bridge.SCALE
    speeds = compute_inner_slopes(np.diff(path.times), places) / rate
    _key(thing, "location", first + path.times * rate, places, speeds, kind)
    times, turns = _divide_turns(path)
    still = np.zeros_like(turns)
    _key(thing, "rotation_quaternion", first + times * rate, turns, still, "LINEAR")
    return thing


def _divide_turns(path: Trajectory) -> tuple[Floats, Floats]:
    """Return times (k,), s, and quaternions (k, 4) of one sign along a path, at most `TURN` apart."""
    times, turns = path.times, path.orientations
    cosine = np.abs((turns[1:] * turns[:-1]).sum(axis=1))
    counts = np.ceil(2.0 * np.arccos(np.minimum(cosine, 1.0)) / TURN).clip(1)
    pieces = zip(times[:-1], times[1:], counts.astype(int) + 1, strict=True)
    times = np.concatenate([times[:1], *(np.linspace(*piece)[1:] for piece in pieces)])
    turns = path.poses(times)[:, 3:]
    turns[1:] *= np.cumprod(np.sign((turns[1:] * turns[:-1]).sum(axis=1)))[:, None]
    return times, turns


def _key(
    thing: Object, name: str, frames: Floats, values: Floats, slopes: Floats, kind: str
) -> None:
    """Key a property at frames (k,): values and slopes per frame, (k, c)."""
    setattr(thing, name, values[0])
    thing.keyframe_insert(name, frame=frames[0])
    gaps = np.diff(frames, prepend=frames[0] - 1.0, append=frames[-1] + 1.0) / 3.0
    for curve in (line for lines in curves(thing) for line in lines if line.data_path == name):
        column, slope = values[:, curve.array_index], slopes[:, curve.array_index]
        points = curve.keyframe_points
        points.add(len(frames) - 1)
        for key in points:
            key.interpolation, key.handle_left_type, key.handle_right_type = kind, "FREE", "FREE"
        # Handles at thirds of the time make the cubic of the path.
        for part, x, y in (
            ("co", frames, column),
            ("handle_left", frames - gaps[:-1], column - slope * gaps[:-1]),
            ("handle_right", frames + gaps[1:], column + slope * gaps[1:]),
        ):
            points.foreach_set(part, np.column_stack([x, y]).astype(np.float32).ravel())
        curve.update()
