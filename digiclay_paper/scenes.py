"""Short sessions of the paper's results."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np
from digiclay.core.files.tables import Record
from digiclay.core.model.trajectory import Path
from digiclay.core.scene.schema import Scene
from digiclay.core.scene.toml_table import resolve
from digiclay.core.studies.speed_limits import find_free_speed

METHODS = ("virtual_master", "cell_states")
#: The method that the paper asks for in its conclusion, and all that figures compare.
THIRD = "hybrid"
COMPARED = (*METHODS, THIRD)
NAMES = {
    "virtual_master": "Method I, virtual master",
    "cell_states": "Method II, cell states",
    THIRD: "Method III, hybrid",
}
#: Finger over the bed at rest: for a blister 15 mm high (the pins press 1.5 mm into it), and in a
#: valley, m.
TALL, SINK = 13.5e-3, -10e-3
#: How deep the first press goes: less never reaches the trigger, because the pulp relaxes, m.
PRESS = 4.5e-3
#: Speeds of the slow lifts, m/s, and of the quick press that starts an oscillation, m/s.
GENTLY, QUICKLY = 4e-3, 25e-3
#: How far that quick press goes, m.
PRESSED = 2e-3
Device = Mapping[str, Mapping[str, float]]
#: A device whose pins are more than twice as fast, with slower valves and a longer dead time.
QUICKER: Device = {
    "valve": {"stroke": 20e-6},
    "fluid": {"viscosity": 1e-6},
    "valve_lag": {"time_constant": 5e-3},
    "delay": {"dead_time": 2e-3},
}


def blister(method: str, height: float, profile: str) -> Scene:
    """Return a scene that presses, and raises or sinks a blister with a profile to `height`, m.

    `height`: of the fingertip's lowest point over the bed at rest while it holds, m.
    """
    table = _table(method, 17, {}, {"profile": profile})
    there = 1.7 + abs(height + PRESS) / GENTLY
    points = [(0.0, 1e-3), (1.3, -PRESS), (1.7, -PRESS), (there, height), (there + 0.6, height)]
    return _with_path(resolve(table), points)


def held(
    gain: float, position_gain: float, device: Device | None = None, method: str = "virtual_master"
) -> tuple[Scene, float]:
    """Return a scene that shapes, is pressed quickly by `PRESSED` and held; and when, s.

    `gain`, `position_gain`: K_f of Method I or K_FF of Method II, 1/N, and K_p, 1/m; `device`:
    sections of the scene that are not the default ones, such as `QUICKER`.
    """
    size = PRESSED
    quick = 2.2 + size / QUICKLY
    points = [
        (0.0, 2e-3), (1.2, -4.0e-3), (1.6, -3.5e-3), (2.2, -3.5e-3), (quick, -3.5e-3 - size),
        (quick + 2.4, -3.5e-3 - size),
    ]  # fmt: skip
    gains = {"force_gain": gain, "position_gain": position_gain}
    table = _table(method, 13, gains, {}) | dict(device or {})
    return _with_path(resolve(table), points), quick


def at_rest(noise: float, radius: float | None = None) -> Scene:
    """Return a scene of Method I that presses and holds still, with noisy force sensors.

    `noise`: standard deviation of a cell's force sensor, N; `radius`: r_VM, m.
    """
    blister = {} if radius is None else {"radius": radius}
    table = _table("virtual_master", 13, blister, {}) | {"sensors": {"force_noise": noise}}
    return _with_path(resolve(table), [(0.0, 2e-3), (1.2, -4e-3), (3.2, -4e-3)])


def _table(
    method: str, side: int, control: Mapping[str, float | str], form: Mapping[str, float | str]
) -> Record:
    return {
        "layout": {"rows": side, "columns": side},
        "control": {"method": method, **control},
        "blister": dict(form),
    }


def _with_path(scene: Scene, points: list[tuple[float, float]]) -> Scene:
    """Return a scene with another path."""
    rest, first = scene.actuator.rest_height, scene.section("trajectory").waypoints[0]
    way = tuple(replace(first, time=t, position=(0.0, 0.0, rest + z)) for t, z in points)
    lasting = replace(scene.simulation, duration=0.0)
    return scene.with_sections(trajectory=Path("smooth", way), simulation=lasting)


def slowed(session: Scene, factor: float) -> Scene:
    """Return a session that takes `factor` times as long."""
    path = session.section("trajectory")
    way = tuple(replace(point, time=factor * point.time) for point in path.waypoints)
    lasting = replace(session.simulation, duration=0.0)
    return session.with_sections(trajectory=replace(path, waypoints=way), simulation=lasting)


def fastest_lift(session: Scene) -> float:
    """Return the greatest speed upward on the ways a pin could follow on the whole, m/s."""
    path, limit, highest = session.section("trajectory"), find_free_speed(session), 0.0
    way = path.trajectory()
    for start, end in pairwise(path.waypoints):
        span = end.time - start.time
        if (end.position[2] - start.position[2]) / span < limit:
            moments = np.linspace(start.time, end.time, 201)
            highest = max(highest, float(np.diff(way.poses(moments)[:, 2]).max()) * 200.0 / span)
    return highest
