"""Nominal surface of press strokes: sections by the distance to the path, passes, images, limits."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from digiclay.core.control.blister import Blister
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.layout import Layout, make_grid
from digiclay.strokes.nominal import Device, extend, find_nominal
from digiclay.strokes.queue_ghosts import Ghost, find_ghosts
from digiclay.strokes.stroke import Brush, deepen, lay_ring, make_images, start
from numpy.testing import assert_array_equal

from tests.assemble import assert_near, table
from tests.strokes import lay

BED = make_grid(Layout(60, 60, pitch=1.5e-3))
REST = 40e-3
FLAT = np.full(BED.count, REST)
BLISTER = Blister(radius=7.5e-3, edge_radius=9e-3, flat_radius=3e-3)
DEVICE = Device(BED, Fingertip(5e-3, 4e-3, 4e-3), BLISTER, 60e-3)
#: Without a blister.
PRESSED = replace(DEVICE, blister=None)

ANGLE = np.radians(17.0)
LINE = np.outer([-1.0, 1.0], [np.cos(ANGLE), np.sin(ANGLE)]) * 30e-3 + [2e-3, -1e-3]
WAVE = np.column_stack(
    [np.linspace(-30e-3, 30e-3, 200), 12e-3 * np.sin(np.linspace(-3.0, 4.0, 200))]
)
TURN = np.linspace(-1.5, 4.7, 300)
PATHS = {
    "a place": LINE[:1],
    "a line at 17 degrees": LINE,
    "a ring beside the middle": lay_ring((3e-3, -2e-3), (3e-3, 16e-3)),
    "a free stroke": WAVE,
    "a figure eight": np.column_stack([18e-3 * np.sin(TURN), 15e-3 * np.sin(2.0 * TURN)]),
}


def stroke(path, brush=Brush.RAISE, amount=4.0, **more):
    """Return a stroke along a path (k, 2), m; `amount`: mm."""
    return lay(1e3 * path, brush, amount, **more)


def form(stroke, bed=FLAT):
    """Return the heights that a stroke leaves of a bed, (n,), m."""
    return find_nominal(stroke, DEVICE, bed).height


@cache
def measure_distance(name):
    """Return the distances of all pins from a path, (n,), m, by its points some 20 µm apart."""
    path = PATHS[name]
    steps = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    fine = np.linspace(0.0, steps[-1], 1 + int(steps[-1] / 20e-6))
    points = np.column_stack([np.interp(fine, steps, path[:, axis]) for axis in (0, 1)])
    near = np.full(BED.count, np.inf)
    for part in np.array_split(points, 1 + len(points) // 200):
        apart = np.hypot(BED.x[:, None] - part[:, 0], BED.y[:, None] - part[:, 1])
        near = np.minimum(near, apart.min(axis=1))
    return near


@pytest.mark.parametrize("brush", [Brush.RAISE, Brush.LOWER])
@pytest.mark.parametrize("name", PATHS)
def test_the_height_follows_from_the_distance_to_the_path_alone(name, brush):
    found = form(stroke(PATHS[name], brush)) - REST
    distance = measure_distance(name)
    section = np.where(distance <= 7.5e-3, np.clip((7.5e-3 - distance) / 4.5e-3, 0.0, 1.0), 0.0)
    sign = 1.0 if brush is Brush.RAISE else -1.0
    # The flank goes 0.9 mm up a mm, and the points cut the path's corners by up to 0.5 µm.
    assert_near(found, sign * 4e-3 * section, 1e-6)


@pytest.mark.parametrize("name", PATHS)
def test_where_no_blister_is_the_fingertip_leaves_its_underside(name):
    path = np.vstack([PATHS[name], PATHS[name][-1:]])
    found = find_nominal(
        stroke(path, Brush.LOWER, 2.0), replace(PRESSED, finger=Fingertip(4e-3, 4e-3, 4e-3)), FLAT
    )
    gap = 4e-3 - np.sqrt(np.maximum(16e-6 - measure_distance(name) ** 2, 0.0))
    # Of a ball 1.5 mm from one place of the path to the next: 0.07 mm between two.
    assert_near(found.height - REST, np.minimum(gap - 2e-3, 0.0), 0.15e-3)


@pytest.mark.parametrize("accumulate, height", [(False, 4e-3), (True, 8e-3)])
def test_a_crossing_counts_once_or_twice_where_it_accumulates(accumulate, height):
    eight = PATHS["a figure eight"]
    found = form(stroke(eight, accumulate=accumulate)).reshape(60, 60) - REST
    # At the crossing; elsewhere it is as high as ever.
    assert found[29:31, 29:31].max() == pytest.approx(height, abs=0.8e-3)
    assert found[:, 38:].max() == pytest.approx(4e-3, abs=1e-9)


@pytest.mark.parametrize("brush", [Brush.RAISE, Brush.LOWER, Brush.LEVEL])
@pytest.mark.parametrize("symmetry", ["X", "XY"])
def test_mirror_images_are_alike_and_meet_without_a_seam(symmetry, brush):
    hill = FLAT + 2e-3 * np.cos(90.0 * BED.x) * np.cos(60.0 * BED.y)
    path = np.array([8e-3, 5e-3]) + WAVE
    found = form(stroke(path, brush, images=make_images(symmetry)), hill).reshape(60, 60)
    for axis in (0, 1):
        if "YX"[axis] in symmetry:
            assert_near(found, np.flip(found, axis), 1e-12)
    assert np.ptp(found) > 2e-3


@pytest.mark.parametrize("count", [3, 4])
def test_images_about_a_center_are_alike_at_every_turn(count):
    images = make_images("RADIAL", count, (2e-3, 1e-3))
    path = LINE * 0.4 + [9e-3, 0.0]
    found = form(stroke(path, images=images))
    places = [np.array([image.place(*at) for at in path]) for image in images]
    assert_near(found, np.max([form(stroke(place)) for place in places], axis=0), 1e-12)


@pytest.mark.parametrize("accumulate", [False, True])
def test_a_surface_that_is_extended_is_that_of_the_whole_path(accumulate):
    whole = stroke(PATHS["a figure eight"], accumulate=accumulate, images=make_images("X"))
    part = None
    for count in (1, 2, 50, 51, len(whole.samples)):
        shown = replace(whole, samples=whole.samples[:count])
        part = find_nominal(shown, DEVICE, FLAT) if part is None else extend(part, shown, DEVICE)
    assert_array_equal(part.height, form(whole))


CLIFF = FLAT + np.where(BED.x > 0.0, 5e-3, 0.0)


@table(
    "brush, amount, share, lowest, highest",
    {
        "as far as the pins' stroke": (Brush.RAISE, 30.0, 1.0, 40e-3, 60e-3),
        "to the height below the first place": (Brush.LEVEL, 4.0, 1.0, 40e-3, 40e-3),
        "half of the way": (Brush.LEVEL, 4.0, 0.5, 40e-3, 42.5e-3),
    },
)
def test_pins_come_to_the_height_of_the_brush(brush, amount, share, lowest, highest):
    line = np.array([[-25e-3, 0.0], [25e-3, 0.0]])
    found = form(stroke(line, brush, amount, share=share), CLIFF)
    below = found[(np.abs(BED.y) < 2.9e-3) & (np.abs(np.abs(BED.x) - 15e-3) < 5e-3)]
    assert (below.min(), below.max()) == (
        pytest.approx(lowest, abs=20e-3 * (brush is Brush.RAISE) + 1e-9),
        pytest.approx(highest, abs=1e-9),
    )


def test_no_pin_is_pressed_below_the_floor_and_a_deepened_stroke_is_deeper_from_there_on():
    low = form(stroke(LINE, Brush.LOWER, 30.0), FLAT - 30e-3)
    assert low.min() == 0.0
    deeper = deepen(start(1, -20e-3, 0.0, 2e-3), 3e-3)
    deeper = replace(deeper, samples=(*deeper.samples, replace(deeper.samples[-1], x=20e-3)))
    found = form(deeper)
    assert found.min() == pytest.approx(REST - 5e-3, abs=1e-12)


def test_a_ghost_that_is_drawn_on_is_that_of_the_whole_path_and_others_stay():
    first, last = stroke(LINE), replace(stroke(WAVE, Brush.LOWER), number=2)
    kept = ()
    for count in (1, 2, 60, 200):
        drawn = replace(last, samples=last.samples[:count])
        before, kept = kept, find_ghosts((first, drawn), DEVICE, FLAT.copy(), kept)
        assert not before or before[0].nominal is kept[0].nominal
    whole = find_ghosts((first, last), DEVICE, FLAT)
    assert np.array_equal(kept[-1].nominal.height, whole[-1].nominal.height)
    assert find_ghosts((first, last), DEVICE, FLAT, kept)[-1].nominal is kept[-1].nominal
    # Another path of the same number, and other pins below it, are looked at anew.
    other = find_ghosts((stroke(WAVE),), DEVICE, FLAT, kept)[0].nominal
    assert np.array_equal(other.height, form(stroke(WAVE)))
    raised = find_ghosts((first,), DEVICE, FLAT + 1e-3, kept)[0].nominal
    assert np.array_equal(raised.before, FLAT + 1e-3)


def test_each_stroke_of_a_long_queue_is_compared_with_one_ghost(monkeypatch):
    queue = tuple(replace(stroke(LINE[:1]), number=number) for number in range(1, 41))
    kept, compare, compared = find_ghosts(queue, DEVICE, FLAT), Ghost.has_grown, []

    def note(ghost, *given):
        compared.append(ghost.stroke.number)
        return compare(ghost, *given)

    monkeypatch.setattr(Ghost, "has_grown", note)
    again = find_ghosts(queue, DEVICE, FLAT, kept)
    assert compared == [one.number for one in queue]
    assert all(new.nominal is old.nominal for new, old in zip(again, kept, strict=True))
