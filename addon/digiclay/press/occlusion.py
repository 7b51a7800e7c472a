"""Objects in front of the pins: what a view shows of a ray, and whether something else hides its end."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ..core.base.arrays import Floats
from ..device import view

#: Objects that may have a surface.
SOLID = frozenset({"MESH", "CURVE", "SURFACE", "META", "FONT"})
#: How an object is displayed that hides nothing.
OPEN = frozenset({"WIRE", "BOUNDS"})
#: A surface that ends a ray hides nothing of what it ends at: share of the ray's length.
NEAR = 1e-6


def shown_stretch(context: Any, start: Floats, end: Floats) -> tuple[float, float]:
    """Return from where to where a view shows a ray: its clipping distances, and its clipping region.

    `context` bpy.types.Context, of a 3D view's region; `start`, `end` (3,), two places on the ray, in the
    world. Returns `first`, `last`: 0 is the start, 1 the end; the first is the greater where nothing of the
    ray is shown.
    """
    looking = context.region_data
    clip = np.array(looking.perspective_matrix, np.float64)
    planes = [clip[3] + clip[2], clip[3] - clip[2]]
    if looking.use_clip_planes:
        planes += [np.array(plane, np.float64) for plane in looking.clip_planes]
    first, last = 0.0, np.inf
    for plane in planes:
        before, after = (float(plane[:3] @ place + plane[3]) for place in (start, end))
        rising = after - before
        if rising:
            crossed = -before / rising
            first, last = (max(first, crossed), last) if rising > 0.0 else (first, min(last, crossed))
        elif before < 0.0:
            return 1.0, 0.0
    return first, last


def find_hider(
    context: Any, bed: Any, start: Floats, end: Floats, surfaces: Iterable[tuple[Any, Any]] | None = None
) -> Any | None:
    """Return the object that the context's 3D view shows in front of the end of a ray, (3,) in the world.

    What the view shows through does not hide: X-ray, and objects displayed as wires or bounds. `surfaces` are
    the ones looked at, by default all that do not belong to the bed.
    """
    if _shows_through(context.space_data.shading):
        return None
    first, _ = shown_stretch(context, start, end)
    start = start + first * (end - start)
    way = end - start
    for thing, matrix in list_surfaces(context, bed) if surfaces is None else surfaces:
        # An object in front of others hides what is nearer too; one behind such a bed hides nothing.
        if bed.show_in_front and not thing.show_in_front:
            continue
        reach = np.inf if thing.show_in_front and not bed.show_in_front else 1.0 - NEAR
        if _meets(thing, matrix, start, way, reach):
            return thing
    return None


def _shows_through(shading: Any) -> bool:
    """Return whether a view shows what lies behind surfaces, and so selects it too."""
    if shading.type == "WIREFRAME":
        return bool(shading.show_xray_wireframe)
    return bool(shading.type == "SOLID" and shading.show_xray)


def list_surfaces(context: Any, bed: Any) -> Iterator[tuple[Any, Any]]:
    """Yield the objects that may hide a bed, and their places in the world."""
    graph, instancers = context.evaluated_depsgraph_get(), set()
    for thing in context.visible_objects:
        if _belongs(thing, bed):
            continue
        if _instances(thing) and not view.is_bed(thing):
            instancers.add(thing)
        if _hides(thing):
            yield thing, thing.matrix_world
    if not instancers:  # a bed of 10 000 pins has as many instances to go through
        return
    for one in graph.object_instances:
        if one.is_instance and one.parent.original in instancers and _hides(one.object):
            # A mesh that nodes instance has no original; Blender crashes on an evaluated curve.
            mesh = one.object.type == "MESH"
            yield one.object if mesh else one.object.original, one.matrix_world


def _hides(thing: Any) -> bool:
    """Return whether an object may have a surface, and is displayed with it."""
    if thing.type not in SOLID or thing.display_type in OPEN:
        return False
    if thing.type != "CURVE":
        return True
    curve = thing.data
    filled = curve.dimensions == "2D" and curve.fill_mode != "NONE"
    return bool(filled or curve.extrude or curve.bevel_depth or curve.bevel_object or thing.modifiers)


def _belongs(thing: Any, bed: Any) -> bool:
    """Return whether an object is a bed or a part of it; what a user has parented to it is none."""
    while thing is not None and thing != bed:
        thing = thing.parent if view.ROLE in thing else None
    return thing is not None


def _instances(thing: Any) -> bool:
    """Return whether an object may draw others as its instances."""
    makers = ("NODES", "PARTICLE_SYSTEM")
    return thing.instance_type != "NONE" or any(modifier.type in makers for modifier in thing.modifiers)


def _meets(thing: Any, matrix: Any, start: Floats, way: Floats, reach: float) -> bool:
    """Return whether a ray in the world meets an object within a reach, in lengths of its way."""
    placed = np.array(matrix, np.float64)
    if not np.isfinite(placed).all() or abs(np.linalg.det(placed[:3, :3])) < np.finfo(np.float32).tiny:
        return False
    inverse = np.linalg.inv(placed)
    origin, along = inverse[:3, :3] @ start + inverse[:3, 3], inverse[:3, :3] @ way
    length = float(np.linalg.norm(along))
    try:
        met = thing.ray_cast(origin.tolist(), along.tolist(), distance=min(reach * length, 1e30))
    except RuntimeError:  # a curve without a surface
        return False
    return bool(met[0])
