"""Geometry nodes of a bed: pins, colored by mode or by force, arrows on them, and the housing."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..core.base.modes import Mode
from . import heat
from .nodes import attribute, node, number, socket, switch
from .parts import Sources

__all__ = [
    "ARROWS", "ARROW_LENGTH", "CASE", "COLOR_BY_FORCE", "LEAST", "LENGTH", "SOURCES", "TOP_FORCE",
    "bed_nodes",
]  # fmt: skip

#: Names of the nodes that have the housing and the collection of all that is drawn.
CASE, SOURCES = "Housing", "Sources"

#: Pins pushed below the deck keep this much of their length, rather than turning upside down.
LEAST_STRETCH = 0.02
#: Names of the settings: colors by force, and arrows.
COLOR_BY_FORCE, TOP_FORCE = "Color by Force", "Top Color at (N)"
ARROWS, ARROW_LENGTH = "Force Arrows", "Arrow Length (mm/N)"
#: How long an arrow is drawn by default, mm for each N.
LENGTH = 150.0
#: Smaller forces get no arrow, N: a millinewton is what the pulp of a finger just feels.
LEAST = 1e-3


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
        Blender units of a millimeter of the device.
    """
    tree = bpy.data.node_groups.new("Digital Clay Pins", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    _add_settings(tree)
    settings = node(tree, "NodeGroupInput", -1, 0)
    result = node(tree, "NodeGroupOutput", 9, 0)
    force_on, top = settings.outputs[COLOR_BY_FORCE], settings.outputs[TOP_FORCE]
    level = _level_of_force(tree, top, len(Mode), 3)
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
    drawn = _arrows_on_points(tree, sources.arrow, settings, instances.outputs["Instances"], unit, 7)
    case = node(tree, "GeometryNodeObjectInfo", 7, 1)
    case.name, case.inputs["Object"].default_value = CASE, sources.housing
    both = node(tree, "GeometryNodeJoinGeometry", 8, 0)
    tree.links.new(case.outputs["Geometry"], both.inputs["Geometry"])
    tree.links.new(drawn, both.inputs["Geometry"])
    tree.links.new(both.outputs["Geometry"], result.inputs["Geometry"])
    return tree


def _add_settings(tree: Any) -> None:
    """Add what each bed may choose for itself."""
    socket(tree, COLOR_BY_FORCE, "NodeSocketBool", False, "Color the pins by force, not by mode")
    socket(tree, TOP_FORCE, "NodeSocketFloat", heat.TOP, "Force of the last color, in N")
    socket(tree, ARROWS, "NodeSocketBool", False, "Draw the force on each pin as an arrow onto its top")
    socket(tree, ARROW_LENGTH, "NodeSocketFloat", LENGTH, "Length of the arrow of 1 N, in mm of the device")


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


def _level_of_force(tree: Any, top: Any, first: int, row: float) -> Any:
    """Add the nodes that choose a pin by the force on it; return its place among the pins.

    Parameters
    ----------
    tree : bpy.types.NodeTree
    top : bpy.types.NodeSocket
        Force of the last level, N.
    first : int
        Place of the pin that nothing presses; the levels of `heat.level` come behind it.
    row : float
        Where in the tree they stand.
    """
    force = attribute(tree, "force", "FLOAT", 0, row + 1)
    per_newton = number(tree, "DIVIDE", 0, row + 2, float(len(heat.COLORS)), top)
    levels = number(tree, "CEIL", 2, row + 1, number(tree, "MULTIPLY", 1, row + 1, force, per_newton))
    within = node(tree, "ShaderNodeClamp", 3, row + 1)
    within.inputs["Max"].default_value = len(heat.COLORS)
    tree.links.new(levels, within.inputs["Value"])
    return number(tree, "ADD", 3.5, row, within.outputs["Result"], float(first))


def _arrows_on_points(tree: Any, arrow: Any, settings: Any, pins: Any, unit: float, row: float) -> Any:
    """Add the nodes that draw the arrows beside the pins.

    Parameters
    ----------
    tree : bpy.types.NodeTree
    arrow : bpy.types.Object
        An arrow of length 1 that points down and ends at the origin.
    settings : bpy.types.Node
        The tree's input node.
    pins : bpy.types.NodeSocket
        The pins, drawn with and without arrows.
    unit : float
        Blender units of a millimeter of the device.
    row : float
        Where in the tree they stand.

    Returns
    -------
    bpy.types.NodeSocket
        Pins and arrows, or pins alone where arrows are off.
    """
    force = attribute(tree, "force", "FLOAT", 1, row + 1)
    pressed = node(tree, "FunctionNodeCompare", 3, row - 0.4)
    pressed.data_type, pressed.operation = "FLOAT", "GREATER_THAN"
    pressed.inputs["B"].default_value = LEAST
    tree.links.new(force, pressed.inputs["A"])
    shape = node(tree, "GeometryNodeObjectInfo", 3, row + 0.6)
    shape.inputs["Object"].default_value = arrow
    shape.inputs["As Instance"].default_value = True
    per_newton = number(tree, "MULTIPLY", 1, row + 2, settings.outputs[ARROW_LENGTH], unit)
    stretch = node(tree, "ShaderNodeCombineXYZ", 3, row + 2)
    stretch.inputs["X"].default_value = stretch.inputs["Y"].default_value = 1.0
    tree.links.new(number(tree, "MULTIPLY", 2, row + 1, force, per_newton), stretch.inputs["Z"])
    instances = node(tree, "GeometryNodeInstanceOnPoints", 4, row)
    tree.links.new(settings.outputs["Geometry"], instances.inputs["Points"])
    tree.links.new(pressed.outputs["Result"], instances.inputs["Selection"])
    tree.links.new(shape.outputs["Geometry"], instances.inputs["Instance"])
    tree.links.new(stretch.outputs["Vector"], instances.inputs["Scale"])
    both = node(tree, "GeometryNodeJoinGeometry", 5, row)
    tree.links.new(instances.outputs["Instances"], both.inputs["Geometry"])
    tree.links.new(pins, both.inputs["Geometry"])
    arrows = settings.outputs[ARROWS]
    return switch(tree, "GEOMETRY", 6, row - 1, arrows, pins, both.outputs["Geometry"])
