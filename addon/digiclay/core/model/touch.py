"""Contact: from the fingertip's pose to the force on each pin (equations 10 to 14), and the law's range."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Constants, Floats
from .contact import ExponentialLaw
from .fingertip import Fingertip, compute_forms, compute_reach, compute_reaches, compute_underside
from .interfaces import Pulp
from .layout import Disc

#: Control periods whose undersides are worked out at a time, and most numbers that they may be.
AHEAD, MOST = 32, 200_000


@dataclass(frozen=True)
class Touch:
    """Fingertip, contact law and relaxation of the pulp."""

    fingertip: Fingertip
    contact: ExponentialLaw
    pulp: Pulp

    @cached_property
    def constants(self) -> Constants:
        """What `force` is made with: no force, and the share of it that a cell carries."""
        return Constants((0.0, self.contact.share))


#: Which cells the finger may touch in a period: center of its way x, y and half the length
#: of it, m; then the arguments of `fingertip.compute_reach`.
Window = tuple[float, float, float, float, float, float]


@dataclass(eq=False)
class FingerPath:
    """Fingertip path over t control periods, at p instants of each.

    Attributes
    ----------
    forms : ndarray (t, 2 p, 6)
    join : ndarray (t, 2, p, 1)
        From `fingertip.compute_forms`.
    windows : list of Window
        One a period.
    """

    forms: Floats
    join: Floats
    windows: list[Window]

    def __post_init__(self) -> None:
        # The undersides worked out last: of which places, from which period on.
        self._last: tuple[Floats | None, int, Floats] = (None, 0, np.empty((0, 0, 0)))

    def under(self, period: int, basis: Floats) -> Floats:
        """Return the underside in one of the periods, see `FingerPeriod.under`.

        It is asked for period by period, mostly of the same places: several are worked out at a time.

        `basis` (6, k), see `fingertip.compute_underside`.
        """
        known, first, unders = self._last
        if known is not basis or not first <= period < first + len(unders):
            # Not so many that a large bed under a large finger would not fit in memory.
            count = max(1, min(AHEAD, MOST // max(1, self.join.shape[2] * basis.shape[1])))
            several = slice(period, period + count)
            first, unders = period, compute_underside(self.forms[several], self.join[several], basis)
            self._last = (basis, first, unders)
        under: Floats = unders[period - first]
        return under


class FingerPeriod(NamedTuple):
    """Fingertip path in one control period."""

    coming: FingerPath
    period: int
    window: Window

    def under(self, basis: Floats) -> Floats:
        """Return its underside at the period's p instants over some places (6, k), shape (p, k), m."""
        return self.coming.under(self.period, basis)


def trace_finger(fingertip: Fingertip, poses: Floats) -> list[FingerPeriod]:
    """Work out how the finger comes, for some control periods.

    `poses` (t, p, 7), its poses at the p instants of t periods: position of the lowest point, m, quaternion.
    """
    count, instants, _ = poses.shape
    outline = fingertip.outline(poses.reshape(-1, 7)).reshape(count, instants, -1)
    low, high = outline[:, :, :2].min(axis=1), outline[:, :, :2].max(axis=1)
    spread = np.hypot(*(0.5 * (high - low)).T)
    shape = compute_reaches(outline)
    farthest = [shape[:, :, 0].min(axis=1), shape[:, :, 1].max(axis=1), shape[:, :, 2].min(axis=1)]
    windows = np.column_stack([0.5 * (low + high), spread, *farthest]).tolist()
    coming = FingerPath(*compute_forms(outline), [tuple(window) for window in windows])
    return [FingerPeriod(coming, period, window) for period, window in enumerate(coming.windows)]


def find_reached_disc(window: Window, peak: float) -> Disc | None:
    """Return the disc x, y, radius that holds every cell the finger may touch in a period, m; None: no cell.

    `peak`: no pin top is higher than this, m.
    """
    x, y, spread, base, tilt, bend = window
    radius = compute_reach(base, tilt, bend, peak)
    return (x, y, radius + spread) if radius >= 0.0 else None


def compute_force(touch: Touch, height: Floats, under: Floats, filters: Floats) -> Floats:
    """Return the force on each cell, N, pressing down is positive.

    ``F = f_d max(T(x) - Σ ĉ_i z_i, 0)``: the pulp pushes but does not stick.

    `height` (k,), pin tops H, m; `under` (k,), underside of the finger over them, m; x = H - underside;
    `filters` (r, k), the relaxation's state rows z_i, N.
    """
    none, share = touch.constants[height.shape]
    tension = touch.contact.tension(height - under)
    tension -= touch.pulp.relaxed(filters)
    np.maximum(tension, none, out=tension)
    tension *= share
    return tension


#: Total force up to which the law and its relaxation were measured, N: Pawluk and Howe, Dynamic contact of
#: the human fingerpad against a flat surface, J Biomech Eng 121(6), 605-611 (1999): 0 to 2 N.
MOST_FORCE = 2.0
#: Indentation up to which fingerpads were pressed in measurements, m: Gulati and Srinivasan, Human fingerpad
#: under indentation I: static and dynamic force response (1995), 0.5 to 3 mm. Below lies the bone.
MOST_INDENTATION = 3e-3
#: Rows whose undersides are worked out at a time.
ROWS = 64


def is_beyond(force: Any, indentation: Any) -> Any:
    """Return whether the contact law does not hold at total forces, N, and indentations, m, of any shape."""
    return (force > MOST_FORCE) | (indentation > MOST_INDENTATION)


def find_indentations(fingertip: Fingertip, history: Mapping[str, Floats]) -> Floats:
    """Return the largest indentation of a pin in contact in each row of a history, (t,), m.

    Rows that are neither the deepest nor deeper than `MOST_INDENTATION` may have 0 instead of theirs.
    """
    felt, height = history["force"] > 0.0, history["height"]
    # No pin stands deeper than it is above the lowest point: few rows are left to look at.
    most = np.max(height, axis=1, where=felt, initial=-np.inf) - history["fingertip"][:, 2]
    deepest_first, found = np.argsort(-most, kind="stable"), np.zeros(len(most))
    cells = np.flatnonzero(felt.any(axis=0))  # the only ones that are worked out: of a large bed they are few
    x, y = np.asarray(history["position"], dtype=np.float64)[cells].T
    basis = np.array([np.ones_like(x), x, y, x * x, x * y, y * y])
    for start in range(0, len(most), ROWS):
        rows = deepest_first[start : start + ROWS]
        if most[rows[0]] <= min(found.max(), MOST_INDENTATION):
            break
        under = compute_underside(
            *compute_forms(fingertip.outline(np.asarray(history["fingertip"])[rows])), basis
        )
        part = np.ix_(rows, cells)
        found[rows] = np.max(height[part] - under, axis=1, where=felt[part], initial=0.0)
    return found


def describe_excess(force: float | None, indentation: float | None) -> str:
    """Return the message on a total force, N, and indentation, m, beyond the law; None: not known; or ""."""
    said = []
    if force is not None and force > MOST_FORCE:
        said.append(f"{force:.3g} N (fingers were measured up to {MOST_FORCE:g} N)")
    if indentation is not None and indentation > MOST_INDENTATION:
        said.append(f"{indentation * 1e3:.3g} mm deep (up to {MOST_INDENTATION * 1e3:g} mm)")
    return f"the contact law does not hold: {', '.join(said)}" if said else ""
