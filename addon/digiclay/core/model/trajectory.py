"""Fingertip path: waypoints with times, joined smoothly or by straight lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arrays import Floats
from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity
from ..base.spline import compute_inner_slopes
from .fingertip import LEVEL

#: Shortest time between waypoints, s, so that speeds are finite.
SHORTEST = 1e-9
#: Default path of the fingertip: one press in the middle of the bed, s, m above the rest height.
PRESS = ((0.0, 6e-3), (0.5, -4e-3), (1.0, -4e-3), (1.5, 6e-3))


@dataclass(frozen=True, eq=False, repr=False)
class Waypoint(Parameters):
    """Pose of the fingertip at one time."""

    time: float = quantity(0.0, "when", unit="s", at_least=0.0, at_most=1e6)
    position: tuple[float, ...] = quantity(
        (0.0, 0.0, 46e-3),
        "lowest point of the fingertip: x, y, z",
        unit="m",
        at_least=-100.0,
        at_most=100.0,
    )
    orientation: tuple[float, ...] = quantity(
        (1.0, 0.0, 0.0, 0.0), "quaternion w, x, y, z", at_least=-1e6, at_most=1e6
    )

    def check(self) -> None:
        """Refuse other than three coordinates and four parts of a quaternion."""
        for name, count in (("position", 3), ("orientation", 4)):
            value = getattr(self, name)
            if len(value) != count:
                rule = f"must be a list of {count} numbers"
                raise ParameterError("Waypoint", name, rule, f"{len(value)} of them")


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Waypoints of the fingertip's lowest point, with orientations.

    *smooth* joins them by monotone cubics (Fritsch and Carlson): velocity is continuous, and no
    coordinate overshoots a waypoint. *linear* joins them by straight lines. Before the first and
    after the last waypoint the fingertip rests. Raises ParameterError on values that are not
    finite, times that do not increase, or a quaternion of length 0.
    """

    times: Floats
    """(w,): Strictly increasing, s."""
    positions: Floats
    """(w, 3): m."""
    orientations: Floats
    """(w, 4): Quaternions w, x, y, z, normalized; between them the shortest arc holds."""
    interpolation: str = "smooth"

    def __post_init__(self) -> None:
        if self.interpolation not in ("smooth", "linear"):
            rule = "must be one of smooth, linear"
            raise ParameterError("Trajectory", "interpolation", rule, repr(self.interpolation))
        if self.times.size == 0:
            raise ParameterError(
                "Trajectory", "waypoints", "must have at least one waypoint", "none"
            )
        for name in ("times", "positions", "orientations"):
            bad = np.argwhere(~np.isfinite(getattr(self, name)))
            if bad.size:
                value = f"{getattr(self, name)[tuple(bad[0])]} at waypoint {bad[0][0] + 1}"
                raise ParameterError("Trajectory", name, "must be finite numbers", value)
        falls = np.flatnonzero(np.diff(self.times) < SHORTEST)
        if falls.size:
            at = int(falls[0])
            value = f"{self.times[at + 1]:g} s after {self.times[at]:g} s at waypoint {at + 2}"
            rule = "must increase from waypoint to waypoint"
            rule += f" by at least {SHORTEST:g} s" if self.times[at + 1] > self.times[at] else ""
            raise ParameterError("Trajectory", "times", rule, value)
        lengths = np.linalg.norm(self.orientations, axis=1)
        if not np.all(lengths > 1e-9):
            raise ParameterError(
                "Trajectory", "orientations", "must have a length above 0", "0, 0, 0, 0"
            )
        object.__setattr__(self, "orientations", self.orientations / lengths[:, None])

    @property
    def duration(self) -> float:
        """Time of the last waypoint, s."""
        return float(self.times[-1])

    def poses(self, times: Floats) -> Floats:
        """Return the fingertip's poses, shape (k, 7), at `times`, shape (k,), s."""
        poses = np.empty((times.size, 7))
        if self.times.size == 1:
            poses[:, :3], poses[:, 3:] = self.positions[0], self.orientations[0]
            return poses
        times = np.clip(times, self.times[0], self.times[-1])
        piece = np.clip(
            np.searchsorted(self.times, times, side="right") - 1, 0, self.times.size - 2
        )
        span = np.diff(self.times)[piece]
        part = ((times - self.times[piece]) / span)[:, None]
        start, end = self.positions[piece], self.positions[piece + 1]
        poses[:, :3] = start + (end - start) * part
        if self.interpolation == "smooth":
            slopes = compute_inner_slopes(np.diff(self.times), self.positions)
            first, last = slopes[piece] * span[:, None], slopes[piece + 1] * span[:, None]
            bend = part * (1.0 - part)
            poses[:, :3] += bend * (
                (1.0 - part) * (first - end + start) - part * (last - end + start)
            )
        poses[:, 3:] = _interpolate_turns(
            self.orientations[piece], self.orientations[piece + 1], part
        )
        return poses


@dataclass(frozen=True)
class Path:
    """The fingertip's path in a scene."""

    interpolation: str = "smooth"
    waypoints: tuple[Waypoint, ...] = ()

    @classmethod
    def press(cls, rest_height: float) -> Path:
        """Return the default path."""
        points = (Waypoint(time=t, position=(0.0, 0.0, rest_height + z)) for t, z in PRESS)
        return cls(waypoints=tuple(points))

    def trajectory(self) -> Trajectory:
        """Return the path as a trajectory, made once: many scenes may share a path."""
        return self._trajectory

    @cached_property
    def _trajectory(self) -> Trajectory:
        times, positions, turns = (
            np.array([getattr(point, name) for point in self.waypoints], dtype=np.float64)
            for name in ("time", "position", "orientation")
        )
        return Trajectory(times, positions, turns, self.interpolation)


def make_level(times: Floats, positions: Floats, interpolation: str = "smooth") -> Trajectory:
    """Return the trajectory of a level finger through positions (w, 3), m, at times (w,), s."""
    return Trajectory(times, positions, np.tile(LEVEL, (times.size, 1)), interpolation)


def sample_poses(trajectories: Sequence[Trajectory], times: Floats) -> Floats:
    """Return the poses of all f fingers at times (k,), s, shape (k, f, 7)."""
    return np.stack([trajectory.poses(times) for trajectory in trajectories], axis=1)


def interpolate_poses(path: Floats, parts: Floats) -> Floats:
    """Return poses (t, p, f, 7) at parts (p,) of the lines between rows of a path (t + 1, f, 7)."""
    start, end, part = path[:-1, None], path[1:, None], parts[:, None, None]
    poses: Floats = start + (end - start) * part
    poses[..., 3:] = _interpolate_turns(start[..., 3:], end[..., 3:], part)
    return poses


def _interpolate_turns(start: Floats, end: Floats, part: Floats) -> Floats:
    """Return unit quaternions (.., 4) at shares `part` (.., 1) of the shortest arc."""
    cosine = np.einsum("...j,...j->...", start, end)[..., None]
    if (np.abs(cosine) >= 1.0).all():  # no turn, the usual case
        return start / np.linalg.norm(start, axis=-1, keepdims=True)
    end = np.where(cosine < 0.0, -end, end)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    sine = np.sin(angle)
    small = sine < 1e-9
    divisor = np.where(small, 1.0, sine)
    turned = (np.sin((1.0 - part) * angle) * start + np.sin(part * angle) * end) / divisor
    turned = np.where(small, start, turned)
    return turned / np.linalg.norm(turned, axis=-1, keepdims=True)
