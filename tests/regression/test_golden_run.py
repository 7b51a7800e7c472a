"""Two runs, digit for digit: what changes a parameter by a part in 1e9 is seen.

The first nine seconds of the paper's session, where every flow is laminar; and one pin whose valve follows a
script, pressed while its flow is turbulent. Compared are not bits, since other processors and other versions
of numpy take sums in another order, but numbers, with a tolerance between two measurements. The contact's
exponent moved by a part in 1e15, which is what rounding does, moves these forces by 2e-14 N and heights by
1e-16 m. Moved by a part in 1e9 it moves them by 1e-10 N and 2e-12 m. A change that is meant brings new
numbers: the failing test shows them.
"""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.model.valve import Fluid
from digiclay.core.session.run_scene import Result, run

from tests.assemble import one_cell, path, record, sample, scripted

#: N and mm: hundreds of times what rounding does, a tenth or less of what a part in 1e9 does.
FORCE, HEIGHT = 1e-11, 1e-10

#: Total force every second, N.
FORCES = [
    0.0,
    0.319782097498434,
    0.309652445288603,
    0.300326582813552,
    0.311905166205854,
    0.500834426541471,
    0.386923876958403,
    0.40079013495187,
    0.397948133182934,
    0.4137835046559,
]
#: Heights at the end of every eighth pin that then is off its rest by more than 1 mm, mm.
HEIGHTS = [
    41.4867935678464,
    44.260656625309,
    43.3016701902414,
    49.5787161964696,
    49.7124434030516,
    52.7039682278608,
    54.868229392124,
    48.9626854408324,
    55.3496972812639,
    55.2436355882679,
    42.5969098632505,
    55.291490993141,
    55.0253554563568,
    51.7383621657807,
    55.3205756640992,
    54.8142163295304,
    54.6093312140399,
    54.8668186817726,
    42.0353743771271,
    49.5734202593264,
    49.5666129053828,
    44.2135738741326,
    44.3584977283982,
]
#: Sum over all rows and cells of force times row times cell, N: what is off anywhere is in it.
WEIGHED = 73.1347749142423
#: Heights of the scripted pin every 50 ms, mm, and forces, N.
SCRIPTED = (
    [
        40.0,
        40.1777323158681,
        40.2260895944411,
        39.7567792308742,
        39.4709622650602,
        39.3640431850715,
        39.1153809048541,
        39.1694834357165,
        39.3733280285476,
    ],
    [0.0, 0.0265791784485218, 0.250831109985598, 0.545394532108921, 0.422450800245762, 0.0, 0.0, 0.0, 0.0],
)


@pytest.fixture(scope="module")
def session() -> Result:
    """Return the beginning of the paper's session."""
    return run(sample("ridge_mound_valley", "simulation.duration=9"))


def formed(session: Result) -> list[float]:
    """Return the heights at the end of some of the pins that have moved, mm."""
    assert session.history is not None
    height = session.history["height"][-1]
    return (height[np.abs(height - 40e-3) > 1e-3][::8] * 1e3).tolist()


def weighed(session: Result) -> float:
    """Return the sum over all rows and cells of force times row times cell, both from 0 to 1, N."""
    assert session.history is not None
    force = session.history["force"]
    return float(np.linspace(0.0, 1.0, len(force)) @ force @ np.linspace(0.0, 1.0, force.shape[1]))


def turbulent() -> tuple[list[float], list[float]]:
    """Return heights, mm, and forces, N, of a pin that is pressed while its valve opens and shuts."""
    system = one_cell(
        fluid=Fluid(viscosity=1.6e-9), control=scripted(lambda t, x, y: 0.05 * np.sin(40.0 * t))
    )
    done = record(system, path((0.0, 0.0, 0.0, 40.2), (0.2, 0.0, 0.0, 37.5), (0.4, 0.0, 0.0, 39.5)), 80)
    return (done.height[::10, 0] * 1e3).tolist(), done.force[::10, 0].tolist()


def test_the_forces_of_the_session_are_what_they_were(session: Result) -> None:
    assert session.history is not None
    assert session.history["total_force"][::200].tolist() == pytest.approx(FORCES, abs=FORCE)


def test_the_surface_of_the_session_is_what_it_was(session: Result) -> None:
    assert session.history is not None
    assert formed(session) == pytest.approx(HEIGHTS, abs=HEIGHT)


def test_no_force_of_any_cell_has_changed(session: Result) -> None:
    assert weighed(session) == pytest.approx(WEIGHED, rel=1e-12)


def test_a_pin_with_a_turbulent_valve_goes_where_it_went() -> None:
    heights, forces = turbulent()
    assert heights == pytest.approx(SCRIPTED[0], abs=HEIGHT)
    assert forces == pytest.approx(SCRIPTED[1], abs=FORCE)


def test_a_part_in_1e9_is_seen() -> None:
    exponent = 2000.0 * (1.0 + 1e-9)
    moved = run(sample("ridge_mound_valley", "simulation.duration=9", f"contact.exponent={exponent!r}"))
    assert moved.history is not None
    assert moved.history["total_force"][::200].tolist() != pytest.approx(FORCES, abs=FORCE)
    assert formed(moved) != pytest.approx(HEIGHTS, abs=HEIGHT)
    assert weighed(moved) != pytest.approx(WEIGHED, rel=1e-12)
