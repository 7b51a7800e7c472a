"""Sensor models: noise, quantization and delay, and what a session makes of them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.arrays import Floats
from digiclay.core.model.interfaces import Sensors, Truth
from digiclay.core.model.null_parts import PerfectSensors
from digiclay.core.model.sensors import Delayed, NoiseAhead, Noisy, Quantized, Sensing, draw_normals
from digiclay.core.scene.assembly import assemble
from digiclay.core.session.run_scene import run

from tests.assemble import record, sample

CELLS = 500
PERIODS = 400
COUNT = CELLS * PERIODS
#: Five standard errors: a sound generator fails such a check once in a million seeds.
SURE = 5.0


def heights(*settings: str) -> Floats:
    """Run a sample scene; return the history of its heights, m."""
    return np.asarray(run(sample("slow_press", *settings)).history["height"])


def truth(period: int, force: Sequence[float], height: Sequence[float]) -> Truth:
    """Return what there is of cells 0, 1, ..."""
    count = len(force)
    return Truth(np.arange(count), period, np.array(force), np.array(height), np.zeros(count))


@cache
def field(seed: int = 3) -> tuple[Floats, Floats]:
    """Return both kinds of noise, (PERIODS, CELLS) each."""
    both = np.array([draw_normals(seed, period, np.arange(CELLS)) for period in range(PERIODS)])
    return both[:, 0], both[:, 1]


# Variance of the mean of n powers of a normal number: 1, 2, 15 and 105 - 9, over n.
@pytest.mark.parametrize(("moment", "normal", "variance"), [(1, 0, 1), (2, 1, 2), (3, 0, 15), (4, 3, 96)])
def test_noise_has_the_moments_of_a_normal_distribution(moment: int, normal: float, variance: float) -> None:
    off = [abs((one**moment).mean() - normal) for one in field()]
    assert max(off) < SURE * np.sqrt(variance / COUNT)


def test_noise_of_other_cells_periods_quantities_and_seeds_is_independent() -> None:
    force, height = field()
    some, (every, _) = np.array([7, 400, 3]), field()
    np.testing.assert_array_equal(draw_normals(3, 9, some)[0], every[9, some])
    others = [np.roll(force, apart, (0, 1)) for apart in ((0, 1), (0, 25), (1, 0), (1, 1), (2, 0))]
    for other in (*others, height, field(4)[0]):
        # The mean of n products of independent normal numbers has standard error 1 / sqrt(n).
        assert abs((force * other).mean()) < SURE / np.sqrt(COUNT)
    # Box and Muller's radius is shared: the squares must be independent too; each has variance 2.
    assert abs(((force**2 - 1.0) * (height**2 - 1.0)).mean()) < SURE * 2.0 / np.sqrt(COUNT)


@pytest.mark.parametrize("seed", [8, np.array([8, 3])])
def test_noise_drawn_ahead_is_that_of_its_period_and_cells_in_any_order(seed: Any) -> None:
    shape = np.shape(seed)
    drawn = NoiseAhead(seed, 1.0, 1.0)
    some = [2, 7]
    asked = [(4, 9), (4, 30), (5, 9), (19, 30), (20, 30), (19, 30), (4, 30), (4, 31), (5, some), (5, 9)]
    for period, cells in asked:
        numbers = np.arange(cells) if isinstance(cells, int) else np.array(cells)
        numbers = np.broadcast_to(numbers.reshape(-1, *[1] * len(shape)), (len(numbers), *shape))
        np.testing.assert_array_equal(drawn.draw(period, numbers), draw_normals(seed, period, numbers))


def test_noise_is_added_in_proportion_to_its_standard_deviation() -> None:
    sensors, seen = Noisy(PerfectSensors(), 2e-3, 5e-6, 8), truth(4, [0.1, 0.2], [0.04, 0.05])
    first, second = draw_normals(8, 4, seen.cells)
    force, height = sensors.measure(np.empty((0, 2)), seen)
    np.testing.assert_array_equal(force, seen.force + 2e-3 * first)
    np.testing.assert_array_equal(height, seen.height + 5e-6 * second)


def test_readings_noise_and_all_are_the_nearest_whole_steps_and_a_step_of_zero_rounds_nothing() -> None:
    seen, own = truth(0, [0.3, 0.4, 0.12], [0.3, 0.0, 1.0]), np.empty((0, 3))
    force, height = Quantized(PerfectSensors(), 0.25, 0.125).measure(own, seen)
    # Steps that are powers of two: not even a rounding error is allowed.
    assert force.tolist() == [0.25, 0.5, 0.0]
    assert height.tolist() == [0.25, 0.0, 1.0]
    assert Quantized(PerfectSensors(), 0.0, 0.125).measure(own, seen)[0] is seen.force
    sensors = assemble(sample("slow_press", "sensors.force_noise=5 mN", "sensors.force_step=1 mN")).sensors
    force, _ = sensors.measure(np.empty((0, 9)), truth(1, [0.02] * 9, [0.04] * 9))
    np.testing.assert_array_equal(force, np.rint(force / 1e-3) * 1e-3)
    assert np.unique(force).size > 3


@pytest.mark.parametrize("step", [0.0, 1.0, 4.0, 7.5])
def test_no_force_reads_above_the_floor_of_five_standard_deviations_and_half_a_step(step: float) -> None:
    floor = Sensing(force_noise=1.0, force_step=step).force_floor
    assert (floor, Sensing(force_step=step).force_floor) == (pytest.approx(5.0 + step / 2, abs=1e-12), 0.0)
    sensors = Quantized(Noisy(PerfectSensors(), 1.0, 0.0, 5), step, 0.0)
    nothing = (truth(period, [0.0] * CELLS, [0.04] * CELLS) for period in range(PERIODS))
    read = max(float(sensors.measure(np.empty((0, CELLS)), seen)[0].max()) for seen in nothing)
    # 200 000 readings: one in 3.5 million would be above.
    assert read < floor


def readings(sensors: Sensors, truths: Sequence[Truth], skipped: Sequence[int] = ()) -> Floats:
    """Return what is read of cell 0, (t, 2), where it takes no part in some periods."""
    own, read = np.zeros((sensors.rows, 1)), []
    for seen in truths:
        if seen.period and seen.period not in skipped:
            sensors.update(own, seen)
        before = own.copy()
        read.append([float(one[0]) for one in sensors.measure(own, seen)])
        np.testing.assert_array_equal(own, before)
    return np.array(read)


RAMP = [truth(i, [0.1 * i], [40e-3 + 1e-3 * i]) for i in range(9)]


@pytest.mark.parametrize("late", [1, 2, 4, 5])
def test_readings_are_late_by_whole_periods_and_begin_with_that_of_the_start(late: int) -> None:
    read = readings(Delayed(PerfectSensors(), late, 40e-3), RAMP)
    expected = [[seen.force[0], seen.height[0]] for seen in RAMP]
    assert read.tolist() == [[0.0, 40e-3]] * late + expected[:-late]


@pytest.mark.parametrize("late", [1, 3])
@pytest.mark.parametrize("gap", [(6,), (6, 7), (6, 7, 8), (6, 7, 8, 9, 10, 11, 12), (1, 2), (1, 6, 9)])
def test_a_cell_that_took_no_part_while_nothing_changed_is_read_as_if_it_had(late, gap):
    level, truths = 40e-3, []
    for i in range(20):
        level += 0.0 if i in gap or i == 0 else 1e-3 * i
        truths.append(truth(i, [0.0], [level]))
    sensors = Delayed(Noisy(PerfectSensors(), 1e-3, 1e-5, 2), late, 40e-3)
    np.testing.assert_array_equal(readings(sensors, truths, gap), readings(sensors, truths))


ALL = ("sensors.force_noise=0.5 mN", "sensors.height_noise=5 um", "sensors.delay=1")


def test_the_seed_makes_the_session_also_one_taken_up_again_in_the_middle() -> None:
    noisy, other = (sample("slow_press", *ALL, f"sensors.seed={seed}") for seed in (0, 1))
    path = noisy.section("trajectory").trajectory()
    first, second = (record(assemble(one), path, 200) for one in (noisy, other))
    assert np.abs(first.height - second.height).max() > 1e-6
    rest = record(assemble(noisy), path, 93, record(assemble(noisy), path, 107).last)
    np.testing.assert_array_equal(rest.height, first.height[107:])


def test_coarse_height_sensors_change_the_session_and_perfect_ones_do_not() -> None:
    plain = heights()
    assert np.abs(heights("sensors.height_step=0.5 mm") - plain).max() > 1e-4
    np.testing.assert_array_equal(heights("sensors.delay=0"), plain)
