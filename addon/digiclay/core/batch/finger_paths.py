"""Fingertips of a batch: paths, undersides, and the cells below them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, apply_map
from ..engine.system import System
from ..model.fingertip import join_surfaces
from ..model.layout import Grid
from ..model.touch import trace_finger
from ..model.trajectory import Trajectory

#: Control periods that are worked out at a time.
CHUNK = 256


@dataclass(frozen=True, eq=False)
class Fingers:
    """Fingertip paths over t control periods, at p instants of each.

    The last axis is b, or 1 where all runs have one and the same finger; see `touch.FingerPeriod`.

    Attributes
    ----------
    first : int
        The first of these periods.
    forms : ndarray (t, 2 p, 6, b)
    join : ndarray (t, 2, p, 1, b)
    window : ndarray (t, 6, b)
    """

    first: int
    forms: Floats
    join: Floats
    window: Floats

    def at(self, period: int) -> FingersPeriod:
        """Return the fingers in one of these periods."""
        return FingersPeriod(self, period)


class FingersPeriod(NamedTuple):
    """The fingers in one control period of their paths; see `touch.FingerPeriod`."""

    coming: Fingers
    period: int

    @property
    def window(self) -> Floats:
        """Which cells the fingers may touch, shape (6, b) or (6, 1); see `touch.Window`."""
        window: Floats = self.coming.window[self.period - self.coming.first]
        return window

    def under(self, basis: Floats) -> Floats:
        """Return their undersides over some places (6, k, b), shape (p, k, b), m."""
        return compute_undersides(self.coming, self.period, basis)


def make_fingers(systems: Sequence[System], paths: Sequence[Trajectory], first: int, count: int) -> Fingers:
    """Work out how the fingers come.

    `systems`: with a fingertip; `paths`: each run's; `first`, `count`: control periods.
    """
    runs = list(zip(systems, paths, strict=True))
    alike = all(_same(run, runs[0]) for run in runs)
    known = [_trace_finger(system, path, first, count) for system, path in (runs[:1] if alike else runs)]
    return Fingers(first, *(np.stack(parts, axis=-1) for parts in zip(*known, strict=True)))


def extend_fingers(
    coming: Fingers | None, systems: Sequence[System], paths: Sequence[Trajectory], period: int
) -> Fingers | None:
    """Return how the fingers come in a period and some more: what is known, or worked out anew.

    `coming`: what is known.
    """
    if systems[0].cell.touch is None or (coming and period < coming.first + len(coming.forms)):
        return coming
    return make_fingers(systems, paths, period, CHUNK)


def _same(one: tuple[System, Trajectory], other: tuple[System, Trajectory]) -> bool:
    """Return whether two runs have the same finger at the same times."""
    (system, path), (first, its) = one, other
    assert system.cell.touch is not None
    assert first.cell.touch is not None
    return (
        system.cell.touch.fingertip == first.cell.touch.fingertip
        and path.interpolation == its.interpolation
        and system.period == first.period
        and np.array_equal(system.instants, first.instants)
        and all(
            np.array_equal(getattr(path, name), getattr(its, name))
            for name in ("times", "positions", "orientations")
        )
    )


def _trace_finger(system: System, path: Trajectory, first: int, count: int) -> tuple[Floats, ...]:
    """Work out how one finger comes: the arrays of `Fingers`, without their last axis."""
    assert system.cell.touch is not None
    starts = (first + np.arange(count)) * system.period
    poses = path.poses((starts[:, None] + system.instants).ravel()).reshape(count, -1, 7)
    coming = trace_finger(system.cell.touch.fingertip, poses)[0].coming
    return coming.forms, coming.join, np.array(coming.windows)


def compute_undersides(coming: Fingers, period: int, basis: Floats) -> Floats:
    """Return the undersides over some cells, shape (p, k, b), m; see `fingertip.compute_underside`.

    `period`: one of these; `basis` (6, k, b).
    """
    forms, (least, root) = coming.forms[period - coming.first], coming.join[period - coming.first]
    rows = apply_map(forms[..., 0] if forms.shape[-1] == 1 else forms, basis)
    return join_surfaces(rows[: len(least)], rows[len(least) :], least, root)


@dataclass(frozen=True, eq=False)
class SampledPath:
    """Fingertip path over a bed, at some times.

    Attributes
    ----------
    time : ndarray (t,)
        s.
    fingertip : ndarray (t, 7)
        Lowest point, m, and quaternion.
    cells : ndarray of int (m,)
        Those that are the nearest to it at some time, ascending.
    """

    time: Floats
    fingertip: Floats
    cells: NDArray[np.intp]


def make_path(grid: Grid, trajectory: Trajectory, time: Floats) -> SampledPath:
    """Compute a fingertip path at times (t,), s. `time` (t,), s."""
    tip = trajectory.poses(time)
    places = np.unique(tip[:, :2], axis=0)
    nearest = [np.argmin((grid.x - x) ** 2 + (grid.y - y) ** 2) for x, y in places]
    return SampledPath(time, tip, np.unique(nearest))
