"""Undersides of meshes over the pins: equal to rays, whatever the mesh, its pose and the bed."""

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.layout import ARRANGEMENTS, Layout, make_grid
from digiclay.core.model.underside import CHUNK, check_mesh, rasterize
from trimesh.transformations import random_rotation_matrix

#: Products of numbers of 53 bits, through triangles a thousand times as high as wide.
ROUNDING = 1e-9


def list_rays(mesh, bed, step=1):
    """Return the lowest point of a mesh over each `step`th pin, m, by trimesh's own formulas."""
    normal, corner = mesh.face_normals, mesh.triangles
    away = np.einsum("tj,tj->t", normal, corner[:, 0])
    low, high = corner[:, :, :2].min(axis=1), corner[:, :, :2].max(axis=1)
    places = bed.positions[::step]
    under = np.full(len(places), np.inf)
    for pin, (x, y) in enumerate(places):
        near = ((low <= (x, y)) & ((x, y) <= high)).all(axis=1) & (np.abs(normal[:, 2]) > 1e-12)
        z = (away - normal[:, 0] * x - normal[:, 1] * y)[near] / normal[near, 2]
        points = np.column_stack([np.full((z.size, 2), (x, y)), z])
        if z.size:
            inside = trimesh.triangles.points_to_barycentric(corner[near], points).min(axis=1) > 0
            under[pin] = z[inside].min(initial=np.inf)
    return under


def make_body(seed, scale=0.02):
    """Return a crumpled sphere at a random turn, its sides at random."""
    chance = np.random.default_rng(seed)
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=scale)
    mesh.vertices *= chance.uniform(0.6, 1.3, (len(mesh.vertices), 1))
    mesh.apply_transform(random_rotation_matrix(chance.random(3)))
    mesh.apply_translation([*chance.uniform(-0.01, 0.01, 2), 0.05])
    return mesh


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("seed", range(3))
def test_the_underside_of_a_crumpled_body_is_where_rays_meet_it_first(arrangement, seed):
    body, bed = make_body(seed), make_grid(Layout(14, 17, 3e-3, arrangement))
    found, wanted = rasterize(body.vertices, body.faces, bed), list_rays(body, bed)
    assert np.array_equal(np.isfinite(found), np.isfinite(wanted))
    met = np.isfinite(wanted)
    assert 80 < np.count_nonzero(met) < bed.count
    assert np.abs(found[met] - wanted[met]).max() < ROUNDING
    # Pins have no side of a triangle to look at.
    some = np.arange(len(body.faces)) % 3 == 0
    flipped = np.where(some[:, None], body.faces[:, ::-1], body.faces)
    assert np.array_equal(rasterize(body.vertices, flipped, bed), found)
    assert np.array_equal(rasterize(body.vertices, body.faces[:, ::-1], bed), found)
    # Below a ceiling it is the same, above there is nothing.
    level = float(np.median(found[met]))
    below = rasterize(body.vertices, body.faces, bed, ceiling=level)
    assert np.array_equal(below, np.where(found < level, found, np.inf))


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_box_covers_the_pins_on_its_outline_on_all_sides(arrangement):
    bed = make_grid(Layout(15, 15, 2e-3, arrangement))
    wide, deep = 8e-3, 4 * bed.layout.row_spacing
    box = trimesh.creation.box((wide, deep, 4e-3))
    wanted = (np.abs(bed.x) < wide / 2 + 1e-9) & (np.abs(bed.y) < deep / 2 + 1e-9)
    # Rounding, which a turn leaves on any side, does not decide.
    for away in (0.0, 1e-12, -1e-12):
        found = rasterize(box.vertices + away, box.faces, bed)
        assert np.array_equal(np.isfinite(found), wanted)
        assert np.abs(found[wanted] + 2e-3).max() < ROUNDING


@pytest.mark.parametrize("turn", range(4))
@pytest.mark.parametrize("diagonal", [[[0, 1, 2], [1, 3, 2]], [[0, 1, 3], [0, 3, 2]]])
def test_a_wall_exactly_over_a_row_or_column_presses_it_by_its_lower_edge(turn, diagonal):
    bed = make_grid(Layout(15, 15, 2e-3))
    wall = np.array([[-1.0, 0, 0], [1, 0, 0], [-1, 0, 1], [1, 0, 1]])
    angle = turn * np.pi / 2
    wall[:, :2] = np.outer(wall[:, 0], [np.cos(angle), np.sin(angle)])
    met = np.isfinite(found := rasterize(wall, np.array(diagonal), bed))
    assert np.count_nonzero(met) == 15
    assert np.abs(found[met]).max() < ROUNDING


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4])
def test_a_blade_thinner_than_the_pitch_presses_a_row_of_rounded_pins(angle):
    bed = make_grid(Layout(41, 41, 3e-3))
    blade = trimesh.creation.box((60e-3, 1e-3, 20e-3))
    blade.apply_transform(trimesh.transformations.rotation_matrix(angle, [0, 0, 1]))
    least = 20 * np.cos(angle)  # pins along the longer side of its plan
    for y in np.linspace(0.0, 3e-3, 7):
        moved = blade.vertices + np.array([0.4e-3, y, 0.05])
        pressed = np.isfinite(rasterize(moved, blade.faces, bed, 3, 0.5e-3))
        assert least - 1 <= np.count_nonzero(pressed) < 50
    # Without width a pin misses it.
    between = blade.vertices + np.array([0.0, 1.5e-3, 0.0])
    assert angle or np.isinf(rasterize(between, blade.faces, bed)).all()


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_the_rounded_end_of_a_pin_is_lowered_by_what_is_beside_its_axis(arrangement):
    bed, radius = make_grid(Layout(12, 12, 3e-3, arrangement)), 2e-3
    # An endless slope: the end touches it beside the axis, lower by half the radius by slope².
    slope = 1e-3 / radius  # touches 1 mm beside the axis, at a sample point
    corner = np.array([[-1.0, -1], [1, -1], [0, 1]])
    for along in (0, 1):
        step = (3e-3, bed.layout.row_spacing)[along] / 3
        plane = np.column_stack([corner, slope * step / 1e-3 * corner[:, along]])
        found = rasterize(plane, np.array([[0, 1, 2]]), bed, 3, radius)
        level = slope * step / 1e-3 * (bed.x, bed.y)[along]
        assert np.abs(found - (level - step**2 / (2 * radius))).max() < ROUNDING
    flat = rasterize(corner @ np.eye(2, 3), np.array([[0, 1, 2]]), bed, 5, radius)
    assert np.abs(flat).max() < ROUNDING


def test_a_bed_of_40_000_pins_is_computed_in_parts():
    bed = make_grid(Layout(200, 200, 1e-3))
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.2)
    whole = rasterize(ball.vertices, ball.faces, bed)
    assert np.count_nonzero(np.isfinite(whole)) > CHUNK
    wanted = list_rays(ball, bed, 37)
    assert np.array_equal(np.isfinite(whole)[::37], np.isfinite(wanted))
    met = np.isfinite(wanted)
    assert np.abs(whole[::37] - wanted)[met].max() < ROUNDING


TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])


@pytest.mark.parametrize(
    "vertices, triangles, rule",
    [
        (TRIANGLE, np.empty((0, 3), int), "none"),
        (TRIANGLE, [[0, 1]], "three numbers"),
        (TRIANGLE, [[0.0, 1.0, 2.0]], "whole numbers"),
        (TRIANGLE, [[0, 1, 3]], "vertex 3"),
        (TRIANGLE, [[0, 1, -1]], "vertex -1"),
        (TRIANGLE[:, :2], [[0, 1, 2]], "three coordinates"),
        (np.empty((0, 3)), [[0, 1, 2]], "vertex 2"),
        (TRIANGLE * [[1], [np.nan], [1]], [[0, 1, 2]], "vertex 1 at nan"),
        (TRIANGLE * 1e7, [[0, 1, 2]], "vertex 1 at 1e\\+07"),
        (TRIANGLE * [1, 0, 0], [[0, 1, 2]], "must have a surface"),
        (TRIANGLE * 0, [[0, 1, 2]], "must have a surface"),
    ],
)
def test_what_is_no_body_is_refused(vertices, triangles, rule):
    with pytest.raises(ParameterError, match=rule) as caught:
        check_mesh(vertices, triangles, "body 2")
    assert str(caught.value).startswith("body 2.mesh must")


def test_vertices_that_are_no_numbers_are_refused_at_each_instant():
    with pytest.raises(ParameterError, match="vertex 2 at nan"):
        rasterize(TRIANGLE * [[1], [1], [np.nan]], np.array([[0, 1, 2]]), make_grid(Layout(3, 3)))
