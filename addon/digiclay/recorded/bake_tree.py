"""Geometry nodes that play a bake: height, mode and force of every pin at a moment.

A bake is one mesh with a vertex for every pin at every moment, moment after moment. It is
ordinary Blender data: it is saved in the file, and plays and renders without this extension.
"""

from __future__ import annotations

from typing import Any

from ..bridge import ATTRIBUTES
from ..compat import bpy
from ..device.nodes import attribute, node, number, socket

#: The setting that is keyframed: which moment to show, from 0 on; between two of them heights are blended.
MOMENT = "Moment"


def playback_nodes(bake: Any, moments: int) -> Any:
    """Make the node group that moves the pins of a bed to where they were at a moment.

    `bake` bpy.types.Object, its mesh holds the pins moment after moment, in the bed's space; `moments`: how
    many there are.
    """
    tree = bpy.data.node_groups.new("Digital Clay Bake", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    socket(tree, MOMENT, "NodeSocketFloat", 0.0, "Which baked moment to show, counted from 0")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    settings, result = node(tree, "NodeGroupInput", 0, 0), node(tree, "NodeGroupOutput", 10, 0)
    source = node(tree, "GeometryNodeObjectInfo", 2, -2)
    source.inputs["Object"].default_value = bake
    table = source.outputs["Geometry"]

    least = number(tree, "MAXIMUM", 1, 1, settings.outputs[MOMENT], 0.0)
    moment = number(tree, "MINIMUM", 2, 1, least, float(moments - 1))
    before, after = number(tree, "FLOOR", 3, 1, moment), number(tree, "CEIL", 3, 2, moment)
    part = number(tree, "SUBTRACT", 4, 4, moment, before)
    size = node(tree, "GeometryNodeAttributeDomainSize", 1, 3)
    tree.links.new(settings.outputs["Geometry"], size.inputs["Geometry"])
    count, pin = size.outputs["Point Count"], node(tree, "GeometryNodeInputIndex", 4, 3).outputs["Index"]
    first = number(tree, "MULTIPLY_ADD", 5, 1, before, count, pin)
    second = number(tree, "MULTIPLY_ADD", 5, 2, after, count, pin)

    place = node(tree, "GeometryNodeInputPosition", 5, -1).outputs["Position"]
    blend = node(tree, "ShaderNodeMix", 8, 1)
    blend.data_type = "VECTOR"
    tree.links.new(part, blend.inputs["Factor"])
    for end, index, row in (("A", first, 0), ("B", second, 1)):
        sampled = _sample(tree, table, place, "FLOAT_VECTOR", index, row)
        tree.links.new(sampled, _enabled_socket(blend.inputs, end))
    moved = node(tree, "GeometryNodeSetPosition", 9, 0)
    tree.links.new(settings.outputs["Geometry"], moved.inputs["Geometry"])
    tree.links.new(_enabled_socket(blend.outputs, "Result"), moved.inputs["Position"])

    shown = moved.outputs["Geometry"]
    for row, (name, (kind, _, _)) in enumerate(ATTRIBUTES.items(), 3):
        stored = node(tree, "GeometryNodeStoreNamedAttribute", 9, row)
        stored.data_type, stored.domain = kind, "POINT"
        stored.inputs["Name"].default_value = name
        value = attribute(tree, name, kind, 6, row)
        tree.links.new(_sample(tree, table, value, kind, first, row), _enabled_socket(stored.inputs, "Value"))
        tree.links.new(shown, stored.inputs["Geometry"])
        shown = stored.outputs["Geometry"]
    tree.links.new(shown, result.inputs["Geometry"])
    return tree


def _sample(tree: Any, table: Any, value: Any, kind: str, index: Any, row: float) -> Any:
    """Add the node that reads a value of the bake's vertices at a place among them."""
    sample = node(tree, "GeometryNodeSampleIndex", 7, row)
    sample.data_type, sample.domain = kind, "POINT"
    tree.links.new(table, sample.inputs["Geometry"])
    tree.links.new(value, _enabled_socket(sample.inputs, "Value"))
    tree.links.new(index, sample.inputs["Index"])
    return _enabled_socket(sample.outputs, "Value")


def _enabled_socket(sockets: Any, name: str) -> Any:
    """Return the socket of a name that is in use: nodes have one for each type, all of the same name."""
    return next(one for one in sockets if one.name == name and one.enabled)
