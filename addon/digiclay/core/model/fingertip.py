"""Fingertip ellipsoid: its underside over each cell.

Near its rim, a paraboloid that meets the ellipsoid with equal slope replaces it (see
`JOIN`). The slope of an ellipsoid is infinite at the rim, but a finger continues there, and
the force on a tall pin that the fingertip meets sideways must grow, not jump.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np

from ..base.arrays import Floats
from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity
from .layout import Discs

Item = TypeVar("Item")
#: Path of a fingertip in a period: center x, y and half its length, m; base, m, tilt and bend, 1/m,
#: of the paraboloid below it. Of b runs the rows of an array (6, b), or (6, 1) of one for all.
Window = tuple[float, float, float, float, float, float] | Floats

#: Squared reduced radius from which the paraboloid replaces the ellipsoid.
JOIN = 0.96
#: Orientation of a level finger (quaternion w, x, y, z).
LEVEL = (1.0, 0.0, 0.0, 0.0)

_ROOT = (1.0 - JOIN) ** 0.5
_SLOPE = 0.5 / _ROOT


def continue_ball(square: Floats) -> Floats:
    """Return the underside of a ball of radius 1 about 0, continued, at squared distances from its axis."""
    low = np.sqrt(np.maximum(1.0 - square, 1.0 - JOIN))
    return _SLOPE * np.maximum(square - JOIN, 0.0) - low


def require_one(fingers: Sequence[Item]) -> Item:
    """Return the item of the only finger, or raise ParameterError; see docs/architecture.md."""
    if len(fingers) != 1:
        rule = "must be one: this function is for a single finger"
        raise ParameterError("scene", "fingers", rule, str(len(fingers)))
    (only,) = fingers
    return only


@dataclass(frozen=True, eq=False, repr=False)
class Fingertip(Parameters):
    """Ellipsoid with semi-axes along the finger (local x), across it (y) and upwards (z)."""

    length: float = quantity(
        10e-3,
        "semi-axis along the fingertip: half its length",
        unit="m",
        symbol="a_x",
        source="C, Microsoft",
        above=0.0,
        whole="length of the fingertip",
    )
    width: float = quantity(
        8e-3,
        "semi-axis across the fingertip: half its width",
        unit="m",
        symbol="a_y",
        source="C, Microsoft",
        above=0.0,
        whole="width of the fingertip",
    )
    height: float = quantity(
        8e-3,
        "semi-axis upwards: half the height of the fingertip",
        unit="m",
        symbol="a_z",
        source="C, Microsoft",
        above=0.0,
        whole="height of the fingertip",
    )

    @property
    def flattest(self) -> float:
        """Largest radius of curvature, m."""
        axes = (self.length, self.width, self.height)
        return max(axes) ** 2 / min(axes)

    def outline(self, poses: Floats) -> Floats:
        """Return the parameters of the undersides at poses (k, 7), (k, 10).

        Center x, y, z, m; matrix of the squared reduced radius S_xx, S_xy, S_yy, 1/m²; tilt of the
        mid surface t_x, t_y; half thickness over the center, m; smaller eigenvalue of S, 1/m².
        """
        turns, outlines = poses[:, 3:], np.empty((len(poses), 10))
        if len(turns) and (turns == turns[0]).all():
            outlines[:] = _outline_turn(self, turns[0].tobytes())
        else:
            outlines[:] = self._outline_turns(turns)
        outlines[:, :3] += poses[:, :3]
        return outlines

    def _outline_turns(self, turns: Floats) -> Floats:
        """Return the outlines (k, 10) of a fingertip at the origin with unit quaternions (k, 4)."""
        rotation = make_matrices(turns)
        axes = np.array([self.length, self.width, self.height])
        inverse = np.einsum("kij,j,klj->kil", rotation, axes**2, rotation)
        form = np.einsum("kij,j,klj->kil", rotation, axes**-2.0, rotation)
        lowest = inverse[:, :, 2] / np.sqrt(inverse[:, 2, 2])[:, None]
        tilt = form[:, :2, 2] / form[:, 2, 2][:, None]
        schur = form[:, :2, :2] - tilt[:, :, None] * form[:, 2, None, :2]
        a, b, c = schur[:, 0, 0], schur[:, 0, 1], schur[:, 1, 1]
        larger = 0.5 * (a + c) + np.hypot(0.5 * (a - c), b)
        smaller = (a * c - b * b) / larger  # eigenvalue
        return np.column_stack([lowest, schur[:, 0], c, tilt, form[:, 2, 2] ** -0.5, smaller])


@lru_cache(64)
def _outline_turn(fingertip: Fingertip, turn: bytes) -> Floats:
    """Return the outline (1, 10) at the origin: most fingertips do not turn from period to period."""
    return fingertip._outline_turns(np.frombuffer(turn)[None])


def compute_reaches(outline: Floats) -> Floats:
    """Return the end of a `Window` for each outline (..., 10), (..., 3): base, m; tilt; bend, 1/m."""
    half, ends = outline[..., 8], np.empty((*outline.shape[:-1], 3))
    ends[..., 0] = outline[..., 2] - half * (_ROOT + _SLOPE * JOIN)
    ends[..., 1] = np.hypot(outline[..., 6], outline[..., 7])
    ends[..., 2] = 2.0 * _SLOPE * half * outline[..., 9]
    return ends


def compute_reach(window: Window, peak: Floats | float) -> Discs | None:
    """Return the disc, or that of each of b runs, outside which the underside is above `peak`, m.

    A paraboloid is below the underside at any tilt, also with the smallest base and bend of several
    poses.
    """
    x, y, spread, base, tilt, bend = window
    square = tilt * tilt + 2.0 * bend * (peak - base)
    if isinstance(square, float):
        return (x, y, (tilt + math.sqrt(square)) / bend + spread) if square > 0.0 else None
    radius = (tilt + np.sqrt(np.maximum(square, 0.0))) / bend + spread
    return x, y, np.where(square > 0.0, radius, -np.inf)


def compute_forms(outline: Floats) -> tuple[Floats, Floats]:
    """Return the quadratic forms of the position that `compute_underside` needs.

    With r² the squared reduced radius, t the half thickness over the center, and ``R = c (1 - r²) /
    (1 - JOIN)``, the underside is ``tangent + (sqrt(max(R, c)) - sqrt(c))²``: the tangent, a
    quadratic form, is the paraboloid from R = c on, and c is in m.

    For outlines (..., p, 10): `forms` (..., 2 p, 6), coefficients of 1, x, y, x², x y, y², p rows
    of R, then p rows of the tangent, m; `join` (..., 2, p, 1), c, m, and its root.
    """
    x, y, z, xx, xy, yy, tilt_x, tilt_y, half, _ = (outline[..., part] for part in range(10))
    count = outline.shape[-2]
    rows = np.zeros((*outline.shape[:-2], 2 * count, 6))
    inward, tangent = rows[..., :count, :], rows[..., count:, :]
    square = xx * x * x + 2.0 * xy * x * y + yy * y * y
    inward[..., 0] = 1.0 - square
    inward[..., 1] = 2.0 * (xx * x + xy * y)
    inward[..., 2] = 2.0 * (xy * x + yy * y)
    inward[..., 3], inward[..., 4], inward[..., 5] = -xx, -2.0 * xy, -yy
    tangent[..., 0] = z + tilt_x * x + tilt_y * y
    tangent[..., 1], tangent[..., 2] = -tilt_x, -tilt_y
    join = np.empty((*outline.shape[:-2], 2, count, 1))
    least = join[..., 0, :, :]
    np.multiply(0.5 * _ROOT, half[..., None], out=least)
    np.sqrt(least, out=join[..., 1, :, :])
    tangent -= (_SLOPE * half)[..., None] * inward
    tangent[..., 0] -= least[..., 0]
    inward *= least / (1.0 - JOIN)
    return rows, join


def compute_underside(forms: Floats, join: Floats, basis: Floats) -> Floats:
    """Return the undersides (..., p, k), m, at positions with rows 1, x, y, x², x y, y² (6, k)."""
    count = join.shape[-2]
    # Not one large product, so that the result of a pose does not depend on the others, bit for
    # bit.
    rows = np.matmul(forms, basis)
    return join_surfaces(
        rows[..., :count, :], rows[..., count:, :], join[..., 0, :, :], join[..., 1, :, :]
    )


def join_surfaces(inner: Floats, tangent: Floats, least: Floats, root: Floats) -> Floats:
    """Return ``tangent + (sqrt(max(inner, least)) - root)²``, m, in `inner`; see `compute_forms`."""
    np.maximum(inner, least, out=inner)
    np.sqrt(inner, inner)
    inner -= root
    inner *= inner
    inner += tangent
    return inner


def make_matrices(quaternions: Floats) -> Floats:
    """Return rotation matrices (k, 3, 3) of quaternions (k, 4), w first."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    matrices = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(matrices), 2, 0)


def find_quaternions(matrices: Floats) -> Floats:
    """Return unit quaternions (k, 4), w first, of rotation matrices (k, 3, 3)."""
    (a, b, c), (d, e, f), (g, h, i) = np.moveaxis(matrices, 0, 2)
    # Four times the products of each two of its parts.
    products = [
        [1 + a + e + i, h - f, c - g, d - b],
        [h - f, 1 + a - e - i, b + d, c + g],
        [c - g, b + d, 1 - a + e - i, f + h],
        [d - b, c + g, f + h, 1 - a - e + i],
    ]
    rows = np.moveaxis(np.array(products), 2, 0)
    largest = np.einsum("kii->ki", rows).argmax(axis=1)
    chosen: Floats = rows[np.arange(len(rows)), largest]
    return chosen / np.linalg.norm(chosen, axis=1, keepdims=True)
