"""Richardson's extrapolation keeps to what a cell can be."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.base.arrays import Floats
from digiclay.core.model.physics import find_speeds
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import find, load
from digiclay.core.steppers.richardson import extrapolate

CELL = assemble(load(find("tap"))).cell


def extrapolated(coarse: float, fine: float, period: float = 10.0, under: float = 1.0) -> Floats:
    """Return the rows of a cell in one run, a pin 40 mm high, that whole and halved steps take to these.

    In a period as long as this a valve lets a pin go anywhere.
    """
    height, unders = np.full((1, 1), 40e-3), np.full((3, 1, 1), under)
    reach = find_speeds(CELL).reach(height, unders, np.array([period]))
    fines, coarses = (np.full((CELL.rows + 1, 1, 1), value) for value in (fine, coarse))
    extrapolate(CELL, fines, coarses, reach)
    rows: Floats = fines[:, 0, 0]
    return rows


def test_a_third_of_what_the_halves_changed_is_added() -> None:
    np.testing.assert_allclose(extrapolated(0.010, 0.013)[: CELL.rows], 0.014, rtol=1e-12)


def test_commands_on_their_way_are_not_extrapolated() -> None:
    assert extrapolated(0.010, 0.013)[CELL.rows] == 0.013


def test_no_pin_goes_beyond_an_end_stop() -> None:
    stroke = CELL.actuator.stroke
    assert extrapolated(3e-3, 0.0)[0] == 0.0
    assert extrapolated(stroke - 3e-3, stroke)[0] == stroke


def test_no_filter_of_the_pulp_pulls() -> None:
    assert (extrapolated(3e-3, 0.0)[CELL.pulp_rows] == 0.0).all()


def test_no_pin_goes_beyond_where_its_valve_and_the_finger_can_take_it() -> None:
    way = find_speeds(CELL).rise * 5e-3
    assert extrapolated(40e-3, 40e-3 + way, period=5e-3)[0] == pytest.approx(40e-3 + way, rel=1e-12)
    assert extrapolated(40e-3, 30e-3, period=5e-3, under=30e-3)[0] == pytest.approx(30e-3 - way, rel=1e-12)
