"""Method I: locate, control, model, direction and loss of its master; its blister, freezing, the rim."""

from dataclasses import fields, replace

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.control.blister import Blister
from digiclay.core.control.masters import VirtualMasterBatch, VirtualMasterColumns, gather
from digiclay.core.control.side_by_side import join_controllers
from digiclay.core.control.travel import Heading
from digiclay.core.control.virtual_master import (
    MANY,
    Master,
    Phase,
    VirtualMaster,
    make_master_cell,
)
from digiclay.core.model.conduit import Conduit
from digiclay.core.model.laws import law_parameters
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.model.valve import Fluid, Valve

from tests.assemble import make_system, master, path, record, table
from tests.measured import measure


def control():
    """Return Method I."""
    return make_system(Layout(15, 15), control=VirtualMaster()).controller


def touched(*presses, height=40.0):
    """Return a measurement of pressed cells: x, y in mm and force in N."""
    x, y, force = np.array(presses).reshape(-1, 3).T
    return measure(x * 1e-3, y * 1e-3, force, height * 1e-3)


# Locate


NOISY = [(0, 0, 0.1), (6, 0, 9e-3), (-3, 0, 0.1)]


@table(
    "before, floor, presses, place",
    {
        "centroid": (None, 0.0, [(0, 0, 0.1), (3, 0, 0.1), (0, 3, 0.2)], (0.75e-3, 1.5e-3)),
        "at first of all cells": (None, 0.0, [(-20, 0, 0.1), (20, 0, 0.3)], (10e-3, 0.0)),
        "later near": (master(), 0.0, [(0, 0, 0.1), (6, 0, 0.1), (9, 0, 5.0)], (3e-3, 0.0)),
        "noise draws it not aside": (master(), 10e-3, NOISY, (-1.5e-3, 0.0)),
    },
)
def test_the_master_is_at_the_centroid_of_the_forces(before, floor, presses, place):
    method = replace(control(), floor=floor)
    memory, _ = method.locate(before or method.begin(), touched(*presses))
    assert (memory.x, memory.y) == pytest.approx(place, abs=1e-15)


def test_the_reference_is_the_surface_at_first_touch_and_the_cells_reach_to_the_edge_ring():
    memory, _ = control().locate(control().begin(), touched((0, 0, 0.05), height=52.0))
    assert memory.reference == pytest.approx(52e-3)
    assert control().locate(master(), touched((0, 0, 0.4)))[1] == pytest.approx((0.0, 0.0, 18.5e-3))
    assert control().locate(control().begin(), touched((0, 0, 0.9e-3)))[1] is None


# Control and noise

IDLE, SPRINGY, SHAPING = Master(), master(phase=Phase.SPRING), master()
#: Memory before, noise floor, N, presses; phase and losses after.
PHASES = {
    "too small to be a fingertip": (IDLE, 0.0, [(0, 0, 0.9e-3)], Phase.IDLE, 0),
    "first touch: a spring": (IDLE, 0.0, [(0, 0, 0.1)], Phase.SPRING, 0),
    "a spring below the set point": (SPRINGY, 0.0, [(0, 0, 0.399)], Phase.SPRING, 0),
    "shaping from it on": (SPRINGY, 0.0, [(0, 0, 0.401)], Phase.SHAPING, 0),
    # The centroid takes those within r_VM of the master alone; a flank pressed farther off counts
    # as well.
    "the force of all cells": (SPRINGY, 0.0, [(0, 0, 0.3), (9, 0, 0.11)], Phase.SHAPING, 0),
    "shaping continues below it": (SHAPING, 0.0, [(0, 0, 0.1)], Phase.SHAPING, 0),
    "elsewhere: anew, and counted": (SHAPING, 0.0, [(-18, 0, 0.1)], Phase.SPRING, 1),
    "may be noise": (IDLE, 10e-3, [(0, 0, 9.9e-3)], Phase.IDLE, 0),
    "no noise": (IDLE, 10e-3, [(0, 0, 10.1e-3)], Phase.SPRING, 0),
    "noise adds up to nothing": (
        IDLE,
        10e-3,
        [(3.0 * x, 0, 9e-3) for x in range(5)],
        Phase.IDLE,
        0,
    ),
    # What noise hides next to the master counts to the controlled force, farther off it does not.
    "enough near": (SPRINGY, 10e-3, [(0, 0, 0.39), (6, 0, 2e-3), (-6, 0, 9e-3)], Phase.SHAPING, 0),
    "too little near": (
        SPRINGY,
        10e-3,
        [(0, 0, 0.39), (6, 0, -2e-3), (-6, 0, 9e-3)],
        Phase.SPRING,
        0,
    ),
    "hidden far off": (SPRINGY, 10e-3, [(0, 0, 0.395), (9, 0, 9.9e-3)], Phase.SPRING, 0),
    "felt far off": (SPRINGY, 10e-3, [(0, 0, 0.395), (9, 0, 10.1e-3)], Phase.SHAPING, 0),
    # 6 mm behind where it was and 11 mm from where it is now; the other way round 12 mm and 7 mm.
    "near where it was": (SPRINGY, 30e-3, [(5, 0, 0.39), (-6, 0, 20e-3)], Phase.SHAPING, 0),
    "near where it is": (SPRINGY, 30e-3, [(5, 0, 0.39), (12, 0, 20e-3)], Phase.SPRING, 0),
    "hidden at first touch": (IDLE, 10e-3, [(0, 0, 0.395), (3, 0, 9e-3)], Phase.SPRING, 0),
}


@table("before, floor, presses, phase, losses", PHASES)
def test_forces_set_the_phase(before, floor, presses, phase, losses):
    memory, _ = replace(control(), floor=floor).locate(before, touched(*presses))
    assert (memory.phase, memory.losses) == (phase, losses)


# Model


@pytest.mark.parametrize(
    "before, force, count, height",
    [
        # 0.2 N / 200 N/m is 1 mm. The flow goes with the error squared: after 3 s some 60 µm are
        # left.
        (master(phase=Phase.SPRING, height=40e-3), 0.2, 600, pytest.approx(39e-3, abs=0.1e-3)),
        (master(), 0.4, 600, 45e-3),  # at the set point it stays
        (master(), 0.3, 20, pytest.approx(45.6e-3, abs=0.6e-3)),  # below it rises
        (master(), 0.5, 20, pytest.approx(44.4e-3, abs=0.6e-3)),  # above it sinks
        (master(), 0.002, 1500, 100e-3),  # it stops where a real pin does
        (master(), 5.0, 1500, 0.0),
    ],
)
def test_a_steady_force_takes_the_master_to_a_height(before, force, count, height):
    method, memory = control(), before
    for _ in range(count):
        memory, _ = method.locate(memory, touched((0, 0, force)))
    assert memory.height == height
    assert (memory.height == before.height) == (force == 0.4)


# Direction and loss


@table(
    "before, path_x, toward",
    {
        "slow, far enough": (master(), np.linspace(0, 1.6, 500), (1.0, 0.0)),
        "not far enough": (master(), np.linspace(0, 1.4, 500), (0.0, 0.0)),
        "at rest it keeps its direction": (master(0.0, 1.0), [0.3, -0.4] * 200, (0.0, 1.0)),
        "fast, in one period": (master(), [-5.0], (-1.0, 0.0)),
        "back by 2 mm": (master(), [6.0, 12.0, 10.0], (-1.0, 0.0)),
        "not so beside the rim": (master(), [6.0, 12.0, 18.0, 20.0, 18.0], (1.0, 0.0)),
    },
)
def test_a_fingertip_gets_its_direction_once_it_has_gone_far_enough(before, path_x, toward):
    method, memory = control(), before
    for x in path_x:
        memory, _ = method.locate(memory, touched((x, 0, 0.4)))
    assert memory.heading[2:] == toward


def alone(memory, count):
    """Return the master after some periods without a fingertip."""
    for _ in range(count):
        memory, _ = control().locate(memory, touched())
    return memory


@pytest.mark.parametrize(
    "phase, count, after",
    [
        (Phase.SHAPING, 10, (Phase.SHAPING, 0)),  # 50 ms
        (Phase.SHAPING, 11, (Phase.IDLE, 1)),
        (Phase.SPRING, 11, (Phase.IDLE, 0)),  # lost before shaping is no loss
    ],
)
def test_a_fingertip_is_lost_after_the_loss_time(phase, count, after):
    memory = alone(master(phase=phase), count)
    assert (memory.phase, memory.losses) == after


def test_a_fingertip_felt_in_time_also_without_a_loss_time_is_not_lost_and_later_is_a_new_one():
    waiting = alone(master(felt=44e-3), 9)
    assert waiting.felt == 44e-3 < waiting.height  # where the fingertip was felt last
    memory, _ = control().locate(waiting, touched((0, 0, 0.4)))
    assert alone(memory, 10).losses == 0
    memory, _ = control().locate(alone(master(), 11), touched((3, 3, 0.1)))
    assert (memory.phase, memory.losses) == (Phase.SPRING, 1)
    method = make_system(Layout(15, 15), control=VirtualMaster(loss_time=0.0)).controller
    memory, _ = method.locate(master(), touched((0, 0, 0.3)))
    assert (memory.phase, memory.height > 45e-3) == (Phase.SHAPING, True)


# Cell of the master

#: Parts whose unloaded valves are laminar, and others that may be turbulent.
CELLS = {
    "valve and conduit": {},
    "no conduit": {"conduit": None},
    "a thin conduit": {"conduit": Conduit(diameter=0.3e-3)},
    "a gap as wide as the opening": {"valve": Valve(gap="opening")},
    "turbulent": {"valve": Valve(orifice_diameter=2e-3), "fluid": Fluid(viscosity=1e-6)},
    "a motor": {"valve": law_parameters("valve")(law="motor"), "conduit": None},
}


@pytest.mark.parametrize("name", CELLS)
@pytest.mark.parametrize("opening", [-1.0, -0.3, 0.0, 1e-9, 0.07, 1.0])
def test_the_speed_is_that_of_the_valve_s_flow_law(name, opening):
    one = make_system(**CELLS[name]).cell
    assert (one.flow.knee <= one.supply.largest) == (name == "turbulent")
    openings = np.array([opening])
    flow = one.flow.flow(openings, one.supply.pressure(openings))[0]
    # Another order of the same few products: rounding.
    assert make_master_cell(one, 5e-3).speed(opening) == pytest.approx(
        flow / one.actuator.area, rel=1e-14
    )


def test_in_a_period_it_goes_the_way_its_opening_lets_it():
    one, period, start, command = make_system().cell, 5e-3, 0.3, 0.9
    found, last = make_master_cell(one, period).advance(40e-3, start, command)
    times = (np.arange(2000) + 0.5) / 2000 * period
    opening = command + (start - command) * np.exp(-times / one.lag.time_constant)
    assert last == pytest.approx(command + (start - command) * np.exp(-2.5), rel=1e-12)  # rounding
    flow = one.flow.flow(opening, np.full(2000, one.supply.high))
    # Two Gauss points: the fourth derivative of a square of exponentials over 2.5 time constants.
    assert found - 40e-3 == pytest.approx(period * flow.mean() / one.actuator.area, rel=0.01)


# The blister around the master

BED = make_grid(Layout(15, 15))
#: A little beside a cell, so that no cell lies exactly on a circle.
BESIDE = {"x": 0.4e-3, "y": 0.2e-3}


def bed(mode=Mode.REST):
    """Return a measurement of a whole bed that nobody touches."""
    return measure(BED.x, BED.y, mode=mode)


def at(x, y):
    """Return the cell at a place in mm."""
    return int(np.hypot(BED.x - x * 1e-3, BED.y - y * 1e-3).argmin())


def created(memory, seen, blister=None):
    """Return what Method I commands."""
    system = make_system(Layout(15, 15), control=VirtualMaster(), blister=blister)
    return system.controller.command(memory, seen)


# Profiles

CONE, BELL = Blister(), Blister(profile="gaussian")


@table(
    "blister, distance, profile",
    {
        "flat on top": (CONE, [0.0, 3e-3, 6e-3], [1.0, 1.0, 1.0]),
        "linear to its radius": (CONE, [8.25e-3, 10.5e-3, 15e-3], [0.75, 0.5, 0.0]),
        "a Gaussian": (BELL, [0.0, 7e-3, 14e-3], [1.0, np.exp(-0.5), np.exp(-2.0)]),
    },
)
def test_a_profile_has_its_formula_over_any_surface(blister, distance, profile):
    places, part = np.array(distance), np.array(profile)
    assert blister.evaluate_profile(places) == pytest.approx(part, rel=1e-14, abs=1e-15)
    for edge, top in ((40e-3, 55e-3), (40e-3, 30e-3)):
        assert blister.interpolate(places, edge, top) == pytest.approx(
            edge + part * (top - edge), abs=1e-16
        )


# Blister


@pytest.mark.parametrize("profile", ["cone", "gaussian"])
def test_cells_of_the_blister_are_commanded_to_its_profile(profile):
    blister = Blister(profile=profile)
    _, orders = created(master(), bed(), blister)
    inside = np.hypot(BED.x, BED.y) <= 15e-3
    expected = 40e-3 + blister.evaluate_profile(np.hypot(BED.x, BED.y)[inside]) * 5e-3
    # A circle may be widened by a billionth, for the sake of cells exactly on it.
    assert orders.target[inside] == pytest.approx(expected, abs=1e-10)


def test_targets_stay_within_the_stroke_and_outside_the_blister_whose_next_cells_are_the_edge():
    outside, seen = np.hypot(BED.x, BED.y) > 15.1e-3, bed()
    seen.target[outside] = 47e-3
    assert np.all(created(master(), seen)[1].target[outside] == 47e-3)
    high = bed()._replace(height=np.full(BED.count, 0.13))
    assert created(master(height=100e-3, edge=130e-3), high)[1].target.max() == 100e-3
    distance = np.hypot(BED.x - BESIDE["x"], BED.y - BESIDE["y"])
    ring = (distance > 15e-3) & (distance < 18.5e-3)
    assert np.array_equal(created(master(**BESIDE), bed())[1].mode == Mode.EDGE, ring)


@pytest.mark.parametrize(
    "phase, mode", [(Phase.SHAPING, Mode.FORCE_FOLLOW), (Phase.SPRING, Mode.SPRING)]
)
def test_cells_under_the_fingertip_show_the_phase(phase, mode):
    seen = bed()
    seen.force[at(0, 0)] = 0.1
    assert created(master(phase=phase), seen)[1].mode[at(0, 0)] == mode


@pytest.mark.parametrize(
    "place", [(15, 0), (-15, 0), (0, 15), (0, -15), (9, 12), (-9, 12), (12, -9), (-12, -9)]
)
def test_cells_exactly_on_the_rim_belong_to_the_blister_on_every_side(place):
    # Else a bell, which is still a tenth of its height there, would be lopsided by rounding alone.
    assert created(master(), bed())[1].mode[at(*place)] == Mode.BLISTER


def test_cells_exactly_on_the_rim_of_the_flat_top_are_treated_alike_on_every_side():
    ways = EAST, WEST, (0, 1), (0, -1)
    modes = [created(master(x, y), ridge())[1].mode[at(-6 * x, -6 * y)] for x, y in ways]
    assert len(set(modes)) == 1


def test_the_edge_height_is_the_mean_of_the_whole_ring_at_rest_and_of_that_ahead_while_moving():
    seen = bed()
    seen.height[BED.x > 0] += 2e-3
    seen.height[BED.x < 0] -= 1e-3
    ring = np.abs(np.hypot(BED.x - BESIDE["x"], BED.y - BESIDE["y"]) - 16.75e-3) < 1.75e-3
    assert created(master(**BESIDE), seen)[0].edge == pytest.approx(
        seen.height[ring].mean(), abs=1e-16
    )
    seen = bed()
    seen.height[BED.x < -0.1e-3] = 60e-3  # the finished ridge
    assert created(master(1.0, 0.0), seen)[0].edge == pytest.approx(40e-3, abs=1e-16)
    assert created(master(1.0, 0.0, x=22e-3, edge=41.5e-3), bed())[0].edge == 41.5e-3


# Freezing


def ridge(mode=Mode.BLISTER):
    """Return a bed whose cells behind a finger that moves along x stand higher than the profile."""
    return bed()._replace(target=np.full(BED.count, 44e-3), mode=bed(mode=mode).mode)


EAST, WEST = (1.0, 0.0), (-1.0, 0.0)


@table(
    "toward, before, place, force, after",
    {
        "behind": (EAST, Mode.BLISTER, (-12, 0), 0.0, Mode.FROZEN),
        "ahead": (EAST, Mode.BLISTER, (12, 0), 0.0, Mode.BLISTER),
        "abeam": (EAST, Mode.BLISTER, (0, 12), 0.0, Mode.BLISTER),
        "abeam on the other side": (EAST, Mode.BLISTER, (0, -12), 0.0, Mode.BLISTER),
        "on the flat top": (EAST, Mode.BLISTER, (-3, 0), 0.0, Mode.BLISTER),
        "before any direction": ((0.0, 0.0), Mode.BLISTER, (-12, 0), 0.0, Mode.BLISTER),
        "ahead again after a turn": (WEST, Mode.FROZEN, (-12, 0), 0.0, Mode.FROZEN),
        "touched lightly": (EAST, Mode.FROZEN, (-12, 0), 0.019, Mode.FROZEN),
        "pressed: freed": (EAST, Mode.FROZEN, (-12, 0), 0.02, Mode.FORCE_FOLLOW),
        "out of the blister": (EAST, Mode.FROZEN, (-21, 0), 0.0, Mode.HOLD),
    },
)
def test_cells_freeze_behind_a_traveling_fingertip(toward, before, place, force, after):
    seen = ridge(before)
    seen.force[at(*place)] = force
    _, orders = created(master(*toward), seen)
    assert orders.mode[at(*place)] == after
    assert (orders.target[at(*place)] == 44e-3) == (after in (Mode.FROZEN, Mode.HOLD))


@table(
    "height, target, after",
    {
        # 12 mm from the master a third of the cone is left: a third of 15 mm up, or of 9 mm down.
        "a blister": (55e-3, 44e-3, 45e-3),
        "a dent": (31e-3, 39e-3, 37e-3),
    },
)
def test_what_outgrows_a_frozen_cell_takes_it_along(height, target, after):
    seen = ridge(Mode.FROZEN)._replace(target=np.full(BED.count, target))
    _, orders = created(master(*EAST, height=height), seen)
    assert orders.mode[at(-12, 0)] == Mode.FROZEN
    assert orders.target[at(-12, 0)] == pytest.approx(after, abs=1e-9)


@pytest.mark.parametrize("risen, kept", [(1.4e-3, False), (1.6e-3, True)])
def test_a_blister_in_search_of_the_finger_takes_frozen_cells_along_by_a_tenth_of_its_radius(
    risen, kept
):
    # It has not felt the finger for a period.
    searching = master(*EAST, height=55e-3)._replace(felt=55e-3 - risen, alone=1)
    target = created(searching, ridge(Mode.FROZEN))[1].target[at(-12, 0)]
    assert target == pytest.approx(44e-3 if kept else 45e-3, abs=1e-9)


def test_noise_neither_frees_a_frozen_cell_nor_marks_one_as_touched():
    noisy = replace(control(), floor=30e-3)
    seen = ridge(Mode.BLISTER)
    seen.mode[at(-12, 0)] = Mode.FROZEN
    seen.force[[at(-12, 0), at(0, 0)]] = 29e-3
    mode = noisy.command(master(*EAST), seen)[1].mode
    assert [mode[at(-12, 0)], mode[at(0, 0)]] == [Mode.FROZEN, Mode.BLISTER]


def test_a_cell_rests_until_it_is_formed_and_without_a_fingertip_goes_to_its_target():
    assert created(master(*EAST), bed())[1].mode[at(-21, 0)] == Mode.REST
    seen = bed()
    seen.target[5] += 1e-3
    _, orders = created(Master(), seen)
    assert (orders.command[5], orders.mode[5]) == (pytest.approx(0.5), Mode.HOLD)


# On the bed


@pytest.mark.parametrize("profile", ["cone", "gaussian"])
def test_a_lifting_finger_takes_the_surface_along(profile):
    system = make_system(Layout(15, 15), control=VirtualMaster(), blister=Blister(profile=profile))
    run = record(
        system, path((0, 0, 0, 46.0), (0.4, 0, 0, 35.5), (0.6, 0, 0, 35.5), (1.4, 0, 0, 43.0)), 280
    )
    assert run.memory[-1].losses == 0
    # From 4.5 mm below the surface to 3 mm above; with its pulp pressed 1.5 mm the pin stands at
    # 44.5 mm.
    assert run.height[-1].reshape(15, 15)[7, 7] == pytest.approx(44.5e-3, abs=0.7e-3)


@pytest.mark.parametrize("laminar", [True, False])
def test_many_masters_decide_side_by_side_as_each_alone_bit_for_bit(laminar):
    draw = np.random.default_rng(3)
    one, runs = control(), []
    valve = replace(one.model.flow.valve, turbulent=one.model.flow.valve.turbulent / 50.0)
    model = one.model if laminar else replace(one.model, laminar=False, flow=valve)
    for _ in range(4 * MANY):
        gains = replace(
            one.parameters, force_gain=draw.uniform(1, 9), felt_force=draw.uniform(0.5e-3, 2e-3)
        )
        runs.append(replace(one, parameters=gains, model=model))
    together = join_controllers(runs)
    parts = {field.name: getattr(together, field.name) for field in fields(together)}
    each = VirtualMasterBatch(**parts)
    assert type(together) is VirtualMasterColumns
    count, kinds = len(runs), set()
    masters = [
        Master(
            Phase(draw.integers(4)), *draw.uniform(-25e-3, 25e-3, 2), draw.choice([45e-3, 0.1]),
            draw.uniform(-1, 1), 44e-3, 40e-3, Heading(*draw.uniform(-25e-3, 25e-3, 2), 0.6, 0.8), 44e-3,
            int(draw.choice([0, 0, 3, 40])),
        )
        for _ in runs
    ]  # fmt: skip
    both = [masters, masters]
    for _ in range(12):
        # Some are not felt, some not near; most go on where they are, or a little farther.
        total = draw.choice([0.0, 0.2, 0.5], count)
        near = total * draw.choice([0.0, 1e-3, 1.0, 1.0], count)
        x, y = np.array([(own.x, own.y) for own in both[0]]).T + draw.choice(
            [0.0, 1e-4, 3e-3], (2, count)
        )
        sums = [total, total * x, total * y, near, near * x, near * y]
        level, cells = draw.uniform(0.0, 0.5, count), draw.integers(0, 9, count)
        results = []
        for place, (method, given) in enumerate(
            [(each, [list(map(float, own)) for own in (*sums, level)]), (together, [*sums, level])]
        ):
            memory = method.follow(both[place], *given[:6])
            memory = method.lead(memory, given[0], [0.045 * own for own in given[0]])
            memory = method.set_edge(memory, given[6], cells.tolist())
            both[place] = memory
            pose, heights = method.get_pose(memory), method.get_heights(memory)
            discs = [disc or (0.0, 0.0, 0.0) for disc in method.find_disc(memory)]
            results.append([*gather(memory).numbers, *np.array(discs).T, *pose, *heights])
        np.testing.assert_array_equal(*results)
        kinds |= {own.phase for own in both[0]}
    assert kinds == set(Phase)
