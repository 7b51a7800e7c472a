"""Several fingertips on one bed: their pulps, and their paths over it.

The pulp's memory belongs to a pair of fingertip and cell, so a cell has the filters of each finger, one after
the other. Where two fingertips meet over a cell, their forces add.
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


class Places(NamedTuple):
    """Places under g fingers, which have up to w each."""

    fingers: Cells
    basis: Floats
    """(g, 6, w): See `FingerPath.under`; places that make up the number are any."""
    at: Cells
    """(k,): Which of all g w are places, those of the first finger first."""


def gather_places(inside: Flags, basis: Floats) -> Places:
    """Return which of places with a basis (6, k) are under each of the fingers that have any, (f, k)."""
    (fingers,) = inside.any(axis=1).nonzero()
    sizes = np.count_nonzero(inside[fingers], axis=1)
    present = np.arange(sizes.max(initial=0)) < sizes[:, None]
    cells = np.zeros(present.shape, np.intp)
    cells[present] = inside[fingers].nonzero()[1]
    return Places(fingers, np.ascontiguousarray(np.moveaxis(basis[:, cells], 0, 1)), np.flatnonzero(present))


@dataclass(frozen=True)
class HandPulp:
    """Relaxation of f pulps over a cell: rows of the first, then of the second, and so on."""

    pulps: tuple[Pulp, ...]

    @property
    def rows(self) -> int:
        """State rows a cell needs."""
        return sum(pulp.rows for pulp in self.pulps)

    @cached_property
    def rates(self) -> Floats:
        """Relaxation rates of all rows, (rows, 1), 1/s."""
        return np.concatenate([pulp.rates for pulp in self.pulps])

    def age(self, own: Floats, time: Floats) -> None:
        """Let filters (rows, n) decay without contact for times (n,) or (rows, n), s, in place; exact."""
        own *= np.exp(-self.rates * time)


@dataclass(frozen=True)
class HandTouch(Touch):
    """Touch of several fingers; fingertip and contact law are the first one's, the pulp is that of all."""

    each: tuple[Touch, ...]
    """Those of the fingers."""

    @cached_property
    def shapes(self) -> list[tuple[Fingertip, list[int]]]:
        """The shapes of the fingertips, and which fingers have each."""
        tips = [own.fingertip for own in self.each]
        return [(tip, [i for i, other in enumerate(tips) if other == tip]) for tip in dict.fromkeys(tips)]


@dataclass(eq=False)
class HandPath:
    """Paths of f fingertips over t control periods, at p instants of each; see `touch.FingerPath`."""

    forms: Floats
    """(f, t, 2 p, 6)."""
    join: Floats
    """(f, t, 2, p, 1)."""
    windows: Floats
    """(t, 6, f)."""

    def __post_init__(self) -> None:
        self._ahead = Ahead()

    def under(self, number: int, places: Places) -> Floats:
        """Return the undersides in a period over each finger's places, one after the other, (p, k), m."""
        return self._ahead.find(number, places, self.join.shape[3] * places.basis.size, self._compute)

    def _compute(self, several: slice, places: Places) -> Floats:
        """Return the undersides in several periods, (t, p, k), m."""
        own = self.forms[places.fingers, several], self.join[places.fingers, several]
        under = compute_underside(*own, places.basis[:, None]).transpose(1, 2, 0, 3)
        return under.reshape(*under.shape[:2], -1).take(places.at, axis=2)


class HandPeriod(NamedTuple):
    """Fingertip paths in one control period."""

    path: HandPath
    number: int
    window: Window
    """(6, f)."""

    def under(self, places: Places) -> Floats:
        """Return the undersides over each finger's places, one after the other, (p, k), m."""
        return self.path.under(self.number, places)


def join_touches(touches: Sequence[Touch]) -> HandTouch:
    """Return the touch of several fingers."""
    first = touches[0]
    # A pulp of all fingers only ages; each finger's own is pressed.
    pulp: Pulp = HandPulp(tuple(touch.pulp for touch in touches))  # type: ignore[assignment]
    return HandTouch(first.fingertip, first.contact, pulp, tuple(touches))


def trace_hands(touch: HandTouch, poses: Floats) -> list[HandPeriod]:
    """Return the paths of f fingertips in each of t periods, of poses (t, p, f, 7)."""
    periods, instants, fingers, _ = poses.shape
    forms = np.empty((fingers, periods, 2 * instants, 6))
    join, windows = np.empty((fingers, periods, 2, instants, 1)), np.empty((fingers, periods, 6))
    for tip, own in touch.shapes:  # those of one shape at once: as periods after each other
        traced = trace_periods(tip, poses[:, :, own].transpose(2, 0, 1, 3).reshape(-1, instants, 7))
        for rows, made in zip((forms, join, windows), traced, strict=True):
            rows[own] = made.reshape(len(own), *rows.shape[1:])
    path = HandPath(forms, join, np.ascontiguousarray(windows.transpose(1, 2, 0)))
    return [HandPeriod(path, number, window) for number, window in enumerate(path.windows)]
