"""Contact: from the fingertip's pose to the force on each pin (equations 10 to 14), and the law's range."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Constants, Flags, Floats, apply_map
from .contact import ExponentialLaw
from .fingertip import (
    Fingertip,
    Window,
    compute_forms,
    compute_reaches,
    compute_underside,
    join_surfaces,
)
from .interfaces import Pulp

#: Control periods whose undersides are computed at a time, and most numbers of them.
AHEAD, MOST = 32, 200_000


@dataclass(frozen=True, eq=False)
class Touch:
    """Fingertip, contact law and relaxation of the pulp."""

    fingertip: Fingertip
    contact: ExponentialLaw
    pulp: Pulp

    @cached_property
    def constants(self) -> Constants:
        """Constants of `relax_force`: no force, and a cell's share of it."""
        return Constants((0.0, self.contact.share))


class Ahead:
    """Cache of the undersides in coming periods, at the last positions, which mostly stay the same."""

    def __init__(self) -> None:
        self._positions: Any = None
        self._first, self._unders = 0, np.empty((0, 0, 0))

    def find(
        self, index: int, positions: Any, numbers: int, compute: Callable[[slice, Any], Floats]
    ) -> Floats:
        """Return the undersides of a period, (p, k), m; `numbers`: their count p k."""
        if positions is not self._positions or not self._first <= index < self._first + len(
            self._unders
        ):
            count = max(1, min(AHEAD, MOST // max(1, numbers)))
            self._unders = compute(slice(index, index + count), positions)
            self._positions, self._first = positions, index
        return self._unders[index - self._first]


@dataclass(eq=False)
class FingerPath:
    """Fingertip path over t control periods, at p instants of each, of a run or of b runs."""

    first: int
    """The first of these periods."""
    forms: Floats
    """(t, 2 p, 6[, b]): From `fingertip.compute_forms`. The last axis is 1 if all runs have the same path."""
    join: Floats
    """(t, 2, p, 1[, b])."""
    windows: Any
    """(t, 6, b): One per period."""
    heights: Floats
    """(t, p[, b]): Intended heights of the lowest point, m."""

    def __post_init__(self) -> None:
        self._ahead = Ahead()

    def at(self, period: int) -> FingerPeriod:
        """Return the path in a period."""
        return FingerPeriod(self, period - self.first, self.windows[period - self.first])

    def under(self, index: int, basis: Floats) -> Floats:
        """Return the underside in the period of an index at positions (6, k[, b]), (p, k[, b]), m."""
        if basis.ndim == 3:
            forms, (least, root) = self.forms[index], self.join[index]
            rows = apply_map(forms[..., 0] if forms.shape[-1] == 1 else forms, basis)
            return join_surfaces(rows[: len(least)], rows[len(least) :], least, root)
        return self._ahead.find(index, basis, self.join.shape[2] * basis.shape[1], self.compute)

    def compute(self, several: slice, basis: Floats) -> Floats:
        """Return the undersides in several periods at positions (6, k), (t, p, k), m."""
        return compute_underside(self.forms[several], self.join[several], basis)


class FingerPeriod(NamedTuple):
    """Fingertip path in one control period, of a run or of b runs."""

    path: FingerPath
    number: int
    window: Window

    def under(self, basis: Floats) -> Floats:
        """Return the underside at the period's p instants at positions (6, k[, b]), (p, k[, b]), m."""
        return self.path.under(self.number, basis)

    @property
    def heights(self) -> Floats:
        """Intended heights at the period's p instants, (p, 1) or (p, b), m."""
        heights = self.path.heights[self.number]
        return heights.reshape(len(heights), -1)

    @staticmethod
    def spread(values: Floats, basis: Floats) -> Floats:
        """Return values (p, 1) or (p, b) of the fingers for positions (6, k[, b])."""
        return values if basis.ndim == 2 else values[:, None]


def trace_finger(fingertip: Fingertip, poses: Floats, first: int = 0) -> FingerPath:
    """Return the path of a fingertip with poses (t, p, 7) at the p instants of t periods."""
    forms, join, windows = trace_periods(fingertip, poses)
    return FingerPath(first, forms, join, windows.tolist(), poses[..., 2])


def trace_periods(fingertip: Fingertip, poses: Floats) -> tuple[Floats, Floats, Floats]:
    """Return forms and join of a `FingerPath`, and windows (t, 6), of poses (t, p, 7) in t periods."""
    count, instants, _ = poses.shape
    outline = fingertip.outline(poses.reshape(-1, 7)).reshape(count, instants, -1)
    # Instant by instant: numpy's own reduction over so short an axis takes ten times as long.
    centers, (bases, tilts, bends) = outline[:, :, :2].swapaxes(0, 1), compute_reaches(outline).T
    low, high = reduce(np.minimum, centers), reduce(np.maximum, centers)
    windows = np.empty((count, 6))
    windows[:, :2] = 0.5 * (low + high)
    windows[:, 2] = np.hypot(*(0.5 * (high - low)).T)
    ends = reduce(np.minimum, bases), reduce(np.maximum, tilts), reduce(np.minimum, bends)
    windows[:, 3:] = np.transpose(ends)
    return *compute_forms(outline), windows


def join_paths(paths: Sequence[FingerPath]) -> FingerPath:
    """Return the path of a batch from those of its runs, or from a single one that all have."""
    parts = zip(
        *((path.forms, path.join, np.array(path.windows), path.heights) for path in paths),
        strict=True,
    )
    return FingerPath(paths[0].first, *(np.stack(part, axis=-1) for part in parts))


def compute_force(touch: Touch, height: Floats, under: Floats, filters: Floats) -> Floats:
    """Return ``f_d max(T - Σ ĉ_i z_i, 0)``, N, of pin tops (k,), m, undersides (k,), m, and filters z_i."""
    return relax_force(touch, touch.contact.tension(height - under), filters)


def relax_force(touch: Touch, tension: Floats, filters: Floats) -> Floats:
    """Return the force, N, of tensions T (k,), N, and filters z_i, in the array of the tensions."""
    none, share = touch.constants[tension.shape]
    tension -= touch.pulp.relaxed(filters)
    np.maximum(tension, none, out=tension)
    tension *= share
    return tension


#: Largest total force at which the law and its relaxation were measured, N: Pawluk and Howe,
#: Dynamic contact of the human fingerpad against a flat surface, J Biomech Eng 121(6), 605-611
#: (1999): 0 to 2 N.
MOST_FORCE = 2.0
#: Largest measured indentation of fingerpads, m: Gulati and Srinivasan, Human fingerpad under
#: indentation I: static and dynamic force response (1995), 0.5 to 3 mm. The bone is below.
MOST_INDENTATION = 3e-3
#: Rows whose undersides are computed at a time.
ROWS = 64


def is_beyond(force: Floats | float, indentation: Floats | float) -> Flags | bool:
    """Return whether total forces, N, or indentations, m, exceed the range of the contact law."""
    return (force > MOST_FORCE) | (indentation > MOST_INDENTATION)


def find_indentations(fingertip: Fingertip, history: Mapping[str, Floats]) -> Floats:
    """Return the largest indentation in each row of a history, (t,), m; shallow rows may have 0."""
    felt, height = history["force"] > 0.0, history["height"]
    # The indentation of a pin is at most its height above the lowest point: few rows remain.
    most = np.max(height, axis=1, where=felt, initial=-np.inf) - history["fingertip"][:, 2]
    deepest_first, deepest = np.argsort(-most, kind="stable"), np.zeros(len(most))
    cells = np.flatnonzero(felt.any(axis=0))  # few of a large bed
    x, y = history["position"][cells].T
    basis = np.array([np.ones_like(x), x, y, x * x, x * y, y * y])
    for start in range(0, len(most), ROWS):
        rows = deepest_first[start : start + ROWS]
        if most[rows[0]] <= min(deepest.max(), MOST_INDENTATION):
            break
        outline = fingertip.outline(history["fingertip"][rows])
        under = compute_underside(*compute_forms(outline), basis)
        part = np.ix_(rows, cells)
        deepest[rows] = np.max(height[part] - under, axis=1, where=felt[part], initial=0.0)
    return deepest


def describe_excess(force: float | None, indentation: float | None) -> str:
    """Return the message on a total force, N, and indentation, m, beyond the law, or ""; None: unknown."""
    excess = []
    if force is not None and force > MOST_FORCE:
        excess.append(f"{force:.3g} N (fingers were measured up to {MOST_FORCE:g} N)")
    if indentation is not None and indentation > MOST_INDENTATION:
        excess.append(f"{indentation * 1e3:.3g} mm deep (up to {MOST_INDENTATION * 1e3:g} mm)")
    return f"the contact law does not hold: {', '.join(excess)}" if excess else ""
