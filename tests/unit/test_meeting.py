"""Strokes that meet: what they leave on a base, how they combine, their limits."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from digiclay.core.base.errors import SceneError
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.shapes.heightmap import make_height_map
from digiclay.recorded.pointer_strokes import PointerStroke, play_strokes, read_strokes
from digiclay.sessions import sculpting
from digiclay.sessions.sculpting import reset, rewind
from digiclay.settings.devices import BEDS, make_scene
from digiclay.strokes import drawn
from digiclay.strokes.falloff import Falloff
from digiclay.strokes.nominal import Device, extend, find_nominal
from digiclay.strokes.queue_ghosts import find_ghosts
from digiclay.strokes.stroke import (
    DRAGGING,
    STAMPS,
    UNLIMITED,
    Brush,
    Combine,
    make_images,
)

from tests import strokes
from tests.assemble import assert_near, refused_in_a_line, table
from tests.hand import heights
from tests.strokes import find_ghost, queue

PITCH, REST = BEDS["design"].pitch, 40e-3
#: As wide as drawings need it, with the blister of the bed "design".
GRID = make_grid(Layout(70, 70, PITCH))
FLAT = np.full(GRID.count, REST)


@cache
def scene(count=31):
    return make_scene("design", Layout(count, count, PITCH), "hybrid", 0.5)


def device(base=FLAT):
    """Return what forms strokes on a base (n,), m."""
    blister, actuator = scene().blister, scene().actuator
    return Device(GRID, Fingertip(), blister, actuator.stroke, rest=REST, base=base)


#: How Raise and Lower are combined by the tool.
EXTREME = {Brush.RAISE: Combine.HIGHEST, Brush.LOWER: Combine.LOWEST}


def lay(path, brush=Brush.RAISE, amount=8.0, **more):
    """Return a stroke along a path, mm, on the base unless told."""
    more = {"combine": EXTREME.get(brush, Combine.USUAL)} | more
    return strokes.lay(path, brush, amount, **more)


def form(laid, surface=FLAT, base=FLAT):
    """Return the heights (n,), m, that strokes leave one after the other."""
    for stroke in laid:
        surface = find_nominal(stroke, device(base), surface).height
    return surface


def bow(x, y, radius, first, last, count=20):
    """Return places on a circle, mm, between two angles, degrees."""
    turn = np.radians(np.linspace(first, last, count))
    return np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])


HILLS = FLAT + 3e-3 * np.sin(180.0 * GRID.x) * np.cos(150.0 * GRID.y)
OTHER = FLAT + 2e-3 * np.cos(210.0 * GRID.x + 70.0 * GRID.y)
LINE = [(-20, -7), (20, 5)]
RAMP = make_height_map("ramp", np.arange(1.0, 17.0).reshape(4, 4) / 16.0)
SQUARE = {"stamp": RAMP}


@table(
    "brush, combine, more, expected",
    {
        "raised on a base": (Brush.RAISE, Combine.HIGHEST, {}, np.maximum),
        "lowered from a base": (Brush.LOWER, Combine.LOWEST, {}, np.minimum),
        "stamped, the higher one": (Brush.STAMP, Combine.HIGHEST, SQUARE, np.maximum),
        "stamped, the lower one": (Brush.STAMP, Combine.LOWEST, SQUARE, np.minimum),
        "stamped, in place": (Brush.STAMP, Combine.REPLACE, SQUARE, lambda _, formed: formed),
        "imprinted, the lower one": (Brush.IMPRINT, Combine.LOWEST, SQUARE, np.minimum),
        "stamped onto it": (
            Brush.STAMP, Combine.ADD, SQUARE, lambda surface, formed: surface + formed - OTHER,
        ),
        "leveled onto it": (
            Brush.LEVEL, Combine.ADD, {}, lambda surface, formed: surface + formed - OTHER,
        ),
    },
)  # fmt: skip
def test_a_stroke_combines_a_surface_with_what_it_forms_on_the_base(brush, combine, more, expected):
    stroke = lay(LINE, brush, 4.0, combine=combine, **more)
    found = find_nominal(stroke, device(OTHER), HILLS)
    on_base = replace(stroke, combine=Combine.USUAL)
    if brush is Brush.LEVEL:  # to the height of the surface under its first place
        first = find_nominal(stroke, device(HILLS), HILLS)
        level = device().find_level(stroke, stroke.images[0], HILLS)
        share = (first.height - HILLS) / (level - HILLS)
        near = found.near & (np.abs(level - HILLS) > 0.5e-3) & (share < 1.0 - 1e-6)
        assert_near(found.height[near], (HILLS + share * (level - OTHER))[near], 1e-9)
        return
    formed = find_nominal(on_base, device(OTHER), OTHER)
    near = formed.near & (formed.height != OTHER)
    assert near.sum() > 100
    assert_near(found.height[near], expected(HILLS, formed.height)[near], 1e-12)
    # Beside it a flank ends on the surface, where Raise and Lower would leave a step.
    same = found.height == HILLS
    assert same[~near].all() if brush in STAMPS else (same[~near].mean() > 0.99 and not same.all())


def measure_slope(surface):
    """Return the steepest slope between neighbors along x or y of the western half, m/m."""
    west = surface.reshape(GRID.layout.rows, -1)[:, : GRID.layout.columns // 2]
    return max(float(np.abs(np.diff(west, axis=axis)).max()) for axis in (0, 1)) / PITCH


#: Across the middle of the bed, and along it, beyond its edges, mm.
ACROSS, ALONG = [(0, -60), (0, 60)], [(-60, 0), (60, 0)]


@table(
    "standing, amount, brush, falloff, steepest",
    {
        "a valley of 4 mm across a ridge": (8.0, 4.0, Brush.LOWER, Falloff.DEVICE, 1.0),
        "a valley of 1 mm across a high ridge": (15.0, 1.0, Brush.LOWER, Falloff.DEVICE, 1.0),
        "a valley with rounded flanks": (8.0, 4.0, Brush.LOWER, Falloff.SMOOTH, 1.5),
        "a ridge through a valley": (8.0, 6.0, Brush.RAISE, Falloff.DEVICE, 1.0),
    },
)
def test_across_a_ridge_or_valley_a_stroke_has_the_flanks_of_its_whole_height(
    standing, amount, brush, falloff, steepest
):
    ridge = form([lay(ALONG, brush.inverse, standing)])
    ridge[GRID.x > 13e-3] += 6e-3  # a wall, steeper than all flanks, stays
    stroke = lay(ACROSS, brush, amount, falloff=falloff)
    left = form([stroke], ridge)
    sign = 1.0 if brush.rises else -1.0
    assert_near(1e3 * sign * (left - REST)[np.abs(GRID.x) < 1e-3], amount, 1e-6)
    # Straight flanks of the blister are 4.5 mm wide; a smooth one is half as steep again in its middle.
    whole = steepest * (standing + amount) / 4.5
    assert measure_slope(ridge) < measure_slope(left) < whole + 1e-5
    # Less than the width of a flank, 4.5 mm, is taken of what stands beside the stroke.
    changed = np.abs(left - ridge) > 1e-9
    assert 1e3 * np.abs(GRID.x[changed]).max() < 7.5 + 4.5
    assert (sign * (left - ridge) >= 0.0).all()
    np.testing.assert_array_equal(form([stroke], left), left)
    stepped = find_nominal(stroke, device(), ridge).stepped.full
    np.testing.assert_array_equal(stepped[np.abs(GRID.x) > 7.5e-3], ridge[np.abs(GRID.x) > 7.5e-3])
    locks = np.where(GRID.x > 8e-3, 1.0, 0.0)
    fixed = find_nominal(stroke, replace(device(), locks=locks), ridge).height
    np.testing.assert_array_equal(fixed[locks == 1.0], ridge[locks == 1.0])


def test_a_ghost_drawn_on_has_the_flanks_of_the_whole_stroke():
    ridges = form([lay([(-60, -15), (60, -15)], amount=4.0), lay([(-60, 15), (60, 15)])])
    whole = lay([(0, -60), (0, 0), (0, 60)], Brush.LOWER, 4.0)
    ghost = find_nominal(replace(whole, samples=whole.samples[:2]), device(), ridges)
    assert ghost.stepped is not None
    drawn_on = extend(ghost, whole, device()).height
    np.testing.assert_array_equal(drawn_on, form([whole], ridges))


def test_on_an_uneven_base_flanks_are_left_as_they_are():
    base = form([lay(ALONG)])
    bump = np.where(np.abs(GRID.x) < 2e-3, 0.5e-3, 0.0)
    stroke = lay(ACROSS, Brush.LOWER, 2.0)
    on_base = form([stroke], base, base)
    # Pins at the foot of the ridge lie diagonally from those that are formed.
    assert_near(form([stroke], base + bump, base), np.minimum(base + bump, on_base), 0.2e-3)


@pytest.mark.parametrize("combine, sign", [(Combine.HIGHEST, 1.0), (Combine.LOWEST, -1.0)])
def test_level_goes_one_way_alone(combine, sign):
    both = find_nominal(lay(LINE, Brush.LEVEL), device(), HILLS).height
    one = find_nominal(lay(LINE, Brush.LEVEL, combine=combine), device(), HILLS).height
    extreme = np.maximum if sign > 0.0 else np.minimum
    assert_near(one, extreme(both, HILLS), 1e-12)
    assert np.ptp(one - HILLS) > 1e-3
    # Images level to heights of their own: where they meet, what goes farthest that way.
    slope, images = FLAT + 0.2 * GRID.x, make_images("X")
    met = [(12, -20), (-2, 18)]
    each = [
        form([lay(met, Brush.LEVEL, combine=combine, images=(image,))], slope) for image in images
    ]
    both = form([lay(met, Brush.LEVEL, combine=combine, images=images)], slope)
    assert_near(both, extreme(*each), 1e-9)


@pytest.mark.parametrize("symmetry", ["X", "RADIAL"])
def test_images_that_meet_leave_the_height_of_one_and_accumulate_builds_on_all(symmetry):
    images = make_images(symmetry, 5)
    stroke = lay([(-18, -10), (18, 10)], images=images)
    left = form([stroke])
    assert 1e3 * (left.max() - REST) == pytest.approx(8.0, abs=1e-9)
    np.testing.assert_array_equal(form([stroke], left), left)
    more = replace(stroke, accumulate=True)
    assert 1e3 * (form([more], left).max() - REST) == pytest.approx(16.0, abs=0.2)


@table(
    "brush, limits, surface, lowest, highest",
    {
        "a ridge": (Brush.RAISE, (-math.inf, 5e-3), FLAT, 0.0, 5.0),
        "a valley": (Brush.LOWER, (-3e-3, 5e-3), FLAT, -3.0, 0.0),
        "a ridge below what stands": (Brush.RAISE, (-1.0, 1e-3), FLAT + 2e-3, 2.0, 2.0),
        "a stamp": (Brush.STAMP, (-1.0, 6e-3), FLAT, 0.0, 6.0),
        "an imprint": (Brush.IMPRINT, (-2e-3, 1.0), FLAT, -2.0, 0.0),
        "what is erased": (Brush.ERASE, (2e-3, 1.0), FLAT + 4e-3, 2.0, 4.0),
        "neither": (Brush.RAISE, (-math.inf, math.inf), FLAT, 0.0, 8.0),
    },
)
def test_nothing_that_a_stroke_forms_is_beyond_its_limits(brush, limits, surface, lowest, highest):
    left = form([lay(LINE, brush, limits=limits, stamp=RAMP)], surface) - REST
    assert (1e3 * left.min(), 1e3 * left.max()) == pytest.approx((lowest, highest), abs=1e-9)


SET_BASE = lay([(0, 0)], Brush.SET_BASE)


def test_the_ghost_of_a_queue_counts_from_the_base_that_the_queue_sets():
    first, second = lay(LINE), lay([(0, -20), (0, 20)])
    laid = tuple(
        replace(each, number=n) for n, each in enumerate([first, second, SET_BASE, second])
    )
    ghosts = find_ghosts(laid, device(), FLAT)
    met = form([first, second])
    np.testing.assert_array_equal(ghosts[1].nominal.height, met)
    np.testing.assert_array_equal(ghosts[-1].nominal.height, form([second], met, met))
    # The same path on another base is found anew; on the same one it stays.
    (former,) = find_ghosts(laid[:1], device(), FLAT)
    for base, same in ((OTHER, False), (former.device.base, True)):
        (ghost,) = find_ghosts(laid[:1], device(base), FLAT, (former,))
        assert (ghost.nominal is former.nominal) == same


@pytest.mark.parametrize(
    "look",
    [
        pytest.param(
            lambda crept: ((SET_BASE, lay(LINE)), device(OTHER), FLAT + crept), id="queued"
        ),
        pytest.param(lambda crept: ((lay(LINE),), device(OTHER + crept), FLAT), id="set"),
    ],
)
def test_a_ghost_on_a_new_base_stays_while_pins_creep_but_not_in_small_steps_for_ever(look):
    first = last = find_ghosts(*look(0.0))
    for crept, stays in ((0.03e-3, True), (0.04e-3, True), (0.07e-3, False)):
        last = find_ghosts(*look(crept), last)
        assert (last[0].nominal is first[0].nominal) == stays


def begin(count=31):
    return strokes.begin(scene(count))


@pytest.mark.parametrize(
    "store, lost, has_base",
    [
        pytest.param(lambda session: None, "", True, id="nothing"),
        pytest.param(lambda session: session.snapshot, "", True, id="the same parts"),
        pytest.param(
            lambda session: sculpting.change_scene(session, replace(session.scene, control=None))[0].snapshot,
            "Only heights", True, id="another method",
        ),
        pytest.param(lambda session: b"broken", "The bed begins at rest", False, id="no session"),
    ],
)  # fmt: skip
def test_a_session_takes_up_a_base_unless_its_snapshot_is_refused(store, lost, has_base):
    base, session = np.full(81, REST + 1e-3), begin(9)
    again, words = sculpting.begin_session(
        7, "Bed", session.scene, session.pose, store(session), base=base
    )
    assert words.startswith(lost)
    assert (words == "") == (lost == "")
    np.testing.assert_array_equal(again.base, base if has_base else heights(again))


SMALL_R = [
    [(-8, -14), (-8, 14)],
    np.vstack([[(-8, 13)], bow(0, 7, 6, 90, -90), [(-8, 1)]]),
    [(0, 1), (9, -14)],
]
#: A valley across a ridge.
ACROSS_A_RIDGE = [lay([(-14, 0), (14, 0)]), lay([(0, -14), (0, 14)], Brush.LOWER, 4.0)]


@table(
    "laid",
    {
        "an R of three ridges": [lay(path) for path in SMALL_R],
        "a valley with flanks across a ridge": ACROSS_A_RIDGE,
    },
)
def test_strokes_that_meet_are_formed_as_their_ghost_shows_and_no_finger_is_pressed_hard(laid):
    session = begin()
    ghost = find_ghost(queue(session, *laid))
    assert (ghost.stepped is not None) == (laid is ACROSS_A_RIDGE)
    done = strokes.form(session, *laid)
    # A pin has arrived within half a micrometer, and its valve still lets as much through.
    assert_near(heights(done), ghost.height, 1.5e-6)
    assert 1e3 * (heights(done).max() - REST) == pytest.approx(8.0, abs=0.01)
    # As elsewhere on a formed bed: a hand presses with 1 N.
    assert done.trace.force.max() < 2.0


def test_set_base_is_a_gesture_and_a_reset_brings_the_base_to_rest():
    ridge = lay([(-9, 0), (9, 0)])
    session = strokes.form(begin(25), ridge)
    assert (session.base == REST).all()
    based = strokes.form(session, SET_BASE)
    np.testing.assert_array_equal(based.base, heights(based))
    assert len(based.gestures) == len(session.gestures) + 1
    twice = strokes.form(based, ridge)
    assert 1e3 * (heights(twice).max() - REST) == pytest.approx(16.0, abs=0.1)
    back = rewind(rewind(twice))
    assert (back.base == REST).all()
    assert (reset(based).base == REST).all()
    np.testing.assert_array_equal(rewind(reset(based)).base, based.base)
    # Other parameters of the same pins keep it; a bed of other pins counts from its surface.
    other = replace(twice.scene, simulation=replace(twice.scene.simulation, duration=9.0))
    np.testing.assert_array_equal(sculpting.change_scene(twice, other)[0].base, based.base)
    assert sculpting.change_scene(twice, scene(21))[0].base.size == 21**2
    undone = sculpting.restore(twice, based.snapshot, based.poses, base=np.zeros(3))
    np.testing.assert_array_equal(undone.base, heights(based))


LIMITED = lay(LINE, limits=(-1e-3, 5e-3))


@pytest.mark.parametrize(
    "stroke",
    [LIMITED, lay(LINE, combine=Combine.USUAL), lay(LINE, Brush.LEVEL, combine=Combine.ADD)],
)
def test_a_stored_stroke_is_what_was_drawn(stroke):
    read = drawn.load(drawn.dump(stroke))
    assert (read.combine, read.limits, read.samples) == (
        stroke.combine,
        stroke.limits,
        stroke.samples,
    )


@pytest.mark.parametrize(
    "more",
    ['"LOUD"', '{"combine": "LOUD"}', '{"combine": "LOWEST"}', '{"limits": [1, 0]}', '{"limits": [1]}',
     '{"limits": [NaN, 1]}', '{"limits": "ab"}', '{"depth": 3}', "7", "{}, {}"],
)  # fmt: skip
def test_a_stored_stroke_somebody_has_broken_is_none(more):
    line = drawn.dump(lay(LINE, combine=Combine.USUAL))
    assert drawn.load(line) is not None
    assert drawn.load(f"{line[:-1]}, {more}]") is None


STROKE = "[[stroke]]\nmoves = [[0, 0, 0], [0.1, 0.01, 0]]\n"


@pytest.mark.parametrize(
    "text, said",
    [
        ('brush = "raise"\ncombine = "lowest"', r"must be one of usual, add, highest with raise"),
        ('brush = "smooth"\ncombine = "add"', r"combine must be one of usual with smooth"),
        ('combine = "most"', r"stroke #1\.combine must be one of"),
        ('limit_low = "5 mm"\nlimit_high = "1 mm"', r"limit_low must be at most limit_high, 0\.001 m"),
        ("limit_low = nan", r"limit_low must be a finite number"),
    ],
)  # fmt: skip
def test_a_file_of_strokes_that_cannot_combine_so_is_refused(tmp_path, text, said):
    path = tmp_path / "strokes.toml"
    path.write_text(f"{STROKE}{text}\n", encoding="utf-8")
    with refused_in_a_line(SceneError, said):
        read_strokes(path)


def test_a_file_of_strokes_sets_a_base_and_limits():
    line = {"brush": "raise", "combine": "highest", "height": 6e-3, "path": "line"}
    moves = ((0.0, -9e-3, 0.0), (0.2, 9e-3, 0.0))
    ridge = PointerStroke(**line, moves=moves)
    assert ridge.limits == UNLIMITED
    based = ridge, PointerStroke(brush="set_base"), replace(ridge, limit_high=9e-3)
    for played, height in (((ridge, ridge), 6.0), (based, 9.0)):
        *_, session = play_strokes(begin(21), played)
        assert 1e3 * (heights(session).max() - REST) == pytest.approx(height, abs=0.01)


LIMITS = {"limits": (7e-3, 1.0)}


@pytest.mark.parametrize(
    "first, combine, limits",
    [
        (Brush.RAISE, Combine.HIGHEST, {}),
        (Brush.LOWER, Combine.LOWEST, {}),
        (Brush.RAISE, Combine.USUAL, LIMITS),
    ],
)
def test_the_fingertip_goes_along_what_is_beyond_that_which_its_stroke_forms(
    first, combine, limits
):
    session = strokes.form(begin(), lay([(0, -14), (0, 14)], first))
    session = queue(session, lay([(-14, 0), (14, 0)], Brush.LEVEL, combine=combine, **limits))
    places = []
    while session.strokes:
        session = sculpting.follow_finger(session, session.pose, 1)
        if session.strokes and session.strokes[0].phase == DRAGGING:
            places.append(1e3 * session.pose[:3])
    x, _, z = np.array(places).T
    # The fingertip lies a millimeter deep in the pins that it leads.
    crossed = z[np.abs(x) < 1.0] - 40.0
    assert_near(crossed, 7.2 if first.rises else -9.0, 1.5)
