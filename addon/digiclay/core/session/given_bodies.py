"""Undersides of a take's bodies as arrays of its file: differences from knot to knot, packed."""

import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from ..base.arrays import Array
from ..model.laws import import_part
from ..scene.schema import BODY, Presser, Scene

if TYPE_CHECKING:
    from ..engine.bodies import Knot

#: Arrays: parameters of the bodies, as JSON, periods of the knots, bytes of each, and all bytes.
UNDERSIDES = BODIES, KNOTS, LENGTHS, PACKED = "bodies", "knots", "lengths", "packed"


def pack_bodies(scene: Scene, knots: Sequence["Knot"]) -> dict[str, Array]:
    """Return the arrays of the bodies of a scene and their undersides; none without bodies."""
    if not scene.bodies:
        return {}
    parameters = [vars(each.body) for each in scene.bodies]
    before, parts = np.zeros((), np.int32), []
    for _, under in knots:
        parts.append(zlib.compress((under - before).astype("<i4").tobytes(), 1))
        before = under
    return {
        BODIES: np.frombuffer(json.dumps(parameters).encode(), np.uint8),
        KNOTS: np.array([period for period, _ in knots], np.int64),
        LENGTHS: np.array([len(part) for part in parts], np.int64),
        PACKED: np.frombuffer(b"".join(parts), np.uint8),
    }


def unpack_bodies(scene: Scene, arrays: Mapping[str, Array]) -> tuple[Scene, tuple["Knot", ...]]:
    """Return a scene with its bodies, and their undersides, from `pack_bodies`; ValueError if damaged."""
    given = json.loads(arrays[BODIES].tobytes())
    path = scene.fingers[0].trajectory
    bodies = tuple(Presser(import_part(*BODY)(**parameters), path) for parameters in given)
    shape: tuple[int, ...] = (len(bodies), scene.cells)
    under, knots = np.zeros(shape, np.int32), []
    ends = list(accumulate(arrays[LENGTHS].tolist(), initial=0))
    for period, start, end in zip(arrays[KNOTS].tolist(), ends[:-1], ends[1:], strict=True):
        opened = zlib.decompressobj()
        data = opened.decompress(arrays[PACKED][start:end].tobytes(), 4 * shape[0] * shape[1] + 1)
        under = np.asarray(under + np.frombuffer(data, "<i4").reshape(shape), np.int32)
        knots.append((period, under))
    if not knots or np.any(np.diff(arrays[KNOTS]) < 0):
        raise ValueError("undersides must have times that do not decrease")
    return replace(scene, bodies=bodies), tuple(knots)
