"""From the finger's pose to the force on each pin (equations 10 to 14)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .contact import Contact
from .filled import filled
from .fingertip import Fingertip, forms, reach, reaches
from .places import Pulp
from .state import Disc

__all__ = ["Approach", "Touch", "Window", "approach", "force", "reached"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Touch:
    """Fingertip, contact law and relaxation of the pulp."""

    fingertip: Fingertip
    contact: Contact
    pulp: Pulp


#: Which cells the finger may touch in a period: centre of its way x, y and half the length
#: of it, m; then the arguments of `fingertip.reach`.
Window = tuple[float, float, float, float, float, float]


@dataclass(frozen=True, eq=False)
class Approach:
    """The finger in one control period, at p instants.

    Attributes
    ----------
    forms : ndarray (2 p, 6)
    join : ndarray (2, p, 1)
        From `fingertip.forms`.
    window : Window
    """

    forms: Floats
    join: Floats
    window: Window


def approach(fingertip: Fingertip, poses: Floats) -> list[Approach]:
    """Work out how the finger comes, for some control periods.

    Parameters
    ----------
    fingertip : Fingertip
    poses : ndarray (t, p, 7)
        Its poses at the p instants of t periods: position of the lowest point, m, quaternion.
    """
    count, instants, _ = poses.shape
    outline = fingertip.outline(poses.reshape(-1, 7)).reshape(count, instants, -1)
    low, high = outline[:, :, :2].min(axis=1), outline[:, :, :2].max(axis=1)
    spread = np.hypot(*(0.5 * (high - low)).T)
    shape = reaches(outline)
    farthest = [shape[:, :, 0].min(axis=1), shape[:, :, 1].max(axis=1), shape[:, :, 2].min(axis=1)]
    windows = np.column_stack([0.5 * (low + high), spread, *farthest]).tolist()
    return [
        Approach(rows, join, tuple(window))
        for rows, join, window in zip(*forms(outline), windows, strict=True)
    ]


def reached(window: Window, peak: float) -> Disc | None:
    """Return the disc x, y, radius that holds every cell the finger may touch in a period, m; None: no cell.

    Parameters
    ----------
    window : Window
    peak : float
        No pin top is higher than this, m.
    """
    x, y, spread, base, tilt, bend = window
    radius = reach(base, tilt, bend, peak)
    return (x, y, radius + spread) if radius >= 0.0 else None


def force(touch: Touch, height: Floats, under: Floats, filters: Floats) -> Floats:
    """Return the force on each cell, N, pressing down is positive.

    ``F = f_d max(T(x) - Σ ĉ_i z_i, 0)``: the pulp pushes but does not stick.

    Parameters
    ----------
    touch : Touch
    height : ndarray (k,)
        Pin tops H, m.
    under : ndarray (k,)
        Underside of the finger over them, m; x = H - underside.
    filters : ndarray (r, k)
        The relaxation's state rows z_i, N.
    """
    none, share = filled((0.0, touch.contact.share), height.size)
    tension = touch.contact.tension(height - under)
    tension -= touch.pulp.relaxed(filters)
    np.maximum(tension, none, out=tension)
    tension *= share
    return tension
