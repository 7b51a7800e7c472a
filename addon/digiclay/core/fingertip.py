"""The fingertip as an ellipsoid, seen from below: its underside over each cell.

Beyond nine tenths of the way to its rim the ellipsoid is continued by the paraboloid
that meets it with equal slope. The ellipsoid itself ends there with infinite slope; the
finger does not end there, and a tall pin that the finger runs into sideways must be met
by a force that grows, not by one that jumps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .quantity import Parameters, quantity

__all__ = ["LEVEL", "Fingertip", "forms", "matrices", "reach", "reaches", "underside"]

Floats = NDArray[np.float64]

#: Squared reduced radius at which the paraboloid takes over.
JOIN = 0.96
#: Orientation of a level finger (quaternion w, x, y, z).
LEVEL = (1.0, 0.0, 0.0, 0.0)

_ROOT = (1.0 - JOIN) ** 0.5
_SLOPE = 0.5 / _ROOT


@dataclass(frozen=True)
class Fingertip(Parameters):
    """Ellipsoid with semi-axes along the finger (local x), across it (y) and upwards (z)."""

    length: float = quantity(
        10e-3, "semi-axis along the finger", unit="m", symbol="a_x", source="S", above=0.0
    )
    width: float = quantity(
        8e-3, "semi-axis across the finger", unit="m", symbol="a_y", source="S", above=0.0
    )
    height: float = quantity(8e-3, "semi-axis upwards", unit="m", symbol="a_z", source="S", above=0.0)

    def outline(self, poses: Floats) -> Floats:
        """Work out, for each pose, what its underside needs.

        Parameters
        ----------
        poses : ndarray (k, 7)
            Position of the lowest point, m, and unit quaternion w, x, y, z.

        Returns
        -------
        ndarray (k, 10)
            Centre x, y, z, m; the matrix of the squared reduced radius S_xx, S_xy, S_yy, 1/m²;
            the tilt of the mid surface t_x, t_y; the half thickness over the centre, m; the
            smaller eigenvalue of S, 1/m².
        """
        rotation = matrices(poses[:, 3:])
        axes = np.array([self.length, self.width, self.height])
        inverse = np.einsum("kij,j,klj->kil", rotation, axes**2, rotation)
        form = np.einsum("kij,j,klj->kil", rotation, axes**-2.0, rotation)
        lowest = inverse[:, :, 2] / np.sqrt(inverse[:, 2, 2])[:, None]
        tilt = form[:, :2, 2] / form[:, 2, 2][:, None]
        schur = form[:, :2, :2] - tilt[:, :, None] * form[:, 2, None, :2]
        outline = np.empty((len(poses), 10))
        outline[:, :3] = poses[:, :3] + lowest
        outline[:, 3], outline[:, 4], outline[:, 5] = schur[:, 0, 0], schur[:, 0, 1], schur[:, 1, 1]
        outline[:, 6:8] = tilt
        outline[:, 8] = form[:, 2, 2] ** -0.5
        outline[:, 9] = np.linalg.eigvalsh(schur)[:, 0]
        return outline


def reaches(outline: Floats) -> Floats:
    """Return what `reach` needs of each outline (..., 10), shape (..., 3): base, m; tilt; bend, 1/m."""
    half = outline[..., 8]
    base = outline[..., 2] - half * (_ROOT + _SLOPE * JOIN)
    return np.stack(
        [base, np.hypot(outline[..., 6], outline[..., 7]), 2.0 * _SLOPE * half * outline[..., 9]], -1
    )


def reach(base: float, tilt: float, bend: float, peak: float) -> float:
    """Return a radius about the centre beyond which the underside is above `peak`, m.

    A paraboloid that nowhere lies above the underside gives a bound for every tilt; it
    stays one with the smallest base, the largest tilt and the smallest bend of several poses.

    Parameters
    ----------
    base, tilt, bend : float
        From `reaches`.
    peak : float
        No pin top is higher than this, m.

    Returns
    -------
    float
        Negative when the finger is wholly above `peak`.
    """
    square = tilt * tilt + 2.0 * bend * (peak - base)
    return (tilt + math.sqrt(square)) / bend if square > 0.0 else -1.0


def forms(outline: Floats) -> tuple[Floats, Floats]:
    """Return the ellipsoid's thickness and its mid surface as quadratic forms of the position.

    Parameters
    ----------
    outline : ndarray (..., 10)
        From `Fingertip.outline`.

    Returns
    -------
    inward : ndarray (..., 6)
        Coefficients of 1, x, y, x², x y, y² in 1 - r², r² the squared reduced radius.
    middle : ndarray (..., 6)
        Those of the height of the mid surface, m.
    """
    x, y, z, xx, xy, yy, tilt_x, tilt_y, _, _ = np.moveaxis(outline, -1, 0)
    zero = np.zeros_like(x)
    square = xx * x * x + 2.0 * xy * x * y + yy * y * y
    inward = [1.0 - square, 2.0 * (xx * x + xy * y), 2.0 * (xy * x + yy * y), -xx, -2.0 * xy, -yy]
    middle = [z + tilt_x * x + tilt_y * y, -tilt_x, -tilt_y, zero, zero, zero]
    return np.stack(inward, -1), np.stack(middle, -1)


def underside(inward: Floats, middle: Floats, half: Floats, place: Floats) -> Floats:
    """Return the height of the finger's underside, shape (p, k), m.

    Parameters
    ----------
    inward, middle : ndarray (p, 6)
        From `forms`.
    half : ndarray (p, 1)
        Half thickness over the centre, m.
    place : ndarray (6, k)
        Rows 1, x, y, x², x y, y² of the places asked for.
    """
    root: Floats = np.dot(inward, place)
    kept = np.maximum(root, 1.0 - JOIN)
    # Beyond the join the tangent: sqrt(kept) + (root - kept) / (2 sqrt(1 - JOIN)).
    root -= kept
    root *= _SLOPE
    root += np.sqrt(kept, kept)
    root *= half
    np.subtract(np.dot(middle, place), root, root)
    return root


def matrices(quaternions: Floats) -> Floats:
    """Return rotation matrices (k, 3, 3) of quaternions (k, 4), w first."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    return np.moveaxis(
        np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        ),
        2,
        0,
    )
