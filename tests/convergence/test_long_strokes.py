"""Long strokes: the largest drawings as a hand draws them, rays formed at once, strokes of older files."""

import numpy as np
import pytest
from digiclay.recorded.pointer_strokes import play_strokes, read_strokes
from digiclay.strokes import drawn
from digiclay.strokes.stroke import make_images

from tests.assemble import assert_near
from tests.drawings import AS_DRAWN, TURNED, put
from tests.hand import heights
from tests.renew import SAMPLES
from tests.strokes import find_ghost, form, queue
from tests.unit.test_drawings import DRAWN, LOWERED, RAISED, assert_formed
from tests.unit.test_meeting import begin

#: As `FORMED` of tests/unit/test_drawings.py has the smaller ones.
FORMED = {
    "face": (RAISED, TURNED, (1435, 250)),
    "map": (LOWERED, AS_DRAWN, (2400, 675)),
}


@pytest.mark.parametrize("name", FORMED)
def test_a_large_drawing_is_formed_while_a_hand_draws_it_and_no_finger_is_pressed_hard(name):
    kind, pose, most = FORMED[name]
    assert_formed(put(DRAWN[name], *pose), kind, most)


def test_24_rays_are_formed_at_once_in_the_periods_of_one():
    ray = np.array([[22.0, 2.0], [62.0, 9.0]])
    assert_formed([ray], RAISED, (181, 168), make_images("RADIAL", 24))


#: m: other processors and versions of numpy take sums in another order. On that of the samples' README
#: the heights are the same.
ROUNDING = 1e-9


def test_strokes_of_older_files_form_what_they_formed():
    folder = SAMPLES / "strokes"
    lines, stood = (
        (folder / "queue.txt").read_text(encoding="utf-8").splitlines(),
        np.load(folder / "heights.npz"),
    )
    strokes = [drawn.load(line) for line in lines]
    assert [drawn.dump(stroke) for stroke in strokes] == lines
    assert_near(find_ghost(queue(begin(), *strokes)).height, stood["ghost"], ROUNDING)
    assert_near(heights(form(begin(), *strokes)), stood["queue"], ROUNDING)
    *_, played = play_strokes(begin(), read_strokes(folder / "file.toml").strokes)
    assert_near(heights(played), stood["played"], ROUNDING)
