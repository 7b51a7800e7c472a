"""The overlay's picture: what it says, where its curves go, and that it can be read on any theme."""

import re
from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.modes import COLORS, Mode
from digiclay.overlay.picture import (
    LETTERS,
    LINES,
    Box,
    Picture,
    choose_colors,
    contrast,
    move_apart,
    round_axis,
    scale_curve,
)
from digiclay.overlay.sections import (
    COMPACT,
    FULL,
    TAKEN,
    Readings,
    find_room,
    lay_out,
    place_label,
)
from digiclay.strokes.stroke import Correction
from hypothesis import given
from hypothesis import strategies as st

from tests.assemble import assert_near

DARK, LIGHT = (0.09, 0.09, 0.09), (0.93, 0.93, 0.93)
CHANNEL = st.floats(0.0, 1.0)
COLOR = st.tuples(CHANNEL, CHANNEL, CHANNEL)
ROOM = (0.0, 0.0, 900.0, 700.0)
COLORED = choose_colors(DARK, LIGHT)


def session(**changes):
    time = np.linspace(0.0, 10.0, 1001)
    told = Readings(
        name="Digital Clay", method="virtual_master", paused=False, waiting=False, factor=0.97,
        errors=(2.1e-6, 4.6e-4), correction=None, set_point=0.4, time=time,
        force=0.4 + 0.1 * np.sin(time), pins=(312, 40),
        heights=np.column_stack([0.04 + 0.001 * np.sin(time), np.full(1001, 0.035)]),
        modes=np.array([600, 10, 0, 15, 0, 0, 0, 0, 0]), colors=tuple(COLORS[mode] for mode in Mode),
        seconds=5.0,
    )  # fmt: skip
    return replace(told, **changes)


def said(picture):
    return " | ".join(words.text for words in picture.words)


@given(COLOR, st.one_of(st.none(), COLOR))
def test_letters_and_curves_stand_out_from_any_theme(back, ink):
    # Letters of the color of the ground: the worst there is.
    chosen = choose_colors(back, ink or back)
    # The guidelines' contrasts, as near as steps of a fortieth of the way to black or white come.
    assert min(contrast(ink, back) for ink in (chosen.ink, chosen.faint)) >= LETTERS - 0.01
    assert (
        min(contrast(line, back) for line in (*chosen.pins, chosen.set_point, chosen.force))
        >= LINES
    )
    assert contrast((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)) == pytest.approx(21.0, rel=1e-12)


def draw(told):
    return lay_out(told, COLORED, ROOM, 1.0)


EMPTY = np.empty(0)
KNOCK = np.where(np.arange(1001) == 900, 180.0, 0.4)
WORDS = {
    "all it has": (
        {}, ("Digital Clay", "Method: virtual master", "0.97 x real time", "2.1 µm, 0.46 mN", "0.35 N",
             "set point 0.40 N", "312: 39.5 mm", "40: 35.0 mm", "600 rest", "10 hold", "15 blister"),
        ("N: beyond",),
    ),
    "several fingertips": (
        {"fingers": ((1, DARK), (4, LIGHT)), "hardest": 1.9, "finger_force": np.full((1001, 2), [1.9, 0.25]),
         "force": np.full(1001, 2.15)},
        ("Total force  2.15 N | set point 0.40 N each | 0 N | 2 N", "1: 1.90 N | 4: 0.25 N"), ("N: beyond",),
    ),
    "the fingertips of a stroke's images, which are not numbered": (
        {"hardest": 0.4, "force": np.full(1001, 1.6)}, ("Total force  1.60 N | set point 0.40 N each",), ()
    ),
    "one of several that presses beyond its model": (
        {"fingers": ((1, DARK), (4, LIGHT)), "hardest": 2.5, "finger_force": np.full((1001, 2), [2.5, 0.0]),
         "force": np.full(1001, 2.5)},
        ("Total force  2.5 N: beyond 2 N",), (),
    ),
    "beyond its model": ({"beyond": True}, ("N: beyond 3 mm",), ("Force on a pin",)),
    "the colors of the force while pins wear them": ({"top": 0.2}, ("Force on a pin | 0 N | 0.2 N",), ()),
    "a hard knock, which does not flatten the force": ({"force": KNOCK}, (" | 2 N | ",), ()),
    "errors too small to matter": (
        {"errors": (9e-12, 0.0)}, ("Solver error: about 0.01 µm or less, 0.01 mN or less",), ()
    ),
    "nothing that is not known yet": (
        {"factor": None, "errors": None, "set_point": None, "time": EMPTY, "force": EMPTY,
         "heights": np.empty((0, 2)), "method": ""},
        ("Solver error: not estimated yet", "Method: none"), ("real time", "set point", "Last stroke"),
    ),
    "what the valves corrected of the last stroke": (
        {"correction": Correction(2.1e-3, 11.9e-3, made=True)},
        ("0.46 mN | Last stroke corrected: 2.10 mm rms, max 11.90 mm | ",), (),
    ),
    "a stroke that was left as it was": (
        {"correction": Correction(5.3e-4, 2.8e-3, made=False)},
        ("Last stroke off nominal: 0.53 mm rms, max 2.80 mm",), ("corrected",),
    ),
    "pins picked just now": ({"heights": np.full((1001, 2), np.nan)}, ("312: | 40:",), ()),
}  # fmt: skip


@pytest.mark.parametrize("case", WORDS)
def test_it_tells(case):
    changes, present, absent = WORDS[case]
    picture = draw(session(**changes))
    words = f" | {said(picture)} | "
    assert [part for part in present if part not in words] == []
    assert [part for part in absent if part in words] == []
    assert all(np.isfinite(line.points).all() for line in picture.lines)


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_every_mark_lies_on_the_box_behind_it_at_every_ui_scale(scale):
    picture = lay_out(session(), COLORED, (0.0, 0.0, 2000.0, 2000.0), scale)
    (box,) = picture.boxes
    assert box.width == 290.0 * scale
    points = [line.points for line in picture.lines]
    points += [np.array([[mark.x, mark.y]]) for mark in (*picture.words, *picture.dots)]
    low = np.min([p.min(axis=0) for p in points], axis=0)
    high = np.max([p.max(axis=0) for p in points], axis=0)
    assert (low >= [box.x, box.y]).all()
    assert (high <= [box.x + box.width, box.y + box.height]).all()


#: Place, and left end and base line of a label of 60 x 12 pixels in a room from 50, 10 to 250, 200.
LABELS = {
    "to the right of its place": ((100.0, 100.0), (122.0, 74.0)),
    "to the left, where there is no room": ((200.0, 100.0), (118.0, 74.0)),
    "in the room, where its place is not": ((400.0, 100.0), (190.0, 74.0)),
    "from its edge": ((0.0, 100.0), (50.0, 74.0)),
    "above the lower edge": ((100.0, 12.0), (122.0, 10.0)),
    "below the upper edge": ((100.0, 300.0), (122.0, 188.0)),
}


@pytest.mark.parametrize("case", LABELS)
@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_a_label_stands(case, scale):
    (x, y), wanted = LABELS[case]
    room = (50.0 * scale, 10.0 * scale, 250.0 * scale, 200.0 * scale)
    found = place_label((x * scale, y * scale), (60.0 * scale, 12.0 * scale), room, scale)
    assert np.divide(found, scale).tolist() == list(wanted)


def test_a_row_too_long_for_its_box_has_smaller_letters():
    names = ("Bed", "Bed of the third experiment, last of six")
    short, long = (draw(session(name=name)).words[0] for name in names)
    assert short.size == 12.0
    assert 7.0 < long.size < 10.0


def test_a_low_view_leaves_sections_away_and_a_narrow_one_all():
    def fit(width, height):
        return lay_out(session(), COLORED, (0.0, 0.0, width, height), 1.0)

    sections = ("Total force", "Heights", "Pins by mode")
    for height, there in ((700.0, sections), (320.0, sections[::2]), (240.0, sections[:1])):
        picture = fit(900.0, height)
        assert [name for name in sections if name in said(picture)] == list(there)
        assert picture.boxes[0].height <= height
    assert fit(250.0, 700.0) == fit(900.0, 40.0) == Picture()


@pytest.mark.parametrize("corner", ["bottom_left", "bottom_right", *TAKEN])
@pytest.mark.parametrize("content", [COMPACT, FULL])
def test_it_stands_in_the_chosen_corner_of_the_room_that_panels_leave(corner, content):
    room = find_room(900.0, 700.0, [("LEFT", 50.0), ("RIGHT", 200.0), ("TOP", 26.0), ("TOP", 26.0)])
    assert room == (50.0, 0.0, 700.0, 648.0)
    picture = lay_out(session(), COLORED, room, 1.0, content, corner)
    box, (left, bottom, right, top) = picture.boxes[0], room
    gap = box.x - left if corner.endswith("left") else right - box.x - box.width
    assert gap == 12.0
    gap = top - box.y - box.height if corner.startswith("top") else box.y - bottom
    assert gap == 12.0 + TAKEN.get(corner, 0.0)


@pytest.mark.parametrize(
    "changes, rows",
    [
        ({}, "0.35 N | of 0.40 N | 10.0 s | 0.97 x real time"),
        ({"paused": True}, "0.35 N | of 0.40 N | 10.0 s | paused"),
        ({"waiting": True, "set_point": None}, "0.35 N | 10.0 s | waiting"),
        (
            {"time": np.empty(0), "force": np.empty(0)},
            "no force yet | of 0.40 N | 0.0 s | 0.97 x real time",
        ),
    ],
)
def test_in_short_it_has_two_rows(changes, rows):
    picture = lay_out(session(**changes), COLORED, ROOM, 1.0, COMPACT, "top_left")
    assert said(picture) == rows
    assert picture.boxes[0].height < 60.0


def test_in_short_several_fingertips_stand_two_in_a_row_below_and_none_over_another():
    told = session(
        fingers=tuple((number, LIGHT) for number in (1, 2, 31)),
        finger_force=np.full((1001, 3), 0.4),
    )
    picture = lay_out(told, COLORED, ROOM, 1.0, COMPACT, "top_left")
    assert said(picture).endswith("1: 0.40 N | 2: 0.40 N | 31: 0.40 N")
    assert 80.0 < picture.boxes[0].height < 100.0
    one, two, three = [(words.x, words.y) for words in picture.words[-3:]]
    assert (one[1] == two[1] > three[1], two[0] - one[0] > 70.0, one[0] == three[0]) == (
        True,
        True,
        True,
    )


def test_a_curve_shows_its_window_alone_and_the_set_point_is_the_dashed_line_at_its_height():
    time, box = np.arange(11.0), Box(100.0, 50.0, 200.0, 40.0, DARK)
    value = np.where(time == 7.0, np.nan, time)
    points = scale_curve(time, value, (5.0, 10.0), (0.0, 10.0), box)
    assert_near(points[:, 0], [100.0, 140.0, 220.0, 260.0, 300.0], 1e-9)
    assert_near(points[:, 1], [70.0, 74.0, 82.0, 86.0, 90.0], 1e-9)
    picture = draw(session(set_point=0.25))
    (dashed,) = (line for line in picture.lines if line.dashed)
    low, high = (line.points[0, 1] for line in picture.lines[:2])
    share = (dashed.points[0, 1] - low) / (high - low)
    axis = next(words.text for words in picture.words if re.fullmatch(r"0\.\d+ N", words.text))
    top = float(axis.removesuffix(" N"))
    assert share == pytest.approx(0.25 / top, rel=1e-9)


@given(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3))
def test_an_axis_holds_its_values_and_wastes_little(low, span):
    ends = round_axis(low, low + span)
    slack = 1e-9 * (abs(low) + span)
    assert ends[0] <= low + slack
    assert ends[1] >= low + span - slack
    # A step of the axis at most a quarter of the span, and at both ends less than one step more.
    assert ends[1] - ends[0] <= 1.5 * span + slack


#: Balls of 10 pixels as a window of 1000 pixels shows them, whose numbers have a radius of 9.5.
CROWDS = {
    "far apart": [(0, 0), (80, 0)],
    "a hand": [(265, 358), (289, 335), (316, 357), (337, 344), (338, 326), (314, 307)],
    "in a row": [(20.0 * place, 0) for place in range(6)],
    "one behind the other": [(0, 0), (0, 4), (0, 9)],
    "at one place": [(0, 0)] * 3,
    "one behind the camera": [(0, 0), (np.nan, np.nan), (5, 5)],
    "none": [],
}


@pytest.mark.parametrize("crowd", CROWDS)
def test_numbers_of_fingertips_cover_neither_each_other_nor_a_fingertip(crowd):
    balls = np.array(CROWDS[crowd], float).reshape(-1, 2)
    above = balls + np.array([0.0, 19.5])
    found = move_apart(above, 9.5, balls, np.full(len(balls), 10.0))
    seen = np.isfinite(balls[:, 0])
    assert np.isfinite(found[seen]).all()
    away = np.linalg.norm(
        found[seen, None] - np.concatenate([found, balls])[np.tile(seen, 2)], axis=2
    )
    np.fill_diagonal(away, np.inf)
    count = int(seen.sum())
    assert away[:, :count].min(initial=np.inf) > 19.0 - 1.0  # half a pixel each is not seen
    assert away[:, count:].min(initial=np.inf) > 19.5 - 1.0
    moved = np.linalg.norm(found - above, axis=1)[seen]
    assert moved.max(initial=0.0) < (0.1 if crowd == "far apart" else 60.0)
