"""Geometry nodes of a bed for the force arrows."""

from __future__ import annotations

from typing import Any

from .nodes import attribute, node, number, socket, switch

__all__ = ["ARROWS", "ARROW_LENGTH", "LEAST", "LENGTH", "add_settings", "arrows_on_points"]

#: Names of the settings.
ARROWS, ARROW_LENGTH = "Force Arrows", "Arrow Length (mm/N)"
#: How long an arrow is drawn by default, mm for each N.
LENGTH = 150.0
#: Smaller forces get no arrow, N: a millinewton is what the pulp of a finger just feels.
LEAST = 1e-3


def add_settings(tree: Any) -> None:
    """Add what each bed may choose for itself."""
    socket(tree, ARROWS, "NodeSocketBool", False, "Draw the force on each pin as an arrow onto its top")
    socket(tree, ARROW_LENGTH, "NodeSocketFloat", LENGTH, "Length of the arrow of 1 N, in mm of the device")


def arrows_on_points(tree: Any, arrow: Any, settings: Any, pins: Any, unit: float, row: float) -> Any:
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
        Blender units of a millimetre of the device.
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
