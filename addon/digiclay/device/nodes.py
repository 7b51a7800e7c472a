"""Helpers for node trees."""

from __future__ import annotations

from typing import Any


def node(tree: Any, kind: str, column: float, row: float) -> Any:
    """Add a node at a place of a coarse grid, so that whoever opens the tree can read it."""
    made = tree.nodes.new(kind)
    made.location = (220.0 * column, -180.0 * row)
    return made


def socket(tree: Any, name: str, kind: str, default: Any, description: str) -> None:
    """Add a setting to a tree, which each object that uses the tree has for itself."""
    made = tree.interface.new_socket(name, in_out="INPUT", socket_type=kind)
    made.default_value = default
    made.description = description


def attribute(tree: Any, name: str, kind: str, column: float, row: float) -> Any:
    """Add a node that reads an attribute of the vertices; return its output."""
    made = node(tree, "GeometryNodeInputNamedAttribute", column, row)
    made.data_type = kind
    made.inputs["Name"].default_value = name
    return made.outputs["Attribute"]


def number(tree: Any, operation: str, column: float, row: float, *values: Any) -> Any:
    """Add a node that reckons with numbers or with outputs of other nodes; return its output."""
    made = node(tree, "ShaderNodeMath", column, row)
    made.operation = operation
    for place, value in zip(made.inputs, values, strict=False):
        if isinstance(value, int | float):
            place.default_value = value
        else:
            tree.links.new(value, place)
    return made.outputs["Value"]


def switch(tree: Any, kind: str, column: float, row: float, on: Any, off: Any, then: Any) -> Any:
    """Add a node that hands on `then` where `on` holds and `off` (may be None) else; return its output."""
    # What is not handed on is not worked out either: that is how a part that is off costs nothing.
    made = node(tree, "GeometryNodeSwitch", column, row)
    made.input_type = kind
    tree.links.new(on, made.inputs["Switch"])
    if off is not None:
        tree.links.new(off, made.inputs["False"])
    tree.links.new(then, made.inputs["True"])
    return made.outputs["Output"]
