"""A cell's parts: the cylinder (equations 1, 2), dead time and valve lag (9), the pulp (10 to 14)."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.engine.system import make_segments
from digiclay.core.model.actuator import Actuator, Supply
from digiclay.core.model.contact import LARGEST_EXPONENT, Contact
from digiclay.core.model.delay import Delay, split_delay
from digiclay.core.model.fingertip import LEVEL, Fingertip
from digiclay.core.model.lag import ValveLag
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.model.physics import find_speeds
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.model.valve import Fluid, Valve
from digiclay.core.steppers.explicit import RungeKutta4
from scipy.integrate import quad
from scipy.optimize import brentq

from tests.assemble import AWAY, Motion, make_system, one_cell, path, record, scripted, table, under

RAISE, LOWER = scripted(lambda t, x, y: 1.0), scripted(lambda t, x, y: -1.0)
STEPPERS = pytest.mark.parametrize(
    "stepper, step", [("bernoulli", 1e-3), ("runge_kutta_4", 0.5e-3)]
)
#: Force that the high reservoir balances, N: half a bar on a bore of 2 mm.
BALANCE = 0.5e5 * math.pi * 1e-6


def test_pressure_is_force_and_speed_flow_over_area_and_reservoirs_move_pins_their_way_alone():
    assert Actuator().pressure(np.array([BALANCE])) == pytest.approx(0.5e5, rel=1e-15)
    flow = np.array([1, 1, -1, -1, 1]) * math.pi * 1e-8
    height = np.array([50e-3, 100e-3, 0.0, 100e-3, 0.0])
    assert Actuator().rate(flow, height) == pytest.approx(
        [10e-3, 0.0, 0.0, -10e-3, 10e-3], rel=1e-14
    )
    above, below = (one_cell(supply=Supply(*ends)) for ends in ((0.8e5, 0.2e5), (-0.2e5, -0.8e5)))
    assert find_speeds(above.cell).fall == find_speeds(below.cell).rise == below.fastest == 0.0


@pytest.mark.parametrize(
    "parts, rise, fall, digits",
    [
        ({}, 24e-3, -24e-3, 0.01),  # as printed
        # The fast preset; to one digit.
        (
            {"valve": Valve(orifice_diameter=0.6e-3)},
            50e-3,
            -50e-3,
            0.05,
        ),
        ({"fluid": Fluid(viscosity=1.6e-9)}, 0.0, 0.0, math.inf),  # turbulent
        ({"supply": Supply(0.8e5, -0.2e5)}, 38.4e-3, -9.6e-3, 0.01),  # as the drops
    ],
)
def test_a_free_cell_has_the_printed_speed_at_full_valve_exactly_that_of_the_bound(
    parts, rise, fall, digits
):
    for control, printed in ((RAISE, rise), (LOWER, fall)):
        system = one_cell(dead_time=0.0, valve_lag=None, control=control, **parts)
        height, bound = record(system, AWAY, 3).height[:, 0], find_speeds(system.cell)
        speed = (height[3] - height[2]) / system.period
        assert speed == pytest.approx(bound.rise if control is RAISE else bound.fall, rel=1e-9)
        assert math.isinf(digits) or speed == pytest.approx(printed, rel=digits)
        assert system.fastest == bound.rise > 0.0 > bound.fall


@pytest.mark.parametrize(
    "start, pulp, count, error, stepper, step",
    [
        # The pole is 150 1/s or faster: half a second leaves rounding.
        (49e-3, None, 100, 1e-9, "bernoulli", 1e-3),
        (47e-3, None, 100, 1e-9, "bernoulli", 1e-3),
        (47e-3, None, 100, 1e-9, "runge_kutta_4", 0.5e-3),
        # The pulp still creeps at 3 s, and the flow that makes up for it costs some 0.2 % of the
        # pressure.
        (47e-3, Relaxation(), 600, 5e-3, "bernoulli", 1e-3),
    ],
)
def test_a_pin_under_a_still_finger_comes_to_the_balance_force(
    start, pulp, count, error, stepper, step
):
    # The finger stays with its underside at 48 mm; whatever the start, P_s A_a balances it in the
    # end.
    system = one_cell(
        actuator=Actuator(rest_height=start),
        relaxation=pulp,
        contact=Contact(stiffness=1000.0),
        control=RAISE,
        stepper=stepper,
        step=step,
    )
    run = record(system, path((0.0, 0.0, 0.0, 48.0)), count)
    assert run.force[-1, 0] == pytest.approx(BALANCE, rel=error)


@STEPPERS
@pytest.mark.parametrize("control, stop", [(RAISE, 100e-3), (LOWER, 0.0)])
def test_a_pin_rests_exactly_at_its_end_stop(control, stop, stepper, step):
    start = Actuator(rest_height=98e-3 if stop else 2e-3)
    run = record(one_cell(actuator=start, control=control, stepper=stepper, step=step), AWAY, 60)
    assert run.height[-10:, 0].tolist() == [stop] * 10


@STEPPERS
def test_a_pin_on_its_end_stop_feels_the_indentation_beyond_where_force_begins(stepper, step):
    # The valve is open downwards: the stop holds the pin, and the finger presses on it.
    contact, start = Contact(offset=0.5e-3), Actuator(rest_height=0.0)
    system = one_cell(
        actuator=start, contact=contact, relaxation=None, control=LOWER, stepper=stepper, step=step
    )
    run = record(
        system, path((0.0, 0.0, 0.0, 1.0), (0.05, 0.0, 0.0, -1.5), (0.1, 0.0, 0.0, -1.5)), 20
    )
    m, wanted = contact.exponent, contact.share * contact.stiffness / contact.exponent
    assert run.height[-1, 0] == 0.0
    assert run.force[-1, 0] == pytest.approx(wanted * math.expm1(m * 1.0e-3), rel=1e-9)


def test_a_finger_is_not_missed_by_pins_that_rise_towards_it_as_fast_as_they_can():
    # A set of cells serves for 32 periods and counts on no pin rising faster than `fastest`. The
    # pins come up 29 mm, to a finger that stands still 25 mm above them.
    start = Actuator(bore=0.5e-3, rest_height=10e-3)
    system = make_system(Layout(9, 9), dead_time=0.0, valve_lag=None, control=RAISE, actuator=start)
    count, still = round(29e-3 / (system.fastest * system.period)), path((0.0, 0.0, 0.0, 35.0))
    force = record(system, still, count).force
    assert count < 64
    assert force[-1].max() > 0.0
    assert np.array_equal(record(replace(system, fastest=1.0), still, count).force, force)


PERIOD = 5e-3
DEAD_TIMES = [0.0, 1e-3, 0.37e-3, 2.5e-3, 4.9999e-3, 5e-3, 7.3e-3, 10e-3, 12e-3]
#: Commands of successive periods, none of them 0: a valve is not to be cut short as shut.
COMMANDS = [0.5, -1.0, 0.25, 1.0, 0.125, -0.5, -0.75, 1.0, 0.3, 0.6, -0.2, 0.4]

SCRIPT = scripted(lambda t, x, y: COMMANDS[min(int(t / PERIOD + 1e-6), len(COMMANDS) - 1)])


def opening(dead_time, time):
    """Return the analytic opening: exponentials from one command's arrival to the next one's."""
    value, last = 0.0, dead_time
    for index, target in enumerate(COMMANDS):
        arrival = dead_time + index * PERIOD
        end = min(arrival + PERIOD, time)
        if end > arrival:
            value, last = target + (value - target) * math.exp(-(end - arrival) / 2e-3), end
    return value if time > last - 1e-12 else math.nan


@pytest.mark.parametrize("dead_time", DEAD_TIMES)
def test_the_opening_follows_the_command_the_dead_time_later(dead_time):
    for step in (0.5e-3, 5e-3):
        system = one_cell(dead_time=dead_time, step=step, control=SCRIPT)
        run = record(system, AWAY, len(COMMANDS))
        analytic = [opening(dead_time, t) if t > dead_time else 0.0 for t in run.time]
        # Rounding of some hundred exponentials; a dead time rounded to the step would be off by
        # 0.1.
        assert run.rows[:, system.cell.lag_rows.start, 0] == pytest.approx(analytic, abs=1e-12)
        assert np.all(run.height[run.time <= dead_time] == 40e-3)  # nothing moves before


@pytest.mark.parametrize("stepper, step", [("bernoulli", 1e-3), ("runge_kutta_4", 0.25e-3)])
@pytest.mark.parametrize("dead_time", [0.37e-3, 7.3e-3])
def test_a_free_pin_moves_as_the_delayed_opening_says(dead_time, stepper, step):
    system = one_cell(dead_time=dead_time, step=step, stepper=stepper, control=SCRIPT)
    run, law = record(system, AWAY, len(COMMANDS)), system.cell.flow
    full = float(law.flow(np.ones(1), np.array([0.5e5]))[0]) / system.cell.actuator.area
    series = law.resistance * law.valve.laminar

    def speed(time):
        k = opening(dead_time, time)
        return full * math.copysign(k**2 * (1.0 + series) / (1.0 + series * k**2), k)

    arrivals = [
        dead_time + i * PERIOD
        for i in range(len(COMMANDS))
        if dead_time + i * PERIOD < run.time[-1]
    ]
    way = quad(speed, dead_time, run.time[-1], points=arrivals, limit=400, epsabs=1e-12)[0]
    # Where the opening changes sign, a step that does not end there is off by some 20 nm;
    # a dead time rounded to the step would show as 5 µm.
    assert run.height[-1, 0] - run.height[0, 0] == pytest.approx(way, abs=0.2e-6)


@pytest.mark.parametrize("dead_time", [0.37e-3, 7.3e-3])
def test_a_step_that_holds_the_arrival_of_a_command_is_as_exact_as_short_ones(dead_time):
    rising = scripted(lambda t, x, y: abs(COMMANDS[min(int(t / PERIOD + 1e-6), len(COMMANDS) - 1)]))
    beds = (
        one_cell(dead_time=dead_time, step=step, control=rising) for step in (PERIOD, PERIOD / 50)
    )
    long, short = (record(bed, AWAY, len(COMMANDS)).height[-1, 0] for bed in beds)
    # 10 nm; 2 µm without Gauss points on either side of the kink that the opening has there.
    assert long == pytest.approx(short, abs=0.05e-6)


@pytest.mark.parametrize("dead_time", [*DEAD_TIMES, 15e-3])
def test_commands_kept_and_the_cut_make_up_the_dead_time_and_steps_fill_the_period(dead_time):
    queue, stepper = split_delay(Delay(dead_time), PERIOD), RungeKutta4()
    whole = queue.length - (2 if queue.cut else 1)
    assert whole * PERIOD + queue.cut == pytest.approx(dead_time, abs=1e-15)  # rounding
    assert (queue.cut == 0.0) == (round(dead_time / PERIOD, 9) % 1.0 == 0.0)
    # The next command is seen from the instant of its arrival on, where a step ends.
    assert [queue.seen(time) for time in (0.0, 0.999 * queue.cut, queue.cut)] == [
        0,
        0,
        int(queue.cut > 0.0),
    ]
    parts, instants = make_segments(stepper, queue.cut, PERIOD, 5)
    ends = [part.start + part.length for part in parts]
    assert [part.start for part in parts] == pytest.approx([0.0, *ends[:-1]], abs=1e-18)
    assert ends[-1] == pytest.approx(PERIOD, abs=1e-18)
    for part in parts:
        wanted = [part.start + node * part.length for node in stepper.nodes]
        assert instants[list(part.nodes)] == pytest.approx(wanted, abs=1e-15)


@table(
    "modulus, stiffness, felt",
    {
        "oil": (1e9, 78540.0, 0.998),
        "oil with 1 % air": (1.0 / (0.99 / 1e9 + 0.01 / 1e5), 778.0, 0.81),
        "air": (1e5, 7.85, 0.0407),
    },
)
def test_compressible_fluid_would_soften_a_shut_pin_as_the_page_on_equations_says(
    modulus, stiffness, felt
):
    actuator, contact = Actuator(), Contact()
    spring = modulus * actuator.area**2 / (actuator.area * 40e-3)
    assert spring == pytest.approx(stiffness, rel=1e-3)

    def find_travel(force, give):
        """Return how far a finger presses, m, a pin that gives way, m/N, to a force."""

        def miss(travel):
            depth = travel - give * force
            return contact.share * float(contact.tension(np.array([depth]))[0]) - force

        return brentq(miss, 0.0, 1.0, xtol=1e-15)

    slopes = [
        2e-4 / (find_travel(50.1e-3, give) - find_travel(49.9e-3, give))
        for give in (0.0, 1.0 / spring)
    ]
    assert slopes[1] / slopes[0] == pytest.approx(felt, rel=5e-3)


TIMES, WEIGHTS = (4e-3, 70e-3, 1.4), (0.08, 0.62, 0.20, 0.10)


def test_tension_begins_at_the_offset_follows_the_exponential_and_stays_finite():
    contact, depth = Contact(), np.array([0.3e-3, 1e-3, 2.4e-3])
    expected = [250.0 / 2000.0 * (math.exp(2000.0 * x) - 1.0) for x in depth]
    assert contact.tension(depth) == pytest.approx(expected, rel=1e-13)  # rounding
    # T = b x (1 + m x/2): at 1 nm the second term is 1e-6.
    assert contact.tension(np.array([1e-9])) / 1e-9 == pytest.approx(250.0, rel=2e-6)
    assert (
        Contact(offset=0.5e-3).tension(np.array([-1.0, 0.0, 0.4e-3, 0.5e-3])).tolist() == [0.0] * 4
    )
    # T' = b + m T, by a central difference: truncation (m dx)²/6, 7e-9; rounding 1e-10.
    dx = 1e-7
    low, here, high = contact.tension(np.array([1e-3 - dx, 1e-3, 1e-3 + dx]))
    assert (high - low) / (2 * dx) == pytest.approx(250.0 + 2000.0 * here, rel=1e-7)
    most = Contact().tension(np.array([1.0, 1e6]))
    assert np.isfinite(most * most).all()  # sums of squares tell whether all is finite
    assert LARGEST_EXPONENT / Contact().exponent > 0.1  # more than a stroke


@pytest.mark.parametrize("arrangement, share", [("aligned", 0.34), ("hexagonal", 0.29)])
def test_the_cells_together_carry_what_a_flat_plate_does(arrangement, share):
    # The share f_d was fitted for this: 0.34 on the square grid, 0.29 on the hexagonal one. One
    # constant cannot match all depths: a quarter from 1 to 2.4 mm, averaged over where the finger
    # stands.
    contact = Contact(share=share)
    bed = make_grid(Layout(rows=15, columns=15, arrangement=arrangement))
    offsets = np.stack(np.meshgrid(np.arange(6), np.arange(6)), axis=-1).reshape(-1, 2) * 0.5e-3
    for depth in (1e-3, 1.5e-3, 2e-3, 2.4e-3):
        poses = np.array([[x, y, -depth, *LEVEL] for x, y in offsets])
        carried = share * contact.tension(-under(Fingertip().outline(poses), bed.x, bed.y)).sum(
            axis=1
        )
        assert carried.mean() == pytest.approx(
            float(contact.tension(np.array([depth]))[0]), rel=0.25
        )


def reduced(time):
    """Return G(t) as equation 12 is written."""
    decays = (c * math.exp(-time / t) for c, t in zip(WEIGHTS[1:], TIMES, strict=True))
    return (WEIGHTS[0] + sum(decays)) / sum(WEIGHTS)


def convolved(depth, speed, time):
    """Return the force by equation 10: G convolved with dT/dt = (b + m T) dx/dt, by adaptive quadrature."""

    def integrand(tau):
        x = depth(tau)
        return reduced(time - tau) * 250.0 * math.exp(2000.0 * x) * speed(tau) if x > 0.0 else 0.0

    # G falls by 0.62 within 4 ms of the end: that stretch gets its own panels.
    points = [time - s for s in (3e-3, 12e-3, 40e-3) if s < time]
    return quad(integrand, 0.0, time, points=points or None, epsabs=1e-12, epsrel=1e-11, limit=400)[
        0
    ]


def filtered(own, first, last, step):
    """Return the filters after a step in which the tension goes linearly from `first` to `last`."""
    return Relaxation().propagator(step) @ np.array([*own, first, 0.5 * (first + last), last])


def test_relaxation_is_the_sum_of_equation_12_and_what_relaxes_quicker_than_the_step_a_share():
    times = np.array([0.0, 1e-3, 5e-3, 0.1, 1.0, 100.0])
    # Rounding.
    assert Relaxation().reduced(times) == pytest.approx([reduced(t) for t in times], rel=1e-14)
    assert Relaxation().reduced(times[[0, -1]]) == pytest.approx([1.0, 0.08], abs=1e-15)
    # The slowest of 1 ns filters in a step of 5 ms: all but 2 in 5e6 of the tension is lost at
    # once.
    quick = Relaxation(times=(1e-9, 1e-9, 1e-9))
    weights, share = quick.mean_loss_map(5e-3)
    assert share == pytest.approx(float(quick.shares.sum()), rel=1e-6)
    assert np.all(np.abs(weights) < 1e-6)


@pytest.mark.parametrize("slope", [0.0, 3.0])
@pytest.mark.parametrize("step, count", [(1e-4, 500), (1e-3, 200), (20e-3, 10), (50e-3, 4)])
def test_a_constant_and_a_linear_tension_are_filtered_exactly(step, count, slope):
    own, start = np.zeros(3), 0.0 if slope else 1.7
    for i in range(count):
        own = filtered(own, start + slope * i * step, start + slope * (i + 1) * step, step)
    time = count * step
    expected = (
        start * reduced(time) + slope * quad(reduced, 0.0, time, epsabs=1e-13, epsrel=1e-13)[0]
    )
    # 500 steps of rounding stay below 1e-10.
    assert start + slope * time - Relaxation().relaxed(own) == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize(
    "stepper, step, tolerance", [("bernoulli", 1e-4, 1e-4), ("runge_kutta_4", 5e-4, 1e-6)]
)
@table(
    "depth, speed",
    {
        "ramp": (lambda t: 20e-3 * t, lambda t: 20e-3),
        "sine": (lambda t: 1e-3 * (1.0 - math.cos(40.0 * t)), lambda t: 40e-3 * math.sin(40.0 * t)),
    },
)
def test_filters_agree_with_the_convolution(depth, speed, stepper, step, tolerance):
    # A locked pin that the finger presses; the errors of the frozen and linear parts are of order 2
    # and 4.
    system = one_cell(contact=Contact(share=1.0), stepper=stepper, step=step)
    force = record(
        system, Motion(lambda times: 40e-3 - np.array([depth(t) for t in times])), 16
    ).force
    for count in (4, 16):
        expected = convolved(depth, speed, count * system.period)
        assert expected > 0.05
        assert force[count, 0] == pytest.approx(expected, rel=tolerance)


def test_a_pulp_one_of_whose_filters_is_cut_in_two_is_the_same():
    halves = Relaxation(
        (TIMES[0], *TIMES), (WEIGHTS[0], 0.5 * WEIGHTS[1], 0.5 * WEIGHTS[1], *WEIGHTS[2:])
    )
    motion = Motion(lambda times: 40e-3 - 20e-3 * times)
    whole, cut = (
        record(one_cell(relaxation=pulp), motion, 20).force for pulp in (Relaxation(), halves)
    )
    assert whole.max() > 0.05
    assert cut == pytest.approx(whole, rel=1e-12)  # rounding


@pytest.mark.parametrize("step", [1e-6, 1e-3, 5e-3, 50e-3])
def test_the_force_lost_over_a_step_is_its_mean_for_a_linear_tension(step):
    own, first, last = np.array([0.3, 0.2, 0.1]), 2.0, 1.2

    def lost_at(time):
        now = first + (last - first) * time / step
        return float(Relaxation().relaxed(filtered(own, first, now, time)))

    weights, share = Relaxation().mean_loss_map(step)
    foreseen = weights @ [*own, first] + share * 0.5 * (first + last)
    # Rounding: what a filter gains in a step of 1 µs is a difference of numbers a million times
    # larger.
    assert foreseen == pytest.approx(quad(lost_at, 0.0, step, epsrel=1e-12)[0] / step, rel=1e-9)


@pytest.mark.parametrize("duration", [40e-3, 60e-3, 100e-3])
def test_a_tap_loses_81_percent_of_its_work(duration):
    # A half sine of 2 mm. The weights were fitted to 81 % a tap; in 30 ms to 1 s all lose 78 to 81
    # %.
    depth = 2e-3 * np.sin(np.pi * np.linspace(0.0, 1.0, 251))
    own, forces = np.zeros(3), [0.0]
    for first, last in itertools.pairwise(Contact().tension(depth)):
        own = filtered(own, first, last, duration / 250)
        forces.append(max(last - float(Relaxation().relaxed(own)), 0.0))
    work = 0.5 * (np.array(forces[1:]) + forces[:-1]) * np.diff(depth)
    assert work.sum() / work[work > 0.0].sum() == pytest.approx(0.81, abs=0.03)


def test_a_valve_that_closes_is_open_until_a_billionth():
    closing = scripted(lambda t, x, y: 1.0 if t < 0.05 else 0.0)
    system = make_system(Layout(1, 2), dead_time=0.0, valve_lag=ValveLag(50e-3), control=closing)
    run = record(system, AWAY, 230)
    opening = run.rows[1:, system.cell.lag_rows.start]
    exact = -np.expm1(-1.0) * np.exp(-(run.time[11:] - 50e-3) / 50e-3)
    # Of the sets that are made anew every 0.16 s; 7e-6 if a valve is shut at 1e-4.
    np.testing.assert_allclose(opening[10:], exact[:, None].repeat(2, 1), rtol=1e-9, atol=1e-9)
    assert opening[9].min() > 0.6
