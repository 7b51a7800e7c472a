"""Parameters that no part can have are refused in one line that names the rule and the value."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.actuator import Supply
from digiclay.core.model.contact import Contact
from digiclay.core.model.delay import Delay
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.layout import Layout
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.model.sensors import Sensing
from digiclay.core.model.trajectory import Trajectory
from digiclay.core.model.valve import Valve


def path(times: Any, positions: Any = None) -> Trajectory:
    """Return a level path, at the origin unless positions are given."""
    count = len(times)
    places = np.zeros((count, 3)) if positions is None else np.array(positions, float)
    return Trajectory(np.array(times, float), places, np.eye(1, 4).repeat(count, 0))


@pytest.mark.parametrize(
    ("part", "given", "said"),
    [
        (Fingertip, {"width": 0.0}, "width must be above 0 m (got 0 m)."),
        (Layout, {"rows": 10_000, "columns": 10_000}, "rows * columns must have at most 20 million"),
        (Contact, {"exponent": 0.0}, "exponent must be above 0 1/m (got 0 1/m)."),
        (Delay, {"dead_time": -1e-3}, "dead_time must be at least 0 s (got -0.001 s)."),
        (Valve, {"gap": "slit"}, "gap must be one of stroke, opening (got 'slit')."),
        (Supply, {"high": -5e4}, "high must be above Supply.low (got -50000 Pa"),
        (Relaxation, {"weights": (0.0,) * 4}, "weights must not all be 0"),
        (Relaxation, {"times": (0.0, 0.07, 1.4)}, "times must be at least 1e-09 s (got 0 s)."),
        (Relaxation, {"weights": (1.0,)}, "weights must have one value more than times, 4 (got 1)."),
        (Relaxation, {"weights": (1.0,) * 3}, "weights must have one value more than times, 4 (got 3)."),
        (Relaxation, {"weights": (1.0,) * 5}, "weights must have one value more than times, 4 (got 5)."),
        (Sensing, {"observer": "valve", "force_noise": 1e-3}, "force_noise must be 0 N with observer"),
        (Sensing, {"observer": "valve", "force_step": 1e-3}, "force_step must be 0 N with observer"),
        (Sensing, {"height_step": 1e-15}, "height_step must be 0 m, or at least 1e-12 m (got 1e-15 m)."),
        (path, {"times": [0.0, 1.0, 1.0]}, "times must increase from waypoint to waypoint (got "),
        (path, {"times": [0.0, 1.0, 1.0 + 1e-12]}, "times must increase from waypoint to waypoint by"),
        (
            path, {"times": [0.0, 1.0], "positions": [[0, 0, 0], [0, np.nan, 0]]},
            "positions must be finite numbers (got nan at waypoint 2).",
        ),
    ],
)  # fmt: skip
def test_what_no_part_can_have_is_refused_with_the_rule(part: Any, given: dict[str, Any], said: str) -> None:
    name = "Trajectory" if part is path else part.__name__
    with pytest.raises(ParameterError, match="^" + re.escape(f"{name}.{said}")):
        part(**given)
