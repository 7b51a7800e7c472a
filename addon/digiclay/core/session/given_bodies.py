"""Undersides of a take's bodies as arrays of its file: differences from time to time, packed."""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..base.arrays import Array
from ..files.formats import inflate
from ..model.laws import import_part
from ..scene.schema import BODY, Presser, Scene

if TYPE_CHECKING:
    from ..engine.bodies import Knot

#: Arrays: parameters of the bodies, as JSON, the periods of the knots, and their undersides.
UNDERSIDES = BODIES, KNOTS, PACKED = "bodies", "knots", "undersides"


def pack_bodies(scene: Scene, knots: tuple[Knot, ...]) -> dict[str, Array]:
    """Return the arrays of the bodies of a scene and their undersides; none without bodies."""
    if not scene.bodies:
        return {}
    parameters = json.dumps([vars(each.body) for each in scene.bodies])
    changes = np.diff([under for _, under in knots], axis=0, prepend=0)
    # All lowest bytes, then all higher ones: those repeat.
    packed = zlib.compress(changes.astype("<i4").view(np.uint8).reshape(-1, 4).T.tobytes())
    return {
        BODIES: np.frombuffer(parameters.encode(), np.uint8),
        KNOTS: np.array([period for period, _ in knots], np.int64),
        PACKED: np.frombuffer(packed, np.uint8),
    }


def unpack_bodies(scene: Scene, arrays: Mapping[str, Array]) -> tuple[Scene, tuple[Knot, ...]]:
    """Return a scene with its bodies, and their undersides, from `pack_bodies`; ValueError if damaged."""
    given, periods = json.loads(arrays[BODIES].tobytes()), arrays[KNOTS]
    if not len(periods) or np.any(np.diff(periods) < 0):
        raise ValueError("its undersides must have times that do not decrease")
    path = scene.fingers[0].trajectory
    bodies = tuple(Presser(import_part(*BODY)(**parameters), path) for parameters in given)
    shape = len(periods), len(bodies), scene.cells
    data = inflate(arrays[PACKED].tobytes(), 4 * math.prod(shape))
    changes = np.frombuffer(data, np.uint8).reshape(4, -1).T.tobytes()
    under = np.cumsum(np.frombuffer(changes, "<i4").reshape(shape), axis=0, dtype=np.int32)
    return replace(scene, bodies=bodies), tuple(zip(periods.tolist(), under, strict=True))
