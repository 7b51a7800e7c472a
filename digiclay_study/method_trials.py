"""Trials of control methods: trajectories by name, each run with sensor noise, and what is measured of it."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from digiclay.core.base.errors import ParameterError
from digiclay.core.base.quantity import find_nearest_name
from digiclay.core.files.tables import Record
from digiclay.core.metrics.metric_table import ERRORS, METHOD, METRICS, Metric
from digiclay.core.metrics.summary import compute_metrics, perceive
from digiclay.core.model.trajectory import Path, Waypoint
from digiclay.core.scene.recorder import Recorder
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import Result, run, select_rows
from digiclay.core.studies.nominal_relief import measure_relief
from digiclay.core.studies.speed_limits import (
    Criterion,
    Drag,
    Follows,
    Lift,
    find_largest_speed,
    find_unintended_losses,
    judge,
    make_trial,
)

#: Time, s; x, y and height above the bed at rest, mm; turn, pitch and roll of the fingertip, rad.
Pose = tuple[float, float, float, float, float, float, float]

#: Turn, pitch and roll, rad.
Turn = tuple[float, float, float]
#: Press from which on Method II shapes, mm.
FELT = 4.5
LEVEL: Turn = (0.0, 0.0, 0.0)
#: Interpolation, and the poses of each fingertip.
Drawn = tuple[Any, ...]
#: How far a fingertip is lifted at the end, m, in which time, and how long it then stays away, s.
AWAY, LIFTED, SETTLED = 40e-3, 0.3, 1.5
#: Seed of the random drags, and how far their fingertips are pitched and rolled, rad: 30 degrees in
#: all.
DRAG_SEED, TILT = 1, 0.37


def with_paths(scene: Scene, interpolation: str, *paths: Sequence[Pose]) -> Scene:
    """Return a scene with its first fingertip once on each of some paths, as long as they are."""
    rest = scene.actuator.rest_height
    ways = []
    for poses in paths:
        points = tuple(
            Waypoint(t, (1e-3 * x, 1e-3 * y, rest + 1e-3 * z), _turn(turn, pitch, roll))
            for t, x, y, z, turn, pitch, roll in poses
        )
        ways.append(Path(interpolation, points))
    return _follow(scene, ways)


def _follow(scene: Scene, paths: Sequence[Path]) -> Scene:
    """Return a scene with its first fingertip once on each of some paths, as long as they are."""
    timing = replace(scene.simulation, duration=max(path.waypoints[-1].time for path in paths))
    fingers = tuple(replace(scene.fingers[0], trajectory=path) for path in paths)
    return replace(scene, fingers=fingers, simulation=timing)


def lift_off(scene: Scene) -> Scene:
    """Return a scene that ends with a quick lift, and a rest in which pins come to their final heights."""
    paths = []
    for path in (finger.trajectory for finger in scene.fingers):
        last = path.waypoints[-1]
        away = (*last.position[:2], max(last.position[2], scene.actuator.rest_height) + AWAY)
        end = last.time + LIFTED
        after = tuple(replace(last, time=t, position=away) for t in (end, end + SETTLED))
        paths.append(replace(path, waypoints=(*path.waypoints, *after)))
    return _follow(scene, paths)


def _turn(turn: float, pitch: float, roll: float) -> tuple[float, float, float, float]:
    """Return the quaternion of a roll, then a pitch, then a turn, rad."""
    halves = [(math.cos(0.5 * angle), math.sin(0.5 * angle)) for angle in (turn, pitch, roll)]
    (ct, st), (cp, sp), (cr, sr) = halves
    return (
        cr * cp * ct + sr * sp * st,
        sr * cp * ct - cr * sp * st,
        cr * sp * ct + sr * cp * st,
        cr * cp * st - sr * sp * ct,
    )


def _lift(x: float, y: float, height: float, turn: Turn = LEVEL, press: float = 3.0) -> list[Pose]:
    """Return a press in 0.8 s, mm, then 5 mm/s to a height, mm, and a rest there."""
    up = 1.1 + max(abs(height + press) / 5.0, 0.3) * 1.2
    ways = ((0.0, 1.5), (0.8, -press), (1.1, -press), (up, height), (up + 0.4, height))
    return [(t, x, y, z, *turn) for t, z in ways]


def _drag(
    x: float,
    y: float,
    height: float,
    speed: float,
    hold: float = 0.5,
    turn: Turn = LEVEL,
    press: float = 3.0,
) -> list[Pose]:
    """Return a lift at (x, y), and a drag along x to -x, mm and mm/s, with turn, pitch and roll, rad."""
    poses = _lift(x, y, height, turn, press)
    end = poses[-1][0] + abs(2.0 * x) / speed
    return [*poses, *((t, -x, y, height, *turn) for t in (end, end + hold))]


def drag_row(turn: float, pitch: float) -> list[Pose]:
    """Return a drag between two rows of pins, 15 mm/s, 1.5 mm below the surface, with turn and pitch, rad."""
    return _drag(-20.0, 1.5, -1.5, 15.0, turn=(turn, pitch, 0.0))


def list_paths() -> dict[str, Drawn]:
    """Return the paths of one fingertip by name."""
    eight = _lift(0.0, 0.0, 8.0)
    for angle in np.linspace(0.0, 2.0 * math.pi, 81)[1:].tolist():
        time = eight[4][0] + 10.0 * angle / (2.0 * math.pi)
        eight.append(
            (time, 20.0 * math.sin(angle), 12.0 * math.sin(2.0 * angle), 8.0, 0.0, 0.0, 0.0)
        )
    twisted = _lift(-20.0, -5.0, 10.0)
    begun = twisted[-1][0]
    turns = ((0.8, 0.0, 0.2), (0.0, 0.25, 0.0), (-0.8, 0.0, -0.2), (0.0, 0.0, 0.0))
    for share, (turn, pitch, roll) in zip((0.25, 0.5, 0.75, 1.0), turns, strict=True):
        y = -5.0 + 4.0 * math.sin(2.0 * math.pi * share)
        twisted.append((begun + 4.0 * share, -20.0 + 40.0 * share, y, 10.0, turn, pitch, roll))
    return {
        "figure-eight": ("smooth", eight),
        "dead-stop": ("linear", _drag(-18.0, 0.0, 12.0, 15.0, hold=1.0)),
        "edge": ("smooth", _drag(-25.0, -35.0, 8.0, 12.0)),
        "twisted": ("smooth", twisted),
        "across": ("linear", drag_row(0.5 * math.pi, 0.0)),
    }


def list_hands() -> dict[str, Drawn]:
    """Return the paths of several fingertips by name."""
    pinch, five = [], []
    for y in (-1.0, 1.0):
        points = (
            (4.0, -18.0, 6.0 * y),
            (4.4, -18.0, 6.0 * y),
            (7.4, 18.0, 6.0 * y),
            (7.9, 18.0, 6.0 * y),
        )
        pinch.append(
            [*_lift(-18.0, 10.0 * y, 0.0, press=FELT), *((*at, 7.0, *LEVEL) for at in points)]
        )
    for start in np.linspace(0.0, 2.0 * math.pi, 6)[:-1].tolist():
        turned = [(0.0, 0.0), (5.5, 0.3), (7.0, 0.0), (8.5, -0.3), (10.0, 0.0)]
        arc = [
            (t, 16.0 * math.cos(start + angle), 16.0 * math.sin(start + angle))
            for t, angle in turned
        ]
        five.append([*_lift(*arc[0][1:], 7.0, press=FELT), *((*at, 7.0, *LEVEL) for at in arc[1:])])
    # The second one starts so much later that it passes 11 mm behind the first.
    along, later = _drag(-20.0, 0.0, 6.0, 12.0, press=FELT), 11.0 * math.sqrt(2.0) / 12.0
    wait = (0.0, *(0.0,) * 4, *(later,) * 3)
    repeated = zip([*along[:5], *along[4:]], wait, strict=True)
    across = [(pose[0] + more, 0.0, pose[1], pose[3], *LEVEL) for pose, more in repeated]
    return {
        "two-hands": (
            "smooth",
            _drag(-20.0, -12.0, 8.0, 12.0, press=FELT),
            _drag(20.0, 12.0, -8.0, 12.0, press=FELT),
        ),
        "pinch": ("smooth", *pinch),
        "crossing": ("linear", along, across),
        "five-fingers": ("smooth", *five),
    }


def draw_drags(count: int) -> list[Drawn]:
    """Return random drags at 5 to 16 mm/s, 8 mm below to 15 mm above the bed, the fingertip turned."""
    random, drags = np.random.default_rng(DRAG_SEED), []
    for number in range(count):
        height, speed = random.uniform(-8.0, 15.0), random.uniform(5.0, 16.0)
        angle, length = random.uniform(0.0, 2.0 * math.pi), random.uniform(20.0, 36.0)
        x, y = random.uniform(-10.0, 10.0, 2)
        dx, dy = 0.5 * length * np.array((math.cos(angle), math.sin(angle)))
        facing, turned = random.uniform((-math.pi, -1.0), (math.pi, 1.0)).tolist()
        first, last = (
            (turn, *random.uniform(-TILT, TILT, 2).tolist()) for turn in (facing, facing + turned)
        )
        poses = _lift(float(x - dx), float(y - dy), height, first)
        end = poses[-1][0] + length / speed
        poses += [(t, float(x + dx), float(y + dy), height, *last) for t in (end, end + 0.5)]
        drags.append(("smooth" if number % 2 else "linear", poses))
    return drags


Stopped = Callable[[], bool] | None
Measure = Callable[[Scene, Stopped], Record | None]

#: Groups of the random drags and of the paper's session.
RANDOM, SESSION = "random", "session"
#: Judged phases of drags and lifts: name, motion, speed, m/s.
PHASES: dict[str, tuple[Drag | Lift, float]] = {
    "ridge-15": (Drag(), 15e-3),
    "ridge-25": (Drag(), 25e-3),
    "ridge-40": (Drag(), 40e-3),
    "surface": (Drag(height=-1.5e-3), 15e-3),
    "valley": (Drag(height=-10e-3), 15e-3),
    "lift": (Lift(), 15e-3),
}
#: Motions whose largest speed is searched.
LIMITS: dict[str, Drag | Lift] = {"ridge-limit": Drag(), "lift-limit": Lift()}
#: Between which speeds, m/s.
LOW, HIGH = 5e-3, 80e-3
#: All trajectories, and those of a quick suite.
GROUPS = (SESSION, *list_paths(), *list_hands(), *PHASES, RANDOM, *LIMITS)
QUICK = ("ridge-25", "surface", "lift")

#: Metrics of a trial.
OUTCOMES: dict[str, Metric] = {
    name: {**METRICS, **METHOD, **ERRORS}[name]
    for name in (
        "set_point",
        "rfd",
        "rfd_jnd_least",
        "rfd_jnd_most",
        "lag_mean",
        "lag_max",
        "ridge_unevenness",
        "ridge_unevenness_touch",
        "relief_rms",
        "relief_largest",
        "max_total_force",
        "contact_loss_share",
        "losses",
        "speed_limit",
        "period_cost",
        *ERRORS,
    )
}


class _StoppedError(Exception):
    """Stop in the middle of a search."""


def read_groups(words: Sequence[str]) -> tuple[str, ...]:
    """Return trajectories in the order of `GROUPS`; an unknown one is refused."""
    if not words:
        raise ParameterError("--trajectories", "", "must name at least one trajectory", "none")
    for word in words:
        if word not in GROUPS:
            close = find_nearest_name(word, list(GROUPS))
            hint = f"Did you mean {close}?" if close else ""
            raise ParameterError(
                "--trajectories", "", f"must be among {', '.join(GROUPS)}", repr(word), hint
            )
    return tuple(group for group in GROUPS if group in words)


def list_trajectories(groups: Sequence[str], drags: int) -> list[str]:
    """Return the trajectories of `groups`, among `GROUPS`; the random drags are ``random-1`` to `drags`."""
    random = [f"{RANDOM}-{number}" for number in range(1, drags + 1)]
    return [name for group in groups for name in (random if group == RANDOM else [group])]


def place_trial(scene: Scene, trajectory: str, *, errors: bool = False) -> tuple[Scene, Measure]:
    """Return a scene with a trajectory, and what measures it, perhaps with estimates of its errors."""
    measure = partial(measure_trial, errors=errors)
    if trajectory in LIMITS:
        motion = LIMITS[trajectory]
        make_trial(scene, motion, HIGH)
        return scene, partial(search_limit, way=motion)
    if trajectory in PHASES:
        placed, start, end = make_trial(scene, *PHASES[trajectory])
        return lift_off(placed), partial(measure, phase=(start, end))
    recorded = replace(scene, recorder=Recorder())
    if trajectory == SESSION:
        return recorded, measure
    group, _, number = trajectory.partition("-")
    drawn = (
        draw_drags(int(number))[-1]
        if group == RANDOM
        else (list_paths() | list_hands())[trajectory]
    )
    return lift_off(with_paths(recorded, *drawn)), measure


def measure_trial(
    scene: Scene,
    stopped: Stopped = None,
    *,
    errors: bool = False,
    phase: tuple[float, float] | None = None,
) -> Record | None:
    """Run a trial, and return its record, perhaps with estimates of its errors; None after a stop."""
    begun = time.thread_time()
    done = run(scene, stopped=stopped)
    spent = time.thread_time() - begun
    estimated = done.estimate_errors(stopped=stopped) if errors else done
    if done.incomplete or estimated is None:
        return None
    figures = judge_trial(done, phase)
    figures |= {name: estimated.metrics.get(name) for name in ERRORS}
    figures["period_cost"] = spent / done.periods
    return {"figures": {name: figures.get(name) for name in OUTCOMES}}


def judge_trial(done: Result, phase: tuple[float, float] | None) -> Record:
    """Return the figures of a finished trial; of a drag or lift those of its phase: start, end, s."""
    figures = dict(done.figures)
    figures["losses"] = float(len(find_unintended_losses(done)))
    if phase is not None:
        judged, part = judge(done, *phase, 0.0), select_rows(done.history, *phase)
        metrics = compute_metrics(part, done.scene.set_point)
        figures |= {name: metrics[name] for name in ("lag_mean", "lag_max", "max_total_force")}
        figures |= {"rfd": metrics["rfd_session"], "losses": float(judged.losses)}
        figures["contact_loss_share"] = judged.loss_share
        figures |= perceive(figures["rfd"], figures["set_point"], figures["ridge_unevenness"])
    relief = measure_relief(done.scene, done.history, figures["ridge_offset"])
    return {**figures, "relief_rms": relief.rms, "relief_largest": relief.largest}


def search_limit(scene: Scene, stopped: Stopped = None, *, way: Drag | Lift) -> Record | None:
    """Search the largest speed at which a motion is followed, and return the record; None after a stop."""

    def check_stop(_: Follows) -> None:
        if stopped and stopped():
            raise _StoppedError

    try:
        speed = find_largest_speed(scene, way, Criterion(), low=LOW, high=HIGH, report=check_stop)
    except _StoppedError:
        return None
    return {"figures": {**dict.fromkeys(OUTCOMES), "speed_limit": speed}}
