"""Trials of the tracking methods: fingertip paths, drags, and controllers made for another device."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.metrics.force import compute_rfd
from digiclay.core.model.set_point import find_set_point
from digiclay.core.model.trajectory import Path, Waypoint
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import run
from digiclay.core.studies.speed_limits import Drag, track
from numpy.typing import NDArray

__all__ = [
    "DRAGS",
    "Outcome",
    "Pose",
    "change_finger",
    "draw_drags",
    "follow_drag",
    "follow_path",
    "list_models",
    "list_paths",
    "run_mismatched",
    "with_path",
]  # fmt: skip

Floats = NDArray[np.float64]

#: Time, s; x, y and height above the bed at rest, mm; turn, pitch and roll of the fingertip, rad.
Pose = tuple[float, float, float, float, float, float, float]

#: Speeds of the ridge drags, m/s.
DRAGS = (15e-3, 25e-3, 40e-3)
#: Seed of the random drags.
SEED = 1


@dataclass(frozen=True)
class Outcome:
    """Result of a trial.

    Attributes
    ----------
    rfd : float
        N.
    losses : int
        While the fingertip was on the bed.
    lag : float
        Mean of the session, largest of a drag, m.
    largest : float
        Largest total force, N.
    unevenness : float or None
        Of the ridge left behind, m.
    """

    rfd: float
    losses: int
    lag: float
    largest: float
    unevenness: float | None


def with_path(scene: Scene, poses: Sequence[Pose], interpolation: str = "smooth") -> Scene:
    """Return a scene with a path of its fingertip, as long as that path.

    Parameters
    ----------
    scene : Scene
    poses : sequence of Pose
    interpolation : {"smooth", "linear"}
    """
    rest = scene.actuator.rest_height
    points = tuple(
        Waypoint(
            time=t,
            position=(1e-3 * x, 1e-3 * y, rest + 1e-3 * z),
            orientation=_turn(turn, pitch, roll),
        )
        for t, x, y, z, turn, pitch, roll in poses
    )
    path, timing = Path(interpolation, points), replace(scene.simulation, duration=poses[-1][0])
    return scene.with_sections(trajectory=path, simulation=timing)


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


def _lift(x: float, y: float, height: float, turn: Sequence[float] = (0.0, 0.0, 0.0)) -> list[Pose]:
    """Return a press of 3 mm in 0.8 s, then 5 mm/s to a height, mm, and a rest there."""
    up = 1.1 + max(abs(height + 3.0) / 5.0, 0.3) * 1.2
    ways = ((0.0, 1.5), (0.8, -3.0), (1.1, -3.0), (up, height), (up + 0.4, height))
    return [(t, x, y, z, *turn) for t, z in ways]  # type: ignore[misc]


def _drag(x: float, y: float, height: float, speed: float, hold: float = 0.5) -> list[Pose]:
    """Return a lift at (x, y), and a drag to the place opposite, mm and mm/s."""
    poses = _lift(x, y, height)
    start, way = poses[-1][0], (-x, y) if y < -20.0 else (-x, -y)
    end = start + math.dist((x, y), way) / speed
    return [*poses, *((t, *way, height, 0.0, 0.0, 0.0) for t in (end, end + hold))]


def list_paths() -> dict[str, tuple[str, list[Pose]]]:
    """Return the paths by name: interpolation and poses."""
    eight = _lift(0.0, 0.0, 8.0)
    for angle in np.linspace(0.0, 2.0 * math.pi, 81)[1:].tolist():
        time = eight[4][0] + 10.0 * angle / (2.0 * math.pi)
        eight.append((time, 20.0 * math.sin(angle), 12.0 * math.sin(2.0 * angle), 8.0, 0.0, 0.0, 0.0))
    twisted = _lift(-20.0, -5.0, 10.0)
    begun = twisted[-1][0]
    for share, turn, pitch, roll in (
        (0.25, 0.8, 0.0, 0.2),
        (0.5, 0.0, 0.25, 0.0),
        (0.75, -0.8, 0.0, -0.2),
        (1.0,) + 3 * (0.0,),
    ):
        y = -5.0 + 4.0 * math.sin(2.0 * math.pi * share)
        twisted.append((begun + 4.0 * share, -20.0 + 40.0 * share, y, 10.0, turn, pitch, roll))
    return {
        "figure eight": ("smooth", eight),
        "dead stop": ("linear", _drag(-18.0, 0.0, 12.0, 15.0, hold=1.0)),
        "edge of the bed": ("smooth", _drag(-25.0, -35.0, 8.0, 12.0)),
        "twisted fingertip": ("smooth", twisted),
    }


def draw_drags(count: int) -> list[tuple[str, list[Pose]]]:
    """Return random drags at 5 to 16 mm/s, 8 mm below to 15 mm above the bed, with a turned fingertip.

    Parameters
    ----------
    count : int
    """
    random, drags = np.random.default_rng(SEED), []
    for number in range(count):
        height, speed = random.uniform(-8.0, 15.0), random.uniform(5.0, 16.0)
        angle, length = random.uniform(0.0, 2.0 * math.pi), random.uniform(20.0, 36.0)
        (x, y), (dx, dy) = (
            random.uniform(-10.0, 10.0, 2),
            0.5 * length * np.array((math.cos(angle), math.sin(angle))),
        )
        first, last = (random.uniform((-1.0, -0.2, -0.2), (1.0, 0.2, 0.2)).tolist() for _ in range(2))
        poses = _lift(float(x - dx), float(y - dy), height, first)
        end = poses[-1][0] + length / speed
        poses += [(t, float(x + dx), float(y + dy), height, *last) for t in (end, end + 0.5)]
        drags.append(("smooth" if number % 2 else "linear", poses))
    return drags


def follow_path(scene: Scene) -> Outcome:
    """Return the result of a scene's session."""
    found = run(scene).metrics
    return Outcome(
        found["rfd"], found["losses"], found["lag_mean"], found["max_total_force"], found["ridge_unevenness"]
    )


def follow_drag(scene: Scene, speed: float, way: Drag | None = None) -> Outcome:
    """Return the result of a ridge drag with the device and method of a scene.

    Parameters
    ----------
    scene : Scene
    speed : float
        m/s.
    way : Drag, optional
        By default the ridge.
    """
    judged, done = track(scene, way or Drag(), speed)
    losses = judged.losses + (judged.loss_share > 0.0)
    metrics = done.metrics
    return Outcome(judged.rfd, losses, judged.lag, metrics["max_total_force"], metrics["ridge_unevenness"])


# Controllers made for another device


def change_finger(scene: Scene, part: str, **factors: float) -> Scene:
    """Return a scene with some numbers of a part of its finger times a factor.

    Parameters
    ----------
    scene : Scene
    part : {"fingertip", "contact", "relaxation"}
    **factors : float
    """
    known = scene.section(part)
    return scene.with_sections(
        **{part: replace(known, **{name: getattr(known, name) * by for name, by in factors.items()})}
    )


def list_models(true: Scene) -> dict[str, Scene]:
    """Return scenes that differ from the true one, for controllers made for them.

    Parameters
    ----------
    true : Scene
    """
    sizes = ("length", "width", "height")
    # The laminar flow goes with the fourth power of the diameter.
    valves = {
        f"valve × {share}": replace(
            true, valve=replace(true.valve, orifice_diameter=true.valve.orifice_diameter * share**0.25)
        )
        for share in (0.7, 1.3)
    }
    return {
        **valves,
        "pulp stiffness × 0.5": change_finger(true, "contact", stiffness=0.5),
        "pulp stiffness × 2": change_finger(true, "contact", stiffness=2.0),
        "exponent × 0.7": change_finger(true, "contact", exponent=0.7),
        "exponent × 1.4": change_finger(true, "contact", exponent=1.4),
        "fingertip × 0.75": change_finger(true, "fingertip", **dict.fromkeys(sizes, 0.75)),
        "fingertip × 1.3": change_finger(true, "fingertip", **dict.fromkeys(sizes, 1.3)),
    }


def run_mismatched(true: Scene, model: Scene) -> Outcome:
    """Return the result of a session whose controller is made for another device.

    Parameters
    ----------
    true : Scene
        The device, and the fingertip's path.
    model : Scene
        The device that the controller is made for.
    """
    system = replace(assemble(true), controller=assemble(model).controller)
    forces, losses = [], 0
    for state in periods(system, true.trajectories(), begin(system), true.periods):
        forces.append(float(state.active.all.force.sum()))
        losses = state.memory.losses
    total = np.array(forces)
    rfd = compute_rfd(np.arange(total.size) * system.period, total, find_set_point(true.set_point, total))
    return Outcome(rfd or 0.0, losses, math.nan, float(total.max()), None)
