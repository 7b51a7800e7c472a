"""Dead time and valve lag (equation 9): exact while a command is held, also between steps and periods."""

from __future__ import annotations

import math

import numpy as np
import pytest
from digiclay.core.engine.system import make_segments
from digiclay.core.model.delay import Delay, Queue, split_delay
from digiclay.core.model.lag import SHUT, ValveLag
from digiclay.core.model.null_parts import InstantValve
from digiclay.core.steppers.explicit import RungeKutta4
from scipy.integrate import quad

from tests.assemble import AWAY, one_cell, record, scripted

PERIOD = 5e-3
DEAD_TIMES = [0.0, 1e-3, 0.37e-3, 2.5e-3, 4.9999e-3, 5e-3, 7.3e-3, 10e-3, 12e-3]
#: Commands of successive periods, none of them 0: a valve is not to be cut short as shut.
COMMANDS = [0.5, -1.0, 0.25, 1.0, 0.125, -0.5, -0.75, 1.0, 0.3, 0.6, -0.2, 0.4]
#: A command of four valves, and the one after it.
COMMAND, NEXT = np.array([1.0, -1.0, 0.2, 0.3]), np.array([-1.0, 0.5, 0.5, -0.3])

SCRIPT = scripted(lambda t, x, y: COMMANDS[min(int(t / PERIOD + 1e-6), len(COMMANDS) - 1)])


def opening(dead_time: float, time: float) -> float:
    """Return the analytic opening: exponentials from one command's arrival to the next one's."""
    value, last = 0.0, dead_time
    for index, target in enumerate(COMMANDS):
        arrival = dead_time + index * PERIOD
        end = min(arrival + PERIOD, time)
        if end > arrival:
            value, last = target + (value - target) * math.exp(-(end - arrival) / 2e-3), end
    return value if time > last - 1e-12 else math.nan


@pytest.mark.parametrize("dead_time", DEAD_TIMES)
def test_the_opening_follows_the_command_the_dead_time_later(dead_time: float) -> None:
    for step in (0.5e-3, 5e-3):
        system = one_cell(dead_time=dead_time, step=step, control=SCRIPT)
        run = record(system, AWAY, len(COMMANDS))
        analytic = [opening(dead_time, t) if t > dead_time else 0.0 for t in run.time]
        # Rounding of some hundred exponentials; a dead time rounded to the step would be off by 0.1.
        assert run.rows[:, system.cell.lag_rows.start, 0] == pytest.approx(analytic, abs=1e-12)
        assert np.all(run.height[run.time <= dead_time] == 40e-3)  # nothing moves before


@pytest.mark.parametrize(("stepper", "step"), [("bernoulli", 1e-3), ("runge_kutta_4", 0.25e-3)])
@pytest.mark.parametrize("dead_time", [0.37e-3, 7.3e-3])
def test_a_free_pin_moves_as_the_delayed_opening_says(dead_time: float, stepper: str, step: float) -> None:
    system = one_cell(dead_time=dead_time, step=step, stepper=stepper, control=SCRIPT)
    run, law = record(system, AWAY, len(COMMANDS)), system.cell.flow
    full = float(law.flow(np.ones(1), np.array([0.5e5]))[0]) / system.cell.actuator.area
    series = law.resistance * law.valve.laminar

    def speed(time: float) -> float:
        k = opening(dead_time, time)
        return full * math.copysign(k**2 * (1.0 + series) / (1.0 + series * k**2), k)

    arrivals = [dead_time + i * PERIOD for i in range(len(COMMANDS)) if dead_time + i * PERIOD < run.time[-1]]
    way = quad(speed, dead_time, run.time[-1], points=arrivals, limit=400, epsabs=1e-12)[0]
    # Where the opening changes sign, a step that does not end there is off by some 20 nm;
    # a dead time rounded to the step would show as 5 µm.
    assert run.height[-1, 0] - run.height[0, 0] == pytest.approx(way, abs=0.2e-6)


@pytest.mark.parametrize("dead_time", [0.37e-3, 7.3e-3])
def test_a_step_that_holds_the_arrival_of_a_command_is_as_exact_as_short_ones(dead_time: float) -> None:
    rising = scripted(lambda t, x, y: abs(COMMANDS[min(int(t / PERIOD + 1e-6), len(COMMANDS) - 1)]))
    beds = (one_cell(dead_time=dead_time, step=step, control=rising) for step in (PERIOD, PERIOD / 50))
    long, short = (record(bed, AWAY, len(COMMANDS)).height[-1, 0] for bed in beds)
    # 10 nm; 2 µm without Gauss points on either side of the kink that the opening has there.
    assert long == pytest.approx(short, abs=0.05e-6)


@pytest.mark.parametrize("dead_time", [*DEAD_TIMES, 15e-3])
def test_commands_kept_and_the_cut_make_up_the_dead_time_and_steps_fill_the_period(dead_time: float) -> None:
    queue, stepper = split_delay(Delay(dead_time), PERIOD), RungeKutta4()
    whole = queue.length - (2 if queue.cut else 1)
    assert whole * PERIOD + queue.cut == pytest.approx(dead_time, abs=1e-15)  # rounding
    assert (queue.cut == 0.0) == (round(dead_time / PERIOD, 9) % 1.0 == 0.0)
    # The next command is seen from the instant of its arrival on, where a step ends.
    assert [queue.seen(time) for time in (0.0, 0.999 * queue.cut, queue.cut)] == [0, 0, int(queue.cut > 0.0)]
    parts, instants = make_segments(stepper, queue.cut, PERIOD, 5)
    ends = [part.start + part.length for part in parts]
    assert [part.start for part in parts] == pytest.approx([0.0, *ends[:-1]], abs=1e-18)
    assert ends[-1] == pytest.approx(PERIOD, abs=1e-18)
    for part in parts:
        wanted = [part.start + node * part.length for node in stepper.nodes]
        assert instants[list(part.nodes)] == pytest.approx(wanted, abs=1e-15)


@pytest.mark.parametrize(
    ("stepper", "lag", "count"),
    [
        ("bernoulli", ValveLag(), 1),  # the closed form goes on over the kink of a lagging valve
        ("bernoulli", None, 2),  # one without lag jumps, and ends a step
        ("runge_kutta_4", ValveLag(), 2),
    ],
)
def test_a_dead_time_within_a_step_cuts_it_where_it_must(stepper, lag, count):
    system = one_cell(stepper=stepper, period=PERIOD, step=PERIOD, dead_time=PERIOD / 5, valve_lag=lag)
    assert len(system.plan.segments) == count


def test_the_rate_is_the_derivative_of_the_exact_opening() -> None:
    start = np.array([0.0, 1.0, -0.7, 0.3])
    moved = ValveLag().response(Queue(), [1e-9]) @ np.array([start, COMMAND])
    # A difference over 1 ns: truncation 1e-9/τ_v, 5e-7; rounding 1e-16/1e-9 against rates of 500 1/s.
    rate = ValveLag().rate(start[None], COMMAND)
    assert (moved - start) / 1e-9 == pytest.approx(rate, rel=1e-5, abs=1e-5)


def test_a_valve_that_is_almost_shut_is_shut() -> None:
    own = np.array([[0.9 * SHUT, -0.9 * SHUT, 1.1 * SHUT, -1.1 * SHUT]])
    ValveLag().settle(own)
    assert own[0].astype(bool).tolist() == [False, False, True, True]


def test_without_lag_the_opening_is_the_command_and_jumps_at_the_cut() -> None:
    assert InstantValve().opening(np.empty((0, 4)), COMMAND) is COMMAND
    response = InstantValve().response(split_delay(Delay(1.3e-3), PERIOD), [1.29e-3, 1.31e-3])
    assert np.array_equal(response @ np.array([COMMAND, NEXT]), [COMMAND, NEXT])
