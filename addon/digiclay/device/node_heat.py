"""Geometry nodes of a bed for the force colours."""

from __future__ import annotations

from typing import Any

from . import heat
from .nodes import attribute, node, number, socket

__all__ = ["COLOUR_BY_FORCE", "TOP_FORCE", "add_settings", "level_of_force"]

#: Names of the settings.
COLOUR_BY_FORCE, TOP_FORCE = "Colour by Force", "Top Colour at (N)"


def add_settings(tree: Any) -> None:
    """Add what each bed may choose for itself."""
    socket(tree, COLOUR_BY_FORCE, "NodeSocketBool", False, "Colour the pins by force, not by mode")
    socket(tree, TOP_FORCE, "NodeSocketFloat", heat.TOP, "Force of the last colour, in N")


def level_of_force(tree: Any, top: Any, first: int, row: float) -> Any:
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
    per_newton = number(tree, "DIVIDE", 0, row + 2, float(len(heat.COLOURS)), top)
    levels = number(tree, "CEIL", 2, row + 1, number(tree, "MULTIPLY", 1, row + 1, force, per_newton))
    within = node(tree, "ShaderNodeClamp", 3, row + 1)
    within.inputs["Max"].default_value = len(heat.COLOURS)
    tree.links.new(levels, within.inputs["Value"])
    return number(tree, "ADD", 3.5, row, within.outputs["Result"], float(first))
