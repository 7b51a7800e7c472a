"""Rays onto pins, the patch that the fingertip touches, and lines over pins without spikes."""

import numpy as np
import pytest
from digiclay.core.model.fingertip import (
    LEVEL,
    Fingertip,
    compute_forms,
    compute_underside,
    make_matrices,
)
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.surface.pointing import (
    find_contact_outline,
    find_ground_height,
    find_ray,
    intersect_surface,
)
from digiclay.press.tool import drape
from hypothesis import example, given
from hypothesis import strategies as st

from tests.assemble import assert_near

DOWN = np.array([0.0, 0.0, -1.0])


def bed(arrangement="aligned", rows=12, columns=15):
    cells = make_grid(Layout(rows, columns, arrangement=arrangement))
    return cells, 0.04 + 0.01 * np.sin(7.0 * np.arange(cells.count))


@pytest.mark.parametrize("size", [(12, 15), (1, 1)])
@pytest.mark.parametrize("arrangement", ["aligned", "staggered", "hexagonal"])
def test_a_ray_from_above_meets_each_pin_on_its_top(arrangement, size):
    cells, height = bed(arrangement, *size)
    for cell in range(cells.count):
        origin = np.array([cells.x[cell], cells.y[cell], 1.0])
        found = intersect_surface(cells, height, origin, 3.0 * DOWN)
        assert_near(found, [*origin[:2], height[cell]], 1e-12)


@example(turn=5e-324, slope=-1.0, x=0.0, y=0.0)
@given(
    st.floats(-3.1, 3.1), st.floats(-1.5, -0.05), st.floats(-0.015, 0.015), st.floats(-0.012, 0.012)
)
def test_a_ray_goes_through_no_more_than_the_corner_of_a_pin_before_it_meets_one(turn, slope, x, y):
    cells, height = bed("staggered")
    direction = np.array(
        [np.cos(turn) * np.cos(slope), np.sin(turn) * np.cos(slope), np.sin(slope)]
    )
    origin = np.array([x, y, 0.04]) - 0.3 * direction
    found = intersect_surface(cells, height, origin, direction)
    assert found[2] <= height.max() + 1e-12
    # Looked at a hundred times as finely, over the bed alone.
    way = np.linspace(0.0, np.linalg.norm(found - origin), 20_000)
    points = origin + way[:, None] * direction
    over = (np.abs(points[:, 0]) < np.abs(cells.x).max()) & (
        np.abs(points[:, 1]) < np.abs(cells.y).max()
    )
    sunk = over & (points[:, 2] < height[cells.at(points[:, 0], points[:, 1])] - 1e-9)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], sunk.astype(int), [0]])))
    longest = max((edges[1::2] - edges[::2]).max(initial=0) - 1, 0) * way[1] * np.cos(slope)
    # Seen from above a step is a quarter of the pitch of 3 mm: shorter corners may be cut.
    assert longest <= 0.75e-3


@pytest.mark.parametrize(
    "origin, way",
    [
        ([1.0, 0.0, 1.0], DOWN),  # they pass by
        ([0.0, 0.0, 1.0], -DOWN),
        ([-1.0, 0.0, 1.0], [1.0, 0.0, 0.0]),
        ([0.0, 0.0, 1.0], [0.0, 0.0, 0.0]),  # no rays
        ([0.0, 0.0, 1.0], [np.nan, 0.0, -1.0]),
        ([0.0, 0.0, 1.0], [0.0, np.inf, -1.0]),
        ([np.nan, 0.0, np.nan], DOWN),
        ([0.0, np.inf, 1.0], DOWN),
    ],
)
def test_a_ray_that_passes_by_or_is_none_meets_nothing(origin, way):
    assert intersect_surface(*bed(), np.array(origin), np.array(way)) is None


def test_a_ray_along_the_bed_meets_the_side_of_the_first_pin_that_stands_out():
    cells, _ = bed()
    height, cell = np.full(cells.count, 0.04), 5 * 15 + 7
    height[cell] = 0.06
    found = intersect_surface(
        cells, height, np.array([-1.0, cells.y[cell], 0.05]), np.array([1.0, 0.0, 0.0])
    )
    # To a quarter of a pitch of the pin's side.
    assert found[0] == pytest.approx(cells.x[cell] - 1.5e-3, abs=0.76e-3)


LENSES = {
    "perspective": [[1.4, 0, 0.1, 0], [0, 2.4, -0.2, 0], [0, 0, -1, -0.02], [0, 0, -1, 0]],
    "none": [[0.4, 0, 0, 0.1], [0, 0.7, 0, -0.2], [0, 0, -0.01, -1], [0, 0, 0, 1]],
}


@pytest.mark.parametrize("lens", LENSES)
def test_every_place_lies_on_the_ray_through_where_it_is_seen(lens):
    projection = np.array(LENSES[lens])
    seen = np.eye(4)
    seen[:3, :3] = 3.0 * make_matrices(np.array([[0.8, 0.4, -0.3, 0.33]]))[0]
    seen[:3, 3] = 1.0, -2.0, -15.0
    for place in ([0.0, 0.0, 0.0], [0.3, -0.2, 0.5], [-1.0, 1.0, 0.1]):
        clip = projection @ seen @ [*place, 1.0]
        origin, way = find_ray(projection, seen, clip[:2] / clip[3])
        along = (place - origin) @ way
        assert along > 0.0
        # Twelve digits of the distance from where the ray begins.
        assert_near(origin + along * way, place, 1e-12 * along + 1e-12)


def test_the_ground_is_the_mean_of_pins_in_reach_and_a_high_pin_raises_a_line_by_a_sixth():
    cells, height = bed()
    near = np.hypot(cells.x - 1e-3, cells.y) <= 5e-3
    assert find_ground_height(cells, height, 1e-3, 0.0, 5e-3) == pytest.approx(
        height[near].mean(), rel=1e-12
    )
    assert find_ground_height(cells, height, 9.0, 9.0, 5e-3) == height[-1]
    cells = make_grid(Layout())
    height = np.full(cells.count, 0.04)
    height[cells.at(np.zeros(1), np.zeros(1))] += 0.012
    places = np.array([(0.0, 0.0), (0.05, 0.0), (-1.0, 2.0), (1e3, -1e3)])
    # The weight of the middle of a normal distribution over squares of one standard deviation: 1 /
    # (2 pi).
    risen = drape(cells, height, places)[:, 2] - 0.04
    assert risen == pytest.approx([0.012 / (2 * np.pi), 0.0, 0.0, 0.0], rel=0.02, abs=1e-12)


@pytest.mark.parametrize("turn", [LEVEL, (0.9, 0.3, -0.2, 0.25), (0.7, 0.0, 0.0, 0.7)])
def test_the_patch_is_where_the_underside_of_the_finger_is_as_high_as_the_plane(turn):
    finger, depth = Fingertip(), 1.2e-3
    pose = np.array([0.0, 0.0, 0.0, *turn])
    outline = finger.outline(pose[None])
    rim = find_contact_outline(finger, np.array(turn), depth)
    x, y = rim.T
    place = np.array([np.ones_like(x), x, y, x * x, x * y, y * y])
    height = compute_underside(*compute_forms(outline), place)[0]
    assert_near(height, depth, 1e-12)


@pytest.mark.parametrize("depth", [-1.0, 0.0, 0.05, np.inf])
def test_the_patch_never_leaves_the_finger(depth):
    rim = find_contact_outline(Fingertip(), np.array(LEVEL), depth)
    radius = np.hypot(rim[:, 0] / 10e-3, rim[:, 1] / 8e-3)
    # The root of a rounding error of 1e-16 is 1e-8.
    assert_near(radius, 1.0 if depth > 0.0 else 0.0, 1e-7)


# So far off in the device's measures is where an orthographic view of a bed at a thousandth of its size
# begins to look.
@pytest.mark.parametrize("away", [0.3, 1e5])
def test_flat_pins_are_met_from_any_distance_however_a_ray_is_rounded(away):
    cells, _ = bed()
    flat, rng = np.full(cells.count, 0.04), np.random.default_rng(4)
    lowest, highest = [-0.02, -0.015, 0.0, 0.8], [0.02, 0.015, 6.2, 1.5]
    for x, y, turn, tilt in rng.uniform(lowest, highest, (200, 4)):
        way = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), -np.cos(tilt)])
        found = intersect_surface(cells, flat, np.array([x, y, 0.04]) - away * way, way)
        # Fifteen digits of the distance.
        assert_near(found, [x, y, 0.04], 1e-15 * (1.0 + away))
