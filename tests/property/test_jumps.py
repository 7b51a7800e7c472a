"""A finger that jumps: no warning, nothing moves that is shut, and no pin goes where none can come to."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from digiclay.core.batch.run_together import run_together
from digiclay.core.engine.simulation import begin
from digiclay.core.model.actuator import Actuator
from digiclay.core.model.contact import Contact
from digiclay.core.model.layout import Layout
from digiclay.core.model.physics import find_speeds
from digiclay.core.model.trajectory import Path, Waypoint
from digiclay.core.model.valve import Fluid
from hypothesis import example, given, settings
from hypothesis import strategies as st

from benchmarks.stiff import strict
from tests.assemble import (
    Motion,
    assert_near,
    make_system,
    one_cell,
    path,
    record,
    sample,
    scripted,
    under,
)

PERIODS = (1e-3, 5e-3, 20e-3, 50e-3)
STEPPERS = st.sampled_from(["bernoulli", "richardson"])
#: Millimeters from where the finger stood: a little, the width of the bed, far beyond it.
far = st.one_of(st.integers(-5, 5), st.integers(-100, 100), st.sampled_from([-1000, 0, 1000])).map(
    float
)
deep = st.one_of(st.integers(-8, 4), st.integers(-100, 100), st.sampled_from([-1000, 1000])).map(
    float
)
straight = st.just(0.0)
#: Milliseconds until the next place, and the place.
jumps = st.lists(st.tuples(st.sampled_from([1, 5, 20, 50]), far, far, deep), min_size=3, max_size=6)
turns = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
beds = st.builds(
    Layout,
    rows=st.just(5),
    columns=st.just(5),
    pitch=st.sampled_from([2e-3, 2.3e-3, 3.1e-3]),
    arrangement=st.sampled_from(["aligned", "staggered", "hexagonal"]),
)
parts = st.sampled_from(
    [
        {},
        {"relaxation": None},
        {"valve_lag": None, "conduit": None},
        {"contact": Contact(exponent=2e4)},
        {"fluid": Fluid(viscosity=1.6e-9)},
        {"actuator": Actuator(bore=0.2e-3)},
        {"contact": Contact(stiffness=2.5e6)},
    ]
)
#: From the issue: 100 mm sideways within 5 ms, at a depth of 4 mm.
SIDEWAYS = [(20, 100.0, 0.0, -4.0), (5, 0.0, 0.0, -4.0), (50, 0.0, 0.0, -4.0)]
DOWN = [(5, 0.0, 0.0, 100.0), (5, 0.0, 0.0, -4.0), (20, 0.0, 0.0, -4.0)]
#: Out of a load whose exponent is beyond the largest one that counts.
UP = [(50, 0.0, 0.0, -26.0), (50, 0.0, 0.0, -26.0), (5, 0.0, 0.0, 1000.0), (20, 0.0, 0.0, -4.0)]
LEVEL = (0.0, 0.0, 0.0)


def waypoints(spots, turn=LEVEL):
    """Return the places of a finger over pins 40 mm high; at every other one it has turned."""
    times = np.cumsum([0, *(after for after, *_ in spots[1:])]) * 1e-3
    return tuple(
        Waypoint(
            float(time),
            (x * 1e-3, y * 1e-3, 40e-3 + z * 1e-3),
            (1.0, *(i % 2 * one for one in turn)),
        )
        for i, (time, (_, x, y, z)) in enumerate(zip(times, spots, strict=True))
    )


def way(spots, turn=LEVEL):
    return Path("linear", waypoints(spots, turn)).trajectory()


def taken(scene, points):
    lasting = replace(scene.simulation, duration=points[-1].time)
    return scene.with_sections(trajectory=Path("linear", points), simulation=lasting)


def half_shut(t, x, y):
    return np.where(x < 0.0, 0.0, np.sin(300.0 * t + 1e3 * y))


def jumped(system, *fingers):
    lasting = max(finger.times[-1] for finger in fingers)
    with strict():
        return record(system, fingers, min(150, round(lasting / system.period) + 2))


def stacked(scenes, row):
    with strict():
        found = {number: result.history[row] for number, result in run_together(scenes)}
    return [found[number] for number in range(len(scenes))]


def assert_within_reach(system, height, *fingers):
    """Check heights, (t, n), a control period apart: within the stroke, and within `Speeds.reach`."""
    touches = getattr(system.cell.touch, "each", (system.cell.touch,))
    assert height.min() >= 0.0
    assert height.max() <= system.cell.actuator.stroke
    for period, (before, after) in enumerate(pairwise(height)):
        poses = [finger.poses(period * system.period + system.instants) for finger in fingers]
        outlines = [
            touch.fingertip.outline(each) for touch, each in zip(touches, poses, strict=True)
        ]
        unders = np.min(
            [under(outline, system.grid.x, system.grid.y) for outline in outlines], axis=0
        )
        lowest, highest = find_speeds(system.cell).reach(before, unders, system.period)
        # Rounding: the undersides are taken over another sum here.
        assert (after >= lowest - 1e-12).all()
        assert (after <= highest + 1e-15).all()


def assert_withstands(bed, hand, turn, period, stepper, **changes):
    system = make_system(
        bed, stepper=stepper, period=period, step=period, control=scripted(half_shut), **changes
    )
    fingers = [way(spots, turn) for spots in hand]
    run = jumped(system, *fingers)
    assert np.all(run.height[:, system.grid.x < 0.0] == 40e-3)
    assert np.isfinite(run.rows).all()
    assert run.force.min() >= 0.0
    assert_within_reach(system, run.height, *fingers)


@settings(max_examples=25)
@given(jumps, turns, beds, parts, st.sampled_from(PERIODS), STEPPERS)
@example(SIDEWAYS, LEVEL, Layout(13, 13), {}, 5e-3, "bernoulli")
@example(DOWN, LEVEL, Layout(5, 5), {}, 5e-3, "bernoulli")
@example(UP, LEVEL, Layout(5, 5), {}, 5e-3, "bernoulli")
def test_no_jump_moves_what_is_shut_or_takes_a_pin_where_none_can_be(
    spots, turn, bed, changes, period, stepper
):
    assert_withstands(bed, [spots], turn, period, stepper, **changes)


#: Of fingers: all alike, or one with a law of its own.
contacts = st.sampled_from(
    [{}, {"contact": Contact(exponent=2e4)}, {"contact": Contact(1e3, 700.0)}]
)
PRESSED = [(5, 1.0, 0.0, 1.0), (50, 1.0, 0.0, -3.0), (50, 1.0, 0.0, -2.0), (50, 1.0, 0.0, -2.0)]
#: Millimeters of the place, and milliseconds: 47 mm sideways in 2 ms of a step, to pins that
#: another presses.
BESIDE = [(1, -46.0, 1.0, -3.5), (75, -46.0, 1.0, -3.5), (2, 1.0, 1.0, -3.5), (50, 1.0, 1.0, -3.5)]


@settings(max_examples=15)
@given(
    st.lists(jumps, min_size=2, max_size=3),
    turns,
    beds,
    parts,
    contacts,
    st.sampled_from(PERIODS),
    STEPPERS,
)
@example([PRESSED, BESIDE], LEVEL, Layout(5, 5), {}, {}, 5e-3, "bernoulli")
@example(
    [PRESSED, BESIDE, DOWN],
    LEVEL,
    Layout(5, 5),
    {},
    {"contact": Contact(exponent=2e4)},
    5e-3,
    "bernoulli",
)
def test_no_jump_of_several_fingers_takes_a_pin_where_none_can_be(
    hand, turn, bed, changes, own, period, stepper
):
    others = [own, {}][: len(hand) - 1]
    assert_withstands(bed, hand, turn, period, stepper, others=others, **changes)


@settings(max_examples=2)
@given(jumps, turns, st.sampled_from(PERIODS))
def test_the_adaptive_stepper_withstands_jumps(spots, turn, period):
    assert_withstands(Layout(3, 3), [spots], turn, period, "adaptive")


@settings(max_examples=15)
@given(
    st.lists(st.tuples(st.sampled_from([1, 5, 20]), straight, straight, deep), min_size=3, max_size=5),
    st.floats(-1.0, 1.0), st.integers(0, 8), st.sampled_from([1.6e-6, 1.6e-9]),
)  # fmt: skip
def test_no_pin_goes_farther_than_its_own_valve_lets_it_under_the_largest_load(
    spots, opening, smaller, viscosity
):
    # A valve that does not lag, and one opening all along: what flows under the largest load is
    # known.
    opening *= 10.0**-smaller
    system = one_cell(
        dead_time=0.0,
        step=5e-3,
        valve_lag=None,
        fluid=Fluid(viscosity=viscosity),
        control=scripted(lambda t, x, y: opening),
    )
    finger, cell = way(spots), system.cell
    run = jumped(system, finger)
    for i, start in enumerate(run.time[:-1]):
        outline = cell.touch.fingertip.outline(finger.poses(start + system.instants))
        low = under(outline, system.grid.x, system.grid.y)
        k = np.array([opening])
        free = cell.flow.flow(k, cell.supply.pressure(k))[0] * 5e-3 / cell.actuator.area
        deepest = run.height[i] + max(free, 0.0) - low.min()
        load = cell.actuator.pressure(
            cell.touch.contact.share * cell.touch.contact.tension(deepest)
        )
        loaded = cell.flow.flow(k, cell.supply.pressure(k) - load)[0] * 5e-3 / cell.actuator.area
        gone = run.height[i + 1, 0] - run.height[i, 0]
        # A turbulent valve: its opening law is taken at mid load; 1e-15 is rounding.
        assert (
            min(loaded, 0.0) * (1.0 + 1e-9) - 1e-15 <= gone <= max(free, 0.0) * (1.0 + 1e-9) + 1e-15
        )


#: Places well above the pins, at any distance.
above = st.tuples(st.sampled_from([1, 5, 20, 50]), far, far, st.integers(1, 20).map(float))


@settings(max_examples=12)
@given(st.lists(above, min_size=2, max_size=4), st.sampled_from(PERIODS), STEPPERS)
@example([(5, 0.0, 0.0, 6.0), (5, -30.0, 0.0, 4.0)], 5e-3, "bernoulli")
def test_a_finger_that_passes_above_all_pins_leaves_nothing_behind(spots, period, stepper):
    system = make_system(Layout(9, 9), stepper=stepper, period=period, step=period)
    run = jumped(system, way(spots))
    untouched = record(system, path((0.0, 0.0, 0.0, 500.0)), 1).rows[0]
    assert (run.rows == untouched).all()


@pytest.mark.parametrize("x", [-8.0, -30.0, 1000.0])
def test_a_finger_that_passed_above_all_pins_presses_as_one_that_begins_there(x):
    # In stacks; all valves are shut. The places are passed at the ends of control periods, of 5 ms.
    spots = [(5, 0.0, 0.0, 6.0), (5, x, 0.0, 4.0)]
    press = [(50, 0.0, 0.0, 20.0), (50, 0.0, 0.0, 0.5), (50, 0.0, 0.0, -3.0), (50, 0.0, 0.0, -3.0)]
    soft, stiff = (sample("tap", f"contact.stiffness={stiffness}") for stiffness in (250, 300))
    known = [replace(one, control=None, blister=None) for one in (soft, stiff)]
    passed, began = (
        [taken(one, waypoints(places)) for one in known] for places in (spots + press, press)
    )
    for after, force in zip(stacked(passed, "force"), stacked(began, "force"), strict=True):
        assert force[-1].max() > 0.1
        # The times at which they press are rounded otherwise.
        np.testing.assert_allclose(after[-len(force) :], force, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("opening, swing", [(-0.5, 0.2), (0.5, 0.2), (1.0, 0.2), (1.0, 1.0)])
def test_a_pin_moves_beside_one_near_overflow_as_beside_one_that_is_not(opening, swing):
    # A step is a quarter of the finger's swing: its way bends. It meets and leaves the pin in each
    # swing.
    contact, control = Contact(exponent=2e4), scripted(lambda t, x, y: opening)
    system = make_system(Layout(1, 2), step=5e-3, contact=contact, control=control)
    finger = Motion(lambda t: 39.95e-3 + 1e-3 * swing * np.sin(2.0 * np.pi * t / 20e-3))
    states = begin(system), begin(system)
    states[1].rows[0, 1] = 95e-3  # 55 mm in the finger: an exponent of 1100
    alone, beside = (record(system, finger, 40, state).height[:, 0] for state in states)
    assert_near(beside, alone, 1e-12)  # rounding: solved another way
