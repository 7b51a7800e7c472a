"""Engine of a bed under meshes, beside fingertips: pairs of body and cell, as of fingertips.

The underside of a mesh is computed at times some control periods apart, counted from the start of
the session. Between them it rises and falls with the mesh, and else is linear in time. So neither
chunks nor a stored state in mid-press change a result. A pin is indented by at most the cap, from its
height at the start of a control period: one that a body meets sideways slips under it, at a bounded
force.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Cells, Flags, Floats, any_true
from ..model.fingers import HandPeriod, HandTouch, trace_hands
from ..model.fingertip import make_matrices
from ..model.layout import Grid
from ..model.trajectory import Trajectory
from ..model.underside import Mesh, rasterize
from .pairs import HandSelection, HandSystem, Pairs
from .state import State

#: Longest time between two computed undersides, s.
LONGEST = 0.1
#: Time, s, for which a set includes the cells that bodies are to touch.
AHEAD = 0.06
#: Largest speed of a smooth path, per mean speed between two waypoints.
FASTER = 1.5
#: Window of what no fingertip touches: its paraboloid is beyond all pins.
FAR = (0.0, 0.0, 0.0, 1e9, 0.0, 1.0)


class Stretch(NamedTuple):
    """Undersides of bodies over all cells in a control period: lines in time, on bodies that rise."""

    start: Floats
    end: Floats
    low: Floats
    """(b, n): At the ends of the lines, m, and the lower ends."""
    parts: Floats
    rise: Floats
    """(b, p): Of the period's instants on these lines, 0 to 1; height of the bodies then, m."""

    def at(self, bodies: Cells | int, cells: Cells) -> Floats:
        """Return the undersides of bodies over cells (k,), (p, k), m."""
        start, end = self.start[bodies, cells], self.end[bodies, cells]
        parts, rise = (rows[bodies].T.reshape(rows.shape[1], -1) for rows in self[3:])
        under: Floats = start + parts * (end - start) + rise
        return under


class Undersides(Protocol):
    """Undersides of bodies over a bed, by the number of the control period."""

    def find(self, period: int) -> Stretch:
        """Return the undersides in a period."""

    def find_lowest(self, period: int) -> Floats:
        """Return the lowest undersides in this period and, as far as known, in later ones, (b, n), m."""


@dataclass(frozen=True, eq=False)
class MovedMesh:
    """Mesh along a path of its origin."""

    mesh: Mesh
    trajectory: Trajectory
    samples: int
    tip_radius: float
    travel: float
    """See `shapes.body.Body`."""

    def count_periods(self, period: float) -> int:
        """Return the number of control periods, s, between two computed undersides."""
        path, radius = self.trajectory, np.linalg.norm(self.mesh.vertices, axis=1).max()
        sideways = np.hypot(*np.diff(path.positions[:, :2], axis=0).T)
        cosine = np.abs((path.orientations[1:] * path.orientations[:-1]).sum(axis=1))
        way = FASTER * sideways + 2.0 * np.arccos(np.minimum(cosine, 1.0)) * radius
        speed = float((way / np.diff(path.times)).max(initial=0.0))
        time = LONGEST if self.travel >= speed * LONGEST else self.travel / speed
        return max(1, math.floor(time / period + 1e-9))


class PathUndersides:
    """Undersides of meshes along their paths, computed when they are needed."""

    def __init__(
        self, bodies: tuple[MovedMesh, ...], grid: Grid, instants: Floats, ceiling: float
    ) -> None:
        self._bodies, self._grid = bodies, grid
        self._period, self._instants = float(instants[-1]), instants
        self._strides = [body.count_periods(self._period) for body in bodies]
        # Above its origin, what is no part of a body and stays above the ceiling.
        self._beyond = [ceiling - float(body.trajectory.positions[:, 2].min()) for body in bodies]
        self._known: list[dict[bytes, Floats]] = [{} for _ in bodies]
        self._lines: tuple[list[int], tuple[Floats, Floats, Floats]] | None = None

    def find(self, period: int) -> Stretch:
        """Return the undersides in a period."""
        numbers = [period // stride for stride in self._strides]
        if self._lines is None or self._lines[0] != numbers:
            start, end = (
                np.stack([self._compute(body, at + more)[0] for body, at in enumerate(numbers)])
                for more in (0, 1)
            )
            self._lines = numbers, (start, end, np.minimum(start, end))
        strides = np.array(self._strides)[:, None]
        parts = (period % strides + self._instants / self._period) / strides
        moments = period * self._period + self._instants
        rise = [body.trajectory.poses(moments)[:, 2] for body in self._bodies]
        return Stretch(*self._lines[1], parts, np.array(rise))

    def find_lowest(self, period: int) -> Floats:
        """Return the lowest undersides from a period on for the time `AHEAD`, (b, n), m."""
        lowest = []
        for body, stride in enumerate(self._strides):
            last = math.ceil((period + AHEAD / self._period) / stride)
            each = [self._compute(body, at) for at in range(period // stride, last + 1)]
            lowest.append(np.minimum.reduce([under + height for under, height in each]))
        return np.stack(lowest)

    def _compute(self, number: int, at: int) -> tuple[Floats, float]:
        """Return the underside of a body at a multiple of its periods over its origin, (n,), and that, m."""
        body, time = self._bodies[number], self._strides[number] * self._period
        known, beyond = self._known[number], self._beyond[number]
        (pose,) = body.trajectory.poses(np.array([at * time]))
        height, pose[2] = float(pose[2]), 0.0
        under = known.pop(pose.tobytes(), None)
        if under is None:
            vertices = body.mesh.vertices @ make_matrices(pose[None, 3:])[0].T + pose[:3]
            triangles, tip = body.mesh.triangles, body.tip_radius
            under = rasterize(vertices, triangles, self._grid, body.samples, tip, beyond)
            np.minimum(under, beyond, out=under)
        known[pose.tobytes()] = under  # the last one used is the last one to go
        if len(known) > 4 + AHEAD / time:
            del known[next(iter(known))]
        return under, height


#: Unit of given undersides, m: whole numbers of it are packed well, and all are exact.
UNIT = 2.0**-20
#: Number of a control period, and the undersides when it begins, (b, n), in `UNIT`.
Knot = tuple[int, NDArray[np.int32]]


class GivenUndersides:
    """Undersides that others give at certain times, at most the ceiling: Blender, or a recording.

    Before the first and after the last of these times they stand still.
    """

    def __init__(self, instants: Floats, ceiling: float) -> None:
        self._shares, self._ceiling = instants / instants[-1], ceiling
        self._knots: Sequence[Knot] = ()
        self._periods: list[int] = []
        self._line: tuple[int, tuple[Floats, Floats, Floats]] | None = None

    def give(self, knots: Sequence[Knot]) -> None:
        """Take other undersides, by ascending periods."""
        self._knots, self._periods, self._line = knots, [period for period, _ in knots], None

    def find(self, period: int) -> Stretch:
        """Return the undersides in a period."""
        at = max(bisect_right(self._periods, period) - 1, 0)
        ends = self._knots[at : at + 2]
        if self._line is None or self._line[0] != at:
            start, end = ends[0][1] * UNIT, ends[-1][1] * UNIT
            low = np.minimum(start, end)
            low[low >= self._ceiling - UNIT] = np.inf
            self._line = at, (start, end, low)
        lasts = max(ends[-1][0] - ends[0][0], 1)
        part = ((period - ends[0][0] + self._shares) / lasts).clip(0.0, 1.0)
        parts = np.tile(part, (len(ends[0][1]), 1))
        return Stretch(*self._line[1], parts, np.zeros_like(parts))

    def find_lowest(self, period: int) -> Floats:
        """Return the lowest undersides from this period to the next time, (b, n), m."""
        return self.find(period).low


@dataclass(frozen=True, eq=False)
class BodyPeriod:
    """Fingertips and bodies in one control period."""

    hand: HandPeriod | None
    undersides: Undersides
    number: int
    window: Floats
    """(6, f): Of fingertips and bodies; see `FAR`."""

    def near(self, height: Floats) -> Flags:
        """Return which of all pins with heights (n,), m, the bodies touch, (b, n)."""
        stretch = self.undersides.find(self.number)
        return stretch.low + stretch.rise.min(axis=1, keepdims=True) <= height


@dataclass(frozen=True, eq=False)
class BodySelection(HandSelection):
    """Selection of the active cells of a bed under bodies: the cells below their undersides."""

    def update(self, state: State, finger: Any, control: Any) -> State:
        """Return a state, in the same arrays, whose active cells include all that can change in a period."""
        active, height = state.active, state.row(0)
        near = finger.near(height + float(self.period * self.fastest))
        known = active.under if state.period < active.until else None
        if known is not None and not any_true(near & ~known[-len(near) :]):
            return super().update(state, finger, control)
        under = np.zeros((self.rows.fingers, self.grid.count), np.bool_)
        under[-len(near) :] = near | (
            finger.undersides.find_lowest(state.period) <= height + self.rise
        )
        return self.renew(state, replace(active, under=under), finger.window, self.join(control))


class BodyPairs(Pairs):
    """Pairs of equal bodies, or of equal fingertips, and cells."""

    def __init__(self, system: BodySystem, active: Any, *given: Any) -> None:
        super().__init__(system, active, *given)
        self._cells, self._caps = active.cells[self.cells], system.caps
        self._bodies = self.fingers - system.fingers + len(system.caps)

    def find_under(self, finger: BodyPeriod) -> Floats:
        """Return the undersides over the pairs in a period, (p, k), m, not below the cap."""
        height, bodies = self.rows[0, : self.cells.size], self._bodies
        if bodies[0] >= 0:
            under = finger.undersides.find(finger.number).at(bodies, self._cells)
            return np.maximum(under, height - self._caps[bodies])
        assert finger.hand is not None
        under = finger.hand.under(self.positions)
        # A fingertip on a pin that a body presses is capped too.
        pressed, stretch = np.zeros(height.size, np.bool_), finger.undersides.find(finger.number)
        for body in range(len(self._caps)):
            pressed |= (stretch.at(body, self._cells) < height).any(axis=0)
        floor = np.where(pressed, height - self._caps.min(), -np.inf)
        return np.maximum(under, floor)


@dataclass(frozen=True, eq=False)
class BodySystem(HandSystem):
    """Constants of a session with bodies, behind its fingers, with or without fingertips."""

    hand: HandTouch | None
    """Of the fingertips; None: there are none."""
    undersides: Undersides
    caps: Floats
    """(b,): Largest indentation by each body, m."""

    @property
    def pairs(self) -> type[Pairs]:
        """Kind of the pairs."""
        return BodyPairs

    def trace(self, poses: Floats, first: int) -> list[Any]:
        """Return fingertips and bodies in each of t periods; see `System.trace`."""
        hands: list[HandPeriod | None] = [None] * len(poses)
        windows = np.tile(np.array(FAR)[:, None], (len(poses), 1, self.fingers))
        if self.hand:
            hands[:] = trace_hands(self.hand, poses)
            for window, hand in zip(windows, hands, strict=True):
                assert hand is not None
                window[:, : poses.shape[2]] = hand.window
        return [
            BodyPeriod(hand, self.undersides, first + number, window)
            for number, (hand, window) in enumerate(zip(hands, windows, strict=True))
        ]
