"""Alembic files of pins or their skin, written by Blender's exporter beside the user's scene."""

import shutil
from pathlib import Path
from typing import BinaryIO

from .. import bridge
from ..compat import Mesh, NodeTree, bpy, quiet, scratch
from ..core.base.errors import OutputError
from ..core.mesh_io.animation import Animation
from ..device.node_tree import finish, mesh_of, new_tree, node
from ..device.parts import marked
from ..recorded.bake import play_moments
from ..roles import BAKE

#: Most bytes of a pin in a frame, as measured with all pins moving in all frames.
SIZE = 170


def write_alembic(file: BinaryIO, animation: Animation, factor: float) -> None:
    """Write a mesh, or pins as instances of one mesh, lengths in 1 / `factor` m, y up."""
    if not bpy.app.build_options.alembic:
        raise OutputError("This Blender was built without Alembic: choose usd or glb.")
    rate, points, faces, pin = animation
    _require_space(Path(file.name).parent, SIZE * points[..., 0].size)
    points, triangles = points * factor, faces.tolist()
    with scratch(), quiet():
        scene = bpy.data.scenes.new("Digital Clay Animation")
        scene.render.fps = max(1, round(rate))
        scene.render.fps_base = scene.render.fps / rate
        name, drawn = ("skin", triangles) if pin is None else ("pins", [])
        moving = bpy.data.objects.new(name, bridge.mesh(name, (points[0], drawn)))
        scene.collection.objects.link(moving)
        frames = bridge.mesh("frames", (points.reshape(-1, 3), []))
        play_moments(moving, marked(frames, "frames", BAKE), 0, len(points))
        if pin is not None:
            mesh = bridge.mesh("pin", (pin * factor, triangles))
            moving.modifiers.new("Pins", "NODES").node_group = _make_instances(mesh)
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            bpy.ops.wm.alembic_export(
                filepath=file.name,
                start=0,
                end=len(points) - 1,
                as_background_job=False,
                normals=False,
            )


def _require_space(folder: Path, needed: int) -> None:
    """Refuse a file of so many bytes for which there is no room: Blender would crash."""
    free = shutil.disk_usage(folder).free
    if free < needed:
        shown = f"{needed / 1e6:.3g} MB (free: {free / 1e6:.3g} MB)"
        raise OutputError(f"An Alembic file of this session needs up to {shown}.")


def _make_instances(mesh: Mesh) -> NodeTree:
    """Return nodes that have a mesh at each point of an object."""
    tree = new_tree("Digital Clay Instances")
    given = {
        "Points": node(tree, "NodeGroupInput").outputs["Geometry"],
        "Instance": mesh_of(tree, bpy.data.objects.new("pin", mesh)),
    }
    instances = node(tree, "GeometryNodeInstanceOnPoints", given)
    finish(tree, instances.outputs["Instances"])
    return tree
