"""How a press stroke ends: brought to its nominal surface by the valves, or as the finger left it."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from digiclay.core.base.errors import SceneError
from digiclay.core.shapes.heightmap import make_height_map
from digiclay.recorded.pointer_strokes import PointerStroke, play_strokes, read_strokes
from digiclay.recorded.takes import read_recording
from digiclay.sessions import sculpting
from digiclay.sessions.running import find_device
from digiclay.sessions.sculpting import change_scene
from digiclay.strokes import drawn
from digiclay.strokes.nominal import find_nominal
from digiclay.strokes.stroke import FINISHING, Brush, start

from tests.assemble import assert_near, replayed
from tests.hand import go_on, heights
from tests.strokes import begin_bed, copy, form, lay, queue

pytestmark = pytest.mark.usefixtures("quick_machine")

ENDS = [(-12.0, -3.0), (12.0, 4.0)]
#: Brushes that a fingertip leads, and their depth or height, mm.
PRESSED = {Brush.RAISE: 8.0, Brush.LOWER: 4.0}
#: Rounding of the mean of some hundred squares.
ROUNDING = 1e-12


@cache
def begin():
    """Return a session on a bed of 13 x 17 pins that records."""
    return sculpting.set_recording(begin_bed("paper", 13, 17), on=True)


@cache
def formed(brush, as_left):
    """Return a session when its stroke is formed, and how far pins are then from its nominal surface.

    (m,), m, about the path alone: of a stroke that valves finish, when the fingertip has left.
    """
    stroke = lay(ENDS, brush, PRESSED[brush], as_left=as_left)
    session = queue(copy(begin()), stroke)
    last = heights(session)
    while session.strokes:
        stroke = session.strokes[0]
        if as_left or (stroke.phase == FINISHING and not stroke.waited):
            last = heights(session).copy()
        session = sculpting.follow_finger(session, session.pose, 1)
    nominal = find_nominal(stroke, find_device(begin()), heights(begin()))
    return session, (last - nominal.height)[nominal.near]


@pytest.mark.parametrize("as_left", [False, True])
@pytest.mark.parametrize("brush", PRESSED)
def test_the_correction_is_how_far_pins_are_from_the_nominal_surface_when_the_finger_has_left(
    brush, as_left
):
    session, error = formed(brush, as_left)
    found = session.correction
    assert found.made is not as_left
    assert found.rms == pytest.approx(np.sqrt(np.mean(error**2)), abs=ROUNDING)
    assert found.largest == pytest.approx(np.abs(error).max(), abs=ROUNDING)
    # No finger forms a section without the valves; this is what the choice is about.
    assert found.rms > 0.1e-3


def test_as_left_no_valve_is_told_anything_and_the_pins_stand_until_the_next_stroke():
    session, _ = formed(Brush.LOWER, as_left=True)
    # Pins stand that move less than 10 µm within a look of 20 ms; they go on for 8 of these.
    assert_near(heights(go_on(copy(session), 5)), heights(session), 8e-5)
    take = read_recording(session)
    assert take.orders is None or not take.orders.given
    assert replayed(take)
    nominal, _ = formed(Brush.LOWER, as_left=False)
    assert read_recording(nominal).orders.given


def test_a_stamp_is_formed_by_the_valves_whatever_the_finish_and_has_no_correction():
    stamp, ends = make_height_map("dot", np.ones((2, 2))), []
    for as_left in (False, True):
        stroke = lay([(0.0, 0.0)], Brush.STAMP, 5.0, stamp=stamp, as_left=as_left)
        session = form(begin(), stroke)
        assert session.correction is None
        ends.append(heights(session))
    np.testing.assert_array_equal(*ends)
    assert np.ptp(ends[0]) == pytest.approx(5e-3, abs=1e-6)


def test_the_correction_is_of_the_last_stroke_until_that_is_undone():
    session, _ = formed(Brush.RAISE, as_left=True)
    other = replace(session.scene, control=replace(session.scene.control, force_setpoint=0.5))
    assert change_scene(copy(session), other)[0].correction == session.correction
    assert sculpting.rewind(copy(session)).correction is None
    assert form(session, lay(ENDS, Brush.SMOOTH)).correction is None


STROKE = start(0, 1e-3, 2e-3, 4e-3, brush=Brush.RAISE)


def test_a_line_of_a_stroke_has_its_finish_only_where_it_is_not_nominal():
    line = drawn.dump(STROKE)
    assert len(json.loads(line)) == 5  # as older releases write and read it
    assert drawn.load(line).as_left is False
    left = drawn.dump(replace(STROKE, as_left=True))
    assert drawn.load(left).as_left is True
    assert drawn.dump(drawn.load(left)) == left


@pytest.mark.parametrize("finish", [1, "yes", None])
def test_a_line_with_another_finish_is_none(finish):
    line = [*json.loads(drawn.dump(STROKE)), {"as_left": finish}]
    assert drawn.load(json.dumps(line)) is None


def test_a_file_of_strokes_says_their_finish_and_an_older_one_means_nominal(tmp_path):
    path = tmp_path / "two.toml"
    table = '[[stroke]]\nbrush = "raise"\nmoves = [[0, -0.01, 0], [0.2, 0.01, 0]]\n'
    path.write_text(f'{table}{table}finish = "as_left"\n', encoding="utf-8")
    nominal, left = read_strokes(path).strokes
    assert (nominal.finish, left.finish) == ("nominal", "as_left")
    # An older file without a height meant 15 mm.
    assert nominal.height == 15e-3
    for stroke in (nominal, left):
        *_, session = play_strokes(copy(begin()), (stroke,))
        assert session.correction.made is (stroke is nominal)
    path.write_text(f'{table}finish = "left"\n', encoding="utf-8")
    with pytest.raises(
        SceneError, match=r"stroke #1\.finish must be one of nominal, as_left \(got 'left'\)"
    ):
        read_strokes(path)


def test_a_stroke_of_the_pointer_is_nominal_by_default():
    assert PointerStroke().finish == "nominal"
