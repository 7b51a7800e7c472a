"""Things made by recorded strokes of the Press tool are what was intended, even, alike, and soon formed."""

import csv
import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from digiclay.recorded.pointer_strokes import PointerStroke
from digiclay.sessions.running import find_stroke
from digiclay.sessions.sculpting import change_stroke, follow_finger, queue_stroke
from digiclay.strokes.stroke import draw, lay_ring, start

from tests.assemble import assert_near
from tests.window.hand_strokes import DRAWN
from tests.window.intended import THINGS, find_distance
from tests.window.made import begin, make, make_bed, move, play

TIMES = {"r_lowered": 6.0, "r_raised": 7.0, "spiral": 7.0, "ring": 5.0, "leaf": 12.0, "lines": 15.0}
#: The table of the gallery, and things that are also formed as left: the quickest.
TABLE = DRAWN.with_name("results") / "gallery.csv"
STORED = {
    row["thing"]: row for row in csv.DictReader(TABLE.read_text(encoding="utf-8").splitlines())
}
LEFT = ("letter_a", "r_raised", "ring")
#: It has three digits; what processors differ in is less, mm.
ROUNDED = 1e-3


@pytest.mark.parametrize("name", THINGS)
def test_a_thing_made_by_recorded_strokes_is_what_was_intended(name):
    made = make(name)
    assert made.correlation >= 0.96
    # A relief of another height would correlate as well.
    assert 0.95 <= made.slope <= 1.05
    assert made.played.time <= TIMES.get(name, 20.0)
    assert made.played.force <= 1.0
    stored, (rms, largest) = STORED[name], made.compare(made.played.formed, made.intended)
    assert rms == pytest.approx(float(stored["nominal_rms_mm"]), abs=ROUNDED)
    assert largest == pytest.approx(float(stored["nominal_largest_mm"]), abs=ROUNDED)
    if name in LEFT:
        rms, largest = made.compare(made.left, made.played.formed)
        assert rms == pytest.approx(float(stored["left_rms_mm"]), abs=ROUNDED)
        assert largest == pytest.approx(float(stored["left_largest_mm"]), abs=ROUNDED)


#: Rows and columns of the bed of the cases.
SIDE = 60
#: Angles, degrees, and shifts, m, of the cases: beside the grid of the pins.
TURNS = ((0.0, (0.0, 0.0)), (17.0, (0.4e-3, 0.7e-3)))
#: Depths and heights asked for, m; ticks a second, and moves a tick, of hands on slow and quick
#: machines.
AMOUNTS, HANDS = (2e-3, 4e-3, 8e-3, 15e-3), ((60.0, 1), (24.0, 5), (7.0, 1))
#: How far from the path pins are whose heights count as those of the stroke, m.
CORE = 1.5e-3
#: What Raise and Lower do in the cases.
KINDS = {
    "lowered 6 mm": {"brush": "lower", "depth": 6e-3},
    "raised 8 mm": {"brush": "raise", "height": 8e-3},
}


def _bend(*places):
    """Return the moves of a hand through places, mm, within half a second."""
    times = np.linspace(0.0, 0.5, len(places))
    return {
        "moves": tuple(
            (t, 1e-3 * x, 1e-3 * y) for t, (x, y) in zip(times.tolist(), places, strict=True)
        )
    }


PATHS = {
    "line": {**_bend((-28.0, 0.0), (28.0, 0.0)), "path": "line"},
    "ring": {**_bend((0.0, 0.0), (26.0, 0.0)), "path": "ring"},
    "free": _bend(*((26.0 * u, 14.0 * math.sin(3.0 * u)) for u in np.linspace(-1.0, 1.0, 24).tolist())),
    "loop": _bend(
        (-28.0, -14.0), (10.0, -14.0),
        *((10.0 + 14.0 * math.sin(a), -14.0 * math.cos(a)) for a in np.linspace(0.3, 4.7, 24).tolist()),
        (-4.0, -28.0),
    ),
}  # fmt: skip


#: Parts of the flat top, and of the slope, between which a section is straight.
PARTS = (3, 6)


def measure_distances(made):
    """Return how far pins are from the path of the only stroke, (n,), m."""
    (stroke,), grid = made.strokes, made.session.system.grid
    path = np.array([move[1:] for move in stroke.moves])
    if stroke.path != "free":
        path = lay_ring(path[0], path[-1]) if stroke.path == "ring" else path[[0, -1]]
    return find_distance(path.tolist(), grid.x, grid.y)


def measure_unevenness(made):
    """Return how far pins near the path, (k,), m, differ from the common section of those as far from it."""
    near, blister = measure_distances(made), made.session.scene.blister
    cells = near < blister.radius + made.session.scene.layout.pitch
    near, flat, radius = near[cells], blister.flat_radius, blister.radius
    knots = np.concatenate(
        [
            np.linspace(0.0, flat, PARTS[0], endpoint=False),
            np.linspace(flat, radius, PARTS[1]),
            [max(2.0 * radius - flat, near.max() * (1.0 + 1e-9))],
        ]
    )
    hats = np.array([np.interp(near, knots, row) for row in np.eye(len(knots))]).T
    height = made.formed[cells]
    return height - hats @ np.linalg.lstsq(hats, height, rcond=None)[0]


def find_spikes(made):
    """Return how far pins are above, or below, all their neighbors, (n,), m."""
    beside = np.append(made.formed, np.nan)[made.session.scene.layout.find_neighbors(corners=True)]
    above = made.formed - np.fmax.reduce(beside, axis=1)
    return np.maximum(above, np.fmin.reduce(beside, axis=1) - made.formed).clip(0.0)


def draw_by_hand(scene, stroke, rate, moves):
    """Draw a stroke on a bed at rest, some moves a tick, ticks at a rate, 1/s; return heights, (n,), m."""
    session = begin(scene)
    session, number = queue_stroke(
        session, start(0, *stroke.moves[0][1:], stroke.amount, brush=stroke.kind)
    )
    left, count = list(stroke.moves[1:]), round(1.0 / (rate * session.system.period))
    while find_stroke(session, number) is not None:
        for _, x, y in left[:moves]:
            session = change_stroke(session, number, partial(draw, x=x, y=y, depth=stroke.amount))
        left = left[moves:]
        session = change_stroke(session, number, partial(replace, held=bool(left)))
        session = follow_finger(session, session.pose, count)
    return np.asarray(session.state.row(0) - scene.actuator.rest_height)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("path", PATHS)
def test_strokes_are_even_and_leave_no_spikes(kind, path):
    stroke = PointerStroke(**KINDS[kind], **PATHS[path])
    for angle, shift in TURNS:
        made = play(make_bed(side=SIDE), move((stroke,), math.radians(angle), shift))
        formed = measure_unevenness(made)
        assert math.sqrt(np.mean(formed**2)) <= 0.1e-3, angle
        assert np.abs(formed).max() <= 0.3e-3, angle
        assert find_spikes(made).max() <= 0.2e-3, angle


def assert_alike(height, other):
    # The band of the valves is half a micrometer, on either side.
    assert_near(height, other, 1.0e-6)


def form(stroke):
    """Return what a stroke leaves on a bed at rest, rows by columns, m."""
    return play(make_bed(side=SIDE), (stroke,)).formed.reshape(SIDE, SIDE)


@pytest.mark.parametrize("kind", KINDS)
def test_strokes_that_are_drawn_alike_come_out_alike(kind):
    free = PointerStroke(**KINDS[kind], **PATHS["free"])
    (shifted,) = move((free,), 0.5 * math.pi, (14e-3, 0.0))
    mirrored = replace(shifted, moves=tuple((t, -x, y) for t, x, y in shifted.moves))
    both = form(replace(shifted, symmetry="x"))
    assert_alike(both, both[:, ::-1])
    assert_alike(form(shifted), form(mirrored)[:, ::-1])
    usual = form(free)
    for rate, moves in HANDS:
        drawn = draw_by_hand(make_bed(side=SIDE), free, rate, moves)
        assert_alike(drawn.reshape(SIDE, SIDE), usual)


@pytest.mark.parametrize("brush", ["lower", "raise"])
@pytest.mark.parametrize("asked", AMOUNTS)
def test_a_line_has_the_depth_or_height_that_is_asked_for(brush, asked):
    line = PointerStroke(brush=brush, depth=asked, height=asked, **PATHS["line"])
    made = play(make_bed(side=SIDE), (line,))
    assert_alike(np.abs(made.formed[measure_distances(made) < CORE]), asked)
