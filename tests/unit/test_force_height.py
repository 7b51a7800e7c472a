"""From force to height: the top whose predicted forces add up, and the heights ahead of the finger."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.control.led_blister import LeadProfile
from digiclay.core.control.pulp_estimate import PulpEstimate, Reach, find_top, form_heights
from digiclay.core.model.contact import Contact
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.model.touch import Touch
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PULP = PulpEstimate(Touch(Fingertip(), Contact(), Relaxation()), 5e-3, 10e-3, 0.0)
#: Nine cells under a fingertip of 8 mm radius at 40 mm.
DISTANCE = np.array([0.0, 3.0, 3.0, 3.0, 3.0, 4.24, 4.24, 4.24, 4.24]) * 1e-3
UNDER = 40e-3 + DISTANCE**2 / 16e-3


def reach(low: float, high: float, part: Floats | None = None) -> Reach:
    """Return the range of cells from one height to another, m."""
    part = np.ones(9) if part is None else part
    return Reach(part, np.full(9, np.inf), np.array([np.full(9, low), np.full(9, high)]))


# Linear between nine heights, 0.16 mm apart near the guess, and up to 2.4 mm far from it.
@pytest.mark.parametrize(("guess", "error"), [(41.13e-3, 10e-3), (40.5e-3, 0.1)])
def test_the_forces_at_the_top_found_add_up_to_what_is_wanted(guess: float, error: float) -> None:
    top, _ = find_top(0.4, guess, 40e-3, reach(39e-3, 43e-3), UNDER, np.zeros(9), PULP, raised=True)
    force = PULP.predict_force(top - UNDER, np.zeros(9)).sum()
    assert force == pytest.approx(0.4, abs=error)


@pytest.mark.parametrize(("wanted", "expected"), [(1e-6, 41e-3), (50.0, 42e-3)])
def test_a_force_that_no_pin_can_give_leads_to_the_end_of_the_range(wanted: float, expected: float) -> None:
    lost = np.zeros(9)
    top, _ = find_top(wanted, 41.5e-3, 40e-3, reach(41e-3, 42e-3), UNDER, lost, PULP, raised=True)
    assert top == pytest.approx(expected)


def test_relaxed_pulp_asks_for_a_higher_top() -> None:
    tops = [
        find_top(0.4, 41.2e-3, 40e-3, reach(39e-3, 43e-3), UNDER, np.full(9, lost), PULP, raised=True)[0]
        for lost in (0.0, 0.1)
    ]
    assert tops[1] - tops[0] > 50e-6


def test_led_cells_stand_no_farther_below_the_top_than_they_may() -> None:
    heights = form_heights(55e-3, 40e-3, np.array([1.0, 0.5, 0.0]), np.array([0.0, 2e-3, 20e-3]), raised=True)
    assert heights == pytest.approx([55e-3, 53e-3, 40e-3])


def test_in_a_valley_led_cells_stand_no_farther_above_it() -> None:
    heights = form_heights(
        30e-3, 40e-3, np.array([1.0, 0.5, 0.0]), np.array([0.0, 2e-3, 20e-3]), raised=False
    )
    assert heights == pytest.approx([30e-3, 32e-3, 40e-3])


# Ahead of the finger


LEAD = LeadProfile(level=7.5e-3, rise=20e-3, fall=20e-3, skirt=0.0)


def test_a_pin_ahead_stands_where_it_can_still_arrive() -> None:
    drop = LEAD.find_drop(np.array([17.5e-3]), np.array([17.5e-3]), 40e-3, raised=True)
    # 10 mm ahead at 40 mm/s is a quarter of a second, in which it rises 5 mm.
    assert drop == pytest.approx([5e-3])


def test_without_a_skirt_pins_beside_and_behind_are_not_led() -> None:
    drop = LEAD.find_drop(np.array([17.5e-3, 5e-3]), np.array([-17.5e-3, 0.0]), 40e-3, raised=True)
    assert drop[0] > 1e3
    assert drop[1] == 0.0


def test_a_skirt_leads_all_around_for_the_speed_it_is_made_for() -> None:
    skirt = LeadProfile(level=7.5e-3, rise=20e-3, fall=20e-3, skirt=40e-3)
    drop = skirt.find_drop(np.array([17.5e-3, 17.5e-3]), np.array([-1.0, 1.0]), 0.0, raised=True)
    assert drop == pytest.approx([5e-3, 5e-3])


def test_the_reach_covers_all_pins_that_are_led() -> None:
    assert LEAD.find_reach(15e-3, 40e-3) == pytest.approx(7.5e-3 + 30e-3)
    assert LEAD.find_reach(-10e-3, 40e-3) == pytest.approx(7.5e-3 + 20e-3)
