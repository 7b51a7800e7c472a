"""Body of the core as a Blender mesh, with attributes and vertex groups."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..bridge import SCALE
from ..compat import bpy
from ..core.base.arrays import Flags
from ..core.surface.body import Body

#: Edges of walls and base sharper than this stay sharp when a user shades them smooth, too, rad.
SHARP = 0.7
#: Least part of its normal by which a face that faces up does so: walls are vertical but for rounding.
UPWARDS = 1e-6


def make_object(body: Body, name: str, *, smooth: bool) -> Any:
    """Return a new object, in no collection yet, with the body in Blender units.

    `body`: with values, as `export_model.make_bodies` makes it; `name`: of the object and its mesh; `smooth`:
    shade its skin smooth. Walls and base stay flat, and the rim between them and the skin is sharp.
    """
    made = bpy.data.objects.new(name, _mesh(body, name, smooth=smooth))
    for number, group in enumerate(body.groups, 1):
        members = np.flatnonzero(body.vertex_group == number).tolist()
        made.vertex_groups.new(name=group).add(members, 1.0, "REPLACE")
    return made


def _mesh(body: Body, name: str, *, smooth: bool) -> Any:
    """Return a new mesh."""
    mesh = bpy.data.meshes.new(name)
    count, corners = len(body.faces), 3 * len(body.faces)
    mesh.vertices.add(len(body.vertices))
    mesh.vertices.foreach_set("co", (body.vertices * SCALE).astype(np.float32).ravel())
    mesh.loops.add(corners)
    mesh.loops.foreach_set("vertex_index", body.faces.astype(np.int32).ravel())
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, corners, 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    for value, kind, of in (("force", "FLOAT", np.float32), ("mode", "INT", np.int32)):
        mesh.attributes.new(value, kind, "POINT")
        mesh.attributes[value].data.foreach_set("value", body.values[value].astype(of))
    skin = _find_skin(body) & smooth
    if smooth:
        _mark_rim(mesh, skin)
    mesh.polygons.foreach_set("use_smooth", skin)
    return mesh


def _find_skin(body: Body) -> Flags:
    """Return which faces belong to the skin: it is a height everywhere, so that all of it faces up."""
    first, second, third = (body.vertices[body.faces[:, corner]] for corner in range(3))
    normal = np.cross(second - first, third - first)
    upwards: Flags = normal[:, 2] > UPWARDS * np.linalg.norm(normal, axis=1)
    return upwards


def _mark_rim(mesh: Any, skin: Flags) -> None:
    """Mark the edges around flat faces as sharp, and none within the skin, however steep it is.

    `mesh` bpy.types.Mesh, of triangles; `skin` bool (f,), which of them are shaded smooth.
    """
    mesh.set_sharp_from_angle(angle=SHARP)
    edge = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("edge_index", edge)
    beside_skin, beside_flat = (
        np.bincount(edge, np.repeat(faces, 3), len(mesh.edges)) > 0 for faces in (skin, ~skin)
    )
    sharp = np.empty(len(mesh.edges), bool)
    mesh.edges.foreach_get("use_edge_sharp", sharp)
    mesh.edges.foreach_set("use_edge_sharp", np.where(beside_skin, beside_flat, sharp))
