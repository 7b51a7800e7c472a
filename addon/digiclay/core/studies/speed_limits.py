"""Largest tracking speed of a control method: a straight drag or a lift, with a bisection on its speed."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity
from ..engine.simulation import Stopped
from ..files.tables import Record
from ..metrics.metric_table import SPEEDS
from ..metrics.summary import (
    compute_rfd,
    find_contact_ends,
    find_losses,
    measure_lag,
    split_fingers,
    sum_cells,
)
from ..model.control_interface import find_set_point
from ..model.trajectory import Path, Waypoint
from ..scene.recorder import Recorder
from ..scene.schema import Scene
from ..session.probes import free_speed
from ..session.run_scene import Result, run, select_rows

#: Rest of the fingertip at the ends of a phase, s.
REST = 0.3
#: Range of speeds in which the largest one is searched, m/s.
LOW, HIGH = 2e-3, 40e-3


@dataclass(frozen=True, eq=False, repr=False)
class Criterion(Parameters):
    """Criteria of tracking: no loss, contact in every row, small lag, small RFD."""

    lag: float = quantity(3e-3, "largest lag of the blister, a pitch", unit="m", above=0.0)
    deviation: float = quantity(
        0.2, "largest RFD, half of Method I's set point", unit="N", above=0.0
    )

    def __str__(self) -> str:
        return (
            "the fingertip is never lost and never without contact, its lag stays below "
            f"{self.lag * 1e3:g} mm, the RFD below {self.deviation:g} N"
        )


@dataclass(frozen=True)
class Follows:
    """Quality of tracking in the evaluated part of a trial."""

    #: m/s.
    speed: float
    #: Ends of contact in it or in the 0.3 s after, and 1 if contact was absent at its start.
    losses: int
    #: Share of the time without contact.
    loss_share: float
    #: Largest distance of the blister, m; infinite without contact.
    lag: float
    #: N, over all rows with a set point, also those without contact.
    rfd: float

    def meets(self, criterion: Criterion) -> bool:
        """Return whether the fingertip counts as followed."""
        in_contact = self.losses == 0 and self.loss_share == 0.0
        return in_contact and self.lag < criterion.lag and self.rfd < criterion.deviation


@dataclass(frozen=True, eq=False, repr=False)
class Drag(Parameters):
    """Press, raise or lower a blister, then drag it level and straight along x."""

    press: float = quantity(4.5e-3, "how deep the first press goes", unit="m", above=0.0)
    height: float = quantity(
        13.5e-3, "finger above the bed at rest while it drags; below 0: into it", unit="m"
    )
    approach: float = quantity(3e-3, "speed up or down to that height", unit="m/s", above=0.0)
    length: float = quantity(42e-3, "how far it drags", unit="m", above=0.0)

    def path(self, speed: float, rest: float) -> tuple[Path, float, float]:
        """Return the fingertip's path, and start and end of the drag, s, for a surface at `rest`, m."""
        right, down, level = 0.5 * self.length, rest - self.press, rest + self.height
        start = 1.3 + max(abs(level - down) / self.approach, REST) + REST
        end = start + self.length / speed
        points = (
            (0.0, -right, rest + 1e-3),
            (1.0, -right, down),
            (1.3, -right, down),
            (start - REST, -right, level),
            (start, -right, level),
            (end, right, level),
            (end + REST, right, level),
        )
        return _through(points, "linear"), start, end


@dataclass(frozen=True, eq=False, repr=False)
class Stroke(Drag):
    """Drag in any direction, anywhere on the bed."""

    speed: float = quantity(10e-3, "of the drag", unit="m/s", above=0.0)
    direction: float = quantity(
        0.0, "from the x axis to the y axis, degrees", at_least=-360.0, at_most=360.0
    )
    x: float = quantity(0.0, "middle of the drag", unit="m")
    y: float = quantity(0.0, "middle of the drag", unit="m")

    def path(self, speed: float, rest: float) -> tuple[Path, float, float]:
        """Return the fingertip's path, and start and end of the drag, s, for a surface at `rest`, m."""
        path, start, end = super().path(speed, rest)
        turn = math.radians(self.direction)
        turned = []
        for point in path.waypoints:
            along, _, height = point.position
            position = self.x + along * math.cos(turn), self.y + along * math.sin(turn), height
            turned.append(replace(point, position=position))
        return replace(path, waypoints=tuple(turned)), start, end


@dataclass(frozen=True, eq=False, repr=False)
class Lift(Parameters):
    """Press, then lift straight up with a gentle start and end; its speed is the largest in between."""

    press: float = quantity(4.5e-3, "how deep the first press goes", unit="m", above=0.0)
    rise: float = quantity(18e-3, "how far it lifts", unit="m", above=0.0)

    def path(self, speed: float, rest: float) -> tuple[Path, float, float]:
        """Return the fingertip's path, and start and end of the lift, s, for a surface at `rest`, m."""
        down, start = rest - self.press, 2.0
        # A cubic that starts and ends at rest is 1.5 times as fast in the middle as on average.
        end = start + 1.5 * self.rise / speed
        points = (
            (0.0, 0.0, rest + 1e-3),
            (1.0, 0.0, down),
            (start, 0.0, down),
            (end, 0.0, down + self.rise),
            (end + REST, 0.0, down + self.rise),
        )
        return _through(points, "smooth"), start, end


#: Motions of which the largest speeds are searched, by the names of these.
MOTIONS: dict[str, Drag | Lift] = dict(zip(SPEEDS, (Drag(), Lift()), strict=True))


def _through(points: tuple[tuple[float, float, float], ...], interpolation: str) -> Path:
    """Return a path through times, s, and x and z, m."""
    return Path(interpolation, tuple(Waypoint(time=t, position=(x, 0.0, z)) for t, x, z in points))


def track(scene: Scene, motion: Drag | Lift, speed: float) -> tuple[Follows, Result]:
    """Run a drag or a lift at a speed, m/s, with the device and method of a scene, and judge it."""
    trial, start, end = make_trial(scene, motion, speed)
    done = run(trial)
    return judge(done, start, end, speed), done


def make_trial(scene: Scene, motion: Drag | Lift, speed: float) -> tuple[Scene, float, float]:
    """Return a scene in which only the first fingertip drags or lifts, and the judged phase: start, end, s.

    Refuses a bed that the fingertip would leave.
    """
    path, start, end = motion.path(speed, scene.actuator.rest_height)
    layout = scene.layout
    sides = (layout.columns - 1) * layout.pitch, (layout.rows - 1) * layout.row_spacing
    places = np.abs([point.position[:2] for point in path.waypoints])
    for name, side, reach in zip(("columns", "rows"), sides, places.max(axis=0), strict=True):
        if isinstance(motion, Drag) and side < 2.0 * reach:
            rule = f"must make the bed at least as wide as the drag, {2.0 * reach:g} m"
            raise ParameterError("layout", name, rule, f"{side:g} m")
    shorter = replace(scene.simulation, duration=0.0)
    alone = replace(scene, fingers=scene.fingers[:1])
    return alone.with_sections(trajectory=path, simulation=shorter, recorder=Recorder()), start, end


def judge(done: Result, start: float, end: float, speed: float) -> Follows:
    """Judge a phase of a run at a speed, m/s, from `start` to `end`, s."""
    part = select_rows(done.history, start, end)
    sums, total = sum_cells(part), part["total_force"]
    ends = find_contact_ends(done.history["time"], done.history["total_force"])
    behind = measure_lag(sums, part["fingertip"])
    wanted = find_set_point(done.scene.set_point, sums.following)
    deviates = compute_rfd(part["time"], total, wanted, np.ones(len(total), dtype=bool))
    # A trial that begins without contact was lost before.
    losses = int(np.sum((ends > start) & (ends <= end + REST)) + (total[0] <= 0.0))
    lag = float(behind.max()) if len(behind) else math.inf
    rfd = math.inf if deviates is None else deviates
    return Follows(speed, losses, float(np.mean(total <= 0.0)), lag, rfd)


def bisect(
    holds: Callable[[float], bool], low: float, high: float, resolution: float
) -> float | None:
    """Return the largest value that holds, to within a resolution, by bisection; None: not even `low`."""
    if not holds(low):
        return None
    if holds(high):
        return high
    while high - low > resolution:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def find_largest_speed(
    scene: Scene,
    motion: Drag | Lift,
    criterion: Criterion,
    *,
    low: float = LOW,
    high: float = HIGH,
    resolution: float = 0.5e-3,
    report: Callable[[Follows], object] = lambda judged: None,
) -> float | None:
    """Return the largest speed, m/s, at which a fingertip is followed, by bisection; see `bisect`."""

    def holds(speed: float) -> bool:
        judged, _ = track(scene, motion, speed)
        report(judged)
        return judged.meets(criterion)

    return bisect(holds, low, high, resolution)


def measure_speeds(scene: Scene, stopped: Stopped = None) -> Record | None:
    """Return the `SPEEDS` of a scene, m/s, 0 if even the lowest is too fast; None after a stop."""
    speeds: dict[str, float] = {}
    for name, motion in MOTIONS.items():
        if stopped and stopped():
            return None
        speeds[name] = find_largest_speed(scene, motion, Criterion()) or 0.0
    return {"figures": speeds}


def describe_end(speed: float | None, low: float = LOW, high: float = HIGH) -> str:
    """Return the end of the range, mm/s, if the largest speed is beyond it; else ``""``."""
    if speed is None:
        return f"below {low * 1e3:g}"
    return f"at least {high * 1e3:g}" if speed >= high else ""


def find_free_speed(scene: Scene) -> float:
    """Return the speed of a pin without load that rises behind an open valve, m/s."""
    return float(free_speed(scene).rise)


def find_unintended_losses(done: Result) -> list[float]:
    """Return when contact of a fingertip ended, s, although it rose no faster than a pin can."""
    limit, moments = find_free_speed(done.scene), done.history["time"]
    starts: list[float] = []
    for part in split_fingers(done.history):
        losses = find_losses(moments, part["total_force"], part["fingertip"][:, 2], limit)
        starts += [loss.start for loss in losses]
    return starts
