"""Rebuild of a bed after a change of its settings, with the same object and fingertip."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from .. import bridge
from ..compat import bpy
from ..core.scene.schema import Scene
from ..live import bed_state
from ..settings import properties
from . import view
from .instant import Instant, find_ellipsoid
from .primitives import FINGER


def rebuild(bed: Any) -> Scene:
    """Make a bed anew, at rest; its place, its fingertip and what else hangs on the object stay.

    The state of a session is forgotten: it is of no use to other pins.

    Returns what the bed now is. Raises ParameterError when the settings do not go together; the bed stays as
    it is.
    """
    scene = properties.read_scene(bed)
    instant = Instant.at_rest(scene.layout, scene.actuator, find_ellipsoid(scene))
    old_mesh, old_trees = bed.data, [modifier.node_group for modifier in _nodes(bed)]
    made = view.build(instant, bed.users_collection[0], lowest=0.0)
    bed.data = made.data
    # The modifier stays, and with it how the bed is colored; only what it draws is another.
    for kept, new in zip(_nodes(bed), _nodes(made), strict=False):
        kept.node_group = new.node_group
    tip = view.fingertip_of(bed)
    if tip is None:
        bed[FINGER] = view.fingertip_of(made)
        bed[FINGER].parent = bed
    else:
        bridge.resize_fingertip(tip, instant.finger)
    view.hold_parts(bed)
    cases = [child for child in bed.children if child.get(view.ROLE) == view.HOUSING]
    _remove([*cases, *made.children_recursive, made])
    for tree in old_trees:
        _discard(tree)
    if not old_mesh.users:
        bpy.data.meshes.remove(old_mesh)
    bed_state.clear(bed)
    return scene


def _nodes(bed: Any) -> list[Any]:
    """Return the modifiers that draw a bed's pins."""
    return [modifier for modifier in bed.modifiers if modifier.type == "NODES" and modifier.node_group]


def _discard(tree: Any) -> None:
    """Remove the nodes that drew pins, with the pins; a copy of the bed may still be drawn by them."""
    if tree.users:
        return
    held = [getattr(socket, "default_value", None) for node in tree.nodes for socket in node.inputs]
    collections = {thing for thing in held if isinstance(thing, bpy.types.Collection)}
    objects = {thing for thing in held if isinstance(thing, bpy.types.Object)}
    objects.update(*(collection.objects for collection in collections))
    bpy.data.batch_remove([tree, *collections])
    _remove(objects)


def _remove(objects: Iterable[Any]) -> None:
    """Remove objects, and the meshes only they have."""
    objects = list(objects)
    meshes = {thing.data for thing in objects if thing.type == "MESH"}
    bpy.data.batch_remove(objects)
    bpy.data.batch_remove([mesh for mesh in meshes if not mesh.users])
