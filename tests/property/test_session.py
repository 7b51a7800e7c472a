"""What holds in any session: small beds, random fingers, a second or less; cells left out; symmetry."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from digiclay.core.control.blister import Blister
from digiclay.core.control.virtual_master import VirtualMaster
from digiclay.core.engine.simulation import begin, step
from digiclay.core.model.actuator import Actuator
from digiclay.core.model.control_interface import Controller
from digiclay.core.model.layout import Layout
from digiclay.core.model.trajectory import Trajectory, make_level
from digiclay.core.model.valve import Fluid, Valve
from digiclay.core.session import snapshot
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.assemble import make_system, one_cell, path, record, scripted, under, whole

COUNT = 60
CELLS = Layout(7, 7, arrangement="staggered")

#: Millimeters, to the tenth.
xy = st.integers(-140, 140).map(lambda tenths: tenths / 10)
#: Down to 8 mm below the tops, and far above; at up to 0.2 m/s.
points = st.lists(
    st.tuples(xy, xy, st.integers(320, 600).map(lambda tenths: tenths / 10)), min_size=3, max_size=6
)
turns = st.tuples(*[st.floats(-0.4, 0.4)] * 3)
steppers = st.sampled_from(["bernoulli", "bernoulli", "bernoulli", "runge_kutta_4"])


def finger(spots):
    """Return a level finger that visits spots, in mm, within the session."""
    return make_level(np.linspace(0.0, COUNT * 5e-3, len(spots)), np.array(spots) * 1e-3)


def tilted(path, turn):
    return Trajectory(path.times, path.positions, np.tile([1.0, *turn], (path.times.size, 1)))


def bed(stepper="bernoulli", **parts):
    """Return a small bed under Method I; Runge and Kutta's steps are short enough for a deep press."""
    return make_system(
        CELLS, stepper=stepper, step=0.25e-3 if stepper != "bernoulli" else 1e-3, **parts
    )


@settings(max_examples=5)
@given(points, turns, st.floats(0.0, 100.0), steppers)
@example(
    [(0.0, 0.0, 45.0), (0.0, 0.0, 36.0), (9.0, 3.0, 38.0)], (0.0, 0.0, 0.0), 40.0, "runge_kutta_4"
)
def test_a_session_is_finite_within_the_stroke_without_pull_and_its_commands_are_openings(
    spots, turn, rest, stepper
):
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
    before = snapshot.dump(system, state)
    poses = path.poses(state.period * 5e-3 + system.instants)[:, None]
    once, again = (step(system, state, poses) for _ in range(2))
    assert snapshot.dump(system, state) == before
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
valves = st.sampled_from(
    [{}, {"valve": Valve(orifice_diameter=0.8e-3), "fluid": Fluid(760.0, 0.65e-6)}]
)


@settings(max_examples=10)
@given(commands, valves)
def test_the_fluid_pumped_is_what_the_pin_rose_by(script, parts):
    # Flow of the exact opening by a fine sum, through the law itself; no load, no end stop, no dead
    # time.
    system = one_cell(
        dead_time=0.0, control=scripted(lambda t, x, y: script[round(t / 5e-3)]), **parts
    )
    run = record(system, make_level(np.zeros(1), np.array([[0, 0, 1.0]])), len(script))
    opening, volume, count = 0.0, 0.0, 1000
    dt = 5e-3 / count
    for command in script:
        times = (np.arange(count) + 0.5) * dt
        k = command + (opening - command) * np.exp(-times / 2e-3)
        volume += system.cell.flow.flow(k, system.cell.supply.pressure(k)).sum() * dt
        opening = command + (opening - command) * np.exp(-2.5)
    way = run.height[-1, 0] - run.height[0, 0]
    # Two Gauss points a millisecond: 1e-5 of the way where all is smooth; where the opening changes
    # sign or the flow turns turbulent within a step, up to a thousandth of what a pin can rise in a
    # period.
    assert system.cell.actuator.area * way == pytest.approx(
        volume, abs=1e-3 * system.cell.actuator.area * system.fastest * system.period
    )


PERIODS = 120
BED = make_system(Layout(9, 9), control=VirtualMaster())

visits = st.lists(
    st.tuples(xy, xy, st.integers(330, 550).map(lambda tenths: tenths / 10)), min_size=4, max_size=7
)


@dataclass(frozen=True)
class Everywhere:
    """A controller that asks for the whole bed, so that every cell takes part in every period."""

    inner: Controller

    rows = 0

    def begin(self):
        return self.inner.begin()

    def locate(self, memory, touched):
        return self.inner.locate(memory, touched)[0], (0.0, 0.0, 1.0)

    def command(self, memory, seen):
        return self.inner.command(memory, seen)


@settings(max_examples=4)
@given(visits)
@example([  # the finger is felt by one cell, and travels along a row: cells lie exactly abeam of it
    (-0.2, -1.5, 34.1), (-3.0, -7.9, 49.0), (2.1, 3.0, 45.1), (-3.3, 9.6, 40.6), (-1.3, -5.4, 37.7),
    (-9.1, 12.0, 54.9), (-10.0, 2.3, 49.7),
])  # fmt: skip
def test_integrating_only_the_cells_that_move_gives_what_integrating_all_does(spots):
    trajectory = make_level(
        np.linspace(0.0, PERIODS * BED.period, len(spots)), np.array(spots) * 1e-3
    )
    fewer = record(BED, trajectory, PERIODS)
    all_cells = record(replace(BED, controller=Everywhere(BED.controller)), trajectory, PERIODS)
    assert all_cells.last.active.cells.size == BED.grid.count
    # Rounding: sums in another order. A force grows e-fold in half a millimeter.
    assert np.abs(fewer.height - all_cells.height).max() < 1e-12
    assert np.abs(fewer.force - all_cells.force).max() < 1e-9


@pytest.mark.parametrize(
    "side, way, count, least, most",
    [
        (9, [(0, 0, 0, 200), (1, 5, 5, 200)], 20, 0, 0),  # far above
        # At rest. The servo's flow goes with the error squared, so coming to rest takes some 20 s.
        (9, [(0, 0, 0, 45), (0.3, 0, 0, 36), (0.6, 0, 0, 60)], 6000, 0, 0),
        # Rows and columns that hold the disc to the edge ring, with a pitch to spare on every side:
        # 15 x 15.
        (25, [(0, 0, 0, 45), (0.3, 0, 0, 36)], 60, 21, 15 * 15),
    ],
)
def test_only_cells_around_a_touch_are_integrated_until_the_surface_is_at_rest(
    side, way, count, least, most
):
    run = record(make_system(Layout(side, side), control=VirtualMaster()), path(*way), count)
    assert np.any(run.height[-1] != 40e-3) == (count > 20)
    assert least <= run.last.active.cells.size <= most


def test_pins_that_rise_into_a_still_finger_meet_it_at_once():
    # The finger waits 1 mm above; which cells it may touch was settled before they rose.
    system = make_system(Layout(9, 9), control=scripted(lambda t, x, y: 1.0))
    run = record(system, path((0, 0, 0, 41)), 40)
    touching = run.height[:, 40] > 41e-3
    assert 5 < touching.sum() < 40
    assert np.array_equal(run.force[:, 40] > 0.0, touching)


#: Press, lift, drag, lift off: off the cells' axes, tilted. Time, x, y, z in mm, then the
#: quaternion.
WAYPOINTS = np.array(
    [
        (0.0, -5.3, 3.1, 42.0, 0.97, 0.1, 0.2, 0.0), (0.25, -5.3, 3.1, 35.5, 0.97, 0.1, 0.2, 0.0),
        (0.6, -5.3, 3.1, 39.5, 0.97, 0.0, 0.2, 0.1), (1.2, 4.4, -1.7, 40.0, 0.95, -0.1, 0.2, 0.2),
        (1.4, 4.4, -1.7, 60.0, 0.95, -0.1, 0.2, 0.2),
    ]
)  # fmt: skip
MIDDLE = WAYPOINTS * [1, 0, 0, 1, 1, 0, 0, 0]
#: What a mirror across x, or across y, makes of a waypoint.
MIRRORED_X = np.array([1, -1, 1, 1, 1, 1, -1, -1])
MIRRORED_Y = np.array([1, 1, -1, 1, 1, -1, 1, -1])


def turned(points):
    t, x, y, z, *q = points.T
    half = np.sqrt(0.5)
    w, qx, qy, qz = q
    turn = [half * (w - qz), half * (qx - qy), half * (qx + qy), half * (w + qz)]
    return np.column_stack([t, -y, x, z, *turn])


#: Name: arrangement, shape of the bed, what is done to the path, and to rows and columns of cells.
CASES = {
    "mirrored": ("aligned", (9, 12), lambda p: p * MIRRORED_X, lambda h: h[:, :, ::-1]),
    "mirrored, odd": ("aligned", (11, 11), lambda p: p * MIRRORED_X, lambda h: h[:, :, ::-1]),
    "rotated by 90": ("aligned", (11, 11), turned, lambda h: h.transpose(0, 2, 1)[:, :, ::-1]),
    "rotated by 180": ("aligned", (9, 12), lambda p: turned(turned(p)), lambda h: h[:, ::-1, ::-1]),
    "hexagonal, mirrored": (
        "hexagonal",
        (11, 12),
        lambda p: p * MIRRORED_Y,
        lambda h: h[:, ::-1, :],
    ),
    "staggered, rotated": (
        "staggered",
        (10, 12),
        lambda p: turned(turned(p)),
        lambda h: h[:, ::-1, ::-1],
    ),
}


def formed(arrangement, shape, points, profile):
    system = make_system(
        Layout(*shape, 3e-3, arrangement), control=VirtualMaster(), blister=Blister(profile=profile)
    )
    run = record(system, Trajectory(points[:, 0], points[:, 1:4] * 1e-3, points[:, 4:]), 260)
    return run.height.reshape(-1, *shape), run.force.reshape(-1, *shape)


@pytest.mark.parametrize(
    "case, points, profile",
    [
        *((case, WAYPOINTS, "cone") for case in CASES if case != "mirrored, odd"),
        ("mirrored", WAYPOINTS, "gaussian"),
        # A press on a cell in the middle: cells lie exactly on the circles of the control here.
        *(("mirrored, odd", MIDDLE, profile) for profile in ("cone", "gaussian")),
    ],
)
def test_a_moved_scene_gives_the_moved_result(case, points, profile):
    arrangement, shape, points_moved, cells_moved = CASES[case]
    height, force = formed(arrangement, shape, points, profile)
    moved_height, moved_force = formed(arrangement, shape, points_moved(points), profile)
    assert np.ptp(height[-1]) > 1e-3
    # Rounding of positions, 1e-17 m, through 260 periods of a closed loop; forces grow e-fold in
    # 0.5 mm.
    assert np.abs(moved_height - cells_moved(height)).max() < 1e-12
    assert np.abs(moved_force - cells_moved(force)).max() < 1e-10
