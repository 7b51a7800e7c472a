"""The geometry nodes that draw a bed: a pin on every vertex, stretched down to the deck."""

from __future__ import annotations

from typing import Any

from .compat import bpy

__all__ = ["pins_on_points"]

#: Pins pushed below the deck keep this much of their length, rather than turning upside down.
LEAST_STRETCH = 0.02


def pins_on_points(pins: Any, deck: float, length: float) -> Any:
    """Make the node group that puts the pin of its mode on every vertex.

    Stretching one mesh costs half of drawing rod and cap apart. A cap is stretched with its
    rod, from a flat one on a low pin to a round one on a high pin.

    Parameters
    ----------
    pins : bpy.types.Collection
        One pin a mode, their names in the order of the codes; tops at their origins.
    deck : float
        Height the rods reach down to, Blender units.
    length : float
        Length of the pins in the collection, Blender units.
    """
    tree = bpy.data.node_groups.new("Digital Clay Pins", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    points = _node(tree, "NodeGroupInput", 3, 1)
    result = _node(tree, "NodeGroupOutput", 5, 1)
    instances = _node(tree, "GeometryNodeInstanceOnPoints", 4, 1)
    instances.inputs["Pick Instance"].default_value = True
    tree.links.new(points.outputs["Geometry"], instances.inputs["Points"])
    tree.links.new(instances.outputs["Instances"], result.inputs["Geometry"])

    choice = _node(tree, "GeometryNodeCollectionInfo", 3, 0)
    choice.inputs["Collection"].default_value = pins
    choice.inputs["Separate Children"].default_value = True
    tree.links.new(choice.outputs["Instances"], instances.inputs["Instance"])

    mode = _node(tree, "GeometryNodeInputNamedAttribute", 3, -1)
    mode.data_type = "INT"
    mode.inputs["Name"].default_value = "mode"
    tree.links.new(mode.outputs["Attribute"], instances.inputs["Instance Index"])

    tree.links.new(_stretch(tree, deck, length).outputs["Vector"], instances.inputs["Scale"])
    return tree


def _stretch(tree: Any, deck: float, length: float) -> Any:
    """Add the nodes that give (1, 1, (z - deck) / length) at every vertex."""
    place = _node(tree, "GeometryNodeInputPosition", -1, 0)
    parts = _node(tree, "ShaderNodeSeparateXYZ", 0, 0)
    line = _node(tree, "ShaderNodeMath", 1, 0)
    line.operation = "MULTIPLY_ADD"
    line.inputs[1].default_value = 1.0 / length
    line.inputs[2].default_value = -deck / length
    least = _node(tree, "ShaderNodeMath", 2, 0)
    least.operation = "MAXIMUM"
    least.inputs[1].default_value = LEAST_STRETCH
    stretch = _node(tree, "ShaderNodeCombineXYZ", 3, 2)
    stretch.inputs["X"].default_value = stretch.inputs["Y"].default_value = 1.0
    tree.links.new(place.outputs["Position"], parts.inputs["Vector"])
    tree.links.new(parts.outputs["Z"], line.inputs[0])
    tree.links.new(line.outputs["Value"], least.inputs[0])
    tree.links.new(least.outputs["Value"], stretch.inputs["Z"])
    return stretch


def _node(tree: Any, kind: str, column: int, row: int) -> Any:
    """Add a node at a place of a coarse grid, so that whoever opens the tree can read it."""
    node = tree.nodes.new(kind)
    node.location = (220.0 * column, -180.0 * row)
    return node
