"""Recorded strokes of the Press tool: their file, and that a replay forms what a hand's strokes form."""

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.errors import SceneError, StateError
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.scene.toml_table import resolve
from digiclay.recorded.pointer_strokes import PointerStroke, play_strokes, read_strokes
from digiclay.sessions.sculpting import begin_session
from digiclay.strokes.stroke import Brush

from tests.assemble import refused_in_a_line
from tests.hand import heights

ALONG = ((0.0, -9e-3, 0.0), (0.1, 0.0, 0.0), (0.2, 9e-3, 0.0))
STROKE = "[[stroke]]\nmoves = [[0, 0, 0], [0.1, 0.01, 0]]\n"


def begin(**control):
    scene = resolve({"layout": {"rows": 11, "columns": 15}, "control": control})
    return begin_session(1, "Bed", scene, np.array([0.0, 0.0, 46e-3, *LEVEL]))[0]


def play(*strokes):
    *_, session = play_strokes(begin(), strokes)
    return session


def test_a_replay_presses_along_the_whole_stroke_the_same_each_time():
    session = play(PointerStroke(moves=ALONG))
    risen = 1e3 * (heights(session) - 40e-3).reshape(11, 15)
    assert (risen[5, 4:11] < -2.0).all()
    # The blister reaches 15 mm to each side.
    assert np.abs(risen[0]).max() < 0.1
    assert (session.strokes, session.finished_strokes) == ((), 1)
    np.testing.assert_array_equal(heights(play(PointerStroke(moves=ALONG))), heights(session))


def test_ctrl_symmetry_strength_and_line_are_those_of_the_tool():
    line = PointerStroke(moves=((0.0, 9e-3, -6e-3), (0.3, 9e-3, 6e-3)), path="line", symmetry="x")
    deep = 1e3 * (40e-3 - heights(play(line)).reshape(11, 15))
    half = 1e3 * (40e-3 - heights(play(replace(line, strength=0.5))).reshape(11, 15))
    assert deep[5, 10] > 2.0
    # The second image is pressed beside the first one.
    assert deep[5, 4] == pytest.approx(deep[5, 10], abs=0.6)
    assert half[5, 10] < deep[5, 10] - 1.0
    kinds = [PointerStroke(brush=name, ctrl=True).kind for name in ("lower", "raise", "level")]
    assert kinds == [Brush.RAISE, Brush.LOWER, Brush.LEVEL]
    assert PointerStroke(ctrl=True).amount == 15e-3


def test_a_stroke_has_its_own_fingertip_and_a_brush_without_its_blister_is_refused():
    begun = begin()
    first, *_, last = play_strokes(begun, (PointerStroke(width=6e-3, moves=ALONG),))
    sessions = [first, last]
    sizes = [one.scene.fingers[0].fingertip.width for one in sessions]
    assert sizes == [3e-3, 8e-3]
    blisters = [one.scene.blister.radius for one in sessions]
    assert blisters[0] == pytest.approx(3 / 8 * begun.scene.blister.radius)
    assert sessions[-1].scene == begun.scene
    with pytest.raises(StateError, match=r"^Stroke 1 \(raise\) needs a method with a blister\.$"):
        list(play_strokes(begin(method="elastic"), (PointerStroke(brush="raise"),)))


def test_a_file_gives_its_strokes(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(
        f'bed = "paper"\n{STROKE}depth = "2 mm"\n{STROKE}brush = "level"\n', encoding="utf-8"
    )
    recorded = read_strokes(path)
    assert (recorded.name, recorded.bed, len(recorded.strokes)) == ("two", "paper", 2)
    assert (recorded.strokes[0].depth, recorded.strokes[1].kind) == (2e-3, Brush.LEVEL)


@pytest.mark.parametrize(
    "text, said",
    [
        ("", r"stroke must be a list of tables, \[\[stroke\]\]"),
        ("stroke = 3", r"stroke must be a list of tables"),
        (f'bed = "huge"\n{STROKE}', r"bed must be one of paper, design, fine \(got 'huge'\)"),
        (f"{STROKE}dept = 1", r"Did you mean stroke #1\.depth\?"),
        (f"{STROKE}depth = nan", r"stroke #1\.depth must be a finite number"),
        (f"{STROKE}depth = -1", r"stroke #1\.depth must be at least"),
        (f'{STROKE}brush = "smear"', r"stroke #1\.brush must be one of"),
        ("[[stroke]]\nmoves = []", r"stroke #1\.moves must be a list"),
        ("[[stroke]]\nmoves = [[0, 0]]", r"stroke #1\.moves must be lists of time, x and y"),
        ("[[stroke]]\nmoves = [[0, nan, 0]]", r"stroke #1\.moves must be lists of time, x and y"),
        (
            "[[stroke]]\nmoves = [[0, 1, 0], [-1, 0, 0]]",
            r"stroke #1\.moves must begin at 0 s .*\(got -1 s\)",
        ),
        ("[[stroke]]\nmoves = [[2, 0, 0]]", r"stroke #1\.moves must begin at 0 s .*\(got 2 s\)"),
        ("[[stroke", r"line 1"),
        (None, "cannot be read"),
    ],
)
def test_a_file_that_is_wrong_is_refused_in_one_line(tmp_path, text, said):
    path = tmp_path / "wrong.toml"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with refused_in_a_line(SceneError, said) as caught:
        read_strokes(path)
    assert str(caught.value).startswith(str(path))
