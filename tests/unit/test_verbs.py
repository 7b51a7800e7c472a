"""Strokes that the valves form: erased, locked, stamped; in takes, undone, and under every other brush."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from digiclay.core.base.errors import DigiclayError
from digiclay.core.base.modes import Mode
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.take import replay
from digiclay.recorded.pointer_strokes import PointerStroke, play_strokes
from digiclay.recorded.takes import read_recording
from digiclay.sessions import sculpting
from digiclay.strokes.nominal import find_radius
from digiclay.strokes.stamps import load_stamp
from numpy.testing import assert_array_equal

from tests.assemble import assert_near, refused_in_a_line, replayed
from tests.hand import heights

REST = 40e-3
#: A click in the middle, a line through it, and a stamp that is drawn out to the right, m.
CLICK, LINE, DRAG = ((0.0, 0.0),), ((-18e-3, 0.0), (18e-3, 0.0)), ((0.0, 0.0), (15e-3, 0.0))


def begin(**tables):
    scene = resolve(
        {"layout": {"rows": 21, "columns": 21}, "control": {"method": "hybrid"}, **tables}
    )
    return sculpting.begin_session(1, "Bed", scene, np.array([0.0, 0.0, 46e-3, *LEVEL]))[0]


def stroke(brush, places=LINE, **keys):
    moves = tuple((0.1 * number, x, y) for number, (x, y) in enumerate(places))
    return PointerStroke(brush=brush, moves=moves, **keys)


def play(session, *strokes):
    *_, done = play_strokes(session, strokes)
    return done


def relief(session):
    """Return how high the pins stand above rest, (21, 21), mm."""
    return 1e3 * (heights(session) - REST).reshape(21, 21)


def locked(session):
    return (session.state.mode() == Mode.LOCKED).reshape(21, 21)


HOLE = stroke("lower", depth=6e-3)


@cache
def hollow(method="hybrid", *drawn):
    """Return a session with a hole, after other strokes."""
    return play(begin(control={"method": method}), HOLE, *drawn)


def begin_hollow(*given):
    """Return that session, to go on with."""
    session = hollow(*given)
    return replace(session, state=session.state.copy())


CASES = [
    pytest.param(stroke("erase"), id="erase"),
    pytest.param(stroke("lock"), id="lock"),
    pytest.param(stroke("stamp", DRAG), id="stamp"),
    pytest.param(stroke("stamp", DRAG, ctrl=True), id="imprint"),
    pytest.param(stroke("invert_locks", CLICK), id="invert"),
    pytest.param(
        stroke("erase", symmetry="radial", radial=3, center_x=3e-3, center_y=-2e-3), id="radial"
    ),
]


@pytest.mark.parametrize("drawn", CASES)
def test_each_is_one_gesture_that_is_taken_back_whole_and_replayed_bit_for_bit(drawn):
    session = sculpting.set_recording(begin_hollow(), True)
    before, kept = heights(session), locked(session)
    done = play(session, drawn)
    assert len(done.gestures) == len(session.gestures) + 1
    assert (locked(done) != kept).any() or np.abs(heights(done) - before).max() > 1e-3
    take = read_recording(done)
    assert replayed(take)
    back = sculpting.rewind(done)
    assert_array_equal(heights(back), before)
    assert_array_equal(locked(back), kept)


@pytest.mark.parametrize("strength, left", [(1.0, 0.02), (0.05, 5.5)])
def test_one_stroke_erases_what_is_in_its_ring_and_a_weak_one_part_of_it(strength, left):
    formed = begin_hollow()
    before = relief(formed)
    done = play(formed, stroke("erase", strength=strength))
    row = relief(done)[10, 5:16]
    assert np.abs(row).max() < left
    assert strength == 1.0 or np.abs(row).min() > 1.5
    far = np.abs(np.arange(21) - 10) * 3e-3 > find_radius(
        done.scene.fingers[0].fingertip, done.scene.layout
    )
    assert_near(relief(done)[far], before[far], 1e-9)


OTHERS = [
    ("lower", {"depth": 4e-3}),
    ("raise", {"height": 6e-3}),
    ("level", {}),
    ("smooth", {}),
    ("erase", {}),
    ("stamp", {"height": 10e-3}),
]


@pytest.mark.parametrize(
    "brush, keys, method",
    [*((*one, "hybrid") for one in OTHERS), (*OTHERS[1], "cell_states")],
)
def test_a_locked_pin_keeps_its_height_under_every_brush_and_no_finger_presses_into_it(
    brush, keys, method
):
    held = begin_hollow(method, stroke("lock", ((6e-3, 0.0), (9e-3, 0.0))))
    before, kept = heights(held), locked(held)
    done = play(
        sculpting.set_recording(held, True),
        stroke(brush, ((-3e-3, -1.8e-3), (15e-3, 9e-3)), **keys),
    )
    assert_array_equal(heights(done)[kept.ravel()], before[kept.ravel()])
    assert_array_equal(locked(done), kept)
    assert np.abs(heights(done) - before).max() > 1e-3
    take = read_recording(done)
    force = [state.row(done.system.rows.force)[kept.ravel()].sum() for state in replay(take)]
    assert max(force) < 0.5


def test_locks_are_taken_off_by_ctrl_turned_over_and_cleared():
    session, counts = begin(), []
    for drawn in (
        stroke("lock"),
        stroke("lock", ((12e-3, 0.0), (18e-3, 0.0)), ctrl=True),
        stroke("invert_locks", CLICK),
        stroke("invert_locks", CLICK),
        stroke("clear_locks", CLICK),
    ):
        session = play(session, drawn)
        counts.append(int(locked(session).sum()))
    first, rest, turned, again, none = counts
    assert 0 < rest < first
    assert (turned, again, none) == (441 - rest, rest, 0)


@pytest.fixture
def bright(tmp_path):
    """A shape that rises to its right side."""
    np.save(tmp_path / "ramp.npy", np.tile(np.linspace(0.0, 1.0, 40), (40, 1)))
    return str(tmp_path / "ramp.npy")


def ramp(session):
    return 1e3 * session.system.grid.x.reshape(21, 21)


@pytest.mark.parametrize(
    "keys, turned",
    [
        ({}, 0.0),
        ({"places": ((0.0, 0.0), (0.0, 15e-3))}, 90.0),
        ({"places": ((0.0, 0.0), (-15e-3, 0.0))}, 180.0),
        ({"strength": 0.5}, 0.0),
        ({"ctrl": True}, 0.0),
    ],
)
def test_a_stamp_has_the_drawn_size_turn_and_strength_up_or_down(bright, keys, turned):
    places = keys.pop("places", DRAG)
    done = play(begin(), stroke("stamp", places, height=9e-3, depth=6e-3, stamp=bright, **keys))
    formed = np.rot90(relief(done), round(turned / 90.0))
    inside = np.abs(ramp(done)) < 14e0
    sign = -6.0 if keys.get("ctrl") else 9.0 * keys.get("strength", 1.0)
    wanted = sign * (ramp(done) + 15.0) / 30.0
    within = inside & inside.T
    assert_near(formed[within], wanted[within], 0.03 * abs(sign))
    beside = (np.abs(ramp(done)) > 16.0) | (np.abs(ramp(done)).T > 16.0)
    assert np.abs(formed[beside]).max() < 1e-3


@pytest.mark.parametrize(
    "symmetry, axis", [("x", 0.0), ("y", 0.0), ("xy", 0.0), ("x", 90.0), ("radial", 0.0)]
)
def test_images_of_a_stamp_are_mirrored_and_turned_about_the_placed_center(bright, symmetry, axis):
    keys = {"symmetry": symmetry, "axis": axis, "radial": 4}
    places = ((15e-3, 12e-3), (21e-3, 12e-3))
    formed = relief(play(begin(), stroke("stamp", places, stamp=bright, **keys)))
    assert formed.max() > 10.0
    images = {
        "x": [np.fliplr],
        "y": [np.flipud],
        "xy": [np.fliplr, np.flipud],
        "radial": [np.rot90],
    }
    images["x"] = [np.flipud] if axis else images["x"]
    for image in images[symmetry]:
        assert_near(formed, image(formed), 2e-3)


def test_a_click_stamps_at_the_size_of_the_ring():
    done = play(begin(), stroke("stamp", CLICK, stamp="pyramid"))
    x = ramp(done)
    radius = 1e3 * find_radius(done.scene.fingers[0].fingertip, done.scene.layout)
    raised = np.abs(relief(done)) > 1e-3
    assert (np.maximum(np.abs(x), np.abs(x.T))[raised] <= radius).all()
    assert raised.sum() >= 9


def test_every_sample_can_be_stamped_and_what_is_no_shape_is_refused_in_one_line(tmp_path):
    from digiclay.core.shapes.fitting import list_shapes

    for name in list_shapes():
        values = load_stamp(name).values
        assert (values.min(), values.max()) == pytest.approx((0.0, 1.0), abs=0.02), name
    (tmp_path / "empty.png").write_bytes(b"")
    for wrong in ("nothing", str(tmp_path / "empty.png"), str(tmp_path / "gone.stl")):
        with refused_in_a_line(DigiclayError):
            load_stamp(wrong)
    changed = replace(stroke("stamp"), axis=math.degrees(1.0))
    assert len(changed.images) == 1
