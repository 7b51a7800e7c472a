"""Steppers: the closed form solves its equation, others keep to what a cell can be."""

import math
from dataclasses import dataclass
from decimal import MAX_EMAX, MIN_EMIN, Decimal, localcontext

import numpy as np
import pytest
from digiclay.core.model.physics import find_speeds
from digiclay.core.steppers import closed_form
from digiclay.core.steppers.explicit import Explicit
from digiclay.core.steppers.richardson import extrapolate
from numpy.testing import assert_allclose

from tests.assemble import make_system, one_cell

COUNT = 4000


def integrated(e, bow, slip, decay, pulp):
    """Return the load's part of the way, and the mean of max(exp(e) - 1, 0), by the midpoint rule.

    Without load the way is the parabola e + slip s + 6 bow s (1 - s), whose mean lies `bow` above
    the straight line between its ends; a load acts where exp(e) is above `pulp`.
    """
    push = mean = 0.0
    ds = 1.0 / COUNT

    def rate(s, push):
        grown = math.exp(min(e + slip * s + 6.0 * bow * s * (1.0 - s) + push, closed_form.LARGE))
        return decay * min(pulp - grown, 0.0)

    for i in range(COUNT):
        s = i * ds
        push_middle = push + 0.5 * ds * rate(s, push)
        middle = s + 0.5 * ds
        mean += ds * max(
            math.expm1(e + slip * middle + 6.0 * bow * middle * (1.0 - middle) + push_middle), 0.0
        )
        push += ds * rate(middle, push_middle)
    return push, mean


def solved(e, bow, slip, decay, pulp):
    numbers = e, bow, slip, decay, pulp, slip > 0.0
    push, mean = closed_form.solve_crossing(*(np.array([value]) for value in numbers))
    return float(push[0]), float(mean[0])


def test_a_cell_that_touches_by_a_rounding_error_at_the_start_meets_the_finger_then():
    touching = solved(0.0, 0.0, 2.0, 1.5, 1.0)
    assert touching[0] < -0.1
    for e, bow in ((1e-15, 0.0), (0.0, 1e-15)):
        assert solved(e, bow, 2.0, 1.5, 1.0) == pytest.approx(touching, abs=1e-12)


@pytest.mark.parametrize(
    "e, slip, decay, pulp",
    [(-1.0, 2.0, 1.5, 1.0), (-0.5, 2.0, 0.8, 1.4), (0.8, -2.0, 1.5, 1.0), (1.2, -2.5, 0.7, 1.3)],
)
def test_a_cell_that_meets_or_leaves_on_a_straight_way_is_solved_exactly(e, slip, decay, pulp):
    # The sum's own error is of second order in its steps, of first at the one that holds the
    # instant.
    assert solved(e, 0.0, slip, decay, pulp) == pytest.approx(
        integrated(e, 0.0, slip, decay, pulp), abs=3e-6
    )


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
def test_a_bend_raises_the_way_by_its_mean_over_the_loaded_part(share):
    # Met after 1 - share of a straight way: the parabola's mean over the rest is bow share (3 - 2
    # share).
    slip, decay, bow = 0.5, 0.2, 0.005
    e = -(1.0 - share) * slip
    gained = solved(e, bow, slip, decay, 1.0)[0] - solved(e, 0.0, slip, decay, 1.0)[0]
    exact = integrated(e, bow, slip, decay, 1.0)[0] - integrated(e, 0.0, slip, decay, 1.0)[0]
    # The instant itself moves too, and the load bends the way: 1 to 5 % here.
    assert gained == pytest.approx(exact, rel=0.06)


@pytest.mark.parametrize(
    "e, bow, slip",
    [(-0.002, 0.015, 0.1), (-0.01, 0.02, 0.1), (0.01, -0.01, -0.05), (0.03, -0.05, -0.1)],
)
def test_a_bend_beyond_the_threshold_does_not_exchange_meeting_and_leaving(e, bow, slip):
    # Of second order in the bend, which is as large as what is left of the way; exchanged it is
    # 4e-2.
    assert solved(e, bow, slip, 1.0, 1.0) == pytest.approx(
        integrated(e, bow, slip, 1.0, 1.0), abs=2e-3
    )


@pytest.mark.parametrize("exponent", [-9000.0, 5.0, 290.0])
@pytest.mark.parametrize("slip", [-8000.0, 0.0, 8000.0])
@pytest.mark.parametrize("decay", [closed_form.TINY, 1e-3, 1e6])
@pytest.mark.parametrize("pulp", [1.0, 1e125])
def test_no_size_overflows_and_no_load_pulls(exponent, slip, decay, pulp):
    numbers = tuple(np.array([value]) for value in (slip, decay, pulp))
    with np.errstate(all="raise", under="ignore"):
        growth = closed_form.replace_zeros(numbers[0] + numbers[1] * numbers[2])
        push, mean = closed_form.solve_carefully(np.array([exponent]), growth, *numbers)
        idle = np.array([exponent <= math.log(pulp)])
        met = closed_form.solve_crossing(np.array([exponent]), np.zeros(1), *numbers, idle)
    assert np.isfinite([push, mean, *met]).all()
    assert mean[0] >= 0.0
    # Not to the last bit: exponents are in the thousands.
    loaded = exponent > math.log(pulp)
    if loaded and slip >= 0.0:  # it stays under load
        assert push[0] <= 1e-9
    elif loaded == (slip < 0.0):  # it leaves, or it meets the finger
        assert met[0] <= 1e-9


@pytest.mark.parametrize("exponent", [-5.0, 5.0, 250.0])
@pytest.mark.parametrize("slip, decay", [(-8e3, 1.0), (-100.0, 1e9), (310.0, 1e6), (8e3, 1e9)])
@pytest.mark.parametrize("pulp", [1.0, 50.0])
def test_a_vast_growth_keeps_its_digits(exponent, slip, decay, pulp):
    e, way, rate, unit = map(Decimal, (exponent, slip, decay, pulp))
    with localcontext() as digits:
        digits.prec, digits.Emax, digits.Emin = 60, MAX_EMAX, MIN_EMIN
        growth = way + rate * unit
        relief = (1 + rate * e.exp() * (growth.exp() - 1) / growth).ln()
    numbers = [np.array([value]) for value in (exponent, float(growth), slip, decay, pulp)]
    push, mean = closed_form.solve_carefully(*numbers)
    # Rounding of slip and exponent; 3e-7 of the mean where relief and growth are subtracted.
    assert_allclose(push, float(rate * unit - relief), rtol=1e-12, atol=1e-12 * abs(slip))
    assert_allclose(mean, float(relief / rate), rtol=1e-12)


@dataclass(frozen=True)
class Setter(Explicit):
    height: float | None
    ways: tuple[float, ...] = ()

    order = 1
    nodes = (0.0, 1.0)

    def increment(self, rates, y, step):
        way = np.zeros_like(y)
        way[0] = self.ways if self.height is None else self.height - y[0]
        if self.height is None and y[0, 0] != 0.04:
            way[0, 0] = -0.01
        return way


def put(stepper, under, start, **parts):
    """Return heights, m, and forces that a stepper leaves of pins under the undersides of a fingertip, m."""
    system = make_system(stepper="euler", dead_time=0.0, relaxation=None, **parts)
    driven = np.zeros((system.rows.physics + system.rows.queue, len(start)))
    driven[0] = start
    unders = np.array(under) if under else np.empty((len(system.plan.segments) + 1, 0))
    force = stepper.advance(system.plan, driven, unders)
    return driven[0], force


def test_a_cell_thrown_off_is_given_up_and_a_finger_pushes_a_pin_no_deeper_than_it_comes():
    alone = {"step": 1e-3, "fingertip": None, "contact": None}
    height, _ = put(Setter(None, (10.0, 1e-3)), [], [0.04, 0.04], **alone)
    assert_allclose(height, [np.inf, 0.045], rtol=1e-12)
    # 1 mm deep at the end of the period: f_d b/m (e^(m x) - 1), and no contact at the start.
    _, force = put(Setter(39e-3), [[41e-3], [38e-3]], [40e-3], step=5e-3)
    assert force[0] == pytest.approx(0.34 * 250.0 / 2000.0 * np.expm1(2.0), rel=1e-9)
    # It leaves the pins. Its way is a parabola, its mean `bow` above its chord and its middle 1.5
    # times that. The valves are open to the high reservoir; a bend of the way without load would
    # take the pins far down.
    cases = [
        (0.5, 0.6, 0.0, 0.5),
        (0.5, 0.6, -0.4, 0.8),
        (0.5, 1.8, -0.8, 0.8),
        (0.3, 1.0, -1.0, 1.3),
    ]
    exponent, lift, bow, deepest = np.array(cases).T
    one, weights, loaded = np.ones(4), np.full((1, 4), 1e3), np.zeros(4, dtype=bool)
    cell, openings = one_cell().cell, np.ones((1, 4))
    pressure = cell.supply.pressure(openings)
    paths = exponent, 9.0 * one, bow, lift
    start = closed_form.StepStart(
        cell, openings, pressure, weights, *paths, relaxed=one, idle=loaded
    )
    rise, _, _ = closed_form.find_loaded_path(2000.0, 1e6, 1.0, start)
    assert_allclose(rise, -deepest / 2000.0, rtol=1e-12)


@pytest.mark.parametrize(
    "height, under, start, left",
    [
        (15e-3, 15e-3, 40e-3, 15e-3),  # pushed as far as the finger comes
        # A hundredth of the stroke is allowed; an open valve lowers it by less than a millimeter in
        # 5 ms.
        (15e-3, 20e-3, 40e-3, np.inf),
        (45e-3, 38e-3, 40e-3, np.inf),  # it rises faster than an open valve lets it
        (-30e-3, -1e-3, 5e-3, 0.0),  # pressed onto its stop
        (np.nan, 38e-3, 40e-3, np.inf),
    ],
)
def test_a_pin_is_given_up_where_neither_finger_nor_valve_can_take_it(height, under, start, left):
    assert put(Setter(height), [[41e-3], [under]], [start], step=5e-3)[0] == left


CELL = make_system().cell
STROKE, WAY = CELL.actuator.stroke, find_speeds(CELL).rise * 5e-3


@pytest.mark.parametrize(
    "coarse, fine, period, under, height",
    [
        # In a period of 10 s a valve lets a pin go anywhere.
        (0.010, 0.013, 10.0, 1.0, 0.014),  # a third of what the halves changed is added
        (3e-3, 0.0, 10.0, 1.0, 0.0),  # no further than the end stops
        (STROKE - 3e-3, STROKE, 10.0, 1.0, STROKE),
        (40e-3, 40e-3 + WAY, 5e-3, 1.0, 40e-3 + WAY),  # nor than the valve
        (40e-3, 30e-3, 5e-3, 30e-3, 30e-3 - WAY),  # or the finger can take it
    ],
)
def test_richardsons_extrapolation_keeps_to_where_a_pin_can_be(coarse, fine, period, under, height):
    reach = find_speeds(CELL).reach(
        np.full((1, 1), 40e-3), np.full((3, 1, 1), under), np.array([period])
    )
    fines, coarses = (np.full((CELL.rows + 1, 1, 1), value) for value in (fine, coarse))
    extrapolate(CELL, fines, coarses, reach)
    assert fines[0, 0, 0] == pytest.approx(height, rel=1e-12)
    # No filter pulls.
    assert (fines[CELL.pulp_rows] == max(fine + (fine - coarse) / 3.0, 0.0)).all()
    assert fines[CELL.rows] == fine  # commands on their way are not extrapolated
