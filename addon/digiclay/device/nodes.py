"""Helpers for node trees."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..compat import bpy


def node(
    tree: Any, kind: str, column: float, row: float, inputs: Mapping[str, Any] | None = None, **settings: Any
) -> Any:
    """Add a node at a place of a coarse grid; each input gets a value, an output, or a list of outputs."""
    made = tree.nodes.new(kind)
    made.location = (220.0 * column, -180.0 * row)
    for name, value in settings.items():
        setattr(made, name, value)
    for name, value in (inputs or {}).items():
        link(tree, value, enabled(made.inputs, name))
    return made


def link(tree: Any, value: Any, place: Any) -> None:
    """Give an input a value, an output, or a list of outputs in the order in which they are to be linked."""
    if isinstance(value, list):
        for each in value:
            tree.links.new(each, place)
    elif isinstance(value, bpy.types.NodeSocket):
        tree.links.new(value, place)
    else:
        place.default_value = value


def enabled(sockets: Any, name: str) -> Any:
    """Return the socket of a name that is in use: nodes have one for each type, all of the same name."""
    return next((each for each in sockets if each.name == name and each.enabled), sockets[name])


def new_tree(name: str) -> Any:
    """Add a tree that takes a geometry."""
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    return tree


def socket(tree: Any, name: str, kind: str, default: Any, description: str) -> None:
    """Add a setting to a tree, which each object that uses the tree has for itself."""
    made = tree.interface.new_socket(name, in_out="INPUT", socket_type=kind)
    made.default_value = default
    made.description = description


def attribute(tree: Any, name: Any, kind: str, column: float, row: float) -> Any:
    """Add a node that reads an attribute of the vertices of a name or text of nodes; return its output."""
    made = node(tree, "GeometryNodeInputNamedAttribute", column, row, {"Name": name}, data_type=kind)
    return enabled(made.outputs, "Attribute")


def number(tree: Any, operation: str, column: float, row: float, *values: Any) -> Any:
    """Add a node that reckons with numbers or with outputs of other nodes; return its output."""
    made = node(tree, "ShaderNodeMath", column, row, operation=operation)
    for place, value in zip(made.inputs, values, strict=False):
        link(tree, value, place)
    return made.outputs["Value"]


def switch(tree: Any, kind: str, column: float, row: float, on: Any, off: Any, then: Any) -> Any:
    """Add a node that hands on `then` where `on` holds and `off` (may be None) else; return its output."""
    # What is not handed on is not worked out either: that is how a part that is off costs nothing.
    ways = {"Switch": on, **({} if off is None else {"False": off}), "True": then}
    return enabled(node(tree, "GeometryNodeSwitch", column, row, ways, input_type=kind).outputs, "Output")


def combine(tree: Any, column: float, row: float, **parts: Any) -> Any:
    """Add a node that makes a vector of X, Y and Z; return its output."""
    return node(tree, "ShaderNodeCombineXYZ", column, row, parts).outputs["Vector"]


def read_height(tree: Any, row: float) -> Any:
    """Add the nodes that read the height of a vertex; return their output."""
    place = node(tree, "GeometryNodeInputPosition", 0, row).outputs["Position"]
    return node(tree, "ShaderNodeSeparateXYZ", 1, row, {"Vector": place}).outputs["Z"]


def mesh_of(tree: Any, thing: Any, column: float, row: float) -> Any:
    """Add the node that reads an object's mesh; return its output."""
    return node(tree, "GeometryNodeObjectInfo", column, row, {"Object": thing}).outputs["Geometry"]


def sample(tree: Any, table: Any, value: Any, kind: str, index: Any, column: float, row: float) -> Any:
    """Add the node that reads a value of other vertices, by their place; return its output."""
    given = {"Geometry": table, "Value": value, "Index": index}
    made = node(tree, "GeometryNodeSampleIndex", column, row, given, data_type=kind, domain="POINT")
    return enabled(made.outputs, "Value")


def store(tree: Any, table: Any, name: str, kind: str, value: Any, column: float, row: float) -> Any:
    """Add the node that stores a value at every vertex; return its geometry."""
    given = {"Geometry": table, "Name": name, "Value": value}
    made = node(tree, "GeometryNodeStoreNamedAttribute", column, row, given, data_type=kind, domain="POINT")
    return made.outputs["Geometry"]
