"""Falloffs, and what brushes leave by them: Smooth, Flatten, Crease, Erase; flanks of Raise."""

import math
from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.control.blister import Blister
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.scene.toml_table import resolve
from digiclay.recorded.takes import read_recording
from digiclay.sessions import sculpting
from digiclay.sessions.running import find_device
from digiclay.strokes import drawn
from digiclay.strokes.falloff import Falloff, evaluate
from digiclay.strokes.nominal import Device, extend, find_nominal
from digiclay.strokes.queue_ghosts import find_ghosts
from digiclay.strokes.stroke import Brush, make_images

from tests import strokes
from tests.assemble import assert_near, refused_in_a_line, replayed, table
from tests.hand import heights

ARRANGEMENTS = ("aligned", "staggered", "hexagonal")
SHAPES = list(Falloff)[1:]
REST, RADIUS = 40e-3, 4e-3
BLISTER = Blister(radius=7.5e-3, edge_radius=9e-3, flat_radius=3e-3)
FINGER = Fingertip(5e-3, RADIUS, RADIUS)


def lay_bed(arrangement="aligned", size=36):
    return make_grid(Layout(size, size, 1.5e-3, arrangement))


def make_device(arrangement="aligned", locked=None):
    return Device(lay_bed(arrangement), FINGER, BLISTER, 60e-3, locked, REST)


def lay(path, brush=Brush.SMOOTH, falloff=Falloff.SMOOTH, amount=4.0, **more):
    return strokes.lay(path, brush, amount, falloff=falloff, **more)


def form(stroke, before, device=None):
    return find_nominal(stroke, device or make_device(), before).height


def measure_slopes(grid, height):
    """Return the slope from each pin to each of its neighbors, (n, k); NaN: there is none."""
    beside = grid.layout.find_neighbors(corners=False)
    length = np.hypot(grid.x[beside] - grid.x[:, None], grid.y[beside] - grid.y[:, None])
    length[beside < 0] = np.nan
    return np.abs(height[beside] - height[:, None]) / length


# What is left of the width: Blender's curves at a quarter, a half and three quarters of it.
@table(
    "falloff, shares",
    {
        "3 p² - 2 p³": (Falloff.SMOOTH, (0.84375, 0.5, 0.15625)),
        "√(2 p - p²)": (Falloff.SPHERE, (0.9682458, 0.8660254, 0.6614378)),
        "√p": (Falloff.ROOT, (0.8660254, 0.7071068, 0.5)),
        "p²": (Falloff.SHARP, (0.5625, 0.25, 0.0625)),
        "p": (Falloff.LINEAR, (0.75, 0.5, 0.25)),
        "1": (Falloff.CONSTANT, (1.0, 1.0, 1.0)),
    },
)
def test_a_falloff_has_the_values_of_blenders(falloff, shares):
    found = evaluate(falloff, np.array([-1.0, 0.0, 0.5, 1.0, 1.5, 2.0, 2.0 - 1e-12, 9.0]), 2.0)
    # To the digits given; the rim is outside however its distance is rounded.
    assert_near(found, [1.0, 1.0, *shares, 0.0, 0.0, 0.0], 1e-7)


@pytest.mark.parametrize("width", [0.0, -1e-3, math.nan, math.inf])
def test_a_falloff_without_a_width_is_refused(width):
    with refused_in_a_line(ParameterError, r"Falloff\.width must be a finite length above 0"):
        evaluate(Falloff.LINEAR, np.zeros(3), width)


def draw_surface(kind, grid, random):
    """Return heights (n,), m: a cone, noise, a ridge or waves."""
    x, y = grid.x - random.uniform(-0.02, 0.02), grid.y - random.uniform(-0.02, 0.02)
    turn = random.uniform(0.0, 3.0)
    if kind == "cone":
        return 0.5 * np.hypot(x, y)
    if kind == "noise":
        return random.uniform(0.0, 8e-3, grid.count)
    if kind == "ridge":
        aside = np.abs(math.cos(turn) * x + math.sin(turn) * y)
        return 8e-3 * ((7.5e-3 - aside) / 4.5e-3).clip(0.0, 1.0)
    return 4e-3 * np.sin(x / 3e-3) * np.sin(y / 3e-3)


@pytest.mark.parametrize("arrangement, falloff", [*zip(2 * ARRANGEMENTS, SHAPES, strict=True)])
@pytest.mark.parametrize("kind", ["cone", "noise", "ridge", "waves"])
def test_smooth_makes_no_slope_steeper_than_those_about_it_and_leaves_other_pins(
    kind, arrangement, falloff
):
    random = np.random.default_rng(len(kind))
    device = make_device(arrangement)
    grid = device.grid
    before = REST + draw_surface(kind, grid, random) * 0.3
    path = random.uniform(-25.0, 25.0, (4, 2))
    stroke = lay(path, falloff=falloff, share=random.uniform(0.3, 1.0))
    nominal = find_nominal(stroke, device, before)
    slopes, smoothed = measure_slopes(grid, before), measure_slopes(grid, nominal.height)
    # Rounding of differences of heights.
    assert np.nanmax(smoothed) <= np.nanmax(slopes) + 1e-9
    # Of pins within the ring's radius as well.
    steepest = np.nanmax(slopes, axis=1)
    for cell in np.flatnonzero(nominal.near)[::17]:
        about = grid.disc(grid.x[cell], grid.y[cell], RADIUS + 4.0 * grid.layout.pitch)
        assert np.nanmax(smoothed[cell]) <= steepest[about].max() + 1e-9
    np.testing.assert_array_equal(nominal.height[~nominal.near], before[~nominal.near])
    assert nominal.height.min() >= before.min()
    assert nominal.height.max() <= before.max()
    # Beside its tip no pin of a cone can move without a steeper slope beside it.
    assert kind == "cone" or np.abs(nominal.height - before).max() > 1e-5


#: Middle of a bed's sections across x: 60 rows of pins, 1.5 mm apart.
WIDE = replace(make_device(), grid=lay_bed(size=60))
LEVEL = np.full(3600, REST)
ASIDE = ((7.5e-3 - np.abs(WIDE.grid.y)) / 4.5e-3).clip(0.0, 1.0)


def cut(height):
    """Return the section across the middle of the bed, m."""
    return height.reshape(60, 60)[:, 30] - REST


def test_smooth_along_both_flanks_of_a_ridge_makes_it_softer_each_time():
    height, steepest = LEVEL + 8e-3 * ASIDE, []
    clay = height.sum() - LEVEL.sum()
    for _ in range(3):
        steepest.append(np.abs(np.diff(cut(height))).max() / 1.5e-3)
        # No terrace: from the crest down each side it falls, as before.
        assert (np.diff(cut(height))[30:] <= 1e-12).all()
        for y in (5.25, -5.25):
            height = form(lay([(-45, y), (45, y)]), height, WIDE)
    # 1.78 before; measured 1.41 and 1.25.
    assert steepest[0] == pytest.approx(8.0 / 4.5, rel=1e-6)
    assert steepest[1] < 0.85 * steepest[0]
    assert steepest[2] < 0.92 * steepest[1]
    # Clay goes down from the crest to the foot.
    assert height.sum() - LEVEL.sum() == pytest.approx(clay, rel=1e-6)


def test_a_plane_stays_and_so_does_a_valleys_floor_that_is_wider_than_the_ring():
    slope = LEVEL + 0.1 * WIDE.grid.x + 0.2 * WIDE.grid.y
    assert_near(form(lay([(-20, -20), (20, 20)]), slope, WIDE), slope, 1e-12)
    valley = LEVEL - 4e-3 * ((12e-3 - np.abs(WIDE.grid.y)) / 4.5e-3).clip(0.0, 1.0)
    for y in (0.0, 9.75, -9.75):
        valley = form(lay([(-45, y), (45, y)]), valley, WIDE)
    assert_near(cut(valley)[np.abs(WIDE.grid.y[::60]) < 3.5e-3], -4e-3, 1e-12)


def test_smooth_leaves_little_of_noise():
    noise = LEVEL + np.random.default_rng(1).uniform(-1e-3, 1e-3, 3600)
    line = (np.abs(WIDE.grid.y) < 1e-3) & (np.abs(WIDE.grid.x) < 30e-3)
    left = form(lay([(-45, 0), (45, 0)]), noise, WIDE)[line].std() / noise[line].std()
    assert left < 0.2


LINE = [(-15, -4), (14, 5)]


@table(
    "brush, falloff, sign",
    {
        "down": (Brush.CREASE, Falloff.DEVICE, -1.0),
        "up": (Brush.CREST, Falloff.DEVICE, 1.0),
        "down, linear": (Brush.CREASE, Falloff.LINEAR, -1.0),
    },
)
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_crease_is_sharp_and_narrow_and_a_crest_is_its_inverse(arrangement, brush, falloff, sign):
    device = make_device(arrangement)
    middle, grid = np.array(LINE).mean(axis=0) * 1e-3, device.grid
    along = np.diff(1e-3 * np.array(LINE), axis=0)[0]
    along /= np.hypot(*along)
    x, y = grid.x - middle[0], grid.y - middle[1]
    aside, ahead = np.abs(x * along[1] - y * along[0]), np.abs(x * along[0] + y * along[1])
    found = sign * (form(lay(LINE, brush, falloff, 3.0), np.full(grid.count, REST), device) - REST)
    wanted = 3e-3 * (1.0 - aside / RADIUS).clip(0.0) ** (1 if falloff is Falloff.LINEAR else 2)
    beside = ahead < 14e-3
    assert_near(found[beside], wanted[beside], 1e-12)
    assert Brush.CREASE.inverse is Brush.CREST


@pytest.mark.parametrize("brush", [Brush.CREASE, Brush.CREST, Brush.FLATTEN, Brush.SMOOTH])
def test_no_brush_in_the_ring_takes_a_pin_beyond_the_limits_unless_it_was_there(brush):
    rough = REST + np.random.default_rng(5).uniform(-2e-3, 2e-3, 1296)
    limited = form(replace(lay(LINE, brush, amount=9.0), limits=(-0.5e-3, 0.5e-3)), rough)
    assert (limited >= np.minimum(rough, REST - 0.5e-3) - 1e-12).all()
    assert (limited <= np.maximum(rough, REST + 0.5e-3) + 1e-12).all()
    assert np.abs(limited - rough).max() > 1e-3


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_flatten_leaves_a_plane_or_moves_no_pin_farther_than_its_depth(arrangement):
    device = make_device(arrangement)
    grid = device.grid
    plane = REST + 0.1 * grid.x - 0.05 * grid.y
    rough = plane + np.random.default_rng(2).uniform(-2e-3, 2e-3, grid.count)
    path = [(-8, -8), (8, -4), (8, 8)]
    flat = form(lay(path, Brush.FLATTEN, Falloff.CONSTANT, 9.0), rough, device)
    near = find_nominal(lay(path, Brush.FLATTEN, Falloff.CONSTANT), device, rough).near
    basis = np.column_stack([np.ones(near.sum()), grid.positions[near]])
    fitted = basis @ np.linalg.lstsq(basis, rough[near], rcond=None)[0]
    assert_near(flat[near], fitted, 1e-12)
    np.testing.assert_array_equal(flat[~near], rough[~near])
    limited = form(lay(path, Brush.FLATTEN, Falloff.CONSTANT, 0.5), rough, device)
    assert np.abs(limited - rough).max() == pytest.approx(0.5e-3, abs=1e-12)
    again = form(lay(path, Brush.FLATTEN, amount=9.0), plane, device)
    assert_near(again, plane, 1e-12)


def test_erase_takes_the_share_of_its_falloff_from_what_is_formed():
    bumpy = REST + np.random.default_rng(3).uniform(-3e-3, 3e-3, 1296)
    erased = form(lay([(0, 0), (0, 0)], Brush.ERASE, Falloff.LINEAR), bumpy)
    grid = lay_bed()
    kept = (np.hypot(grid.x, grid.y) / RADIUS).clip(0.0, 1.0)
    assert_near(erased - REST, kept * (bumpy - REST), 1e-12)


@pytest.mark.parametrize("brush", [Brush.RAISE, Brush.LOWER, Brush.LEVEL])
@pytest.mark.parametrize("falloff", SHAPES)
def test_flanks_have_the_falloff_between_the_flat_top_and_the_rim(falloff, brush):
    hill = REST + np.where(WIDE.grid.x < -30e-3, 5e-3, 0.0)
    found = form(
        lay([(-40, 0), (40, 0)], brush, falloff), hill if brush is Brush.LEVEL else LEVEL, WIDE
    )
    left = ((7.5e-3 - np.abs(WIDE.grid.y)) / 4.5e-3).clip(0.0, 1.0)
    section = evaluate(falloff, 1.0 - left, 1.0)
    sign = {Brush.RAISE: 1.0, Brush.LOWER: -1.0, Brush.LEVEL: 1.25}[brush]
    # Level brings low ground to the height of its first place.
    middle = (np.abs(WIDE.grid.x) < 20e-3) & (np.abs(np.abs(WIDE.grid.y) - 7.5e-3) > 1e-6)
    assert_near(found[middle], REST + sign * 4e-3 * section[middle], 1e-9)


@pytest.mark.parametrize("brush", [Brush.SMOOTH, Brush.ERASE, Brush.CREASE, Brush.FLATTEN])
def test_images_locks_and_a_path_that_is_drawn_on_count(brush):
    hill = REST + 2e-3 * np.cos(500.0 * lay_bed().x) * np.cos(300.0 * lay_bed().y)
    path = [(5, -8), (9, 0), (6, 9)]
    mirrored = lay(path, brush, images=make_images("X"))
    found = form(mirrored, hill).reshape(36, 36)
    assert_near(found, np.flip(found, 1), 1e-12)
    assert (found.ravel() - hill).min() < -1e-4
    locked = np.zeros(1296, np.bool_)
    locked[lay_bed().disc(9e-3, 0.0, 2e-3)] = True
    held = form(mirrored, hill, make_device(locked=locked))
    np.testing.assert_array_equal(held[locked], hill[locked])
    short = replace(mirrored, samples=mirrored.samples[:2])
    drawn_on = extend(find_nominal(short, make_device(), hill), mirrored, make_device())
    np.testing.assert_array_equal(drawn_on.height.reshape(36, 36), found)
    (ghost,) = find_ghosts((mirrored,), make_device(), hill)
    np.testing.assert_array_equal(ghost.nominal.height.reshape(36, 36), found)


def test_a_smooth_that_accumulates_is_smoothed_again_where_it_comes_back():
    noise = LEVEL + np.random.default_rng(4).uniform(-1e-3, 1e-3, 3600)
    path = [(x, 0) for x in (*range(-30, 31), *range(30, -31, -1))]
    once, twice = (
        form(lay(path, falloff=Falloff.SMOOTH, accumulate=again), noise, WIDE)
        for again in (False, True)
    )
    line = (np.abs(WIDE.grid.y) < 1e-3) & (np.abs(WIDE.grid.x) < 20e-3)
    assert twice[line].std() < 0.9 * once[line].std()


@pytest.mark.parametrize("falloff", [Falloff.DEVICE, Falloff.ROOT])
def test_a_line_of_a_file_keeps_the_falloff_and_without_one_is_what_it_was(falloff):
    line = drawn.dump(lay(LINE, Brush.RAISE, falloff))
    assert ("falloff" in line) is (falloff is not Falloff.DEVICE)
    assert drawn.load(line).falloff is falloff
    assert drawn.load(line.replace("ROOT", "BENT")) is None or falloff is Falloff.DEVICE


@table(
    "brush, tables, off",
    {
        # A pin has arrived within half a micrometer; its valve lets through as much until it is shut.
        "smooth": (Brush.SMOOTH, {}, 1e-6),
        "erase, hexagonal": (Brush.ERASE, {"layout": {"arrangement": "hexagonal"}}, 1e-6),
        "crease, late": (
            Brush.CREASE,
            {"sensors": {"delay": 4}, "delay": {"dead_time": 10e-3}},
            1e-6,
        ),
        # Five standard deviations.
        "flatten, noisy": (Brush.FLATTEN, {"sensors": {"height_noise": 5e-6}}, 30e-6),
    },
)
def test_the_valves_form_the_nominal_surface_in_a_session_that_replays_and_is_undone(
    brush, tables, off
):
    layout = {"rows": 21, "columns": 21} | tables.get("layout", {})
    session = strokes.begin(resolve({**tables, "layout": layout}))
    session = sculpting.set_recording(session, on=True)
    session = strokes.form(session, lay([(-6, 0), (6, 2)], Brush.CREST, amount=3.0))
    before, stroke = heights(session), lay([(-6, 3), (6, -2)], brush, Falloff.SMOOTH, 2.0)
    wanted = form(stroke, before, find_device(session))
    session = strokes.form(session, stroke)
    assert_near(heights(session), wanted, off)
    assert np.abs(wanted - before).max() > 0.2e-3
    assert session.trace.force.max() == 0.0
    assert replayed(read_recording(session))
    assert_near(heights(sculpting.rewind(session)), before, 1e-12)
