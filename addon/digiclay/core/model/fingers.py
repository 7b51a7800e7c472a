"""Several fingertips on one bed: their pulps, and their paths over it.

The pulp's memory belongs to a pair of fingertip and cell, so a cell has the filters of each finger, one after
the other. Where two fingertips meet over a cell, their forces add.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arrays import Floats
from .fingertip import Window
from .interfaces import Pulp
from .touch import FingerPath, Touch, trace_finger

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
class HandPeriod:
    """Fingertip paths in one control period."""

    paths: tuple[FingerPath, ...]
    number: int
    window: Window
    """(6, f)."""

    def under(self, finger: int, basis: Floats) -> Floats:
        """Return a finger's underside at the period's p instants over places (6, k), shape (p, k), m."""
        return self.paths[finger].under(self.number, basis)


def join_touches(touches: Sequence[Touch]) -> HandTouch:
    """Return the touch of several fingers."""
    first = touches[0]
    # A pulp of all fingers only ages; each finger's own is pressed.
    pulp: Pulp = HandPulp(tuple(touch.pulp for touch in touches))  # type: ignore[assignment]
    return HandTouch(first.fingertip, first.contact, pulp, tuple(touches))


def trace_hands(touch: HandTouch, poses: Floats) -> list[HandPeriod]:
    """Return the paths of f fingertips in each of t periods, of poses (t, p, f, 7)."""
    paths = tuple(trace_finger(own.fingertip, poses[:, :, i]) for i, own in enumerate(touch.each))
    windows = np.stack([np.array(path.windows) for path in paths], axis=-1)
    return [HandPeriod(paths, number, window) for number, window in enumerate(windows)]
