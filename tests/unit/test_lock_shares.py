"""Pins locked in part: how brushes set and change their shares, and how far other brushes move such pins."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.control.orders import share
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.live_session import follow_path
from digiclay.core.session.snapshot import dump, load
from digiclay.core.session.take import replay
from digiclay.device.instant import find_ellipsoid
from digiclay.recorded.takes import read_recording
from digiclay.sessions import sculpting
from digiclay.sessions.running import find_device
from digiclay.strokes import drawn
from digiclay.strokes.falloff import Falloff, evaluate
from digiclay.strokes.locks import find_inside, find_locks, place_images
from digiclay.strokes.nominal import Device, find_nominal, find_radius
from digiclay.strokes.queue_ghosts import find_ghosts
from digiclay.strokes.stamps import load_stamp
from digiclay.strokes.stroke import Brush, make_images
from numpy.testing import assert_array_equal

from tests import strokes
from tests.assemble import assert_near, replayed
from tests.hand import heights
from tests.strokes import copy, form

REST, SIZE = 40e-3, 21
LINE = ((-18.0, 0.0), (18.0, 0.0))
#: Shares of pins by their columns: locked at the right, not at the left.
SHARES = np.tile(np.linspace(0.0, 1.0, SIZE).round(2), SIZE)


def lay(brush, path=LINE, amount=6.0, **more):
    return strokes.lay(path, brush, amount, **more)


def begin():
    tables = {"layout": {"rows": SIZE, "columns": SIZE}, "control": {"method": "hybrid"}}
    return strokes.begin(resolve(tables))


def shares(session):
    return session.state.shares()


# A bed of 3 by 5 pins whose middle one is locked, or all but that one.
def device_of(arrangement, locks):
    grid = make_grid(Layout(3, 5, 3e-3, arrangement))
    finger = find_ellipsoid(resolve({}))
    return Device(grid, finger, None, 80e-3, np.asarray(locks, float), REST)


ONE = np.eye(15)[7]


@pytest.mark.parametrize(
    "arrangement, beside",
    [
        ("aligned", (2, 6, 8, 12)),
        ("staggered", (2, 3, 6, 8, 12, 13)),
        ("hexagonal", (2, 3, 6, 8, 12, 13)),
    ],
)
def test_locks_grow_shrink_and_blur_by_the_pins_beside_each(arrangement, beside):
    around, flat = [7, *beside], np.zeros(15)

    def change(brush, locks):
        return find_locks(lay(brush), device_of(arrangement, locks), flat)

    grown = change(Brush.GROW_LOCKS, ONE)
    assert sorted(np.flatnonzero(grown)) == sorted(around)
    assert_array_equal(change(Brush.SHRINK_LOCKS, grown), ONE)
    # Beyond an edge of the bed there is nothing, and not the last pin.
    assert not change(Brush.GROW_LOCKS, np.eye(15)[14])[:5].any()
    assert_array_equal(change(Brush.SHRINK_LOCKS, 1.0 - ONE), 1.0 - grown)
    blurred = change(Brush.BLUR_LOCKS, ONE)
    assert_near(blurred, grown / len(around), 1e-15)
    # What is locked all about stays locked, at the edges of the bed too.
    assert_array_equal(change(Brush.BLUR_LOCKS, np.ones(15)), np.ones(15))
    assert_near(change(Brush.INVERT_LOCKS, blurred), 1.0 - blurred, 1e-15)
    assert_array_equal(change(Brush.CLEAR_LOCKS, blurred), flat)


HEIGHTS = np.linspace(-7e-3, 7e-3, 15)


@pytest.mark.parametrize(
    "brush, keys, chosen",
    [
        (Brush.LOCK_PINS, {"pins": (0, 3)}, (0, 3)),
        (Brush.LOCK_PINS, {"pins": ()}, ()),
        (Brush.LOCK_PINS, {"pins": (14, 99)}, (14,)),  # of a bed that had more
        (Brush.LOCK_PINS, {}, range(15)),
        (Brush.LOCK_PINS, {"limits": (5e-3, np.inf)}, (12, 13, 14)),
        (Brush.LOCK_PINS, {"limits": (-np.inf, -5e-3)}, (0, 1, 2)),
        (Brush.LOCK_PINS, {"limits": (5e-3, np.inf), "pins": (0, 13)}, (13,)),
        (Brush.UNLOCK_PINS, {"limits": (5e-3, np.inf)}, (12, 13, 14)),
        (Brush.UNLOCK_PINS, {"pins": (3,)}, (3,)),
    ],
)
def test_pins_are_locked_by_number_and_by_height(brush, keys, chosen):
    device = device_of("aligned", np.full(15, 0.25))
    wanted = np.full(15, 0.25)
    wanted[list(chosen)] = float(brush is Brush.LOCK_PINS)
    assert_array_equal(find_locks(lay(brush, **keys), device, REST + HEIGHTS), wanted)


SQUARE = [(0, 0), (4, 0), (4, 4), (0, 4)]
LEFT, RIGHT, TOP, BESIDE = (1, 2), (3, 2), (2, 3.5), [(5, 2), (-1, 2), (2, 5), (1e9, 2)]


@pytest.mark.parametrize(
    "path, inside",
    [
        (SQUARE, {LEFT, RIGHT, TOP}),
        (SQUARE[::-1], {LEFT, RIGHT, TOP}),
        ([(0, 0), (4, 4), (4, 0), (0, 4)], {LEFT, RIGHT}),  # an eight
        ([*SQUARE, (0, 0), (1.5, 0), (1.5, 4), (0, 4)], {RIGHT, TOP}),  # twice around the left
        ([(0, 0)], set()),
        ([(0, 0), (4, 4)], set()),
        ([(0, 2), (4, 2), (2, 2)], set()),
    ],
)
def test_a_lasso_is_even_odd_where_it_crosses_itself(path, inside):
    places = [LEFT, RIGHT, TOP, *BESIDE, (np.nan, np.nan)]
    found = find_inside(np.array(places, float), np.array([*path, path[0]], float))
    assert {place for place, is_in in zip(places, found, strict=True) if is_in} == inside


@pytest.mark.parametrize(
    "symmetry, count, center, locked",
    [
        ("NONE", 2, (0.0, 0.0), {(-2, -1)}),
        ("X", 2, (0.0, 0.0), {(-2, -1), (2, -1)}),
        ("X", 2, (-3e-3, 0.0), {(-2, -1), (0, -1)}),
        ("XY", 2, (0.0, 0.0), {(-2, -1), (2, -1), (-2, 1), (2, 1)}),
        ("RADIAL", 4, (-3e-3, 0.0), {(-2, -1), (0, -1), (-2, 1), (0, 1)}),
        ("RADIAL", 3, (-6e-3, -3e-3), {(-2, -1)}),
    ],
)
def test_an_area_locks_the_pins_that_come_into_it_by_the_symmetry(symmetry, count, center, locked):
    grid = device_of("aligned", np.zeros(15)).grid
    images = make_images(symmetry, count, center)
    found = set()
    for places in place_images(images, grid, np.arange(15.0)):
        near = np.hypot(*(places[:, :2] - grid.positions[0]).T) < 1e-6
        found |= {tuple(pin) for pin in np.rint(grid.positions[near] / 3e-3).astype(int).tolist()}
        # It is looked at where the surface is that comes there.
        assert (places[near, 2] == 0.0).all()
    assert found == locked


@pytest.mark.parametrize("falloff", list(Falloff)[1:])
def test_lock_has_the_falloff_of_its_ring_and_unlock_leaves_what_that_does_not_take(falloff):
    path, images = ((3.0, 0.0), (12.0, 0.0)), make_images("Y", 2, (0.0, 9e-3))
    weak = {"falloff": falloff, "images": images}
    # A strength that the header does not show counts for nothing.
    session = form(begin(), lay(Brush.LOCK, path, share=0.3, **weak))
    x, y = session.system.grid.x, session.system.grid.y
    distance = np.min([np.hypot(x - x.clip(3e-3, 12e-3), y - at) for at in (0.0, 18e-3)], axis=0)
    radius = find_radius(find_ellipsoid(session.scene), session.scene.layout)
    wanted = evaluate(falloff, distance, radius)
    assert_near(shares(session), wanted, 1e-12)
    assert_array_equal(session.state.mode() == Mode.LOCKED, wanted == 1.0)
    half = form(session, lay(Brush.UNLOCK, path, **weak))
    assert_near(shares(half), np.minimum(wanted, 1.0 - wanted), 1e-12)


@cache
def hollow():
    """Return a session with a hole."""
    return form(begin(), lay(Brush.LOWER))


def begin_hollow(locks=SHARES):
    """Return that session with pins locked by shares, to go on with."""
    session = copy(hollow())
    path = np.tile(session.poses, (2, 1, 1))
    session = follow_path(session, path, share(locks), session.tick)
    return replace(session, snapshot=dump(session.system, session.state))


def test_another_method_keeps_all_locks():
    session = begin_hollow()
    other, words = sculpting.change_scene(session, replace(session.scene, control=None))
    assert words.startswith("Only heights and locks were kept")
    assert_array_equal(shares(other), shares(session))
    assert_array_equal(heights(other), heights(session))


CROSS = ((-12.0, -9.0), (12.0, 9.0))
CASES = {
    "lower": lay(Brush.LOWER, CROSS),
    "raise": lay(Brush.RAISE, CROSS, amount=9.0),
    "raise, back and forth": lay(Brush.RAISE, (*CROSS, CROSS[0]), accumulate=True),
    "stamp": lay(Brush.STAMP, CROSS, stamp=load_stamp("dome")),
    "crease": lay(Brush.CREASE, CROSS),
    "smooth": lay(Brush.SMOOTH, CROSS, falloff=Falloff.SMOOTH),
}


@pytest.mark.parametrize("stroke", CASES.values(), ids=CASES)
def test_what_a_brush_is_to_leave_of_a_pin_is_the_share_that_its_lock_leaves(stroke):
    before, device = heights(hollow()), find_device(begin_hollow())
    bare = find_nominal(stroke, replace(device, locks=1.0 * (SHARES == 1.0)), before)
    held = find_nominal(stroke, device, before)
    assert np.abs(bare.height - before)[SHARES > 0.5].max() > 0.2e-3
    assert_array_equal(held.height[SHARES == 1.0], before[SHARES == 1.0])
    assert_near(held.height, before + (1.0 - SHARES) * (bare.height - before), 1e-15)
    assert_array_equal(held.near, bare.near)
    # Its ghost is that of the locks as they are.
    (ghost,) = find_ghosts((stroke,), device, before)
    again = find_ghosts((stroke,), replace(device, locks=SHARES.copy()), before, (ghost,))
    assert again[0].nominal is ghost.nominal
    (other,) = find_ghosts((stroke,), replace(device, locks=None), before, (ghost,))
    assert_array_equal(other.nominal.height, find_nominal(stroke, other.device, before).height)


HALF = 0.5 * (SHARES > 0.5)
FORMED = [
    pytest.param(lay(Brush.RAISE, CROSS, amount=5.0), SHARES, id="a finger, to the nominal form"),
    pytest.param(lay(Brush.LOWER, CROSS, as_left=True), HALF, id="a finger, as it leaves them"),
    pytest.param(lay(Brush.ERASE, CROSS), HALF, id="valves that erase"),
    pytest.param(lay(Brush.SMOOTH, CROSS), HALF, id="valves that smooth"),
]


@pytest.mark.parametrize("stroke, locks", FORMED)
def test_pins_locked_in_part_stand_at_their_share_when_a_stroke_is_done(stroke, locks):
    before, held = heights(hollow()), sculpting.set_recording(begin_hollow(locks), True)
    bare, done = form(begin_hollow(0.0 * locks), stroke), form(held, stroke)
    moved = np.abs(heights(bare) - before)
    assert min(moved[locks > 0.4].max(), moved[locks < 0.4].max()) > 0.5e-3
    # The valves bring pins to within a micrometer of their heights.
    assert_near(heights(done), before + (1.0 - locks) * (heights(bare) - before), 2e-6)
    assert_array_equal(shares(done), locks)
    assert replayed(read_recording(done))
    assert_array_equal(heights(sculpting.rewind(done)), before)


@pytest.mark.parametrize("brush", [Brush.BLUR_LOCKS, Brush.GROW_LOCKS, Brush.CLEAR_LOCKS])
def test_a_change_of_locks_is_an_undo_step_in_takes_and_stored_with_the_bed(brush):
    held = sculpting.set_recording(begin_hollow(), True)
    done = form(held, lay(brush))
    assert len(done.gestures) == len(held.gestures) + 1
    assert np.abs(shares(done) - SHARES).max() > 0.01
    assert replayed(read_recording(done))
    assert replayed(read_recording(form(done, lay(Brush.INVERT_LOCKS))))
    assert_array_equal(shares(sculpting.rewind(done)), SHARES)
    assert_array_equal(load(done.system, done.snapshot).shares(), shares(done))
    # A finger may be added.
    two = sculpting.change_scene(
        done, done.scene.with_fingers(2), (1, 2), np.repeat(done.poses, 2, axis=0)
    )
    assert_array_equal(shares(two[0]), shares(done))
    more = form(done, lay(Brush.INVERT_LOCKS), lay(Brush.BLUR_LOCKS))
    for session in (more, sculpting.rewind(more)):
        *_, last = replay(read_recording(session))
        assert_array_equal(last.shares(), shares(session))


def test_lock_and_unlock_as_the_valves_sweep_them_take_off_shares():
    session = form(begin_hollow(HALF), lay(Brush.UNLOCK))
    x, y = session.system.grid.positions.T
    under = (np.abs(y) < 2e-3) & (np.abs(x) < 20e-3)
    assert (shares(session)[under] == 0.0).all()
    assert (shares(form(session, lay(Brush.LOCK)))[under] == 1.0).all()
    assert (shares(session) == HALF).any()


def test_a_line_of_a_stroke_keeps_its_pins_and_none_that_are_wrong():
    for pins in (None, (), (3, 0, 440)):
        stroke = lay(Brush.LOCK_PINS, pins=pins)
        assert drawn.load(drawn.dump(stroke)).pins == pins
    assert "pins" not in drawn.dump(lay(Brush.LOCK_PINS))
    high = lay(Brush.LOCK_PINS, limits=(5e-3, np.inf))
    assert drawn.load(drawn.dump(high)).limits == high.limits
    line = drawn.dump(lay(Brush.LOCK_PINS, pins=(3,)))
    for wrong in ("[-1]", "[1.5]", "[true]", '["3"]', "3", "[[3]]", "[null]", "[NaN]"):
        assert drawn.load(line.replace("[3]", wrong)) is None
