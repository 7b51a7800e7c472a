"""Method II, one control period at a time: what a cell becomes and is commanded; the arrows of Fig. 5."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.base.modes import Mode
from digiclay.core.control.blister import Blister
from digiclay.core.control.cell_states import (
    BY_FORCE,
    BY_PLACE,
    CellStates,
    CellStatesControl,
    Patch,
    follow_arrows,
)
from digiclay.core.control.travel import Heading, Rim
from digiclay.core.model.actuator import Actuator
from digiclay.core.model.layout import Layout, make_grid

from tests.assemble import table
from tests.measured import measure

REST = 40e-3
BLISTER = Blister(radius=12e-3, edge_radius=15.5e-3, flat_radius=3e-3)
CONTROL = CellStatesControl(
    CellStates(), BLISTER, Actuator(), Rim(math.inf, math.inf, 0.0), lift=0.157, period=5e-3
)
BED = make_grid(Layout(rows=13, columns=13))
MIDDLE = 6 * 13 + 6


def seen(forces, modes=None):
    """Measure a bed at rest on which some cells are pressed, or in some mode."""
    measured = measure(BED.x, BED.y, rows=1)
    for row, values in ((measured.force, forces), (measured.mode, modes or {})):
        row[list(values)] = list(values.values())
    return measured


def ordered(measured, memory=None):
    memory, _ = CONTROL.locate(memory or CONTROL.begin(), measured)
    return CONTROL.command(memory, measured)


def distance(cell):
    return float(np.hypot(BED.x[cell] - BED.x[MIDDLE], BED.y[cell] - BED.y[MIDDLE]))


@table(
    "before, force, after, command",
    {
        "pressed to the trigger: it follows": (Mode.REST, 0.06, Mode.FORCE_FOLLOW, -0.3),
        "pressed less: on its spring": (Mode.REST, 0.059, Mode.SPRING, -1.0),
        # 0.02 N over 20 N/m is 1 mm below; the gain of 500 1/m makes half a valve of it.
        "a spring gives way by force over stiffness": (Mode.REST, 0.02, Mode.SPRING, -0.5),
        # 15 1/N times (0.04 - 0.02) N.
        "gain times missing force": (Mode.FORCE_FOLLOW, 0.02, Mode.FORCE_FOLLOW, 0.3),
        "without a force critical first": (Mode.FORCE_FOLLOW, 0.0, Mode.CRITICAL, 0.6),
    },
)
def test_a_cell_is_driven_by_its_own_force(before, force, after, command):
    _, orders = ordered(
        seen({MIDDLE: force}, {MIDDLE: before}), Patch(felt=before == Mode.FORCE_FOLLOW)
    )
    assert orders.mode[MIDDLE] == after
    assert orders.command[MIDDLE] == pytest.approx(command, rel=1e-12)


@pytest.mark.parametrize(
    "low, high, mode",
    [(0.0, BLISTER.radius * (1 - 1e-6), Mode.BLISTER), (12e-3, 15.5e-3, Mode.EDGE)],
)
def test_the_neighbors_of_a_following_cell_become_its_blister_and_its_edge(low, high, mode):
    modes = ordered(seen({MIDDLE: 0.1}))[1].mode
    assert {Mode(int(m)) for m in modes[[low < distance(c) < high for c in range(BED.count)]]} == {
        mode
    }


def test_only_critical_cells_count_their_periods_and_giving_up_the_last_one_or_a_far_jump_are_losses():
    measured = seen({MIDDLE + 1: 0.02}, {MIDDLE: Mode.CRITICAL, MIDDLE + 1: Mode.FORCE_FOLLOW})
    measured.own[0] = 1.0
    mode = CONTROL.command(Patch(felt=True), measured)[1].mode
    assert mode[MIDDLE] == Mode.CRITICAL
    assert (measured.own[0, MIDDLE], set(np.delete(measured.own[0], MIDDLE))) == (2.0, {0.0})
    measured = seen({}, {MIDDLE: Mode.CRITICAL})
    measured.own[0] = 100.0
    memory, _ = CONTROL.command(Patch(felt=True), measured)
    assert (memory.losses, memory.felt) == (1, False)
    assert CONTROL.locate(Patch(x=-9e-3, felt=True), seen({MIDDLE: 0.1}))[0].losses == 1


def test_the_blister_falls_off_to_the_edge_and_a_cell_behind_the_finger_is_frozen():
    target = ordered(seen({MIDDLE: 0.1}))[1].target
    assert target[MIDDLE + 1] == pytest.approx(REST + 1e-3, abs=1e-12)
    # 9 mm from the cell: a third of the way down the cone from 3 to 12 mm is left.
    assert target[MIDDLE + 3] == pytest.approx(REST + 1e-3 / 3.0, abs=1e-9)
    modes = {MIDDLE: Mode.FORCE_FOLLOW, MIDDLE - 3: Mode.BLISTER}
    measured = seen({MIDDLE: 0.04}, modes)
    measured.target[MIDDLE - 3] = 47e-3
    memory, _ = CONTROL.locate(Patch(x=-2e-3, heading=Heading(-2e-3), felt=True), measured)
    _, orders = CONTROL.command(memory, measured)
    assert (orders.mode[MIDDLE - 3], orders.target[MIDDLE - 3]) == (Mode.FROZEN, 47e-3)


@pytest.mark.parametrize("low, expected", [(1e-3, 0.0), (99.5e-3, 0.1)])
def test_the_blister_stays_within_the_stroke(low, expected):
    measured = seen({MIDDLE: 0.1}, {MIDDLE: Mode.FORCE_FOLLOW})
    measured.height[:] = low
    # A top above or below the stroke, as a measured height can be: noise, or a surface that slopes.
    measured.height[MIDDLE] = 0.1 + 5e-3 if expected else -5e-3
    target = CONTROL.command(Patch(felt=True, edge=low), measured)[1].target
    assert target[MIDDLE + 1] == expected


@pytest.mark.parametrize("toward", [(1.0, 0.0), (-1.0, 0.0), (0.0, -1.0), (0.6, 0.8)])
def test_the_blister_s_edge_is_the_mean_height_of_the_ring_ahead_and_abeam(toward):
    # On a bed that slopes both ways; behind lies what the finger has formed, no measure of the
    # ground.
    measured = seen({MIDDLE: 0.1}, {MIDDLE: Mode.FORCE_FOLLOW})
    measured.height[:] += 0.2 * BED.x - 0.3 * BED.y
    # 1e-9: rounding in the places of cells on the border and abeam.
    ring = [
        c for c in range(BED.count) if BLISTER.radius - 1e-9 < distance(c) < BLISTER.edge_radius
    ]
    ahead = [c for c in ring if BED.x[c] * toward[0] + BED.y[c] * toward[1] > -1e-9]
    memory, _ = ordered(measured, Patch(heading=Heading(0.0, 0.0, *toward), felt=True))
    assert len(ring) / 2 <= len(ahead) < len(ring)
    assert memory.edge == pytest.approx(measured.height[ahead].mean(), abs=1e-15)


@pytest.mark.parametrize(
    "toward, leaves", [((1.0, 0.0), True), ((-1.0, 0.0), False), ((0.0, 1.0), False)]
)
def test_no_cell_rises_for_a_finger_that_leaves_the_bed(toward, leaves):
    # The outer cells begin 2 mm beyond the pressed one, and 3 mm ahead carry the finger.
    cell, gains = MIDDLE + 2, CONTROL.parameters
    control = replace(CONTROL, rim=Rim(8e-3, 8e-3, 3e-3))
    measured = seen({cell: 0.5 * gains.force_setpoint}, {cell: Mode.FORCE_FOLLOW})
    memory = Patch(heading=Heading(BED.x[cell], BED.y[cell], *toward), felt=True)
    memory, _ = control.locate(memory, measured)
    _, orders = control.command(memory, measured)
    assert (orders.command[cell] > 0.0) != leaves
    shaped = orders.target[cell + (1 if toward[0] >= 0.0 else -1)]
    assert shaped == pytest.approx(REST + (0.0 if leaves else gains.rise), abs=1e-12)


FF, PATCH = Mode.FORCE_FOLLOW, Mode.BLISTER
#: With sensors whose noise hides forces below 25 mN; with a flat top short of a pin 3 mm away, and
#: beyond it.
NOISY = replace(CONTROL, floor=25e-3)
SHORT, WIDE = (
    replace(CONTROL, blister=replace(BLISTER, flat_radius=flat)) for flat in (2.9e-3, 3.1e-3)
)


@table(
    "control, forces, before, after",
    {
        "a blister cell follows at a lower force than one at rest": (
            CONTROL,
            {MIDDLE: 0.05, MIDDLE + 1: 0.016},
            {MIDDLE: FF, MIDDLE + 1: PATCH},
            {MIDDLE + 1: FF},
        ),
        "without a following cell no blister is left": (
            CONTROL,
            {},
            {MIDDLE + 1: PATCH, MIDDLE + 2: Mode.FROZEN, MIDDLE + 3: Mode.EDGE},
            dict.fromkeys(range(BED.count), Mode.REST),
        ),
        "beyond the flat top a cell freezes behind the finger": (
            SHORT,
            {MIDDLE: 0.04},
            {MIDDLE: FF, MIDDLE - 1: PATCH},
            {MIDDLE - 1: Mode.FROZEN},
        ),
        "and none within": (
            WIDE,
            {MIDDLE: 0.04},
            {MIDDLE: FF, MIDDLE - 1: PATCH},
            {MIDDLE - 1: PATCH},
        ),
        "a force that may be noise makes no blister cell follow": (
            NOISY,
            {MIDDLE: 0.1, MIDDLE + 2: 24e-3, MIDDLE - 2: 26e-3},
            {MIDDLE: FF, MIDDLE + 2: PATCH, MIDDLE - 2: PATCH},
            {MIDDLE + 2: PATCH, MIDDLE - 2: FF},
        ),
    },
)
def test_what_a_cell_becomes_under_a_finger_that_travels_east(control, forces, before, after):
    memory = Patch(heading=Heading(0.0, 0.0, 1.0, 0.0), felt=True)
    mode = control.command(memory, seen(forces, before))[1].mode
    assert {cell: mode[cell] for cell in after} == after


@pytest.mark.parametrize(
    "name, value, said",
    [("blister_trigger", 0.07, "below spring_trigger, 0.06 N (got 0.07 N)."),
     ("critical_trigger", 0.02, "below blister_trigger, 0.015 N (got 0.02 N).")],
)  # fmt: skip
def test_thresholds_in_the_wrong_order_are_refused(name, value, said):
    with pytest.raises(ParameterError, match=re.escape(f"CellStates.{name} must be {said}")):
        CellStates(**{name: value})


def test_a_force_that_may_be_noise_moves_no_spring_but_counts_where_a_cell_follows():
    assert NOISY.command(NOISY.begin(), seen({MIDDLE: 24e-3}))[1].command[MIDDLE] == 0.0
    # A finger that rises presses with less than the noise hides; where it is shows nevertheless.
    following = {MIDDLE: Mode.FORCE_FOLLOW, MIDDLE + 1: Mode.CRITICAL}
    measured = seen({MIDDLE: 10e-3, MIDDLE + 1: 10e-3, MIDDLE + 3: 24e-3}, following)
    memory, _ = NOISY.locate(NOISY.begin(), measured)
    assert memory.x - BED.x[MIDDLE] == pytest.approx(1.5e-3, abs=1e-12)


#: Fig. 5, written down from the paper and drawn in docs/pictures/method_2.svg: from, to, when. VS
#: is any cell on a virtual spring.
FIGURE_5 = [
    ("VS", "FF", "above_spring_trigger"),
    ("blister", "FF", "above_blister_trigger"),
    ("frozen", "FF", "above_blister_trigger"),
    ("FF", "critical", "below_critical_trigger"),
    ("critical", "FF", "above_critical_trigger"),
    ("critical", "blister", "timed_out"),
    ("VS", "blister", "in_blister"),
    ("blister", "frozen", "left_behind"),
    ("VS", "edge", "at_edge"),
    ("blister", "edge", "at_edge"),
    ("frozen", "edge", "at_edge"),
    ("edge", "VS", "outside"),
    ("blister", "VS", "outside"),
    ("frozen", "VS", "outside"),
]
STATES = {
    "VS": (Mode.REST, Mode.HOLD, Mode.SPRING, Mode.EDGE),
    "FF": (Mode.FORCE_FOLLOW,),
    "blister": (Mode.BLISTER,),
    "frozen": (Mode.FROZEN,),
    "critical": (Mode.CRITICAL,),
    "edge": (Mode.EDGE,),
}
GOALS = {"VS": Mode.HOLD, **{name: modes[0] for name, modes in STATES.items() if name != "VS"}}
CONDITIONS = sorted({arrow.condition for arrow in (*BY_FORCE, *BY_PLACE)})


@pytest.mark.parametrize("condition", [*CONDITIONS, None])
def test_a_cell_goes_where_the_arrows_of_the_figure_point_and_nowhere_else(condition):
    drawn = {
        mode: GOALS[goal]
        for one, goal, when in FIGURE_5
        if when == condition
        for mode in STATES[one]
    }
    holds = {name: np.array([name == condition]) for name in CONDITIONS}
    for mode in Mode:
        modes = follow_arrows(np.array([mode], np.int8), BY_FORCE, holds)
        assert follow_arrows(modes, BY_PLACE, holds)[0] == drawn.get(mode, mode), mode


def test_of_two_arrows_the_later_wins_and_a_critical_cell_is_given_up_after_the_time_out():
    both = ("below_critical_trigger", "above_critical_trigger")
    holds = {name: np.array([name in both]) for name in CONDITIONS}
    assert (
        follow_arrows(np.array([Mode.CRITICAL], np.int8), BY_FORCE, holds)[0] == Mode.FORCE_FOLLOW
    )
    measured, memory, periods = seen({}, {MIDDLE: Mode.CRITICAL}), Patch(felt=True), 0
    while measured.mode[MIDDLE] == Mode.CRITICAL:
        memory, orders = CONTROL.command(memory, measured)
        measured.mode[:] = orders.mode
        periods += 1
    assert periods * CONTROL.period == pytest.approx(
        CONTROL.parameters.critical_time, abs=CONTROL.period
    )
