"""From force to height: the top whose predicted forces add up, and the heights ahead of the finger."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.control.blister import Blister, BlisterRule
from digiclay.core.control.led_blister import Follower, LeadProfile, LedBlister
from digiclay.core.control.pulp_estimate import PulpEstimate, Reach, find_top
from digiclay.core.control.virtual_master import Phase
from digiclay.core.model.contact import Contact
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.model.touch import Touch

PULP = PulpEstimate(Touch(Fingertip(), Contact(), Relaxation()), 5e-3, 10e-3, 0.0)
#: Nine cells under a fingertip of 8 mm radius at 40 mm.
DISTANCE = np.array([0.0, 3.0, 3.0, 3.0, 3.0, 4.24, 4.24, 4.24, 4.24]) * 1e-3
UNDER = 40e-3 + DISTANCE**2 / 16e-3


def reach(low: float, high: float) -> Reach:
    """Return the range of cells of one part from one height to another, m, on a bed at 40 mm."""
    ends = np.array([np.full(9, low), np.full(9, high)])
    return Reach(40e-3, True, np.ones(9), np.full(9, np.inf), ends)


@pytest.mark.parametrize(
    ("wanted", "guess", "low", "high", "force", "top"),
    [
        # Linear between nine heights, 0.16 mm apart near the guess, and up to 2.4 mm far from it.
        (0.4, 41.13e-3, 39e-3, 43e-3, pytest.approx(0.4, abs=10e-3), None),
        (0.4, 40.5e-3, 39e-3, 43e-3, pytest.approx(0.4, abs=0.1), None),
        # A force that no pin can give leads to the end of the range.
        (1e-6, 41.5e-3, 41e-3, 42e-3, None, pytest.approx(41e-3)),
        (50.0, 41.5e-3, 41e-3, 42e-3, None, pytest.approx(42e-3)),
    ],
)
def test_the_forces_at_the_top_add_up_to_what_is_wanted(
    wanted: float, guess: float, low: float, high: float, force: object, top: object
) -> None:
    height, total = find_top(wanted, guess, reach(low, high), UNDER, np.zeros(9), PULP)
    assert top is None or height == top
    assert force is None or PULP.predict_force(height - UNDER, np.zeros(9)).sum() == force
    assert force is None or total == pytest.approx(wanted)


def test_relaxed_pulp_asks_for_a_higher_top() -> None:
    tops = [
        find_top(0.4, 41.2e-3, reach(39e-3, 43e-3), UNDER, np.full(9, lost), PULP)[0] for lost in (0.0, 0.1)
    ]
    assert tops[1] - tops[0] > 50e-6


@pytest.mark.parametrize(
    ("raised", "top", "expected"),
    [(True, 55e-3, [55e-3, 53e-3, 40e-3]), (False, 30e-3, [30e-3, 32e-3, 40e-3])],
    ids=["ridge", "valley"],
)
def test_led_cells_stand_no_farther_from_the_top_than_they_may(
    raised: bool, top: float, expected: list[float]
) -> None:
    cells = Reach(40e-3, raised, np.array([1.0, 0.5, 0.0]), np.array([0.0, 2e-3, 20e-3]), np.empty((2, 3)))
    assert cells.form_heights(top) == pytest.approx(expected)


# Ahead of the finger


LEAD = LeadProfile(level=7.5e-3, rise=20e-3, fall=20e-3, skirt=0.0)
SKIRT = LeadProfile(level=7.5e-3, rise=20e-3, fall=20e-3, skirt=40e-3)


@pytest.mark.parametrize(
    ("profile", "distance", "ahead", "speed", "drop"),
    [
        # 10 mm ahead at 40 mm/s is a quarter of a second, in which a pin rises 5 mm.
        pytest.param(LEAD, 17.5e-3, 17.5e-3, 40e-3, 5e-3, id="ahead, where it can still arrive"),
        pytest.param(LEAD, 17.5e-3, -17.5e-3, 40e-3, 1e7, id="behind, without a skirt: not led"),
        pytest.param(LEAD, 17.5e-3, 17.5e-3, 0.5e-3, 1e7, id="too slow to have a direction"),
        pytest.param(LEAD, 5e-3, 0.0, 40e-3, 0.0, id="on the level ring"),
        pytest.param(SKIRT, 17.5e-3, -1.0, 0.0, 5e-3, id="a skirt behind, for its speed"),
        pytest.param(SKIRT, 17.5e-3, 1.0, 0.0, 5e-3, id="a skirt ahead, for its speed"),
    ],
)
def test_a_pin_stands_as_far_from_the_top_as_it_can_still_rise(
    profile: LeadProfile, distance: float, ahead: float, speed: float, drop: float
) -> None:
    found = profile.find_drop(np.array([distance]), np.array([ahead]), speed, raised=True)
    assert found == pytest.approx([drop])


def test_the_reach_covers_all_pins_that_are_led() -> None:
    assert LEAD.find_reach(15e-3, 40e-3) == pytest.approx(7.5e-3 + 30e-3)
    assert LEAD.find_reach(-10e-3, 40e-3) == pytest.approx(7.5e-3 + 20e-3)


def test_the_disc_reaches_farther_than_pins_are_led_and_holds_those_led_before() -> None:
    blister = LedBlister(Blister(), BlisterRule(Blister(), -0.05, 0.02, 1e-3), SKIRT, 10e-3)
    memory = Follower(Phase.SHAPING, top=50e-3, edge=40e-3)
    # 10 mm above the surface the skirt leads pins 20 mm around the level ring, 2 mm more are commanded.
    assert blister.find_disc(memory) == pytest.approx((0.0, 0.0, 29.5e-3))
    assert blister.find_disc(memory._replace(top=40e-3)) == pytest.approx((0.0, 0.0, 20.5e-3))
    far = memory._replace(led_x=40e-3, led_radius=10e-3)
    x, y, radius = blister.find_disc(far) or (0.0, 0.0, 0.0)
    assert (x - radius, y, x + radius) == pytest.approx((-29.5e-3, 0.0, 50e-3))
