"""Several fingertips on one bed: their pulps, and their paths over it.

The pulp's memory belongs to a pair of fingertip and cell, so a cell has the filters of each finger, one after
the other. Where two fingertips meet over a cell, their forces add.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..base.arrays import Floats
from .fingertip import Window
from .interfaces import Pulp
from .touch import Ahead, FingerPath, Touch, trace_finger

#: Fingers, and for each the basis of places, (6, k), see `FingerPath.under`.
Places = list[tuple[int, Floats]]
#: Most fingers of a scene.
MOST_FINGERS = 32


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


@dataclass(eq=False)
class HandPath:
    """Paths of f fingertips over t control periods."""

    paths: tuple[FingerPath, ...]
    windows: Floats
    """(t, 6, f)."""

    def __post_init__(self) -> None:
        self._ahead = Ahead()

    def under(self, number: int, bases: Places) -> Floats:
        """Return the undersides in a period over each finger's places, one after the other, (p, k), m."""
        cells = sum(basis.shape[1] for _, basis in bases)
        return self._ahead.find(number, bases, self.paths[0].join.shape[2] * cells, self._compute)

    def _compute(self, several: slice, bases: Places) -> Floats:
        """Return the undersides in several periods, (t, p, k), m."""
        parts = [self.paths[finger].compute(several, basis) for finger, basis in bases]
        return np.concatenate(parts, axis=2)


class HandPeriod(NamedTuple):
    """Fingertip paths in one control period."""

    path: HandPath
    number: int
    window: Window
    """(6, f)."""

    def under(self, bases: Places) -> Floats:
        """Return the undersides over each finger's places, one after the other, (p, k), m."""
        return self.path.under(self.number, bases)


def join_touches(touches: Sequence[Touch]) -> HandTouch:
    """Return the touch of several fingers."""
    first = touches[0]
    # A pulp of all fingers only ages; each finger's own is pressed.
    pulp: Pulp = HandPulp(tuple(touch.pulp for touch in touches))  # type: ignore[assignment]
    return HandTouch(first.fingertip, first.contact, pulp, tuple(touches))


def trace_hands(touch: HandTouch, poses: Floats) -> list[HandPeriod]:
    """Return the paths of f fingertips in each of t periods, of poses (t, p, f, 7)."""
    count, traced = len(poses), {}
    tips = [own.fingertip for own in touch.each]
    for tip in dict.fromkeys(tips):  # those of one shape at once: as periods after each other
        alike = [i for i, other in enumerate(tips) if other == tip]
        whole = trace_finger(tip, np.concatenate([poses[:, :, i] for i in alike]))
        for place, i in enumerate(alike):
            own = slice(place * count, place * count + count)
            traced[i] = FingerPath(0, whole.forms[own], whole.join[own], whole.windows[own])
    paths = tuple(traced[i] for i in range(len(tips)))
    windows = np.stack([np.array(path.windows) for path in paths], axis=-1)
    path = HandPath(paths, windows)
    return [HandPeriod(path, number, window) for number, window in enumerate(windows)]
