"""Geometry nodes of a bed: a pin on every vertex, down to the deck, and the housing."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..core.base.modes import Mode
from . import node_arrows, node_heat
from .nodes import attribute, node, number, switch
from .parts import Sources

__all__ = ["CASE", "SOURCES", "bed_nodes"]

#: Names of the nodes that have the housing and the collection of all that is drawn.
CASE, SOURCES = "Housing", "Sources"

#: Pins pushed below the deck keep this much of their length, rather than turning upside down.
LEAST_STRETCH = 0.02


def bed_nodes(sources: Sources, deck: float, length: float, unit: float) -> Any:
    """Make the node group that puts a pin on every vertex, an arrow where arrows are on, and the housing.

    Stretching one mesh costs half of drawing rod and cap apart. A cap is stretched with its
    rod, from a flat one on a low pin to a round one on a high pin.

    Parameters
    ----------
    sources : Sources
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
    result = node(tree, "NodeGroupOutput", 9, 0)
    force_on, top = settings.outputs[node_heat.COLOUR_BY_FORCE], settings.outputs[node_heat.TOP_FORCE]
    level = node_heat.level_of_force(tree, top, len(Mode), 3)
    choice = node(tree, "GeometryNodeCollectionInfo", 4, 0)
    choice.name, choice.inputs["Collection"].default_value = SOURCES, sources.collection
    choice.inputs["Separate Children"].default_value = True
    mode = attribute(tree, "mode", "INT", 2, 1)
    instances = node(tree, "GeometryNodeInstanceOnPoints", 5, 0)
    instances.inputs["Pick Instance"].default_value = True
    index = switch(tree, "INT", 4, 1, force_on, mode, level)
    tree.links.new(settings.outputs["Geometry"], instances.inputs["Points"])
    tree.links.new(choice.outputs["Instances"], instances.inputs["Instance"])
    tree.links.new(index, instances.inputs["Instance Index"])
    tree.links.new(_stretch(tree, deck, length), instances.inputs["Scale"])
    drawn = node_arrows.arrows_on_points(
        tree, sources.arrow, settings, instances.outputs["Instances"], unit, 7
    )
    case = node(tree, "GeometryNodeObjectInfo", 7, 1)
    case.name, case.inputs["Object"].default_value = CASE, sources.housing
    both = node(tree, "GeometryNodeJoinGeometry", 8, 0)
    tree.links.new(case.outputs["Geometry"], both.inputs["Geometry"])
    tree.links.new(drawn, both.inputs["Geometry"])
    tree.links.new(both.outputs["Geometry"], result.inputs["Geometry"])
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
