"""Fingertip paths of trials: figure eight, dead stop, edge of the bed, twisted fingertip, random drags."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..model.trajectory import Path, Waypoint
from ..scene.schema import Scene

#: Time, s; x, y and height above the bed at rest, mm; turn, pitch and roll of the fingertip, rad.
Pose = tuple[float, float, float, float, float, float, float]

#: How far a fingertip is lifted at the end, m, in which time, and how long it then stays away, s.
AWAY, LIFTED, SETTLED = 40e-3, 0.3, 1.5
#: Seed of the random drags, and how far their fingertips are pitched and rolled, rad: 30 degrees in all.
DRAG_SEED, TILT = 1, 0.37


def with_path(scene: Scene, poses: Sequence[Pose], interpolation: str = "smooth") -> Scene:
    """Return a scene with a path of its fingertip, as long as that path."""
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


def lift_off(scene: Scene) -> Scene:
    """Return a scene that ends with a quick lift, and a rest in which pins come to their final heights."""
    fingers = tuple(
        replace(finger, trajectory=_lift_after(finger.trajectory, scene.actuator.rest_height))
        for finger in scene.fingers
    )
    lasting = max(finger.trajectory.waypoints[-1].time for finger in fingers)
    return replace(scene, fingers=fingers, simulation=replace(scene.simulation, duration=lasting))


def _lift_after(path: Path, rest: float) -> Path:
    """Return the path with a lift at its end, above the bed at rest, m."""
    last = path.waypoints[-1]
    away = (*last.position[:2], max(last.position[2], rest) + AWAY)
    end = last.time + LIFTED
    after = tuple(replace(last, time=t, position=away) for t in (end, end + SETTLED))
    return replace(path, waypoints=(*path.waypoints, *after))


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


def _drag(
    x: float,
    y: float,
    height: float,
    speed: float,
    hold: float = 0.5,
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> list[Pose]:
    """Return a lift at (x, y), and a drag along x to -x, mm and mm/s, with turn, pitch and roll, rad."""
    poses = _lift(x, y, height, turn)
    end = poses[-1][0] + abs(2.0 * x) / speed
    return [*poses, *((t, -x, y, height, *turn) for t in (end, end + hold))]


def drag_row(turn: float, pitch: float) -> list[Pose]:
    """Return a drag between two rows of pins, 15 mm/s, 1.5 mm below the surface, with turn and pitch, rad."""
    return _drag(-20.0, 1.5, -1.5, 15.0, turn=(turn, pitch, 0.0))


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
        "figure-eight": ("smooth", eight),
        "dead-stop": ("linear", _drag(-18.0, 0.0, 12.0, 15.0, hold=1.0)),
        "edge": ("smooth", _drag(-25.0, -35.0, 8.0, 12.0)),
        "twisted": ("smooth", twisted),
        "across": ("linear", drag_row(0.5 * math.pi, 0.0)),
    }


def draw_drags(count: int) -> list[tuple[str, list[Pose]]]:
    """Return random drags at 5 to 16 mm/s, 8 mm below to 15 mm above the bed, the fingertip turned."""
    random, drags = np.random.default_rng(DRAG_SEED), []
    for number in range(count):
        height, speed = random.uniform(-8.0, 15.0), random.uniform(5.0, 16.0)
        angle, length = random.uniform(0.0, 2.0 * math.pi), random.uniform(20.0, 36.0)
        (x, y), (dx, dy) = (
            random.uniform(-10.0, 10.0, 2),
            0.5 * length * np.array((math.cos(angle), math.sin(angle))),
        )
        facing, turned = random.uniform((-math.pi, -1.0), (math.pi, 1.0)).tolist()
        first, last = ((turn, *random.uniform(-TILT, TILT, 2).tolist()) for turn in (facing, facing + turned))
        poses = _lift(float(x - dx), float(y - dy), height, first)
        end = poses[-1][0] + length / speed
        poses += [(t, float(x + dx), float(y + dy), height, *last) for t in (end, end + 0.5)]
        drags.append(("smooth" if number % 2 else "linear", poses))
    return drags
