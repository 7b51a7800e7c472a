"""Bodies of a take as arrays of its file: a mesh once and its places, or undersides; differences, packed."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array, Floats
from ..engine.bodies import Given, Knot, PlacedMesh
from ..files.formats import inflate
from ..model.fingertip import find_quaternions, make_matrices
from ..model.laws import import_part
from ..model.underside import Mesh, check_mesh
from ..scene.schema import BODY, Presser, Scene
from ..shapes.body import read_bodies

#: Arrays: parameters of the bodies, as JSON, the periods of the knots, and undersides, of all knots
#: in version 5.
BODIES, KNOTS, PACKED = "bodies", "knots", "undersides"
#: Number of each knot's and body's mesh, `NONE`: it has an underside; vertices and triangles of each
#: mesh, and their numbers; places of all meshes, body by body, like the undersides.
NUMBERS, VERTICES, TRIANGLES, SIZES, PLACES = "meshes", "vertices", "triangles", "sizes", "places"
GIVEN = BODIES, KNOTS, PACKED, NUMBERS, VERTICES, TRIANGLES, SIZES, PLACES
NONE = -1
#: Largest difference of squares of lengths, of 1, in a mesh that is rigid: places have 32 bits.
UNEVEN = 1e-4


def pack_bodies(scene: Scene, knots: Sequence[Knot]) -> dict[str, Array]:
    """Return the arrays of the bodies of a scene at some times; none without bodies."""
    if not scene.bodies:
        return {}
    parameters = json.dumps([vars(each.body) for each in scene.bodies])
    given = [
        body for bodies in zip(*(bodies for _, bodies in knots), strict=True) for body in bodies
    ]
    placed = [body for body in given if isinstance(body, PlacedMesh)]
    meshes = list({id(body.mesh): body.mesh for body in placed}.values())
    number_of = {id(mesh): number for number, mesh in enumerate(meshes)}
    numbers = [number_of[id(body.mesh)] if isinstance(body, PlacedMesh) else NONE for body in given]
    return {
        BODIES: np.frombuffer(parameters.encode(), np.uint8),
        KNOTS: np.array([period for period, _ in knots], np.int64),
        NUMBERS: _pack([np.array(numbers)[:, None]]),
        SIZES: np.array([[len(part) for part in mesh] for mesh in meshes], np.int64).reshape(-1, 2),
        VERTICES: _pack([mesh.vertices.astype("<f4").view("<i4") for mesh in meshes]),
        TRIANGLES: _pack([mesh.triangles for mesh in meshes]),
        PLACES: _pack([body.matrix.astype("<f4").view("<i4").reshape(1, -1) for body in placed]),
        PACKED: _pack([body[None] for body in given if not isinstance(body, PlacedMesh)]),
    }


def place_bodies(scene: Scene, periods: Sequence[int]) -> tuple[Scene, tuple[Knot, ...]]:
    """Return a scene whose bodies are given, and those of a scene with meshes when some periods begin."""
    times = np.array(periods) * scene.simulation.control_period
    columns, pressers = [], []
    for each, mesh in zip(scene.bodies, read_bodies(p.body for p in scene.bodies), strict=True):
        # Of 32 bits, as a take keeps them.
        mesh = mesh._replace(vertices=mesh.vertices.astype("<f4").astype(np.float64))
        poses = each.trajectory.trajectory().poses(times)
        places = np.concatenate([make_matrices(poses[:, 3:]), poses[:, :3, None]], axis=2)
        columns.append([PlacedMesh(mesh, matrix) for matrix in places.astype(np.float32)])
        pressers.append(replace(each, body=each.body.without_mesh()))
    given = replace(scene, bodies=tuple(pressers))
    return given, tuple(zip(periods, zip(*columns, strict=True), strict=True))


def find_motion(given: Sequence[Given]) -> tuple[Mesh, Floats] | None:
    """Return the mesh of a rigid body, m, and its poses (k, 7); None: it deforms or changes its size."""
    placed = [body for body in given if isinstance(body, PlacedMesh)]
    if len(placed) < len(given) or len({id(body.mesh) for body in placed}) > 1:
        return None
    places = np.array([body.matrix for body in placed], np.float64)
    # The first place is a turn of a stretch: that belongs to the mesh.
    left, sizes, right = np.linalg.svd(places[0, :, :3])
    stretch = right.T @ np.diag(sizes) @ right * np.linalg.det(left @ right)
    turns = places[:, :, :3] @ np.linalg.inv(stretch)
    if np.abs(turns @ turns.swapaxes(1, 2) - np.eye(3)).max() > UNEVEN:
        return None
    mesh = placed[0].mesh
    stretched = mesh._replace(vertices=mesh.vertices @ stretch)
    return stretched, np.concatenate([places[:, :, 3], find_quaternions(turns)], axis=1)


def unpack_bodies(scene: Scene, arrays: Mapping[str, Array]) -> tuple[Scene, tuple[Knot, ...]]:
    """Return a scene with its bodies, and the knots, from `pack_bodies`; ValueError if damaged."""
    parameters, periods = json.loads(arrays[BODIES].tobytes()), arrays[KNOTS].tolist()
    if not periods or np.any(np.diff(periods) < 0):
        raise ValueError("its bodies must have times that do not decrease")
    path = scene.fingers[0].trajectory
    bodies = tuple(Presser(import_part(*BODY)(**each), path) for each in parameters)
    given = _unpack_given(arrays, len(periods), len(bodies), scene.cells)
    knots = zip(periods, zip(*given, strict=True), strict=True)
    return replace(scene, bodies=bodies), tuple(knots)


def _unpack_given(
    arrays: Mapping[str, Array], knots: int, bodies: int, cells: int
) -> list[list[Given]]:
    """Return each body at all knots."""
    if NUMBERS not in arrays:
        rows = _add_up(_read_numbers(arrays[PACKED], knots, bodies * cells).view("<i4"))
        return [list(under) for under in rows.reshape(knots, bodies, cells).swapaxes(0, 1)]
    numbers = _unpack(arrays[NUMBERS], knots * bodies, 1).reshape(bodies, knots)
    loose = int(np.count_nonzero(numbers == NONE))
    unders = iter(_unpack(arrays[PACKED], loose, cells))
    places = _unpack(arrays[PLACES], numbers.size - loose, 12).view("<f4").reshape(-1, 3, 4)
    if not np.isfinite(places).all():
        raise ValueError("its meshes must have finite places")
    meshes, matrices = _unpack_meshes(arrays), iter(places)
    return [
        [
            next(unders) if number == NONE else PlacedMesh(meshes[number], next(matrices))
            for number in row
        ]
        for row in numbers
    ]


def _unpack_meshes(arrays: Mapping[str, Array]) -> list[Mesh]:
    """Return the meshes of bodies."""
    sizes = arrays[SIZES].reshape(-1, 2)
    vertices = _unpack(arrays[VERTICES], int(sizes[:, 0].sum()), 3).view("<f4").astype(np.float64)
    triangles = _unpack(arrays[TRIANGLES], int(sizes[:, 1].sum()), 3)
    ends = np.cumsum(sizes, axis=0)
    starts = ends - sizes
    return [
        check_mesh(vertices[a:b], triangles[c:d])
        for (a, c), (b, d) in zip(starts.tolist(), ends.tolist(), strict=True)
    ]


def _pack(parts: Sequence[Array]) -> Array:
    """Return rows (k, m) of whole numbers of 32 bits as packed changes of the differences from row to row."""
    rows = np.concatenate(parts).astype("<i4") if parts else np.zeros((0, 1), "<i4")
    changes = np.diff(rows, n=2, axis=0, prepend=np.zeros((2, rows.shape[1]), "<i4"))
    # The sign last, then all lowest bytes, then all higher ones: those are 0.
    numbers = (changes << 1) ^ (changes >> 31)
    return np.frombuffer(zlib.compress(numbers.view(np.uint8).reshape(-1, 4).T.tobytes()), np.uint8)


def _unpack(packed: Array, count: int, width: int) -> NDArray[np.int32]:
    """Return rows (count, width) from `_pack`; ValueError if damaged."""
    numbers = _read_numbers(packed, count, width)
    changes = (numbers >> 1).view("<i4") ^ -(numbers & 1).view("<i4")
    return _add_up(_add_up(changes))


def _read_numbers(packed: Array, count: int, width: int) -> NDArray[np.uint32]:
    """Return packed numbers (count, width), all lowest bytes first; ValueError if damaged."""
    data = inflate(packed.tobytes(), 4 * count * width)
    numbers = np.frombuffer(data, np.uint8).reshape(4, -1).T.tobytes()
    return np.frombuffer(numbers, "<u4").reshape(count, width)


def _add_up(changes: Array) -> NDArray[np.int32]:
    """Return rows (k, m) from their differences."""
    return np.cumsum(changes, axis=0, dtype=np.int32)
