"""Sensor models: noise, quantization and delay, what a session makes of them; the observer of the force."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from digiclay.core.control.virtual_master import VirtualMaster
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.model.control_interface import Measurement
from digiclay.core.model.null_parts import PerfectSensors
from digiclay.core.model.sensors import Delayed, NoiseAhead, Noisy, Quantized, Sensing, draw_polar
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.run_scene import run
from numpy.testing import assert_array_equal

from tests.assemble import over_middle, record, sample, scripted

CELLS = 500
PERIODS = 400
COUNT = CELLS * PERIODS
#: Five standard errors: a sound generator fails such a check once in a million seeds.
SURE = 5.0


def heights(*settings):
    known = sample("slow_press", "simulation.duration=1.2", *settings)
    return np.asarray(run(known).history["height"])


def show(force, height):
    cells, nothing = np.arange(len(force)), np.zeros(len(force))
    return Measurement(
        quadratic_basis=np.empty(0),
        height=np.array(height),
        force=np.array(force),
        target=nothing,
        mode=nothing.astype(np.int8),
        own=np.empty((0, cells.size)),
        cells=cells,
        command=nothing,
        sensed=np.empty((0, cells.size)),
    )


def draw_normals(seed, period, cells):
    radius, angle = draw_polar(seed, period, cells)
    return radius * np.cos(angle), radius * np.sin(angle)


@cache
def field(seed=3):
    both = np.array([draw_normals(seed, period, np.arange(CELLS)) for period in range(PERIODS)])
    return both[:, 0], both[:, 1]


# Variance of the mean of n powers of a normal number: 1, 2, 15 and 105 - 9, over n.
@pytest.mark.parametrize("moment, normal, variance", [(1, 0, 1), (2, 1, 2), (3, 0, 15), (4, 3, 96)])
def test_noise_has_the_moments_of_a_normal_distribution(moment, normal, variance):
    off = [abs((one**moment).mean() - normal) for one in field()]
    assert max(off) < SURE * np.sqrt(variance / COUNT)


def test_noise_of_other_cells_periods_quantities_and_seeds_is_independent():
    force, height = field()
    some, (every, _) = np.array([7, 400, 3]), field()
    assert_array_equal(draw_normals(3, 9, some)[0], every[9, some])
    others = [np.roll(force, apart, (0, 1)) for apart in ((0, 1), (0, 25), (1, 0), (1, 1), (2, 0))]
    for other in (*others, height, field(4)[0]):
        # The mean of n products of independent normal numbers has standard error 1 / sqrt(n).
        assert abs((force * other).mean()) < SURE / np.sqrt(COUNT)
    # Box and Muller's radius is shared: the squares must be independent too; each has variance 2.
    assert abs(((force**2 - 1.0) * (height**2 - 1.0)).mean()) < SURE * 2.0 / np.sqrt(COUNT)


@pytest.mark.parametrize("seed", [8, np.array([8, 3])])
def test_noise_drawn_ahead_is_that_of_its_period_and_cells_in_any_order(seed):
    shape = np.shape(seed)
    drawn = NoiseAhead(seed, 1.0, 1.0)
    some = [2, 7]
    asked = [
        (4, 9),
        (4, 30),
        (5, 9),
        (19, 30),
        (20, 30),
        (19, 30),
        (4, 30),
        (4, 31),
        (5, some),
        (5, 9),
    ]
    for period, cells in asked:
        numbers = np.arange(cells) if isinstance(cells, int) else np.array(cells)
        numbers = np.broadcast_to(numbers.reshape(-1, *[1] * len(shape)), (len(numbers), *shape))
        assert_array_equal(drawn.draw(period, numbers), draw_normals(seed, period, numbers))


def test_noise_is_added_in_proportion_to_its_standard_deviation():
    sensors, seen = Noisy(PerfectSensors(), 2e-3, 5e-6, 8), show([0.1, 0.2], [0.04, 0.05])
    first, second = draw_normals(8, 4, seen.cells)
    force, height = sensors.measure(seen, 4)
    assert_array_equal(force, seen.force + 2e-3 * first)
    assert_array_equal(height, seen.height + 5e-6 * second)
    assert Noisy(PerfectSensors(), 2e-3, 0.0, 8).measure(seen, 4)[1] is seen.height


def test_readings_noise_and_all_are_the_nearest_whole_steps_and_a_step_of_zero_rounds_nothing():
    seen = show([0.3, 0.4, 0.12], [0.3, 0.0, 1.0])
    force, height = Quantized(PerfectSensors(), 0.25, 0.125).measure(seen, 0)
    # Steps that are powers of two: not even a rounding error is allowed.
    assert force.tolist() == [0.25, 0.5, 0.0]
    assert height.tolist() == [0.25, 0.0, 1.0]
    assert Quantized(PerfectSensors(), 0.0, 0.125).measure(seen, 0)[0] is seen.force
    sensors = assemble(
        sample("slow_press", "sensors.force_noise=5 mN", "sensors.force_step=1 mN")
    ).sensors
    force, _ = sensors.measure(show([0.02] * 9, [0.04] * 9), 1)
    assert_array_equal(force, np.rint(force / 1e-3) * 1e-3)
    assert np.unique(force).size > 3


@pytest.mark.parametrize("step", [0.0, 1.0, 4.0, 7.5])
def test_no_force_reads_above_the_floor_of_five_standard_deviations_and_half_a_step(step):
    floor = Sensing(force_noise=1.0, force_step=step).force_floor
    assert (floor, Sensing(force_step=step).force_floor) == (
        pytest.approx(5.0 + step / 2, abs=1e-12),
        0.0,
    )
    sensors = Quantized(Noisy(PerfectSensors(), 1.0, 0.0, 5), step, 0.0)
    nothing = show([0.0] * CELLS, [0.04] * CELLS)
    read = max(float(sensors.measure(nothing, period)[0].max()) for period in range(PERIODS))
    # 200 000 readings: one in 3.5 million would be above.
    assert read < floor


def readings(sensors, truths, skipped=()):
    """Return what is read of cell 0, (t, 2), with forces and heights, where some periods leave it out."""
    own, read = np.zeros((sensors.rows, 1)), []
    for period, (force, height) in enumerate(truths):
        seen = show([force], [height])._replace(sensed=own)
        if period and period not in skipped:
            sensors.note(seen, period)
        before = own.copy()
        read.append([float(one[0]) for one in sensors.measure(seen, period)])
        assert_array_equal(own, before)
    return np.array(read)


RAMP = [(0.1 * i, 40e-3 + 1e-3 * i) for i in range(9)]


@pytest.mark.parametrize("late", [1, 2, 4, 5])
def test_readings_are_late_by_whole_periods_and_begin_with_that_of_the_start(late):
    read = readings(Delayed(PerfectSensors(), late, 40e-3), RAMP)
    assert read.tolist() == [[0.0, 40e-3]] * late + [list(true) for true in RAMP[:-late]]


@pytest.mark.parametrize("late", [1, 3])
@pytest.mark.parametrize(
    "gap", [(6,), (6, 7), (6, 7, 8), (6, 7, 8, 9, 10, 11, 12), (1, 2), (1, 6, 9)]
)
def test_a_cell_that_took_no_part_while_nothing_changed_is_read_as_if_it_had(late, gap):
    level, truths = 40e-3, []
    for i in range(20):
        level += 0.0 if i in gap or i == 0 else 1e-3 * i
        truths.append((0.0, level))
    sensors = Delayed(Noisy(PerfectSensors(), 1e-3, 1e-5, 2), late, 40e-3)
    assert_array_equal(readings(sensors, truths, gap), readings(sensors, truths))


ALL = ("sensors.force_noise=0.5 mN", "sensors.height_noise=5 um", "sensors.delay=1")


def test_seed_and_coarse_sensors_make_the_session_also_one_taken_up_again_in_the_middle():
    noisy, other = (sample("slow_press", *ALL, f"sensors.seed={seed}") for seed in (0, 1))
    path = noisy.section("trajectory").trajectory()
    first, second = (record(assemble(one), path, 200) for one in (noisy, other))
    assert np.abs(first.height - second.height).max() > 1e-6
    rest = record(assemble(noisy), path, 93, record(assemble(noisy), path, 107).last)
    assert_array_equal(rest.height, first.height[107:])
    plain = heights()
    assert np.abs(heights("sensors.height_step=0.5 mm") - plain).max() > 1e-4
    assert_array_equal(heights("sensors.delay=0"), plain)


# The force observer: what it makes of a pin's motion, beside the force that is there

PERIOD = 5e-3
PRESS = over_middle((0.0, 0.0395), (0.6, 0.036))
AWAY = over_middle((0.0, 0.09), (0.6, 0.09))


def scene(waypoints=PRESS, **sections):
    table = {
        "layout": {"rows": 1, "columns": 1},
        "control": "absent",
        "sensors": {"observer": "valve"},
        # The observer is judged here, not the integration: at the default step a run's own force is
        # off by more than the readings are, as is shown below.
        "simulation": {"physics_step": 1e-3},
    }
    return resolve({**table, "trajectory": {"waypoints": list(waypoints)}, **sections})


def sensed_by(waypoints=PRESS, **inexact):
    """Return a scene whose observer reads inexact heights."""
    return scene(waypoints, sensors={"observer": "valve", **inexact})


def watched(known, command_in, count=120):
    """Simulate; return the true forces of the pin and what the sensors read, N, shape (count + 1,)."""
    played = scripted(lambda time, x, y: command_in(round(time / PERIOD)))
    system = replace(assemble(known), controller=played(PERIOD))
    true, read = [0.0], [0.0]
    for state in periods(system, known.trajectories(), begin(system), count):
        true.append(float(state.row(system.rows.force)[0]))
        read.append(sensed(system, state))
    return np.array(true), np.array(read)


def sensed(system, state):
    """Return the force the sensors read of the pin, N; they get no true force to look at."""
    own = np.array([state.row(row) for row in range(system.rows.count)[system.rows.sensed]])
    hidden = show([np.nan], state.row(0))._replace(sensed=own)
    return float(system.sensors.measure(hidden, state.period)[0][0])


def pulled_down(period):
    return -0.8


def down_and_up(period):
    return 0.6 * math.cos(2.0 * math.pi * period / 80.0 + math.pi / 2) + (
        0.25 if period > 60 else 0.15
    )


def half_way(force):
    return np.concatenate([[0.0], 0.5 * (force[1:] + force[:-1])])


def well_open(command_in, count=120, least=0.2):
    command = np.array([0.0, *(command_in(period) for period in range(count))])
    open_now = (np.abs(command) > least) & (np.abs(np.roll(command, 1)) > least)
    return open_now & (command * np.roll(command, 1) > 0.0)


#: The lines to the valve, by the sections of a scene file that differ.
LINES = [
    {},
    {"conduit": "absent"},
    {"valve_lag": "absent"},
    {"delay": "absent"},
    {"delay": {"dead_time": 7.3e-3}},
    {"delay": {"dead_time": 5e-3}},
]
#: A valve in its turbulent branch, and a finger that follows a falling pin.
NARROW = {"valve": {"orifice_diameter": 0.4e-3, "stroke": 5e-6}, "fluid": {"viscosity": 6.5e-7}}
FALL = over_middle((0.0, 0.040), (0.4, 0.010))
PRESSED = slice(30, 68)  # the finger has caught up with the pin, which falls freely at first


@pytest.mark.parametrize("sections", LINES)
def test_the_force_on_a_pressed_moving_pin_is_found_to_three_millinewtons(sections):
    true, read = watched(scene(**sections), down_and_up)
    # At the default step too: the mean of a period is read whatever it is cut into.
    _, coarse = watched(scene(**sections, simulation={}), down_and_up)
    known = well_open(down_and_up)
    assert np.ptp(true[known]) > 0.05, "hardly a force to be found"
    # The finger loads the pin by some 0.1 N in 100 ms: within a period the force changes by up to
    # 10 mN, and a mean weighted with the conductance lies off the middle by a part of that.
    assert np.abs(np.array([read, coarse]) - half_way(true))[:, known].max() < 3e-3


def test_the_force_is_found_where_the_flow_is_turbulent():
    known = scene(FALL, **NARROW)
    true, read = watched(known, pulled_down, 75)
    assert assemble(known).cell.flow.knee / 0.8**2 < 0.5e5, "the flow is laminar"
    assert true[PRESSED].min() > 0.02, "the finger hardly presses"
    # The force's change within a period, as above; the flow's regime is settled to 0.1 mN.
    assert np.abs(read - half_way(true))[PRESSED].max() < 3e-3
    # At the default step 18 mN off at the ends of the steps, 5 mN in the means that are read: the
    # valve's law is kept over the whole step, the force at its end is what the heights left of it.
    own, coarse = watched(scene(FALL, **NARROW, simulation={}), pulled_down, 75)
    assert np.abs(coarse - half_way(true))[PRESSED].max() < 0.5 * np.abs(own - true)[PRESSED].max()


@pytest.mark.parametrize(
    "inexact, most",
    # The simulation averages the flow over 1 ms steps, the observer over the period: 18 µN between
    # them.
    [({}, 5e-5), ({"height_noise": 1e-6}, 0.0), ({"height_step": 5e-6}, 0.0)],
)
def test_an_unloaded_pin_reads_no_force_and_no_reading_is_below_zero(inexact, most):
    assert watched(sensed_by(AWAY, **inexact), down_and_up)[1].max() <= most
    read = watched(sensed_by(**inexact), down_and_up)[1]
    assert read.min() == 0.0 < read.max()


def test_the_last_estimate_is_held_while_the_valve_is_shut_at_a_stop_or_of_a_bed_at_rest():
    true, read = watched(scene(), lambda period: 0.5 if period < 60 else 0.0)
    # Five time constants of the valve, and the dead time, after period 60 it is shut.
    assert true[-1] - true[64] > 0.05, "the force does not change"
    assert read[64] > 0.05
    assert np.unique(read[64:]).size == 1
    # At an end stop too: an open valve and no motion would otherwise mean that the finger holds the
    # high reservoir, 157 mN. It rises the millimeter in 15 periods.
    assert (
        watched(
            scene(over_middle((0.0, 0.15), (0.6, 0.15)), actuator={"rest_height": 99e-3}),
            lambda period: 0.8,
        )[1].max()
        < 1e-3
    )
    # Its valves are shut, and stay shut: there is nothing to tell the force from.
    history = run(
        resolve({"layout": {"rows": 11, "columns": 11}, "sensors": {"observer": "valve"}})
    ).history
    assert history["total_force"].max() > 1.0
    assert np.ptp(history["height"]) == 0.0


def loading(flow, opening):
    """Return the force that a rise more or less by a height in a period makes at an opening, N."""
    cell = assemble(scene()).cell
    conductance = float(cell.flow.laminar_conductance(np.array([opening]))[0])
    return cell.actuator.area**2 * flow / (PERIOD * conductance)


def test_coarse_late_or_noisy_heights_cost_the_observer_what_the_flow_says():
    def read(**inexact):
        return watched(sensed_by(**inexact), down_and_up)[1]

    exact, known = read(), well_open(down_and_up, least=0.4)
    # Two heights, each half a step off, in one period.
    error = np.abs(read(height_step=1e-6) - exact)[known]
    assert 0.05 * loading(1e-6, 0.4) < error.max() <= loading(1e-6, 0.4)
    assert_array_equal(read(delay=3)[3:], exact[:-3])
    exact, noisy = (
        watched(sensed_by(height_noise=noise), lambda period: 0.4)[1] for noise in (0.0, 1e-7)
    )
    # Some hundred readings: their standard deviation is known to 7 %, and neighbors share a height.
    assert abs(np.std((noisy - exact)[10:]) / (math.sqrt(2.0) * loading(1e-7, 0.4)) - 1.0) < 0.3


@pytest.mark.parametrize("gap", [(13,), (13, 14, 15, 16, 17)])
def test_a_cell_that_took_no_part_while_its_valve_was_shut_is_observed_as_if_it_had(gap):
    sensors = assemble(sensed_by(height_noise=1e-6, delay=2)).sensors
    # Ten periods are 25 time constants of the valve: less than 1e-9 open, it counts as shut.
    command, results = [0.0, 0.5, 0.5, *[0.0] * 15, -0.5, -0.5, -0.5, 0.0, 0.0], []
    for skipped in ((), gap):
        own, level, after = np.zeros((sensors.rows, 1)), 40e-3, []
        for period, now in enumerate(command[1:], 1):
            level += 1e-5 * now
            if period not in skipped:
                seen = show([0.0], [level])._replace(command=np.array([now]), sensed=own)
                sensors.note(seen, period)
            if period > max(gap):
                after.append(own.copy())
        results.append(np.array(after))
    assert_array_equal(results[1], results[0])


def test_an_error_of_a_step_as_large_as_the_dead_band_gets_no_command():
    """Multiples of a step differ by it but for rounding, which must not decide."""
    step = 10e-6
    read = np.arange(5000) * step
    for error in (step, -step):
        assert not VirtualMaster(dead_band=step).command(read, read - error).any()
    assert VirtualMaster(dead_band=step).command(read, read - 1.01 * step).all()
