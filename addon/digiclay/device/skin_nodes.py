"""Geometry nodes of the live skin: weighted sums of the heights of the pins, in Blender's own code.

The skin follows whatever moves the pins: a session, a bake, undo. It needs no data of its own in a tick.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..bridge import SCALE
from ..compat import bpy
from .nodes import attribute, combine, enabled, link, mesh_of, node, number, read_height, sample, store
from .skin_lattice import Pass, SkinLattice

#: Attributes of the meshes: neighbors for the slope, neighbors for the sum, and what is stored on the way.
PREVIOUS, FOLLOWING, LOW, HIGH, VALUE, PAIR = "previous", "following", "low", "high", "value", "pair"
#: Attributes of the weights: their first half; the other is the name of the skin.
WEIGHTS = ("weight low ", "weight high ")


class SkinMeshes(NamedTuple):
    """Meshes of the skin: points of the pins and of the rows, and the skin itself, flat."""

    pins: Any
    rows: Any
    skin: Any


def make_meshes(lattice: SkinLattice, deck: float, material: Any) -> SkinMeshes:
    """Make the meshes of a skin."""
    pins = _points("Digital Clay Skin Pins", lattice.along.previous.size)
    _write_neighbors(pins, lattice.along)
    rows = _points("Digital Clay Skin Rows", lattice.across.previous.size)
    _write_neighbors(rows, lattice.across)
    _write_weights(rows, lattice.along)
    count = len(lattice.place)
    skin = _points("Digital Clay Skin", count)
    flat = np.column_stack([lattice.place, np.where(lattice.sunk, deck, 0.0)]) * SCALE
    skin.vertices.foreach_set("co", flat.astype(np.float32).ravel())
    skin.loops.add(lattice.faces.size)
    skin.loops.foreach_set("vertex_index", lattice.faces.ravel())
    skin.polygons.add(len(lattice.faces))
    skin.polygons.foreach_set("loop_start", np.arange(0, lattice.faces.size, 4, dtype=np.int32))
    skin.update(calc_edges=True)
    _write_weights(skin, lattice.across)
    skin.materials.append(material)
    return SkinMeshes(pins, rows, skin)


def skin_nodes(tree: Any, sources: Any, pins: Any, kind: Any, row: float) -> Any:
    """Add the nodes that stretch a skin over pins; return its geometry."""
    names = [_prefixed(tree, words, kind, row + step) for step, words in enumerate(WEIGHTS)]
    height = read_height(tree, row + 3)
    index = node(tree, "GeometryNodeInputIndex", 1, row + 2).outputs["Index"]
    points = mesh_of(tree, sources.pins, 1, row)
    value = sample(tree, pins, height, "FLOAT", index, 2, row)
    pair = _store_pair(tree, store(tree, points, VALUE, "FLOAT", value, 3, row), 4, row)
    lines = mesh_of(tree, sources.rows, 6, row + 2)
    value = _sum(tree, pair, names, 6, row)
    pair = _store_pair(tree, store(tree, lines, VALUE, "FLOAT", value, 10, row), 11, row)
    up = combine(tree, 17, row + 1, Z=_sum(tree, pair, names, 13, row))
    flat = mesh_of(tree, sources.skin, 16, row)
    raised = node(tree, "GeometryNodeSetPosition", 18, row, {"Geometry": flat, "Offset": up})
    return raised.outputs["Geometry"]


def _points(name: str, count: int) -> Any:
    """Make a mesh of loose vertices."""
    made = bpy.data.meshes.new(name)
    made.vertices.add(count)
    return made


def _write_neighbors(mesh: Any, step: Pass) -> None:
    """Write the neighbors that the slopes of a pass need."""
    for name, values in ((PREVIOUS, step.previous), (FOLLOWING, step.following)):
        mesh.attributes.new(name, "INT", "POINT").data.foreach_set("value", values)


def _write_weights(mesh: Any, step: Pass) -> None:
    """Write the neighbors that a pass adds up, and their weights."""
    for name, values in ((LOW, step.low), (HIGH, step.high)):
        mesh.attributes.new(name, "INT", "POINT").data.foreach_set("value", values)
    for kind, weights in step.weights.items():
        for name, share in zip(WEIGHTS, weights, strict=True):
            made = mesh.attributes.new(name + kind, "FLOAT2", "POINT")
            made.data.foreach_set("vector", share.astype(np.float32).ravel())


def _prefixed(tree: Any, words: str, kind: Any, row: float) -> Any:
    """Add the nodes that put words before a name."""
    first = node(tree, "FunctionNodeInputString", -1, row, string=words).outputs["String"]
    # What is linked first stands last.
    return node(tree, "GeometryNodeStringJoin", 0, row, {"Strings": [kind, first]}).outputs["String"]


def _store_pair(tree: Any, table: Any, column: float, row: float) -> Any:
    """Add the nodes that store height and slope: the harmonic mean of the slopes on both sides, or 0."""
    here = attribute(tree, VALUE, "FLOAT", column, row + 1)
    sides = []
    for step, name in enumerate((PREVIOUS, FOLLOWING), 2):
        beside = {"Value": here, "Index": attribute(tree, name, "INT", column, row + step)}
        kind = {"data_type": "FLOAT", "domain": "POINT"}
        read = node(tree, "GeometryNodeFieldAtIndex", column + 0.5, row + step, beside, **kind)
        sides.append(enabled(read.outputs, "Value"))
    before = number(tree, "SUBTRACT", column + 1, row + 2, here, sides[0])
    after = number(tree, "SUBTRACT", column + 1, row + 3, sides[1], here)
    product = number(tree, "MULTIPLY", column + 1, row + 4, before, after)
    same_way = number(tree, "MAXIMUM", column + 1, row + 5, product, 0.0)
    twice = number(tree, "MULTIPLY", column + 1, row + 6, same_way, 2.0)
    total = number(tree, "ADD", column + 1, row + 7, before, after)
    slope = number(tree, "DIVIDE", column + 1, row + 8, twice, total)  # Blender divides by 0 to 0
    pair = combine(tree, column + 1.5, row + 1, X=here, Y=slope)
    return store(tree, table, PAIR, "FLOAT_VECTOR", pair, column + 1.7, row)


def _sum(tree: Any, table: Any, names: list[Any], column: float, row: float) -> Any:
    """Add the nodes that add up heights and slopes of two neighbors."""
    pair = attribute(tree, PAIR, "FLOAT_VECTOR", column, row + 5)
    parts = []
    for step, (side, name) in enumerate(zip((LOW, HIGH), names, strict=True)):
        at = attribute(tree, side, "INT", column, row + 6 + step)
        weight = attribute(tree, name, "FLOAT_VECTOR", column, row + 8 + step)
        there = sample(tree, table, pair, "FLOAT_VECTOR", at, column + 1, row + 5 + step)
        dot = node(tree, "ShaderNodeVectorMath", column + 2, row + 5 + step, operation="DOT_PRODUCT")
        for place, value in zip(dot.inputs, (there, weight), strict=False):
            link(tree, value, place)
        parts.append(dot.outputs["Value"])
    return number(tree, "ADD", column + 3, row + 5, *parts)
