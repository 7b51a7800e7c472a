"""The observer of the pulp finds tension and indentation from forces; from a force to heights."""

import numpy as np
import pytest
from digiclay.core.control.blister import Blister, BlisterRule
from digiclay.core.control.finger_sections import Sections
from digiclay.core.control.led_blister import Follower, LeadProfile, LedBlister
from digiclay.core.control.pulp_estimate import PulpEstimate, Reach, find_tops
from digiclay.core.control.virtual_master import Phase
from digiclay.core.model.contact import Contact
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.model.touch import Touch
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from tests.assemble import table

Floats = NDArray[np.float64]

PERIOD = 5e-3
CONTACT, RELAXATION = Contact(), Relaxation()
PULP = PulpEstimate(Touch(Fingertip(), CONTACT, RELAXATION), PERIOD, 2.0 * PERIOD, 0.0)


def history(depth, count):
    """Return forces and tensions of a cell period by period, N, by SciPy, for its indentation over time."""
    rates, shares = RELAXATION.rates[:, 0], RELAXATION.shares
    times = np.arange(count + 1) * PERIOD
    tension = lambda t: CONTACT.tension(np.atleast_1d(depth(t)))  # type: ignore[operator] # noqa: E731
    law, exact = lambda t, z: rates * (tension(t)[0] - z), {"rtol": 1e-9, "atol": 1e-12}
    found = solve_ivp(law, (0.0, times[-1]), np.zeros(3), t_eval=times, **exact)
    own = np.array([tension(t)[0] for t in times])
    return CONTACT.share * np.maximum(own - shares @ found.y, 0.0), own


def observe(forces, expected):
    pulp, found = np.zeros((4, 1)), []
    for force, guess in zip(forces[1:], expected[1:], strict=True):
        PULP.observe(pulp, np.array([force]), np.array([guess]))
        found.append(float(pulp[-1, 0]))
    return np.array(found)


def test_the_tension_of_a_press_is_found_and_its_underside_as_uncertain_as_the_force():
    forces, own = history(lambda t: 1.5e-3 * np.minimum(t / 0.2, 1.0), 100)
    # The tension is taken as linear within 5 ms, while it grows exponentially; a filter takes 4 ms.
    assert observe(forces, own) == pytest.approx(own[1:], rel=0.01, abs=2e-3)
    depth, step = np.array([0.5e-3, 2e-3]), 1e-8
    slope = (
        CONTACT.share
        * (CONTACT.tension(depth + step) - CONTACT.tension(depth - step))
        / (2.0 * step)
    )
    _, deviation = PULP.find_underside(np.zeros(2), CONTACT.tension(depth), 1e-3)
    assert deviation == pytest.approx(1e-3 / slope, rel=1e-6)


def test_a_predicted_force_comes_and_relieved_pulp_keeps_the_expected_tension():
    depth = lambda t: 1.0e-3 + 3e-3 * (t - 0.2)  # noqa: E731
    forces, own = history(lambda t: np.maximum(depth(t), 0.0), 42)
    pulp = np.zeros((4, 1))
    for force, guess in zip(forces[1:41], own[1:41], strict=True):
        PULP.observe(pulp, np.array([force]), np.array([guess]))
    lost = PULP.predict_loss(pulp)
    found = PULP.predict_force(np.array([depth(42 * PERIOD)]), lost)
    assert found == pytest.approx(forces[42], rel=0.01)
    depth = lambda t: np.where(t < 0.5, 1.5e-3, 0.8e-3)  # noqa: E731
    forces, own = history(depth, 104)
    assert forces[-1] == 0.0
    assert own[-1] > 0.3
    # Expected a little too large: it is at most the tension at which there would be a force.
    assert observe(forces, own)[-1] == pytest.approx(own[-1], rel=1e-9)
    assert observe(forces, np.full(own.size, 9.0))[-1] < 2.0


# From force to height: the top whose predicted forces add up, and the heights ahead of the
# fingertip

#: Nine cells under a fingertip of 8 mm radius at 40 mm.
DISTANCE = np.array([0.0, 3.0, 3.0, 3.0, 3.0, 4.24, 4.24, 4.24, 4.24]) * 1e-3
UNDER = 40e-3 + DISTANCE**2 / 16e-3


@pytest.mark.parametrize(
    "wanted, guess, low, high, force, top",
    [
        # Linear between nine heights, 0.16 mm apart near the guess, and up to 2.4 mm far from it.
        (0.4, 41.13e-3, 39e-3, 43e-3, pytest.approx(0.4, abs=10e-3), None),
        (0.4, 40.5e-3, 39e-3, 43e-3, pytest.approx(0.4, abs=0.1), None),
        # A force that no pin can give leads to the end of the range.
        (1e-6, 41.5e-3, 41e-3, 42e-3, None, pytest.approx(41e-3)),
        (50.0, 41.5e-3, 41e-3, 42e-3, None, pytest.approx(42e-3)),
    ],
)
def test_the_forces_at_the_top_add_up_to_what_is_wanted(wanted, guess, low, high, force, top):
    ends = np.array([np.full(9, low), np.full(9, high)])
    # Of cells of one part, on a bed at 40 mm.
    reach = Reach(40e-3, True, np.ones(9), np.full(9, np.inf), ends)
    ((height, total),) = find_tops([wanted], [guess], reach, UNDER, np.zeros(9), PULP)
    assert top is None or height == top
    assert force is None or PULP.predict_force(height - UNDER, np.zeros(9)).sum() == force
    assert force is None or total == pytest.approx(wanted)


def test_several_fingertips_have_the_tops_that_each_has_alone():
    random, sizes = np.random.default_rng(4), [9, 1, 30]
    sections, cells = Sections(sizes), sum(sizes)
    part, under = random.uniform(0.3, 1.0, cells), random.uniform(38e-3, 40e-3, cells)
    drop, lost = random.uniform(0.0, 5e-3, cells), random.uniform(0.0, 0.02, cells)
    ends = np.sort(random.uniform(39e-3, 43e-3, (2, cells)), axis=0)
    wanted = [0.4, 0.05, 0.8]
    guesses = [40e-3, 41e-3, 42e-3]
    edges = [39e-3, 40e-3, 43e-3]
    raised = [True, True, False]
    many = Reach(sections.spread(edges), sections.spread(raised), part, drop, ends)
    found = find_tops(wanted, guesses, many, under, lost, PULP, sections)
    for i, own in enumerate(sections.parts):
        alone = Reach(edges[i], raised[i], part[own], drop[own], ends[:, own])
        (expected,) = find_tops([wanted[i]], [guesses[i]], alone, under[own], lost[own], PULP)
        assert found[i] == pytest.approx(expected, rel=1e-12)  # sums in another order


@pytest.mark.parametrize(
    "raised, top, expected", [(True, 55e-3, [55e-3, 53e-3]), (False, 30e-3, [30e-3, 32e-3])]
)
def test_led_cells_stand_no_farther_from_the_top_than_they_may(raised, top, expected):
    cells = Reach(
        40e-3, raised, np.array([1.0, 0.5, 0.0]), np.array([0.0, 2e-3, 20e-3]), np.empty((2, 3))
    )
    assert cells.form_heights(top) == pytest.approx([*expected, 40e-3])


LEAD = LeadProfile(level=7.5e-3, rise=20e-3, fall=20e-3, skirt=0.0)
SKIRT = LeadProfile(level=7.5e-3, rise=20e-3, fall=20e-3, skirt=40e-3)


@table(
    "profile, distance, ahead, speed, drop",
    {
        # 10 mm ahead at 40 mm/s is a quarter of a second, in which a pin rises 5 mm.
        "ahead, where it can still arrive": (LEAD, 17.5e-3, 17.5e-3, 40e-3, 5e-3),
        "behind, without a skirt: not led": (LEAD, 17.5e-3, -17.5e-3, 40e-3, 1e7),
        "too slow to have a direction": (LEAD, 17.5e-3, 17.5e-3, 0.5e-3, 1e7),
        "on the level ring": (LEAD, 5e-3, 0.0, 40e-3, 0.0),
        "a skirt behind, for its speed": (SKIRT, 17.5e-3, -1.0, 0.0, 5e-3),
        "a skirt ahead, for its speed": (SKIRT, 17.5e-3, 1.0, 0.0, 5e-3),
    },
)
def test_a_pin_stands_as_far_from_the_top_as_it_can_still_rise(
    profile, distance, ahead, speed, drop
):
    slopes = profile.find_slopes(speed, raised=True)
    found = profile.find_drop(np.array([distance]), np.array([ahead]), *slopes)
    assert found == pytest.approx([drop])


def test_the_disc_reaches_farther_than_pins_are_led_and_holds_those_led_before():
    assert LEAD.find_reach(15e-3, 40e-3) == pytest.approx(7.5e-3 + 30e-3)
    assert LEAD.find_reach(-10e-3, 40e-3) == pytest.approx(7.5e-3 + 20e-3)
    blister = LedBlister(BlisterRule(Blister(), -0.05, 0.02, 1e-3), SKIRT, 10e-3)
    memory = Follower(Phase.SHAPING, top=50e-3, edge=40e-3)
    # 10 mm above the surface the skirt leads pins 20 mm around the level ring, 2 mm more are
    # commanded.
    assert blister.find_disc(memory) == pytest.approx((0.0, 0.0, 29.5e-3))
    assert blister.find_disc(memory._replace(top=40e-3)) == pytest.approx((0.0, 0.0, 20.5e-3))
    far = memory._replace(led_x=40e-3, led_radius=10e-3)
    x, y, radius = blister.find_disc(far) or (0.0, 0.0, 0.0)
    assert (x - radius, y, x + radius) == pytest.approx((-29.5e-3, 0.0, 50e-3))
