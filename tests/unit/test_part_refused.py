"""Parameters that no part can have are refused in one line that names the rule and the value."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.actuator import Actuator, Supply
from digiclay.core.model.contact import Contact
from digiclay.core.model.delay import Delay
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.layout import Layout
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.model.sensors import Sensing
from digiclay.core.model.trajectory import Trajectory
from digiclay.core.model.valve import Valve


def path(times: Any, positions: Any = None, turns: Any = None, interpolation: str = "smooth") -> Trajectory:
    """Return a path, at the origin and level unless it is said otherwise."""
    count = len(times)
    places = np.zeros((count, 3)) if positions is None else np.array(positions, float)
    level = np.eye(1, 4).repeat(count, 0) if turns is None else turns
    return Trajectory(np.array(times, float), places, level, interpolation)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Fingertip(width=0.0), "Fingertip.width must be above 0 m (got 0 m)."),
        (lambda: Layout(rows=0), "Layout.rows must be at least 1 (got 0)."),
        (
            lambda: Layout(rows=10_000, columns=10_000),
            "Layout.rows * columns must have at most 20 million",
        ),
        (
            lambda: Actuator(rest_height=0.2),
            "Actuator.rest_height must be at most the stroke, 0.1 m (got 0.2",
        ),
        (lambda: Contact(exponent=0.0), "Contact.exponent must be above 0 1/m (got 0 1/m)."),
        (lambda: Delay(-1e-3), "Delay.dead_time must be at least 0 s (got -0.001 s)."),
        (lambda: Valve(orifice_diameter=-3e-4), "Valve.orifice_diameter must be above 0 m (got -0.0003 m)."),
        (lambda: Valve(gap="slit"), "Valve.gap must be one of stroke, opening (got 'slit')."),
        (lambda: Supply(high=-6e4), "Supply.high must be above Supply.low (got -60000 Pa, low -50000 Pa)."),
        (lambda: Supply(high=-5e4), "Supply.high must be above Supply.low (got -50000 Pa"),
        (lambda: Relaxation(weights=(0.0,) * 4), "Relaxation.weights must not all be 0"),
        (lambda: Relaxation(times=(0.0, 0.07, 1.4)), "Relaxation.times must be at least 1e-09 s (got 0 s)."),
        *(
            (
                lambda count=count: Relaxation(weights=(1.0,) * count),
                f"Relaxation.weights must have one value more than times, 4 (got {count}).",
            )
            for count in (1, 3, 5)
        ),
        *(
            (
                lambda name=name: Sensing(observer="valve", **{name: 1e-3}),
                f"Sensing.{name} must be 0 N with observer = 'valve'",
            )
            for name in ("force_noise", "force_step")
        ),
        (lambda: path([0.0, 1.0, 1.0]), "Trajectory.times must increase from waypoint to waypoint (got "),
        (
            lambda: path([0.0, 1.0, 1.0 + 1e-12]),
            "Trajectory.times must increase from waypoint to waypoint by",
        ),
        (lambda: path([]), "Trajectory.waypoints must have at least one waypoint"),
        (
            lambda: path([0.0, 1.0], [[0, 0, 0], [0, np.nan, 0]]),
            "Trajectory.positions must be finite numbers (got nan at waypoint 2).",
        ),
        (lambda: path([0.0], turns=np.zeros((1, 4))), "Trajectory.orientations must have a length above 0"),
        (
            lambda: path([0.0], interpolation="cubic"),
            "Trajectory.interpolation must be one of smooth, linear (got 'cubic').",
        ),
    ],
)
def test_what_no_part_can_have_is_refused_with_the_rule(make: Any, said: str) -> None:
    with pytest.raises(ParameterError, match="^" + re.escape(said)):
        make()
