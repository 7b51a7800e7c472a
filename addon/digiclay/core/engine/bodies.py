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
from functools import lru_cache
from itertools import product, repeat
from operator import itemgetter
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
from .system import System

#: Longest time between two computed undersides, s.
LONGEST = 0.1
#: Time, s, for which a set includes the cells that bodies are to touch.
AHEAD = 0.06
#: Largest speed of a smooth path, per mean speed between two waypoints.
FASTER = 1.5
#: Window of what no fingertip touches: its paraboloid is beyond all pins.
FAR = (0.0, 0.0, 0.0, 1e9, 0.0, 1.0)


#: Undersides of bodies at both ends of lines, (b, n), m, and the lower ends.
Lines = tuple[Floats, Floats, Floats]


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
        start, end, rows = self.start[bodies, cells], self.end[bodies, cells], np.atleast_1d(bodies)
        under: Floats = start + self.parts[rows].T * (end - start) + self.rise[rows].T
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
        shift = np.hypot(*np.diff(path.positions[:, :2], axis=0).T)
        cosine = np.abs((path.orientations[1:] * path.orientations[:-1]).sum(axis=1))
        turn = 2.0 * np.arccos(np.minimum(cosine, 1.0))
        speeds = (FASTER * shift + turn * radius) / np.diff(path.times)
        speed = float(speeds.max(initial=0.0))
        time = LONGEST if self.travel >= speed * LONGEST else self.travel / speed
        return max(1, math.floor(time / period + 1e-9))

    def rasterize(self, pose: Floats, grid: Grid, ceiling: float) -> Floats:
        """Return the underside at a pose (7,), (n,), m, at most the ceiling."""
        vertices = self.mesh.vertices @ make_matrices(pose[None, 3:])[0].T + pose[:3]
        tip, triangles = self.tip_radius, self.mesh.triangles
        under = rasterize(vertices, triangles, grid, self.samples, tip, ceiling)
        return np.minimum(under, ceiling)

    def measure_falls(self, times: Floats) -> Floats:
        """Return the largest fall of a corner of its box between successive times (t,), s, (t - 1,), m."""
        ends = zip(self.mesh.vertices.min(axis=0), self.mesh.vertices.max(axis=0), strict=True)
        poses, corners = self.trajectory.poses(times), np.array(list(product(*ends)))
        heights = make_matrices(poses[:, 3:])[:, 2] @ corners.T + poses[:, 2, None]
        return -np.diff(heights, axis=0).min(axis=1)


class TracedMesh:
    """Undersides of a mesh at every few control periods of its path; the last ones are remembered."""

    def __init__(self, body: MovedMesh, grid: Grid, period: float, ceiling: float) -> None:
        self.trajectory, self.stride = body.trajectory, body.count_periods(period)
        self._time = self.stride * period
        # Above its origin, what is no part of the body and stays above the ceiling.
        beyond = ceiling - float(body.trajectory.positions[:, 2].min())
        # By pose, since one that stands still has the same at any time.
        remember = lru_cache(int(4 + AHEAD / self._time))
        self._rasterize = remember(lambda pose: body.rasterize(np.frombuffer(pose), grid, beyond))

    def compute(self, number: int) -> tuple[Floats, float]:
        """Return the underside over its origin at a multiple of its periods, (n,), and that, m."""
        (pose,) = self.trajectory.poses(np.array([number * self._time]))
        height, pose[2] = float(pose[2]), 0.0
        return self._rasterize(pose.tobytes()), height


class PathUndersides:
    """Undersides of meshes along their paths, computed when they are needed."""

    def __init__(
        self, bodies: tuple[MovedMesh, ...], grid: Grid, instants: Floats, ceiling: float
    ) -> None:
        self._instants, self._period = instants, float(instants[-1])
        self.meshes = bodies
        self._bodies = [TracedMesh(body, grid, self._period, ceiling) for body in bodies]
        self._make_lines = lru_cache(1)(self._join_undersides)

    def find(self, period: int) -> Stretch:
        """Return the undersides in a period."""
        lines = self._make_lines(tuple(period // body.stride for body in self._bodies))
        strides = np.array([[body.stride] for body in self._bodies])
        parts = (period % strides + self._instants / self._period) / strides
        moments = period * self._period + self._instants
        rise = [body.trajectory.poses(moments)[:, 2] for body in self._bodies]
        return Stretch(*lines, parts, np.array(rise))

    def find_lowest(self, period: int) -> Floats:
        """Return the lowest undersides from a period on for the time `AHEAD`, (b, n), m."""
        lowest = []
        for body in self._bodies:
            last = math.ceil((period + AHEAD / self._period) / body.stride)
            each = map(body.compute, range(period // body.stride, last + 1))
            lowest.append(np.minimum.reduce([under + height for under, height in each]))
        return np.stack(lowest)

    def _join_undersides(self, numbers: tuple[int, ...]) -> Lines:
        """Return the lines from multiples of the bodies' periods to the next ones."""
        bodies = list(zip(self._bodies, numbers, strict=True))
        start = np.stack([body.compute(number)[0] for body, number in bodies])
        end = np.stack([body.compute(number + 1)[0] for body, number in bodies])
        return start, end, np.minimum(start, end)


#: Unit of given undersides, m: whole numbers of it are packed well, and all are exact.
UNIT = 2.0**-20


@dataclass(frozen=True, eq=False)
class PlacedMesh:
    """Mesh in axes of its own, and its place over a bed."""

    mesh: Mesh
    matrix: NDArray[np.float32]
    """(3, 4): From its axes to those of the bed, m."""

    @property
    def vertices(self) -> Floats:
        """Its vertices in the axes of the bed, (v, 3), m."""
        x, y, z = self.mesh.vertices.T
        # Not a product of matrices, whose last bits depend on the number of threads.
        rows = self.matrix.astype(np.float64)
        return np.stack([a * x + b * y + c * z + d for a, b, c, d in rows], axis=1)


#: Body at one time: its mesh and place, or its underside, (n,), in `UNIT`.
Given = PlacedMesh | NDArray[np.int32]
#: Number of a control period, and the bodies when it begins.
Knot = tuple[int, Sequence[Given]]


class GivenUndersides:
    """Undersides of bodies that others give at certain times: Blender, or a recording.

    Before the first and after the last of these times they stand still.
    """

    def __init__(
        self, ends: Sequence[tuple[int, float]], grid: Grid, instants: Floats, ceiling: float
    ) -> None:
        """`ends`: samples and radius of the pins' ends under each body; see `shapes.body.Body`."""
        self._ends, self._grid = ends, grid
        self._shares, self._ceiling = instants / instants[-1], ceiling
        self._knots: Sequence[Knot] = ()
        self._make_lines = lru_cache(1)(self._join_knots)
        self._remember = lru_cache(2 * len(ends))(self._rasterize)

    def give(self, knots: Sequence[Knot]) -> None:
        """Take other bodies, by ascending periods."""
        self._knots = knots
        self._make_lines.cache_clear()

    def measure(self, bodies: Sequence[Given]) -> list[NDArray[np.int32]]:
        """Return the undersides of bodies, (n,) each, in `UNIT`; the last are remembered."""
        return [
            self._remember(number, body) if isinstance(body, PlacedMesh) else body
            for number, body in enumerate(bodies)
        ]

    def condense(self, bodies: Sequence[Given], first: Sequence[Given]) -> tuple[Given, ...]:
        """Return bodies for a recording: those whose mesh is not the first one any more as undersides."""
        return tuple(
            body if _find_mesh(body) is _find_mesh(begun) else under
            for body, under, begun in zip(bodies, self.measure(bodies), first, strict=True)
        )

    def find(self, period: int) -> Stretch:
        """Return the undersides in a period."""
        at = max(bisect_right(self._knots, period, key=itemgetter(0)) - 1, 0)
        (first, bodies), (last, _) = self._knots[at], self._knots[at : at + 2][-1]
        part = ((period - first + self._shares) / max(last - first, 1)).clip(0.0, 1.0)
        parts = np.tile(part, (len(bodies), 1))
        return Stretch(*self._make_lines(at), parts, np.zeros_like(parts))

    def find_lowest(self, period: int) -> Floats:
        """Return the lowest undersides from this period to the next time, (b, n), m."""
        return self.find(period).low

    def _join_knots(self, at: int) -> Lines:
        """Return the lines from a time to the next one."""
        start, end = (
            np.stack(self.measure(bodies)) * UNIT
            for _, bodies in (self._knots[at], self._knots[at : at + 2][-1])
        )
        low = np.minimum(start, end)
        low[low >= self._ceiling - UNIT] = np.inf
        return start, end, low

    def _rasterize(self, number: int, body: PlacedMesh) -> NDArray[np.int32]:
        """Return the underside of a body, (n,), in `UNIT`."""
        ends, ceiling = self._ends[number], self._ceiling
        under = rasterize(body.vertices, body.mesh.triangles, self._grid, *ends, ceiling)
        return np.rint(np.minimum(under, ceiling) / UNIT).astype(np.int32)


def _find_mesh(body: Given) -> Mesh | None:
    """Return the mesh of a body; None: its underside is given."""
    return body.mesh if isinstance(body, PlacedMesh) else None


def find_given(system: System) -> GivenUndersides | None:
    """Return the undersides that a system expects to be given; None: it expects none."""
    undersides = system.undersides if isinstance(system, BodySystem) else None
    return undersides if isinstance(undersides, GivenUndersides) else None


def give_bodies(system: System, knots: Sequence[Knot]) -> None:
    """Give a system bodies, if it expects any."""
    given = find_given(system)
    if given:
        given.give(knots)


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
        present = active.under if state.period < active.until else None
        if present is not None and not any_true(near & ~present[-len(near) :]):
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
        stretch = finger.undersides.find(finger.number)
        if bodies[0] >= 0:
            return np.maximum(stretch.at(bodies, self._cells), height - self._caps[bodies])
        assert finger.hand is not None
        # A fingertip on a pin that a body presses is capped too.
        pressed = np.zeros(height.size, np.bool_)
        for body in range(len(self._caps)):
            pressed |= (stretch.at(body, self._cells) < height).any(axis=0)
        floor = np.where(pressed, height - self._caps.min(), -np.inf)
        return np.maximum(finger.hand.under(self.positions), floor)


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
        periods = []
        hands = trace_hands(self.hand, poses) if self.hand else repeat(None, len(poses))
        for number, hand in enumerate(hands, first):
            window = np.tile(np.array(FAR)[:, None], self.fingers)
            if hand:
                window[:, : poses.shape[2]] = hand.window
            periods.append(BodyPeriod(hand, self.undersides, number, window))
        return periods


def describe_falls(system: System, pressed: Flags) -> str:
    """Return which bodies of meshes fall by more than their caps while they press, or ``""``.

    `pressed` (t, b): whether a body presses at the end of each control period.
    """
    if not (isinstance(system, BodySystem) and isinstance(system.undersides, PathUndersides)):
        return ""
    times, said = np.arange(len(pressed) + 1) * system.period, []
    for number, mesh in enumerate(system.undersides.meshes):
        fall = mesh.measure_falls(times).max(where=pressed[:, number], initial=0.0)
        if fall > system.caps[number]:
            said.append(
                f"body {number + 1} falls by up to {fall * 1e3:.3g} mm in a control period, its cap is "
                f"{system.caps[number] * 1e3:.3g} mm: errors are larger than estimated"
            )
    return "; ".join(said)
