"""What holds in any session: small beds, random fingers, a second or less."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.control.virtual_master import VirtualMaster
from digiclay.core.engine.simulation import begin, step
from digiclay.core.engine.system import System
from digiclay.core.model.actuator import Actuator
from digiclay.core.model.layout import Layout
from digiclay.core.model.trajectory import Trajectory, make_level
from digiclay.core.model.valve import Fluid, Valve
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.assemble import make_system, one_cell, record, scripted, under, whole

COUNT = 60
CELLS = Layout(7, 7, arrangement="staggered")

#: Millimeters, to the tenth.
xy = st.integers(-140, 140).map(lambda tenths: tenths / 10)
#: Down to 8 mm below the tops, and far above; at up to 0.2 m/s.
points = st.lists(
    st.tuples(xy, xy, st.integers(320, 600).map(lambda tenths: tenths / 10)), min_size=3, max_size=6
)
turns = st.tuples(*[st.floats(-0.4, 0.4)] * 3)
#: Seldom the slow one.
steppers = st.sampled_from(["bernoulli", "bernoulli", "bernoulli", "runge_kutta_4"])


def finger(spots: list[tuple[float, float, float]]) -> Trajectory:
    """Return a level finger that visits spots, in mm, within the session."""
    return make_level(np.linspace(0.0, COUNT * 5e-3, len(spots)), np.array(spots) * 1e-3)


def tilted(path: Trajectory, turn: tuple[float, ...]) -> Trajectory:
    """Return the path with a tilted finger."""
    return Trajectory(path.times, path.positions, np.tile([1.0, *turn], (path.times.size, 1)))


def bed(stepper: str = "bernoulli", **parts: object) -> System:
    """Return a small bed under Method I; Runge and Kutta's steps are short enough for a deep press."""
    return make_system(CELLS, stepper=stepper, step=0.25e-3 if stepper != "bernoulli" else 1e-3, **parts)


@settings(max_examples=5)
@given(points, turns, st.floats(0.0, 100.0), steppers)
@example([(0.0, 0.0, 45.0), (0.0, 0.0, 36.0), (9.0, 3.0, 38.0)], (0.0, 0.0, 0.0), 40.0, "runge_kutta_4")
def test_a_session_is_finite_within_the_stroke_without_pull_and_its_commands_are_openings(
    spots: list[tuple[float, float, float]], turn: tuple[float, ...], rest: float, stepper: str
) -> None:
    system = bed(stepper, control=VirtualMaster(), actuator=Actuator(rest_height=rest * 1e-3))
    path = tilted(finger([(x, y, z + rest - 40.0) for x, y, z in spots]), turn)
    run = record(system, path, COUNT)
    assert np.isfinite(run.rows).all()
    assert 0.0 <= run.height.min() <= run.height.max() <= 100e-3
    assert np.abs(run.command).max() <= 1.0
    assert run.force.min() >= 0.0
    outline = system.cell.touch.fingertip.outline(path.poses(run.time))
    gap = under(outline, system.grid.x, system.grid.y) - run.height
    # Without contact there is no force. Rounding: the underside is taken over another sum here.
    assert not run.force[gap > 1e-15].any()
    outside = np.delete(run.last.rows[0], run.last.active.cells)
    assert outside.max(initial=0.0) <= run.last.peak
    near = run.last.active.block[0, : run.last.active.near]
    assert near.max(initial=0.0) <= max(run.last.active.peak, run.last.peak)


@settings(max_examples=5)
@given(points, st.integers(0, COUNT - 1))
def test_a_step_leaves_the_state_it_was_given_as_it_was(spots, when):
    system, path = bed(control=VirtualMaster()), finger(spots)
    state = record(system, path, when).last if when else begin(system)
    kept = state.copy()
    once = step(system, state, path.poses(state.period * 5e-3 + system.instants)[:, None])
    again = step(system, state, path.poses(state.period * 5e-3 + system.instants)[:, None])
    for name in ("rows", "modes", "aged"):
        assert np.array_equal(getattr(state, name), getattr(kept, name)), name
    for name in ("cells", "block", "mode"):
        assert np.array_equal(getattr(state.active, name), getattr(kept.active, name)), name
    assert np.array_equal(whole(once), whole(again))


@settings(max_examples=5)
@given(points, st.integers(1, COUNT - 1))
def test_a_session_twice_or_interrupted_is_the_same_session_bit_for_bit(spots, when):
    system, path = bed(control=VirtualMaster()), finger(spots)
    whole, first = record(system, path, COUNT), record(system, path, when)
    assert np.array_equal(first.rows, whole.rows[: when + 1])  # the same twice, bit for bit
    rest = record(system, path, COUNT - when, first.last)
    assert np.array_equal(rest.rows, whole.rows[when:])
    assert rest.memory == whole.memory[when:]


commands = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6)
#: A laminar valve, and one that is turbulent in between.
valves = st.sampled_from([{}, {"valve": Valve(orifice_diameter=0.8e-3), "fluid": Fluid(760.0, 0.65e-6)}])


@settings(max_examples=10)
@given(commands, valves)
def test_the_fluid_pumped_is_what_the_pin_rose_by(script: list[float], parts: dict[str, object]) -> None:
    # Flow of the exact opening by a fine sum, through the law itself; no load, no end stop, no dead time.
    system = one_cell(dead_time=0.0, control=scripted(lambda t, x, y: script[round(t / 5e-3)]), **parts)
    run = record(system, make_level(np.zeros(1), np.array([[0, 0, 1.0]])), len(script))
    opening, volume, count = 0.0, 0.0, 1000
    dt = 5e-3 / count
    for command in script:
        times = (np.arange(count) + 0.5) * dt
        k = command + (opening - command) * np.exp(-times / 2e-3)
        volume += system.cell.flow.flow(k, system.cell.supply.pressure(k)).sum() * dt
        opening = command + (opening - command) * np.exp(-2.5)
    way = run.height[-1, 0] - run.height[0, 0]
    # Two Gauss points a millisecond: 1e-5 of the way where all is smooth; where the opening changes sign or
    # the flow turns turbulent within a step, up to a thousandth of what a pin can rise in a period.
    assert system.cell.actuator.area * way == pytest.approx(
        volume, abs=1e-3 * system.cell.actuator.area * system.fastest * system.period
    )
