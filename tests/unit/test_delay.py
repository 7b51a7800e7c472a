"""Dead time (the t - t_d of equation 9), exact also where it is no multiple of step or period."""

from __future__ import annotations

import math

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.engine.system import System, make_segments
from digiclay.core.model.delay import Delay, Queue, split_delay
from digiclay.core.model.lag import ValveLag
from digiclay.core.steppers.bernoulli import BernoulliExponential
from digiclay.core.steppers.explicit import RungeKutta4
from scipy.integrate import quad

from tests.assemble import AWAY, one_cell, record, scripted

PERIOD = 5e-3
DEAD_TIMES = [0.0, 1e-3, 0.37e-3, 2.5e-3, 4.9999e-3, 5e-3, 7.3e-3, 10e-3, 12e-3]
#: Commands of successive periods, none of them 0: a valve is not to be cut short as shut.
COMMANDS = [0.5, -1.0, 0.25, 1.0, 0.125, -0.5, -0.75, 1.0, 0.3, 0.6, -0.2, 0.4]


def command(time: float) -> float:
    """Return the command the controller gives at `time`, s."""
    return COMMANDS[min(int(time / PERIOD + 1e-6), len(COMMANDS) - 1)]


def opening(dead_time: float, time: float) -> float:
    """Return the analytic opening: exponentials from one command's arrival to the next one's."""
    value, last = 0.0, dead_time
    for index, target in enumerate(COMMANDS):
        arrival = dead_time + index * PERIOD
        end = min(arrival + PERIOD, time)
        if end > arrival:
            value, last = target + (value - target) * math.exp(-(end - arrival) / 2e-3), end
    return value if time > last - 1e-12 else math.nan


@pytest.mark.parametrize("step", [0.5e-3, 1e-3, 5e-3])
@pytest.mark.parametrize("dead_time", DEAD_TIMES)
def test_the_opening_follows_the_command_the_dead_time_later(dead_time: float, step: float) -> None:
    system = one_cell(dead_time=dead_time, step=step, control=scripted(lambda t, x, y: command(t)))
    run = record(system, AWAY, len(COMMANDS))
    analytic = [opening(dead_time, t) if t > dead_time else 0.0 for t in run.time]
    # Rounding of some hundred exponentials; a dead time rounded to the step would be off by 0.1.
    assert run.rows[:, system.cell.lag_rows.start, 0] == pytest.approx(analytic, abs=1e-12)


@pytest.mark.parametrize(("stepper", "step"), [("bernoulli", 1e-3), ("runge_kutta_4", 0.25e-3)])
@pytest.mark.parametrize("dead_time", [0.37e-3, 7.3e-3])
def test_a_free_pin_moves_as_the_delayed_opening_says(dead_time: float, stepper: str, step: float) -> None:
    system = one_cell(
        dead_time=dead_time, step=step, stepper=stepper, control=scripted(lambda t, x, y: command(t))
    )
    run = record(system, AWAY, len(COMMANDS))
    full = float(system.cell.flow.flow(np.ones(1), np.array([0.5e5]))[0]) / system.cell.actuator.area

    def speed(time: float) -> float:
        k = opening(dead_time, time)
        return full * laminar(system, k)

    arrivals = [dead_time + i * PERIOD for i in range(len(COMMANDS)) if dead_time + i * PERIOD < run.time[-1]]
    way = quad(speed, dead_time, run.time[-1], points=arrivals, limit=400, epsabs=1e-12)[0]
    # Where the opening changes sign, a step that does not end there is off by some 20 nm;
    # a dead time rounded to the step would show as 5 µm.
    assert run.height[-1, 0] - run.height[0, 0] == pytest.approx(way, abs=0.2e-6)


def laminar(system: System, opening: float) -> float:
    """Return the share of full flow at an opening, with its sign: the valve, and the conduit in series."""
    law = system.cell.flow
    series = law.resistance * law.valve.laminar
    return math.copysign(opening**2 * (1.0 + series) / (1.0 + series * opening**2), opening)


def test_nothing_moves_before_the_dead_time_is_over() -> None:
    run = record(one_cell(dead_time=10e-3, control=scripted(lambda t, x, y: 1.0)), AWAY, 3)
    assert run.height[:3].tolist() == [[40e-3]] * 3
    assert run.height[3, 0] > 40e-3


@pytest.mark.parametrize("dead_time", DEAD_TIMES)
def test_the_commands_kept_and_the_cut_make_up_the_dead_time(dead_time: float) -> None:
    waiting = split_delay(Delay(dead_time), PERIOD)
    whole = waiting.length - (2 if waiting.cut else 1)
    assert whole * PERIOD + waiting.cut == pytest.approx(dead_time, abs=1e-15)  # rounding


@pytest.mark.parametrize("dead_time", [0.0, 5e-3, 10e-3, 15e-3])
def test_whole_periods_of_dead_time_need_no_cut(dead_time: float) -> None:
    assert split_delay(Delay(dead_time), PERIOD).cut == 0.0


@pytest.mark.parametrize("dead_time", DEAD_TIMES)
def test_the_steps_of_a_period_fill_it_without_a_gap(dead_time: float) -> None:
    cut, _ = make_segments(RungeKutta4(), split_delay(Delay(dead_time), PERIOD).cut, PERIOD, 5)
    ends = [part.start + part.length for part in cut]
    assert [part.start for part in cut] == pytest.approx([0.0, *ends[:-1]], abs=1e-18)
    assert ends[-1] == pytest.approx(PERIOD, abs=1e-18)


def test_a_step_ends_where_the_next_command_arrives() -> None:
    waiting = split_delay(Delay(7.3e-3), PERIOD)
    cut, _ = make_segments(BernoulliExponential(), waiting.cut, PERIOD, 5)
    seen = {round(part.start, 12): waiting.seen(part.start) for part in cut}
    assert seen == {0.0: 0, 1e-3: 0, 2e-3: 0, 2.3e-3: 1, 3e-3: 1, 4e-3: 1}


def steps(stepper: str, valve_lag: ValveLag | None) -> int:
    """Return how many physics steps a control period is cut into, with a dead time of a fifth of it."""
    system = one_cell(stepper=stepper, period=PERIOD, step=PERIOD, dead_time=PERIOD / 5, valve_lag=valve_lag)
    return len(system.plan.segments)


def test_the_closed_form_step_goes_on_over_the_kink_of_a_lagging_valve() -> None:
    assert steps("bernoulli", ValveLag()) == 1


def test_a_valve_without_lag_jumps_and_ends_a_step() -> None:
    assert steps("bernoulli", None) == 2


def test_other_steppers_end_a_step_at_the_kink() -> None:
    assert steps("runge_kutta_4", ValveLag()) == 2


@pytest.mark.parametrize("dead_time", DEAD_TIMES)
def test_the_instants_of_each_step_are_the_stepper_s_nodes(dead_time: float) -> None:
    stepper = RungeKutta4()
    cut, instants = make_segments(stepper, split_delay(Delay(dead_time), PERIOD).cut, PERIOD, 5)
    wanted = [[part.start + node * part.length for node in stepper.nodes] for part in cut]
    assert [instants[list(part.nodes)].tolist() for part in cut] == [
        pytest.approx(w, abs=1e-15) for w in wanted
    ]


def test_without_dead_time_the_newest_command_is_seen_at_once() -> None:
    assert split_delay(Delay(0.0), PERIOD) == Queue(1, 0.0)


def test_a_dead_time_below_zero_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"^Delay\.dead_time must be at least 0 s \(got -0\.001 s\)\.$"):
        Delay(-1e-3)
