"""Animated files of pins, as instances, or of their skin: USD as text, and binary glTF."""

from typing import BinaryIO, NamedTuple

import numpy as np

from ..base.arrays import Faces, Floats
from ..base.errors import OutputError
from ..files.tables import Record
from .mesh_writer import CLAY, GlbArrays, add_triangles
from .obj_reader import UP, make_axes, turn


class Animation(NamedTuple):
    """Points that move in frames of equal length, and what is drawn at them."""

    rate: float
    """Frames per second."""
    points: Floats
    """(t, m, 3): Pin tops or points of the skin, m."""
    faces: Faces
    """(f, 3): Triangles of the skin, or of one pin."""
    pin: Floats | None = None
    """(v, 3): Vertices of one pin about its top, m; None: a skin."""


#: Most frames of a skin in a GLB: each has a weight in every frame, together 64 MB.
MOST_TARGETS = 4000
USD_HEAD = """#usda 1.0
(
    defaultPrim = "digiclay"
    metersPerUnit = {meters:g}
    upAxis = "Z"
    timeCodesPerSecond = {rate:.9g}
    framesPerSecond = {rate:.9g}
    startTimeCode = 0
    endTimeCode = {last}
)

def Xform "digiclay"
{{
"""
USD_MESH = """def Mesh "{name}"
{{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = {counts}
    int[] faceVertexIndices = {corners}
    point3f[] points"""
USD_PINS = """def PointInstancer "pins"
{{
{pin} = {vertices}
}}
    rel prototypes = </digiclay/pins/pin>
    int[] protoIndices = {prototypes}
    point3f[] positions"""


def write_usd(file: BinaryIO, animation: Animation, factor: float) -> None:
    """Write a mesh, or a point instancer of pins, lengths in 1 / `factor` m, z up."""
    rate, points, faces, pin = animation
    head = USD_HEAD.format(meters=1.0 / factor, rate=rate, last=len(points) - 1)
    name = "skin" if pin is None else "pin"
    corners = faces.ravel().tolist()
    moving = USD_MESH.format(name=name, counts=[3] * len(faces), corners=corners)
    if pin is not None:
        vertices, prototypes = _list_points(pin * factor), [0] * points.shape[1]
        moving = USD_PINS.format(pin=moving, vertices=vertices, prototypes=prototypes)
    file.write(f"{head}{moving}.timeSamples = {{\n".encode())
    for frame, moved in enumerate(points):
        file.write(f"{frame}: {_list_points(moved * factor)},\n".encode())
    file.write(b"}\n}\n}\n")


def _list_points(points: Floats) -> str:
    """Return points (m, 3) as USD writes them, to a nanometer or finer."""
    return str(list(map(tuple, points.round(9).tolist())))


def write_glb(file: BinaryIO, animation: Animation, factor: float) -> None:
    """Write nodes that move, one per pin, or a skin with one morph target per frame, in meters, y up."""
    rate, points, faces, pin = animation
    arrays, count = GlbArrays(), len(points)
    paths = turn(points, make_axes(UP))
    times = arrays.add(np.arange(count) / rate)
    if pin is None:
        if count > MOST_TARGETS:
            rule = f"must have at most {MOST_TARGETS} frames (got {count}): choose usd or abc"
            raise OutputError(f"An animated skin in a GLB {rule}.")
        name, moved = "skin", "weights"
        part = add_triangles(arrays, points[0], faces)
        part["targets"] = [{"POSITION": arrays.add(rise, "VEC3")} for rise in paths[1:] - paths[0]]
        # Each frame has the whole of its target and nothing of the others.
        outputs = [arrays.add(np.eye(count, count - 1, -1).ravel())]
        nodes: list[Record] = [{"mesh": 0, "name": name}]
    else:
        name, moved = "pin", "translation"
        part = add_triangles(arrays, pin, faces)
        outputs = [arrays.add(path, "VEC3") for path in paths.swapaxes(0, 1)]
        nodes = [
            {"mesh": 0, "name": f"pin_{number}", "translation": place}
            for number, place in enumerate(paths[0].tolist())
        ]
    session = {
        "name": "session",
        "channels": [
            {"sampler": number, "target": {"node": number, "path": moved}}
            for number in range(len(nodes))
        ],
        "samplers": [{"input": times, "output": output} for output in outputs],
    }
    meshes = [{"name": name, "primitives": [part]}]
    arrays.write(
        file, {"nodes": nodes, "meshes": meshes, "materials": [CLAY], "animations": [session]}
    )
