"""Body of the core as a Blender mesh, with attributes and vertex groups."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..bridge import SCALE
from ..compat import bpy
from ..core.surface.body import NO_PIN, Body

__all__ = ["make_object"]

#: Edges sharper than this stay sharp when a curved skin is shaded smooth, rad.
SHARP = 0.7


def make_object(body: Body, name: str, *, smooth: bool) -> Any:
    """Return a new object, in no collection yet, with the body in Blender units.

    Parameters
    ----------
    body : Body
        With values, as `export_model.make_bodies` makes it.
    name : str
        Of the object and its mesh.
    smooth : bool
        Shade it smooth, but for its sharp edges.
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
    if smooth:
        mesh.set_sharp_from_angle(angle=SHARP)  # this makes all faces smooth
    # Walls and base stay flat, so that the skin's shading does not run down them.
    curved = (body.values["mode"][body.faces] != NO_PIN).all(axis=1) & smooth
    mesh.polygons.foreach_set("use_smooth", curved)
    return mesh
