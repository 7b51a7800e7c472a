"""Several fingertips on one bed: their pulps, and their paths over it.

The relaxation of the pulp belongs to a pair of fingertip and cell: a cell has the filters of each
finger, one after the other. The forces of fingertips over the same cell add.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..base.arrays import Cells, Flags, Floats
from .fingertip import Fingertip, Window, compute_underside
from .interfaces import Pulp
from .touch import Ahead, Touch, trace_periods

#: Most fingers of a scene.
MOST_FINGERS = 32


class Positions(NamedTuple):
    """Positions under g fingers, up to w each."""

    fingers: Cells
    basis: Floats
    """(g, 6, w): See `FingerPath.under`; of fewer positions the rest is arbitrary."""
    at: Cells
    """(k,): Which of all g w are positions, those of the first finger first."""


def gather_positions(inside: Flags, basis: Floats) -> Positions:
    """Return which positions with a basis (6, k) are `inside` the reach of each finger, (f, k), if any."""
    (fingers,) = inside.any(axis=1).nonzero()
    sizes = np.count_nonzero(inside[fingers], axis=1)
    present = np.arange(sizes.max(initial=0)) < sizes[:, None]
    cells = np.zeros(present.shape, np.intp)
    cells[present] = inside[fingers].nonzero()[1]
    of_fingers = np.ascontiguousarray(np.moveaxis(basis[:, cells], 0, 1))
    return Positions(fingers, of_fingers, np.flatnonzero(present))


@dataclass(frozen=True)
class HandPulp:
    """Relaxation of f pulps over a cell: rows of the first, then of the second, and so on."""

    pulps: tuple[Pulp, ...]

    @property
    def rows(self) -> int:
        """State rows per cell."""
        return sum(pulp.rows for pulp in self.pulps)

    @cached_property
    def rates(self) -> Floats:
        """Relaxation rates of all rows, (rows, 1), 1/s."""
        return np.concatenate([pulp.rates for pulp in self.pulps])

    def age(self, filters: Floats, time: Floats) -> None:
        """Let filters (rows, n) decay without contact for times (n,) or (rows, n), s, in place; exact."""
        filters *= np.exp(-self.rates * time)


@dataclass(frozen=True)
class HandTouch(Touch):
    """Touch of several fingers: fingertip and contact law of the first one, pulps of all."""

    each: tuple[Touch, ...]
    """One per finger."""

    @cached_property
    def shapes(self) -> list[tuple[Fingertip, list[int]]]:
        """The different fingertips, and which fingers have each."""
        tips = [touch.fingertip for touch in self.each]
        return [
            (tip, [i for i, other in enumerate(tips) if other == tip])
            for tip in dict.fromkeys(tips)
        ]


@dataclass(eq=False)
class HandPath:
    """Paths of f fingertips over t control periods, at p instants of each; see `touch.FingerPath`."""

    forms: Floats
    """(f, t, 2 p, 6)."""
    join: Floats
    """(f, t, 2, p, 1)."""
    windows: Floats
    """(t, 6, f)."""
    heights: Floats
    """(t, p, f): Intended heights of the lowest points, m."""

    def __post_init__(self) -> None:
        self._ahead = Ahead()

    def under(self, number: int, positions: Positions) -> Floats:
        """Return the undersides in a period at the positions of all fingers, (p, k), m."""
        return self._ahead.find(
            number, positions, self.join.shape[3] * positions.basis.size, self._compute
        )

    def _compute(self, several: slice, positions: Positions) -> Floats:
        """Return the undersides in several periods, (t, p, k), m."""
        forms, join = self.forms[positions.fingers, several], self.join[positions.fingers, several]
        under = compute_underside(forms, join, positions.basis[:, None]).transpose(1, 2, 0, 3)
        return under.reshape(*under.shape[:2], -1).take(positions.at, axis=2)


class HandPeriod(NamedTuple):
    """Fingertip paths in one control period."""

    path: HandPath
    number: int
    window: Window
    """(6, f)."""

    def under(self, positions: Positions) -> Floats:
        """Return the undersides at the positions of all fingers, (p, k), m."""
        return self.path.under(self.number, positions)

    @property
    def heights(self) -> Floats:
        """Intended heights at the period's instants, (p, f), m."""
        return self.path.heights[self.number]

    @staticmethod
    def spread(values: Floats, positions: Positions) -> Floats:
        """Return values (p, f) of the fingers for their positions, (p, k)."""
        return values[:, positions.fingers[positions.at // max(1, positions.basis.shape[2])]]


def join_touches(touches: Sequence[Touch]) -> HandTouch:
    """Return the touch of several fingers."""
    first = touches[0]
    # The joint pulp is only aged; the pulp of each finger is pressed.
    pulp: Pulp = HandPulp(tuple(touch.pulp for touch in touches))  # type: ignore[assignment]
    return HandTouch(first.fingertip, first.contact, pulp, tuple(touches))


def trace_hands(touch: HandTouch, poses: Floats) -> list[HandPeriod]:
    """Return the paths of f fingertips in each of t periods, of poses (t, p, f, 7)."""
    periods, instants, fingers, _ = poses.shape
    forms = np.empty((fingers, periods, 2 * instants, 6))
    join, windows = np.empty((fingers, periods, 2, instants, 1)), np.empty((fingers, periods, 6))
    for tip, alike in touch.shapes:  # fingers of one shape together, as periods in sequence
        traced = trace_periods(
            tip, poses[:, :, alike].transpose(2, 0, 1, 3).reshape(-1, instants, 7)
        )
        for rows, of_alike in zip((forms, join, windows), traced, strict=True):
            rows[alike] = of_alike.reshape(len(alike), *rows.shape[1:])
    windows = np.ascontiguousarray(windows.transpose(1, 2, 0))
    path = HandPath(forms, join, windows, poses[..., 2])
    return [HandPeriod(path, number, window) for number, window in enumerate(path.windows)]
