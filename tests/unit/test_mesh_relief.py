"""Rays down through meshes: the top surface at the pins, overhangs, holes of scans, what is no mesh."""

import re

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.actuator import Actuator
from digiclay.core.model.layout import ARRANGEMENTS, Layout, make_grid
from digiclay.core.shapes.fitting import fit_relief
from digiclay.core.shapes.mesh_relief import SMALL, fill_holes, make_shape_mesh
from digiclay.core.shapes.request import Placement, Shape
from digiclay.core.surface.formed import take_corners
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import Delaunay

from tests.assemble import assert_near
from tests.mesh_files import FACES, PLACES, VOLUME

#: Meshes here are in mm and stand where they are.
IN_PLACE = Placement(1e-3, 1e-3, 0.0, 0.0)
#: Heights of a few mm, from products of a few numbers of 53 bits.
ROUNDING = 1e-12


def shape(mesh, up="z"):
    return make_shape_mesh("test.stl", mesh.vertices, mesh.faces, up, 1e-3)


def tops(mesh, arrangement="aligned", side=21):
    """Return a mesh's tops on a bed 2 mm apart."""
    return shape(mesh).tops(make_grid(Layout(side, side, 2e-3, arrangement)), IN_PLACE)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("seed", range(2))
def test_the_top_of_a_terrain_is_what_scipy_interpolates(arrangement, seed):
    chance = np.random.default_rng(seed)
    plan, z = chance.uniform(-25.0, 25.0, (60, 2)), chance.uniform(-5.0, 5.0, 60)
    cut = Delaunay(plan)
    bed = make_grid(Layout(21, 17, 2e-3, arrangement))
    found = make_shape_mesh("x", np.column_stack([plan, z]), cut.simplices, "z", 1e-3).tops(
        bed, IN_PLACE
    )
    wanted = LinearNDInterpolator(cut, z)(bed.x * 1e3, bed.y * 1e3)
    # The rim belongs to either: rounding decides.
    inside = np.isfinite(wanted) & found.covered
    assert np.count_nonzero(np.isfinite(wanted) != found.covered) <= 2
    # Slivers of Delaunay's may be 1e4 times as long as wide.
    assert_near(found.value[inside], wanted[inside], 1e-8)
    assert not found.overhang.any()


def test_a_box_covers_the_pins_on_its_outline_too():
    # Pins stand on every edge and on the diagonals the faces are cut along.
    found = tops(trimesh.creation.box((8.0, 8.0, 6.0)))
    assert found.covered.sum() == 25
    assert_near(found.value[found.covered], 3.0, ROUNDING)
    assert not found.overhang.any()


def test_a_table_overhangs_where_there_is_room_below_its_top_and_an_open_surface_above_another():
    top, foot = trimesh.creation.box((20.0, 20.0, 2.0)), trimesh.creation.box((30.0, 30.0, 2.0))
    top.apply_translation((0.0, 0.0, 10.0))
    found = tops(trimesh.util.concatenate([top, foot]))
    assert np.array_equal(found.overhang, found.value > 5.0)
    assert found.overhang.sum() == 11 * 11
    sheet = np.array([[-9.0, -9.0], [9.0, -9.0], [0.0, 9.0]])
    lower, upper = (np.column_stack([sheet, np.full(3, z)]) for z in (0.0, 4.0))
    single, double = trimesh.Trimesh(lower, [[0, 1, 2]]), np.concatenate([lower, upper])
    assert not tops(single).overhang.any()
    found = tops(trimesh.Trimesh(double, [[0, 1, 2], [3, 4, 5]], process=False))
    assert np.array_equal(found.overhang, found.covered)
    assert found.covered.any()
    # On edge it covers nothing.
    upright = trimesh.Trimesh(np.array([[-9.0, 0, 0], [9, 0, 0], [0, 0, 9]]), [[0, 1, 2]])
    assert not tops(upright).covered.any()


@pytest.mark.parametrize("up", ["x", "y", "z", "-x", "-y", "-z"])
def test_every_direction_of_a_mesh_can_be_up(up):
    turned = make_shape_mesh("x", PLACES, FACES, up, 1e-3).vertices
    axis, sign = "xyz".index(up[-1]), -1 if up[0] == "-" else 1
    assert np.array_equal(turned[:, 2], sign * PLACES[:, axis])
    assert trimesh.Trimesh(turned, FACES, process=False).volume == pytest.approx(VOLUME)


@pytest.mark.parametrize(
    "mesh, closed",
    [
        (trimesh.creation.box(), True),
        (trimesh.creation.icosphere(), True),
        (trimesh.creation.torus(2.0, 1.0), True),
        (trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), False),
        (trimesh.Trimesh(PLACES, [*FACES, FACES[0]]), False),  # a face twice
    ],
)
def test_a_mesh_is_known_as_closed_as_trimesh_knows_it(mesh, closed):
    corners = np.arange(3 * len(mesh.faces)).reshape(-1, 3)
    soup = trimesh.Trimesh(mesh.triangles.reshape(-1, 3), corners, process=False)
    assert mesh.is_watertight == closed
    assert shape(mesh).closed == closed
    assert shape(soup).closed == closed


TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])


@pytest.mark.parametrize(
    "vertices, faces, said",
    [
        (np.zeros((0, 3)), np.zeros((0, 3), int), "surface made of faces (got odd.stl: no face)"),
        (TRIANGLE, np.zeros((0, 3), int), "surface made of faces (got odd.stl: no face)"),
        (TRIANGLE * [[1], [np.nan], [1]], [[0, 1, 2]], "(got odd.stl: vertex 1 at nan, nan"),
        (np.where(TRIANGLE, np.inf, 0.0), [[0, 1, 2]], "(got odd.stl: vertex 1 at inf, 0"),
        (TRIANGLE, [[0, 1, 3]], "among its vertices (got odd.stl: corner 3 of 3)"),
    ],
)
def test_what_is_no_surface_is_refused(vertices, faces, said):
    with pytest.raises(ParameterError, match=re.escape(said)):
        make_shape_mesh("odd.stl", vertices, np.array(faces), "z", 1e-3)


def ground(x, y):
    """Return the height of a hilly ground 20 mm up, mm."""
    return 20.0 + 0.1 * x + 3.0 * np.sin(x / 20.0) * np.cos(y / 25.0)


def ground_under(bed):
    return ground(bed.x * 1e3, bed.y * 1e3)


def scan(*holes, size=40.0):
    """Return the ground as triangles 1 mm wide, without those in holes: x, y and radius, mm."""
    side = np.arange(-size, size + 1.0)
    x, y = (axis.ravel() for axis in np.meshgrid(side, side, indexing="ij"))
    number = np.arange(x.size).reshape(side.size, side.size)
    a, d, c, b = (part.ravel() for part in take_corners(number))
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    plan = np.column_stack([x, y])[faces].mean(axis=1)
    for left, front, radius in holes:
        away = np.hypot(plan[:, 0] - left, plan[:, 1] - front) > radius
        faces, plan = faces[away], plan[away]
    return trimesh.Trimesh(np.column_stack([x, y, ground(x, y)]), faces, process=False)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_hole_of_a_scan_is_as_high_as_what_is_around_it(arrangement):
    bed = make_grid(Layout(25, 25, 3e-3, arrangement))
    found = shape(scan((5.0, -8.0, 5.0), (-20.0, 14.0, 2.5))).tops(bed, IN_PLACE)
    assert found.covered.all()
    assert not found.overhang.any()
    missed = np.count_nonzero(np.hypot(bed.x * 1e3 - 5.0, bed.y * 1e3 + 8.0) < 4.0)
    assert missed < found.filled < 25
    # The flattest surface leaves the ground by its curvature, 3 mm / (20 mm)², times a quarter of
    # (5 mm)².
    assert_near(found.value, ground_under(bed), 0.1)


def test_a_hole_in_the_top_of_a_solid_is_filled_though_its_inside_is_seen_through_it():
    top = scan((3.0, 4.0, 5.0))
    plate = trimesh.creation.box((80.0, 80.0, 2.0))
    lower = plate.submesh([np.flatnonzero(plate.face_normals[:, 2] < 0.5)], append=True)
    bed = make_grid(Layout(25, 25, 3e-3))
    found = shape(trimesh.util.concatenate([top, lower])).tops(bed, IN_PLACE)
    assert found.filled > 5
    assert_near(found.value, ground_under(bed), 0.1)


def turned(share):
    mesh = scan()
    some = np.random.default_rng(2).random(len(mesh.faces)) < share
    mesh.faces[some] = mesh.faces[some][:, ::-1]
    return mesh


@pytest.mark.parametrize(
    "mesh, bare",
    [
        # More than a twentieth of the pins.
        (
            scan((0.0, 0.0, 12.0)),
            lambda x, y: np.hypot(x, y) < 11.0,
        ),
        (trimesh.creation.annulus(3.0, 30.0, 10.0), lambda x, y: np.hypot(x, y) < 2.5),
        (scan((-20.0, 0.0, 4.0), size=21.0), lambda x, y: np.abs(x) > 22.0),  # beside a scan
        # A bay to the rim of the bed.
        (
            scan((-36.0, 0.0, 4.0)),
            lambda x, y: np.hypot(x + 36.0, y) < 2.0,
        ),
        (turned(1.0), lambda x, y: x > 99.0),
        (turned(0.85), lambda x, y: x > 99.0),
    ],
)
def test_what_is_no_small_hole_stays_as_it_is(mesh, bare):
    bed = make_grid(Layout(25, 25, 3e-3))
    found = shape(mesh).tops(bed, IN_PLACE)
    assert found.filled == 0
    assert not found.covered[bare(bed.x * 1e3, bed.y * 1e3)].any()
    if len(mesh.faces) == 12_800:  # the whole ground
        assert_near(found.value, ground_under(bed), 0.02)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_slope_goes_on_through_a_hole(arrangement):
    bed = make_grid(Layout(21, 21, 3e-3, arrangement))
    slope = 7.0 + 300.0 * bed.x - 200.0 * bed.y
    missing = np.hypot(bed.x - 3e-3, bed.y) < 7e-3
    value, hole = fill_holes(bed, np.where(missing, -99.0, slope), missing)
    assert np.array_equal(hole, missing)
    # 300 rounds bring a hole four pins wide to rest.
    assert_near(value, slope, 1e-9)


def test_a_hole_is_small_up_to_a_twentieth_of_the_covered_pins():
    bed, value = make_grid(Layout(21, 21, 3e-3)), np.arange(441.0)
    for count in (20, 21, 22):
        missing = np.zeros(bed.count, np.bool_)
        missing[21 * 5 + 2 : 21 * 5 + 13] = missing[21 * 6 + 2 : 21 * 6 + 2 + count - 11] = True
        _, hole = fill_holes(bed, value, missing)
        assert hole.any() == (count <= SMALL * (bed.count - count))
    for missing in (np.zeros(441, np.bool_), np.ones(441, np.bool_)):
        kept, hole = fill_holes(bed, value, missing)
        assert not hole.any()
        np.testing.assert_array_equal(kept, value)


def test_a_scan_with_holes_says_so():
    bed = make_grid(Layout())
    laid, whole = (
        fit_relief(Shape(relief="true"), shape(scan(*holes, size=36.0)), bed, Actuator())
        for holes in ([(5.0, -8.0, 5.0)], [])
    )
    assert laid.filled > 5
    assert f"{laid.filled} cells under holes filled from around" in laid.describe()
    assert "holes" not in whole.describe()
