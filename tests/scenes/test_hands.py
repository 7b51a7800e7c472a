"""Several fingertips on one bed: as alone where they are apart, by the sum of forces where they meet."""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from digiclay.core.base.arrays import Floats
from digiclay.core.control.blister import Blister
from digiclay.core.control.methods import find_method
from digiclay.core.control.virtual_master import Phase
from digiclay.core.engine.simulation import advance, begin
from digiclay.core.engine.state import State
from digiclay.core.engine.system import System
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import find, load
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import snapshot
from digiclay.core.session.run_scene import run

from tests.assemble import assert_near
from tests.measured import measure

PAPER = load(find("ridge_mound_valley"))
(FINGER,) = PAPER.fingers
PERIOD, REST = 5e-3, 40e-3
FOLLOWING = ("virtual_master", "cell_states", "hybrid")


def scene(method, *fingers, **parts):
    """Return a bed of 50 x 50 pins under some fingers."""
    control = find_method(method).import_parameters()() if method else None
    shape = find_method(method).blister if method else None
    blister = None if shape is None else Blister(**shape)
    layout = replace(PAPER.layout, rows=50, columns=50)
    known = {"layout": layout, "blister": blister, "fingers": fingers, "recorder": None}
    return replace(PAPER, control=control, method=method or "virtual_master", **known | parts)


def beds(method, *counts, **parts):
    """Return beds under so many fingers each."""
    return [assemble(scene(method, *[FINGER] * count, **parts)) for count in counts]


def press(system, places, way, periods):
    """Return poses (t, p, f, 7) of fingertips that press 2.5 mm, and are dragged after half a second, m/s."""
    time = np.arange(periods)[:, None] * PERIOD + system.instants
    poses = np.zeros((*time.shape, len(places), 7))
    for finger, (x, y) in enumerate(places):
        gone = np.maximum(time - 0.5, 0.0)
        poses[:, :, finger, 0], poses[:, :, finger, 1] = x + way[0] * gone, y + way[1] * gone
        poses[:, :, finger, 2] = REST + 1e-3 - np.minimum(20e-3 * time, 3.5e-3)
        angle = 0.4 * (finger + 1)
        poses[:, :, finger, 3], poses[:, :, finger, 6] = np.cos(angle / 2), np.sin(angle / 2)
    return poses


def follow(system, poses, state=None):
    """Simulate poses; return the last state, and the forces of the fingers, (t, f), N."""
    state, forces = state or begin(system), []
    for finger in system.trace(poses, 0):
        state = advance(system, state, finger)
        forces.append(state.finger_forces())
    return state, np.array(forces)


@pytest.mark.parametrize("method", [None, *FOLLOWING, "viscous"])
def test_fingers_far_from_each_other_form_what_each_forms_alone(method):
    places = [(-52e-3, -11e-3), (31e-3, 17e-3), (-3e-3, 55e-3)]
    one, three = beds(method, 1, 3)
    poses = press(one, places, (14e-3, 5e-3), 180)
    single = [follow(one, poses[:, :, [finger]]) for finger in range(3)]
    state, forces = follow(three, poses)
    # Rounding alone: sums go over the cells in another order; viscous pins depend on the active
    # set.
    assert_near(forces, np.hstack([own for _, own in single]), 1e-9)
    formed = sum(own.row(0) - REST for own, _ in single)
    assert_near(state.row(0) - REST, formed, 1e-10)


SOFT = replace(FINGER, contact=replace(FINGER.contact, exponent=1700.0, stiffness=280.0))
LONG = replace(
    FINGER,
    contact=replace(FINGER.contact, stiffness=330.0),
    fingertip=replace(FINGER.fingertip, length=12e-3),
    relaxation=Relaxation((5e-3, 0.3), (0.5, 0.2, 0.3)),
)


@pytest.mark.parametrize("method", [None, "virtual_master"])
def test_a_third_finger_that_hovers_over_two_that_meet_changes_nothing(method):
    two, three = beds(method, 2, 3)
    poses = press(three, [(-3e-3, 1e-3), (3e-3, -1e-3), (9e-3, 1e-3)], (6e-3, 2e-3), 150)
    poses[:, :, 2, 2] += 6e-3  # within reach, without a touch
    (alone, forces), (state, all_forces) = follow(two, poses[:, :, :2]), follow(three, poses)
    assert not all_forces[:, 2].any()
    # Rounding alone: sums go over the cells in another order.
    assert_near(all_forces[:, :2], forces, 1e-9)
    assert_near(state.row(0), alone.row(0), 1e-12)


@pytest.mark.parametrize("below, known", [(0.1e-3, False), (0.3e-3, True)])
def test_nobody_knows_who_presses_a_pin_just_below_two_predicted_fingertips(below, known):
    system = assemble(scene("hybrid", FINGER, FINGER))
    hands = system.controller
    pin = measure(np.zeros(1), np.zeros(1), force=5e-3, rows=hands.rows)
    shares, sure = hands.division.divide_force(
        np.zeros(1, np.intp), np.full((2, 1), REST + below), pin, np.zeros(1, np.intp)
    )
    assert sure.tolist() == [known]
    assert shares.ravel().tolist() == [1.0, 0.0]


def drag(system):
    """Return poses (t, p, 2, 7): pressed, lifted by 5.5 and 11.5 mm, at rest, then off at once.

    They are 12 mm apart, and go in the direction of the lower one, which rises.
    """
    time = np.arange(730)[:, None] * PERIOD + system.instants
    poses = np.zeros((*time.shape, 2, 7))
    poses[..., 3] = 1.0
    gone, angle = 12e-3 * np.maximum(time - 2.92, 0.0), np.deg2rad(160)
    for finger, (ahead, top) in enumerate(((6e-3, 42e-3), (-6e-3, 48e-3))):
        way = [(0.0, 42e-3), (0.5, 36.5e-3), (0.7, 36.5e-3), (2.62, top)]
        along = ahead + gone
        poses[..., finger, 0] = 1.3e-3 + along * np.cos(angle)
        poses[..., finger, 1] = 0.7e-3 + along * np.sin(angle)
        poses[..., finger, 2] = np.interp(time, *np.transpose(way)) + 0.5 * gone * (ahead > 0.0)
    return poses


def test_a_finger_beside_a_higher_one_is_followed_as_alone():
    # While pins far above a fingertip told of its place, both were lost.
    one, two = beds("virtual_master", 1, 2, layout=replace(PAPER.layout, rows=27, columns=27))
    poses = drag(two)
    _, both = follow(two, poses)
    alone = np.hstack([follow(one, poses[:, :, [finger]])[1] for finger in (0, 1)])
    # In all rows of the lift: without contact the force is off by the whole set point.
    off, own = (np.sqrt(np.mean((forces[200:] - 0.4) ** 2, axis=0)) for forces in (both, alone))
    assert (both[200:] > 0.0).all()
    assert (off <= 1.1 * own).all()


class Unlike(NamedTuple):
    """Three fingers of their own kinds that press near each other, and what they form."""

    system: System
    poses: Floats
    half: State
    """After 150 of the 240 periods."""
    last: State
    forces: Floats


UNLIKE = (FINGER, SOFT, LONG)
ELASTIC = replace(FINGER, relaxation=None)


@cache
def unlike(method):
    """Return what three unlike fingers form; two go up, so that pins around change hands."""
    system = assemble(scene(method, *UNLIKE))
    poses = press(system, [(-10e-3, 1e-3), (6e-3, -4e-3), (2e-3, 9e-3)], (6e-3, -9e-3), 240)
    poses[100:, :, :, 2] += np.linspace(0.0, 1e-3, 140)[:, None, None] * (10.0, 3.0, 0.0)
    half, before = follow(system, poses[:150])
    last, after = follow(system, poses[150:], half.copy())
    return Unlike(system, poses, half, last, np.concatenate([before, after]))


@pytest.mark.parametrize("method", [None, *FOLLOWING])
def test_the_order_of_the_fingers_changes_nothing(method):
    first, order = unlike(method), [2, 0, 1]
    second = assemble(scene(method, *(UNLIKE[finger] for finger in order)))
    state, swapped = follow(second, first.poses[:, :, order])
    # Rounding alone: forces and shares are added in another order.
    assert_near(swapped, first.forces[:, order], 1e-9)
    assert_near(state.row(0), first.last.row(0), 1e-11)


@pytest.mark.parametrize("method", [None, *FOLLOWING])
def test_a_session_of_three_fingers_goes_on_from_a_kept_state_to_the_same_bits(method):
    system, poses, half, last, _ = unlike(method)
    state, _ = follow(system, poses[150:], snapshot.load(system, snapshot.dump(system, half)))
    assert snapshot.dump(system, state) == snapshot.dump(system, last)


#: A set that is made anew adds up in another order; a controller with other rows begins anew. N.
ORDER, ANEW = 1e-6, 0.2


@pytest.mark.parametrize(
    "method, middle, apart",
    [
        ("virtual_master", ELASTIC, ORDER),
        ("viscous", ELASTIC, ORDER),
        ("cell_states", LONG, ORDER),
        ("hybrid", FINGER, ORDER),
        ("hybrid", LONG, ANEW),
    ],
)
def test_fingers_that_come_and_go_leave_the_others_what_they_have(method, middle, apart):
    # The one that stays may have another number of filters than those that come and go.
    one, three = assemble(scene(method, middle)), assemble(scene(method, FINGER, middle, FINGER))
    places = [(-40e-3, 1e-3), (2e-3, -4e-3), (40e-3, 2e-3)]
    poses = press(three, places, (6e-3, -9e-3), 120)
    state, _ = follow(three, poses)
    single = snapshot.change_fingers(three, one, state.copy(), [1])
    assert np.array_equal(single.row(0), state.row(0))
    assert apart < ANEW or single.memory.phase is Phase.IDLE
    still = np.repeat(poses[-1:, -1:], len(three.instants), axis=1)
    after, force = follow(one, np.repeat(still[:, :, [1]], 5, axis=0), single)
    _, forces = follow(three, np.repeat(still, 5, axis=0), state)
    assert_near(force[:, 0], forces[:, 1], apart)
    more = snapshot.change_fingers(one, three, after, [None, 0, None])
    _, again = follow(three, np.repeat(still, 3, axis=0), more)
    assert (again[-1] > 0.0).all()


@pytest.mark.parametrize("later", [False, True], ids=["both from the start", "one comes later"])
def test_where_blisters_overlap_each_pin_has_the_ground_it_had_before_the_first_one(later):
    made = [scene("virtual_master", *[FINGER] * count) for count in (1, 2)]
    one, two = (assemble(replace(own, control=replace(own.control, ground="cell"))) for own in made)
    # 27 mm apart at first, or 13 mm, and dragged towards each other on a bias until they are 11 mm
    # apart.
    time = np.arange(240)[:, None] * PERIOD + two.instants
    poses = np.zeros((*time.shape, 2, 7))
    for finger, side in enumerate((-1.0, 1.0)):
        gone = np.clip(time - 0.5, 0.0, 0.7)
        start = 6.5e-3 if later else 13.5e-3
        poses[:, :, finger, 0] = side * (start - (start - 5.5e-3) / 0.7 * gone)
        poses[:, :, finger, 1] = 3e-3 - 9e-3 * gone
        poses[:, :, finger, 2] = REST + 4e-3 - np.minimum(20e-3 * time, 9.5e-3)
        poses[:, :, finger, 3] = 1.0
    state, targets = begin(two), []
    if later:
        state, _ = follow(one, poses[:100, :, :1])
        state = snapshot.change_fingers(one, two, state, [0, None])
    for finger in two.trace(poses[100:] if later else poses, 100 if later else 0):
        state = advance(two, state, finger)
        targets.append(state.row(two.rows.target))
    # They sink 5.5 mm, less the indentation: no pin is commanded deeper, and none is raised.
    assert 34.2e-3 < np.min(targets) < 36e-3
    assert np.max(targets) <= REST + 0.2e-3


def displaying(method):
    """Return beds that display a shape before a method, under one finger and two."""
    shown = resolve({"shape": {"file": "face"}, "control": {"method": method}})
    return [assemble(replace(shown, fingers=(FINGER,) * count)) for count in (1, 2)]


@pytest.mark.parametrize("method", ["virtual_master", "elastic"])
def test_a_finger_comes_and_goes_on_a_bed_that_displays_a_shape(method):
    one, two = displaying(method)
    poses = press(two, [(-20e-3, 1e-3), (20e-3, 0.0)], (0.0, 0.0), 40)
    poses[..., 2] += 20e-3
    state, _ = follow(one, poses[:30, :, :1])
    state, _ = follow(two, poses[30:], snapshot.change_fingers(one, two, state, [0, None]))
    single = snapshot.change_fingers(two, one, state.copy(), [0])
    assert np.array_equal(single.row(0), state.row(0))
    assert np.isfinite(follow(one, poses[-5:, :, :1], single)[0].row(0)).all()


def test_pins_that_a_display_raises_against_resting_fingers_press_each_as_alone():
    one, two = displaying("virtual_master")
    poses = press(two, [(-17e-3, 3e-3), (15e-3, -2e-3)], (0.0, 0.0), 120)
    poses[..., 2] = REST + np.array([5e-3, 6e-3])
    state, forces = begin(two), []
    for finger in two.trace(poses, 0):
        state = advance(two, state, finger)
        forces.append(state.finger_forces())
        # Or pins that are touched may be left out.
        assert state.active.block[0].max() <= state.active.peak
    alone = [follow(one, poses[:, :, [finger]])[1] for finger in range(2)]
    assert np.max(forces, axis=0).min() > 0.05
    assert_near(forces, np.hstack(alone), 1e-9)


@pytest.mark.parametrize("method", [None, "hybrid"])
def test_fingers_that_jump_and_meet_leave_finite_numbers(method):
    system = assemble(scene(method, FINGER, SOFT, LONG))
    poses = press(system, [(0.0, 1e-3), (1e-3, 0.0), (0.0, 0.0)], (40e-3, 0.0), 120)
    chance = np.random.default_rng(5)
    poses[..., :2] += chance.normal(0.0, 8e-3, (*poses.shape[:1], 1, 3, 2))
    poses[60:, :, :, 2] -= chance.uniform(0.0, 30e-3, (60, 1, 3))
    state, forces = follow(system, poses)
    assert np.isfinite(forces).all()
    assert ((state.row(0) >= 0.0) & (state.row(0) <= system.cell.actuator.stroke)).all()


@pytest.mark.filterwarnings("error")
def test_where_the_law_of_two_fingers_begins_at_a_depth_a_pin_above_both_is_nobodys():
    late = replace(FINGER, contact=replace(FINGER.contact, offset=1e-3))
    system = assemble(scene("hybrid", late, late))
    _, forces = follow(system, press(system, [(-6e-3, 1e-3), (6e-3, -1e-3)], (3e-3, 2e-3), 200))
    assert np.abs(forces[-1] - 0.4).max() < 0.02
    assert forces.max() < 0.5


def test_a_run_of_two_fingers_has_the_metrics_of_each_and_its_errors():
    path = FINGER.trajectory
    shifted = [
        replace(place, position=(place.position[0], 40e-3, place.position[2]))
        for place in path.waypoints
    ]
    aside = replace(FINGER, trajectory=replace(path, waypoints=tuple(shifted)))
    short = replace(PAPER.simulation, duration=1.5)
    result, alone = (
        run(replace(scene("virtual_master", *fingers, simulation=short), recorder=PAPER.recorder))
        for fingers in ((FINGER, aside), (FINGER,))
    )
    assert result.history["fingertip"].shape[1:] == (2, 7)
    assert_near(result.history["finger_force"].sum(axis=1), result.history["total_force"], 1e-12)
    first, second = result.metrics["fingers"]
    assert first["rfd"] == pytest.approx(alone.metrics["rfd"], rel=1e-6)
    assert result.metrics["rfd"] == max(first["rfd"], second["rfd"])
    assert result.metrics["losses"] is not None
    # What one finger of the paper's session has: 15 µm.
    assert 0.0 < result.estimate_errors().metrics["height_error"] < 30e-6


def test_the_pulp_of_a_finger_that_went_forgets_while_another_one_hovers_where_it_pressed():
    one, two = beds(None, 1, 2)
    poses = press(two, [(0.0, 1e-3), (2e-3, 0.0)], (0.0, 0.0), 120)
    poses[:, :, 1, 2] += 5e-3  # it hovers
    poses[40:80, :, 0, 0] += 60e-3
    _, alone = follow(one, poses[:, :, :1])
    _, forces = follow(two, poses)
    assert_near(forces[:, :1], alone, 1e-9)  # rounding; 40 mN if it does not
