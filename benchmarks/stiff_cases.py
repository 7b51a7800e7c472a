"""Stiff and extreme cases: changes to an easy press on a small bed."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from digiclay.core.scene.schema import Scene
from digiclay.core.scene.toml_table import resolve

Table = Mapping[str, Any]

#: Commands are recorded at this control period and held through it, s: all steps divide it, so that
#: every run is the same problem.
HOLD = 0.1
#: Simulated time, s.
DURATION = 0.5


@dataclass(frozen=True)
class Case:
    """A case.

    Attributes
    ----------
    changes : mapping
        Sections of a scene file.
    path : tuple of (float, float, float)
        Waypoints: time, s; x, m; height over the bed at rest, m.
    why : str
        What makes it ill-conditioned: a rounding error of its data already moves its solution, or the
        path is no function of time that a step could resolve. Empty where the error must fall with the step.
    straight : bool
        The waypoints are joined by straight lines.
    borrowed, factor : bool, float
        The recorded commands are those of the easy case, because this case's own controller sees no need
        to act; and what they are multiplied with.
    """

    changes: Table = field(default_factory=dict)
    path: tuple[tuple[float, float, float], ...] = (
        (0.0, 0.0, 0.5e-3), (0.15, 0.0, -2.5e-3), (0.25, 1e-3, -2.5e-3), (0.4, 3e-3, 1.5e-3),
        (0.5, 3e-3, 3e-3),
    )  # fmt: skip
    why: str = ""
    straight: bool = False
    borrowed: bool = False
    factor: float = 1.0


#: A press with a finger that then rises, dragged a little; everything at its default.
EASY = "easy"
#: Everything at once.
ALL = "all together"
SHALLOW = ((0.0, 0.0, 0.5e-3), (0.15, 0.0, -0.4e-3), (0.25, 1e-3, -0.4e-3), (0.4, 3e-3, 1.5e-3))
DEEP = ((0.0, 0.0, 1e-3), (0.12, 0.0, 1e-3), (0.16, 0.0, -15e-3), (0.3, 1e-3, -15e-3), (0.5, 3e-3, 3e-3))
JUMP = ((0.0, 0.0, 48e-3), (0.1995, 0.0, 48e-3), (0.2, 0.0, -2e-3), (0.35, 0.0, -2e-3), (0.5, 3e-3, 3e-3))
THROUGH = ((0.0, 0.0, 2e-3), (0.1995, 0.0, 2e-3), (0.2, 0.0, -60e-3), (0.35, 0.0, -60e-3), (0.5, 3e-3, 3e-3))
#: Jumps of 100 mm to and fro within 1, 5, 20 and 50 ms, at a depth of 4 mm; and when they begin and end, s.
JUMPS = (0.0, 0.05, 0.051, 0.15, 0.155, 0.25, 0.27, 0.35, 0.4, 0.5)
FROM_AFAR = (1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0)
BIG_GAINS = {"position_gain": 5e6, "force_gain": 5e4}

#: Beds, and a blister that fits on them.
BED = {
    "layout": {"rows": 5, "columns": 5},
    "blister": {"radius": 6e-3, "edge_radius": 8e-3, "flat_radius": 3e-3},
}
ONE_PIN = {
    "layout": {"rows": 1, "columns": 1},
    "blister": {"radius": 1.4e-3, "edge_radius": 2e-3, "flat_radius": 1e-3},
}


def _jumping(across: float, up: float, *, away_first: bool) -> Case:
    """Return a case whose finger jumps by so much, m, out of a press or into one."""
    path = tuple(
        (time, across * (far if away_first else 1.0 - far), up * (far if away_first else 1.0 - far) - 4e-3)
        for time, far in zip(JUMPS, FROM_AFAR, strict=True)
    )
    return Case(path=path, why="jumps within a step, and e^(m x) = 3000", straight=True)


CASES: dict[str, Case] = {
    EASY: Case(),
    "m x 10": Case({"contact": {"exponent": 2e4}}, path=SHALLOW),
    "m x 10, pressed as deep": Case({"contact": {"exponent": 2e4}}, why="e^(m x) = 1e21"),
    "press to e^(m x) = 1e12": Case(path=DEEP, why="forces are differences of 1e9 N", straight=True),
    "tau_v 0.1 ms": Case({"valve_lag": {"time_constant": 1e-4}}),
    "tau_v 0 (absent)": Case({"valve_lag": "absent"}),
    "viscosity x 1000": Case({"fluid": {"viscosity": 1.6e-3}}, borrowed=True),
    "viscosity / 1000": Case({"fluid": {"viscosity": 1.6e-9}}),
    "bore 0.2 mm": Case({"actuator": {"bore": 0.2e-3}}),
    "gains x 1e4": Case({"control": BIG_GAINS}),
    "relaxation rate 1e6 1/s": Case({"relaxation": {"times": [1e-6, 70e-3, 1.4]}}),
    "b x 1e4": Case({"contact": {"stiffness": 2.5e6}}),
    "orifice 2 mm": Case({"valve": {"orifice_diameter": 2e-3}}),
    "c0 = 0": Case({"relaxation": {"weights": [0.0, 0.62, 0.20, 0.10]}}),
    "dead time 0.23 s": Case({"delay": {"dead_time": 0.23}}),
    "finger jumps 50 mm": Case(path=JUMP, why="the jump lasts half a step of 1 ms", straight=True),
    "finger through the bed": Case(
        path=THROUGH, why="e^(m x) = 1e52, within half a step of 1 ms", straight=True
    ),
    "jumps sideways, in first": _jumping(0.1, 0.0, away_first=True),
    "jumps sideways, out first": _jumping(0.1, 0.0, away_first=False),
    "jumps down first": _jumping(0.0, 0.1, away_first=True),
    "jumps up first": _jumping(0.0, 0.1, away_first=False),
    "openings of 1e-9": Case(
        {"control": {"position_gain": 1e-6, "force_gain": 1e-8}}, borrowed=True, factor=1e-8
    ),
    "all at the upper end stop": Case({"actuator": {"rest_height": 100e-3}}),
    "all at the lower end stop": Case({"actuator": {"rest_height": 0.0}}, borrowed=True),
    "one pin": Case(ONE_PIN),
}
CASES[ALL] = Case(
    {
        **ONE_PIN,
        "contact": {"exponent": 2e4, "stiffness": 2.5e6},
        "valve_lag": {"time_constant": 1e-4},
        "fluid": {"viscosity": 1.6e-9},
        "actuator": {"bore": 0.2e-3, "rest_height": 100e-3},
        "control": BIG_GAINS,
        "relaxation": {"times": [1e-6, 70e-3, 1.4], "weights": [0.0, 0.62, 0.20, 0.10]},
        "valve": {"orifice_diameter": 2e-3},
        "delay": {"dead_time": 0.23},
    },
    path=THROUGH,
    why="all of the above",
    straight=True,
)


def scene(case: Case, stepper: str, step: float, period: float) -> Scene:
    """Return the scene of a case: 5 x 5 pins, and no recorder.

    `step`, `period`: physics step and control period, s.
    """
    table: dict[str, Any] = {**BED, **copy.deepcopy(dict(case.changes))}
    rest = table.get("actuator", {}).get("rest_height", 40e-3)
    return resolve(
        {
            **table,
            "recorder": "absent",
            "simulation": {
                "stepper": stepper, "physics_step": step, "control_period": period, "duration": DURATION,
            },
            "trajectory": {
                "interpolation": "linear" if case.straight else "smooth",
                "waypoints": [{"time": t, "position": [x, 0.0, rest + z]} for t, x, z in case.path],
            },
        },
        "stiff",
    )  # fmt: skip
