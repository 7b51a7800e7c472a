"""Reader of 3MF files: a zip of XML parts, with objects, their components, and the items of a build.

The standard library reads the XML as a stream: trimesh would need lxml and networkx. A document
type, which can define entities, is refused, as 3MF forbids it.
"""

from __future__ import annotations

import posixpath
import zipfile
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

import numpy as np

from ..base.arrays import Floats, Indices
from ..files.formats import BROKEN_ZIP
from .mesh_limits import (
    IDENTITY,
    join_meshes,
    make_refusal,
    nest_placement,
    refuse_many_triangles,
    refuse_size,
)

#: Part and number of an object.
Key = tuple[str, str]
#: An object, and its placement (4, 3).
Placed = tuple[Key, Floats]
#: Takes name and attributes of an element that begins.
Start = Callable[[str, dict[str, str]], None]

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02 "
PATH = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06 path"
RELATION = "http://schemas.openxmlformats.org/package/2006/relationships Relationship"
#: Namespaces of extensions that do not change a shape, or that are read.
KNOWN = (
    CORE.strip(),
    PATH.partition(" ")[0],
    "http://schemas.microsoft.com/3dmanufacturing/material/2015/02",
)
MODEL = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
#: Meters in a model's unit.
UNITS = {
    "micron": 1e-6,
    "millimeter": 1e-3,
    "centimeter": 1e-2,
    "inch": 25.4e-3,
    "foot": 0.3048,
    "meter": 1.0,
}
#: Types of objects that support others during printing, and do not belong to the shape.
SUPPORTS = ("support", "solidsupport")
#: Bytes per call of the parser, and most bytes of a tag.
PIECE, LONGEST_TAG = 1 << 16, 1 << 22
UNREADABLE = "must be a 3MF file that can be read"
#: Most objects, components and items, and deepest nesting of components.
MOST_PARTS, DEEPEST = 1_000_000, 64


@dataclass
class _Object:
    """Object of a model; vertices and triangles are flat."""

    support: bool
    vertices: array[float] = field(default_factory=lambda: array("d"))
    triangles: array[int] = field(default_factory=lambda: array("q"))
    components: list[Placed] = field(default_factory=list)


@dataclass
class _Model:
    """Content of the parts read so far."""

    unit: float = UNITS["millimeter"]
    objects: dict[Key, _Object] = field(default_factory=dict)
    items: list[Placed] = field(default_factory=list)
    prefixes: dict[str, str] = field(default_factory=dict)
    counted: int = 0
    unpacked: int = 0


class _Extent(NamedTuple):
    """Size of an object with its components: triangles, meshes, and depth of nesting."""

    triangles: int
    meshes: int
    depth: int


def read(path: Path) -> tuple[Floats, Indices, float]:
    """Return vertices (v, 3), triangles (f, 3), and the meters in the vertices' unit."""
    name, model = path.name, _Model()
    try:
        with zipfile.ZipFile(path) as archive:
            root = _find_root(archive, name, model)
            waiting, seen = [root], {root}
            while waiting:
                parts = _add_part(archive, waiting.pop(), name, model, root) - seen
                waiting += sorted(parts)
                seen |= parts
    except (*BROKEN_ZIP, EOFError, KeyError) as error:
        content = str(error).strip("'\"") or type(error).__name__
        raise make_refusal(UNREADABLE, name, content) from None
    return *_placed(model, name), model.unit


def _find_root(archive: zipfile.ZipFile, name: str, model: _Model) -> str:
    """Return the part that contains the model, by the package's relations."""
    targets: list[str] = []

    def start(tag: str, given: dict[str, str]) -> None:
        if tag == RELATION and given.get("Type") == MODEL and given.get("TargetMode") != "External":
            targets.append(_inside("", given.get("Target", "")))

    _parse(archive, "_rels/.rels", name, model, start)
    if not targets:
        raise make_refusal(UNREADABLE, name, "its relations name no model")
    return targets[0]


def _inside(part: str, target: str) -> str:
    """Return the path in the zip of a part that another one names."""
    return posixpath.normpath(posixpath.join("/", posixpath.dirname(part), target)).lstrip("/")


def _parse(archive: zipfile.ZipFile, part: str, name: str, model: _Model, start: Start) -> None:
    """Read a part of the zip; call `start` with name and attributes of each element."""
    entry = archive.getinfo(part)
    model.unpacked += entry.file_size  # no more is unpacked
    refuse_size(name, model.unpacked, part)
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise make_refusal("must be stored or deflated, as 3MF has it", name, part)
    parser = expat.ParserCreate(namespace_separator=" ")

    def refuse(*_: object) -> None:
        raise make_refusal("must not have a document type (<!DOCTYPE ...>)", name, part)

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = start
    parser.StartNamespaceDeclHandler = model.prefixes.__setitem__
    fed = 0
    try:
        with archive.open(entry) as file:
            while piece := file.read(PIECE):
                parser.Parse(piece, False)
                fed += len(piece)
                if fed - max(parser.CurrentByteIndex, 0) > LONGEST_TAG:
                    rule = f"must have tags of at most {LONGEST_TAG // 2**20} MB"
                    raise make_refusal(rule, name, f"{part}, byte {parser.CurrentByteIndex}")
            parser.Parse(b"", True)
    except expat.ExpatError as error:
        raise make_refusal(UNREADABLE, name, f"{part}: {error}") from None


def _add_part(archive: zipfile.ZipFile, part: str, name: str, model: _Model, root: str) -> set[str]:
    """Add a part's objects to the model, and the root part's items and unit; return the parts it names."""
    objects: list[_Object] = []
    parts: set[str] = set()

    def add(kind: str, given: dict[str, str]) -> None:
        if kind == "vertex":
            objects[-1].vertices.extend((float(given["x"]), float(given["y"]), float(given["z"])))
        elif kind == "triangle":
            objects[-1].triangles.extend((int(given["v1"]), int(given["v2"]), int(given["v3"])))
        elif kind == "object":
            objects.append(_Object(given.get("type") in SUPPORTS))
            model.objects[part, given["id"]] = objects[-1]
        elif kind == "component" or (kind == "item" and part == root):
            placed = _reference(part, given)
            parts.add(placed[0][0])
            (objects[-1].components if kind == "component" else model.items).append(placed)
        elif kind == "model" and part == root:
            unit = given.get("unit", "millimeter")
            if unit not in UNITS:
                raise ValueError(f"no unit: {unit}")
            model.unit = UNITS[unit]
            for prefix in given.get("requiredextensions", "").split():
                if model.prefixes.get(prefix, prefix) not in KNOWN:
                    raise ValueError(f"needs {model.prefixes.get(prefix, prefix)}")

    def start(tag: str, given: dict[str, str]) -> None:
        if not tag.startswith(CORE):
            return
        kind = tag[len(CORE) :]
        if kind in ("object", "component", "item"):
            model.counted += 1
            if model.counted > MOST_PARTS:
                rule = f"must have at most {MOST_PARTS:,} objects, components and items"
                raise make_refusal(rule, name, "more")
        try:
            add(kind, given)
        except KeyError as error:
            raise make_refusal(UNREADABLE, name, f"{part}, a {kind} without {error}") from None
        except (ValueError, OverflowError, IndexError) as error:
            raise make_refusal(UNREADABLE, name, f"{part}, {kind}: {error}") from None

    _parse(archive, part, name, model, start)
    refuse_many_triangles(name, sum(len(shape.triangles) // 3 for shape in model.objects.values()))
    return parts


def _reference(part: str, given: dict[str, str]) -> Placed:
    """Return the object of a component or an item, and its placement."""
    path = _inside("", given[PATH]) if PATH in given else part
    placement = IDENTITY
    if "transform" in given:
        numbers = [float(word) for word in given["transform"].split()]
        if len(numbers) != 12:
            raise ValueError(f"a transform of {len(numbers)} numbers")
        placement = np.array(numbers).reshape(4, 3)
    return (path, given["objectid"]), placement


def _placed(model: _Model, name: str) -> tuple[Floats, Indices]:
    """Return the vertices and triangles of all items as the build places them."""
    extents: dict[Key, _Extent] = {}
    items = [_measure(model, key, name, extents, 0) for key, _ in model.items]
    refuse_many_triangles(name, sum(extent.triangles for extent in items))
    meshes = sum(extent.meshes for extent in items)
    if meshes > MOST_PARTS:
        raise make_refusal(f"must place at most {MOST_PARTS:,} meshes", name, f"{meshes:,}")
    return join_meshes(_meshes(model, extents), name)


def _meshes(model: _Model, extents: dict[Key, _Extent]) -> Iterator[tuple[Floats, Indices, Floats]]:
    """Yield the mesh of each placed object that has one, and its placement."""
    waiting = list(reversed(model.items))
    while waiting:
        key, placement = waiting.pop()
        if extents[key].meshes:
            shape = model.objects[key]
            for inner, inside in reversed(shape.components):
                waiting.append((inner, nest_placement(inside, placement)))
            if shape.triangles:
                corners = np.array(shape.triangles, np.int64).reshape(-1, 3)
                yield np.array(shape.vertices).reshape(-1, 3), corners, placement


def _measure(
    model: _Model, key: Key, name: str, extents: dict[Key, _Extent], depth: int
) -> _Extent:
    """Return the extent of an object with its components; that of a support is empty."""
    if key not in extents:
        shape = model.objects.get(key)
        if shape is None:
            raise make_refusal(
                "must hold the objects it refers to", name, f"no object {key[1]} in {key[0]}"
            )
        components = shape.components if depth <= DEEPEST else []
        inside = [_measure(model, inner, name, extents, depth + 1) for inner, _ in components]
        below = 1 + max((extent.depth for extent in inside), default=-1)
        if max(depth, below) > DEEPEST:
            rule = f"must have components at most {DEEPEST} deep, and none in itself"
            raise make_refusal(rule, name, f"object {key[1]}")
        triangles_here = len(shape.triangles) // 3
        triangles = triangles_here + sum(extent.triangles for extent in inside)
        meshes = (triangles_here > 0) + sum(extent.meshes for extent in inside)
        extents[key] = _Extent(0, 0, below) if shape.support else _Extent(triangles, meshes, below)
    return extents[key]
