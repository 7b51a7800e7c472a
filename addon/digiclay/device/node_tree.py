"""The geometry nodes that draw a bed: a pin on every vertex, stretched down to the deck."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from . import node_arrows, node_heat
from .nodes import attribute, node, number, switch

__all__ = ["bed_nodes"]

#: Pins pushed below the deck keep this much of their length, rather than turning upside down.
LEAST_STRETCH = 0.02


def bed_nodes(by_mode: Any, by_force: Any, arrow: Any, deck: float, length: float, unit: float) -> Any:
    """Make the node group that puts a pin on every vertex, and an arrow where arrows are on.

    Stretching one mesh costs half of drawing rod and cap apart. A cap is stretched with its
    rod, from a flat one on a low pin to a round one on a high pin.

    Parameters
    ----------
    by_mode, by_force : bpy.types.Collection
        One pin a mode and one a level of force, their names in the order of the codes; tops at
        their origins.
    arrow : bpy.types.Object
        An arrow of length 1 that points down and ends at the origin.
    deck : float
        Height the rods reach down to, Blender units.
    length : float
        Length of the pins in the collections, Blender units.
    unit : float
        Blender units of a millimetre of the device.
    """
    tree = bpy.data.node_groups.new("Digital Clay Pins", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    node_heat.add_settings(tree)
    node_arrows.add_settings(tree)
    settings = node(tree, "NodeGroupInput", -1, 0)
    result = node(tree, "NodeGroupOutput", 7, 0)
    force_on, top = settings.outputs[node_heat.COLOUR_BY_FORCE], settings.outputs[node_heat.TOP_FORCE]
    hot, level = node_heat.pins_by_force(tree, by_force, top, 3)
    choice = node(tree, "GeometryNodeCollectionInfo", 2, 0)
    choice.inputs["Collection"].default_value = by_mode
    choice.inputs["Separate Children"].default_value = True
    mode = attribute(tree, "mode", "INT", 2, 1)
    instances = node(tree, "GeometryNodeInstanceOnPoints", 5, 0)
    instances.inputs["Pick Instance"].default_value = True
    shapes = switch(tree, "GEOMETRY", 4, 0, force_on, choice.outputs["Instances"], hot)
    index = switch(tree, "INT", 4, 1, force_on, mode, level)
    tree.links.new(settings.outputs["Geometry"], instances.inputs["Points"])
    tree.links.new(shapes, instances.inputs["Instance"])
    tree.links.new(index, instances.inputs["Instance Index"])
    tree.links.new(_stretch(tree, deck, length), instances.inputs["Scale"])
    drawn = node_arrows.arrows_on_points(tree, arrow, settings, instances.outputs["Instances"], unit, 7)
    tree.links.new(drawn, result.inputs["Geometry"])
    return tree


def _stretch(tree: Any, deck: float, length: float) -> Any:
    """Add the nodes that give (1, 1, (z - deck) / length) at every vertex."""
    place = node(tree, "GeometryNodeInputPosition", 0, -2)
    parts = node(tree, "ShaderNodeSeparateXYZ", 1, -2)
    tree.links.new(place.outputs["Position"], parts.inputs["Vector"])
    line = number(tree, "MULTIPLY_ADD", 2, -2, parts.outputs["Z"], 1.0 / length, -deck / length)
    stretch = node(tree, "ShaderNodeCombineXYZ", 4, -2)
    stretch.inputs["X"].default_value = stretch.inputs["Y"].default_value = 1.0
    tree.links.new(number(tree, "MAXIMUM", 3, -2, line, LEAST_STRETCH), stretch.inputs["Z"])
    return stretch.outputs["Vector"]
