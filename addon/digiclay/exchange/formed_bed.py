"""Bed in Blender as a formed surface, and bodies of the core as meshes of Blender."""

from typing import Any

import numpy as np

from .. import bridge
from ..bridge import SCALE
from ..compat import Mesh, Object, bpy
from ..core.base.arrays import Flags, Floats
from ..core.base.errors import DigiclayError
from ..core.engine.state import State
from ..core.engine.system import System
from ..core.files.tables import Record
from ..core.mesh_io.export_model import Model
from ..core.scene.assembly import assemble
from ..core.scene.schema import Scene
from ..core.scene.toml_table import resolve
from ..core.session import snapshot
from ..core.surface.formed import Body, Formed
from ..live import beds
from ..sessions import running
from ..settings import properties

#: Attribute of the bed's mesh: height of each pin, m, that features are measured from.
FORMER = "former"
#: A drawn pin is this near to where the session has it, m: float32 at a bed's size.
SHOWN = 1e-7


def read_formed(bed: Object) -> Formed:
    """Return the pins of a bed, and before: as kept, or at rest; DigiclayError when the object is no bed."""
    cells = bridge.read_cells(bed.data) | _of_session(bed)
    before: float | Floats = _scene(bed).actuator.rest_height
    if has_reference(bed):
        former = np.empty(len(cells["height"]), np.float32)
        bed.data.attributes[FORMER].data.foreach_get("value", former)
        before = former.astype(np.float64)
    return Formed.of(cells["position"], cells["height"], before, cells["force"], cells["mode"])


def has_reference(bed: Object) -> bool:
    """Return whether a bed's owner has kept a surface to measure from."""
    stored = bed.data.attributes.get(FORMER)
    return stored is not None and stored.domain == "POINT" and stored.data_type == "FLOAT"


def set_reference(bed: Object) -> None:
    """Keep the present surface as the one features are measured from."""
    height = read_formed(bed).height
    clear_reference(bed)
    bed.data.attributes.new(FORMER, "FLOAT", "POINT")
    bed.data.attributes[FORMER].data.foreach_set("value", height.astype(np.float32))


def clear_reference(bed: Object) -> None:
    """Measure features from the bed at rest again."""
    stored = bed.data.attributes.get(FORMER)
    if stored is not None:
        bed.data.attributes.remove(stored)


def model(bed: Object, **fields: Any) -> Model:
    """Return a `Model` of a bed from its other fields; the flat ends of its pins are those of its device."""
    return Model(cap=_scene(bed).actuator.bore / 2.0, **fields)


def _of_session(bed: Object) -> Record:
    """Return heights, forces and modes of the session if that is shown: the mesh may not have its forces."""
    current = _state(bed)
    if current is None:
        return {}
    system, state = current
    height, shown = state.row(0), bridge.read_cells(bed.data)["height"]
    if height.shape != shown.shape or np.abs(height - shown).max() > SHOWN:
        return {}
    force = state.row(system.rows.force).copy()
    return {"height": height.copy(), "force": force, "mode": state.mode().copy()}


def _state(bed: Object) -> tuple[System, State] | None:
    """Return the state of the bed's session, running or kept, or None."""
    session = running.find(bed)
    if session is not None:
        return session.system, session.state
    data = beds.read_snapshot(bed)
    if data is None:
        return None
    try:
        system = assemble(properties.scene_of(bed))
        return system, snapshot.load(system, data)
    except DigiclayError:  # the settings have changed since: what is drawn is all there is
        return None


def _scene(bed: Object) -> Scene:
    """Return the scene of the bed's settings, or the defaults while a setting makes no sense."""
    try:
        return properties.read_scene(bed)
    except DigiclayError:  # a mesh needs no settings that can be simulated
        return resolve({})


#: Edges of walls and base sharper than this stay sharp when a user shades them smooth, too, rad.
SHARP = 0.7
#: Least part of its normal by which a face that faces up does so: walls are vertical but for
#: rounding.
UPWARDS = 1e-6


def make_object(body: Body, name: str, *, smooth: bool) -> Object:
    """Return a new object, in no collection yet, of a body that has values; `smooth` shades its skin."""
    thing = bpy.data.objects.new(name, _mesh(body, name, smooth=smooth))
    for number, group in enumerate(body.groups, 1):
        members = np.flatnonzero(body.vertex_group == number).tolist()
        thing.vertex_groups.new(name=group).add(members, 1.0, "REPLACE")
    return thing


def _mesh(body: Body, name: str, *, smooth: bool) -> Mesh:
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
    return normal[:, 2] > UPWARDS * np.linalg.norm(normal, axis=1)


def _mark_rim(mesh: Mesh, skin: Flags) -> None:
    """Mark the edges around flat faces as sharp, and none within the skin (f,), however steep it is."""
    mesh.set_sharp_from_angle(angle=SHARP)
    edge = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("edge_index", edge)
    beside_skin, beside_flat = (
        np.bincount(edge, np.repeat(faces, 3), len(mesh.edges)) > 0 for faces in (skin, ~skin)
    )
    sharp = np.empty(len(mesh.edges), bool)
    mesh.edges.foreach_get("use_edge_sharp", sharp)
    mesh.edges.foreach_set("use_edge_sharp", np.where(beside_skin, beside_flat, sharp))
