"""Skin, solid and stepped bed on small beds; skins between the pins beside SciPy's; the live skin."""

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import ParameterError
from digiclay.core.base.spline import interpolate_monotone
from digiclay.core.model.layout import ARRANGEMENTS, Layout, find_grid_shape, make_grid
from digiclay.core.surface import skins
from digiclay.core.surface.formed import Formed, find_base_level, make_skin, make_solid
from digiclay.core.surface.pins_solid import BRIDGE, make_parts, make_pins_solid
from digiclay.core.surface.skins import SKINS, fit_skin
from digiclay.device.instant import Instant
from digiclay.device.skin_lattice import MOST_POINTS, choose_parts, make_lattice
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import (
    BSpline,
    LinearNDInterpolator,
    PchipInterpolator,
    RegularGridInterpolator,
)
from scipy.spatial import Delaunay

from tests.assemble import assert_near
from tests.live_skin import interpolate


def pins(rows, columns, arrangement="aligned"):
    return make_grid(Layout(rows=rows, columns=columns, arrangement=arrangement)).positions


@pytest.mark.parametrize("corner", range(4))
def test_a_square_of_pins_is_cut_between_the_two_ends_that_are_level(corner):
    # With one corner raised the level diagonal is the one that does not end in it.
    height = np.full(4, 0.04)
    height[corner] = 0.05
    raised = np.any(make_skin(pins(2, 2), height, 2, 2) == corner, axis=1)
    assert raised.sum() == 1


def test_a_ridge_is_not_cut_across():
    # Pins 1 and 2, on a diagonal, are the ridge; 0 and 3 are level too, but low: the higher one
    # wins.
    faces = make_skin(pins(2, 2), [0.04, 0.05, 0.05, 0.04], 2, 2)
    assert all({1, 2} <= set(face) for face in faces.tolist())


def test_shifted_rows_are_joined_by_the_shorter_diagonal_whatever_the_heights():
    place = pins(6, 6, "staggered")
    random = np.random.default_rng(2)
    first, second = (make_skin(place, random.uniform(0.0, 0.1, 36), 6, 6) for _ in range(2))
    assert_array_equal(first, second)
    sides = np.hypot(*np.moveaxis(place[first] - place[np.roll(first, 1, axis=1)], -1, 0))
    # Half a pitch across and one along: 1.118 pitches; the longer one has 1.803.
    assert sides.max() < 1.2 * 3e-3


def test_pins_that_do_not_fill_their_rows_are_refused():
    with pytest.raises(
        ParameterError, match=r"^Surface\.position must fill rows of 4 pins \(got 11 pins"
    ):
        find_grid_shape(pins(3, 4)[:-1])


BROKEN = np.where(np.arange(18).reshape(9, 2) == 9, np.nan, pins(3, 3))


@pytest.mark.parametrize(
    "place, height, shape, said",
    [
        (
            BROKEN,
            np.zeros(9),
            (3, 3),
            r"^Surface\.position must be finite \(got nan at cell 4\)\.$",
        ),
        (
            pins(3, 3),
            np.zeros(8),
            (3, 3),
            r"each of the 3 x 3 pins \(got 8 values at 9 positions\)",
        ),
        (pins(3, 3)[[0, 1, 2, 6, 4, 5, 3, 7, 8]], np.zeros(9), (3, 3), "order the pins row by row"),
        (pins(1, 9), np.zeros(9), (1, 9), r"2 x 2 pins, in rows along x \(got 1 x 9\)\.$"),
        (pins(9, 1), np.zeros(9), (9, 1), r"2 x 2 pins, in rows along x \(got 9 x 1\)\.$"),
    ],
)
def test_pins_that_carry_no_skin_are_refused(place, height, shape, said):
    with pytest.raises(ParameterError, match=said):
        make_solid(place, height, *shape)


@pytest.mark.parametrize("thickness", [0.0, -1e-3, np.nan, np.inf])
def test_a_base_that_is_not_below_every_pin_is_refused(thickness):
    with pytest.raises(ParameterError, match=r"^Surface\.base_thickness must be above 0 mm"):
        find_base_level(np.array([0.05, 0.04]), thickness)


def over(place, height):
    """Return a bed at rest at 40 mm whose pins stand at heights, m."""
    return Formed.of(place, height, 0.04, 0.0, 0)


def formed(heights_mm, rows, columns, arrangement="aligned"):
    return over(pins(rows, columns, arrangement), np.asarray(heights_mm, float) * 1e-3)


@st.composite
def beds(draw):
    rows, columns = draw(st.integers(2, 9)), draw(st.integers(2, 9))
    place = pins(rows, columns, draw(st.sampled_from([*ARRANGEMENTS])))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    levels = draw(st.sampled_from([1, 2, 3, 5, 1000]))
    height = 0.03 + 1e-3 * random.integers(0, levels, len(place))
    turned = draw(st.sampled_from([(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]))
    return over(place * turned, height)


@given(beds())
def test_every_edge_has_two_faces_and_all_face_outward(bed):
    vertices, faces, _ = make_pins_solid(bed)
    # Merged by place, as a reader of STL does it: so parts that only touch would be found.
    mesh = trimesh.Trimesh(vertices, faces, process=True)
    edges = np.sort(mesh.edges, axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert set(counts) == {2}
    assert mesh.is_winding_consistent
    assert mesh.volume > 0.0
    assert mesh.body_count == 1
    assert mesh.area_faces.min() > 0.0
    assert len(np.unique(faces)) == len(vertices)
    tops = np.column_stack([bed.position, bed.height])
    assert_near(vertices[: len(tops)], tops, 0.51e-7)  # in steps of 0.1 µm


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_bed_without_bridges_has_the_volume_of_its_prisms(arrangement):
    layout = Layout(rows=4, columns=5, arrangement=arrangement)
    heights = np.random.default_rng(2).integers(300, 600, 20) / 10.0
    if arrangement == "aligned":
        heights = np.arange(20.0) + 30.0  # a stair: no two corners are above both others
    thickness = 1e-3 * heights.min() - 0.01
    vertices, faces, _ = make_pins_solid(formed(heights, 4, 5, arrangement), thickness)
    prisms = (heights * 1e-3 - 0.01).sum() * layout.pitch * layout.row_spacing
    assert trimesh.Trimesh(vertices, faces, process=False).volume == pytest.approx(
        prisms, rel=1e-12
    )


def test_squares_that_meet_at_a_corner_are_joined_and_differences_no_file_can_hold_make_no_wall():
    bed = formed([50, 40, 40, 50], 2, 2)
    made = make_parts(bed)
    assert len(made.corner) == 10  # nine and one more: the middle is two
    between = made.corner[np.abs(made.corner).max(axis=1) < 0.5e-3]
    assert_allclose(np.abs(between), BRIDGE * 3e-3, rtol=1e-9)
    high = {0, 3}
    met = made.twin >= 0
    assert any(
        {int(p), int(o)} == high
        for p, o in zip(made.pin[met], made.pin[made.twin[met]], strict=True)
    )
    heights = 40.0 + np.array([0.0, 1e-6, 2e-5, 0.0, 5.0, 5.0])
    vertices, faces, _ = make_pins_solid(formed(heights, 2, 3))
    corners = vertices[faces].astype(np.float32)
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert area.min() > 1e-8  # m²; a wall of the least step would have 3e-10


#: Radius of a pin's end: half the bore.
CAP = 1e-3
#: Rounding of some ten operations on heights below 0.1 m.
ROUNDING = 1e-15


def bed(arrangement="aligned", rows=7, columns=9, seed=1):
    place = pins(rows, columns, arrangement)
    return over(place, np.random.default_rng(seed).uniform(0.02, 0.08, len(place)))


def covered(formed, skin, parts):
    return fit_skin(formed, skin, parts, CAP)


def covered_rows(arrangement, skin, parts):
    """Return the skin of a bed, and its pins' x and heights, (7, 9), and rows' y, (7,), m."""
    known = bed(arrangement)
    x, y = known.position[:, 0].reshape(7, 9), known.position[::9, 1]
    return covered(known, skin, parts), x, y, known.height.reshape(7, 9)


def test_the_bilinear_skin_of_an_aligned_bed_is_scipys():
    formed = bed()
    sheet = covered(formed, "bilinear", 4)
    x, y = formed.position[:9, 0], formed.position[::9, 1]
    known = RegularGridInterpolator((y, x), formed.height.reshape(7, 9))
    # Points of the edge may be a rounding error outside.
    inside = np.clip(sheet.position, formed.position.min(axis=0), formed.position.max(axis=0))
    assert_near(sheet.height, known(inside[:, ::-1]), 1e-14)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("arrangement", ["staggered", "hexagonal"])
def test_the_bilinear_skin_of_a_shifted_bed_is_flat_on_the_triangles_of_delaunay(
    arrangement, mirrored
):
    formed = bed(arrangement)
    place = formed.position * (-1.0 if mirrored else 1.0, 1.0)
    sheet = covered(over(place, formed.height), "bilinear", 4)
    # In mm, because of Delaunay's own tolerances.
    known = LinearNDInterpolator(Delaunay(place * 1e3), formed.height)(sheet.position * 1e3)
    compared = np.isfinite(known)
    # At the zig-zag ends the hull has triangles that the bed has not, but no point of ours lies in
    # them.
    assert compared.mean() > 0.95
    assert_near(sheet.height[compared], known[compared], 1e-12)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_the_smooth_skin_is_scipys_monotone_splines_along_and_then_across_the_rows(arrangement):
    sheet, x, y, height = covered_rows(arrangement, "smooth", 3)
    # Beside the zig-zag ends of a shifted bed the skin is held between the pins, which SciPy's is
    # not.
    within = (sheet.position[:, 0] >= x[:, 0].max()) & (sheet.position[:, 0] <= x[:, -1].min())
    points = np.flatnonzero(within)[::7]
    assert len(points) > 50
    for point in points:
        at_x, at_y = sheet.position[point]
        along = [PchipInterpolator(x[row], height[row])(at_x) for row in range(7)]
        assert sheet.height[point] == pytest.approx(PchipInterpolator(y, along)(at_y), abs=1e-14)


@pytest.mark.parametrize("falling", [False, True])
@pytest.mark.parametrize("count", [2, 3, 12])
def test_a_spline_may_have_its_knots_anywhere(falling, count):
    random = np.random.default_rng(5)
    knot = np.sort(random.uniform(0.0, 1.0, count))[:: -1 if falling else 1]
    # Some run level for a while, some rise and fall.
    value = random.integers(-2, 3, size=(count, 30)) * 1.0
    at = np.linspace(knot.min(), knot.max(), 101)
    order = np.argsort(knot)
    known = PchipInterpolator(knot[order], value[order])(at)
    assert_near(interpolate_monotone(knot, value, at), known, 1e-12)


@pytest.mark.parametrize("skin", SKINS)
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_skin_is_nowhere_above_or_below_the_pins_about_it(skin, arrangement):
    formed = bed(arrangement, rows=6, columns=6, seed=4)
    sheet = covered(formed, skin, 4)
    # The pins of the own cell and the cells beside it: a line between two shifted rows has its
    # neighbors in either of them.
    away = np.linalg.norm(sheet.position[:, None] - formed.position, axis=2)
    near = away <= 1.6 * formed.pitch
    lowest = np.where(near, formed.height, np.inf).min(axis=1)
    highest = np.where(near, formed.height, -np.inf).max(axis=1)
    assert (sheet.height - lowest).min() >= -1e-9
    assert (sheet.height - highest).max() <= 1e-9


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_the_membrane_is_along_the_rows_then_across_them_what_numpy_makes_of_flat_ends(arrangement):
    sheet, x, y, height = covered_rows(arrangement, "membrane", 6)

    def ends(knots):
        return np.column_stack([knots - CAP, knots + CAP]).ravel()

    for at_x, at_y, found in zip(*sheet.position.T, sheet.height, strict=True):
        along = [np.interp(at_x, ends(x[row]), height[row].repeat(2)) for row in range(7)]
        assert found == pytest.approx(np.interp(at_y, ends(y), np.repeat(along, 2)), abs=1e-14)


def test_force_is_straight_between_pins_and_a_mode_that_of_the_nearest():
    formed = bed(rows=2, columns=2)
    known = Formed.of(formed.position, formed.height, 0.04, [0.0, 1.0, 0.0, 1.0], [1, 2, 3, 4])
    values = covered(known, "smooth", 4).values()
    assert_allclose(values["force"].reshape(5, 5), np.tile([0, 0.25, 0.5, 0.75, 1], (5, 1)))
    assert_array_equal(values["mode"].reshape(5, 5)[[0, 1, 3, 4]][:, [0, 1, 3, 4]][0], [1, 1, 2, 2])


def at_rest(rows, columns, arrangement="aligned"):
    return Instant.at_rest(Layout(rows=rows, columns=columns, arrangement=arrangement))


def rough(instant):
    return 0.04 + 0.005 * np.random.default_rng(3).standard_normal(len(instant.position))


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("parts", [2, 4])
def test_the_membrane_goes_through_the_top_of_every_pin(arrangement, parts):
    instant = at_rest(6, 7, arrangement)
    height = rough(instant)
    lattice = make_lattice(instant, parts)
    skin, top = interpolate(lattice, height, "membrane"), ~lattice.sunk
    for pin, place in enumerate(instant.position):
        apart = np.hypot(*(lattice.place[top] - place).T)
        assert apart.min() < 1e-9
        # A point of the surface may have a second one for the sides, of the same height.
        assert_near(skin[top][apart < 1e-9], height[pin], ROUNDING)


def draw_inside(height, kind, rows, columns, parts):
    """Return the live skin of a bed but its margin, row by row."""
    margin = 2
    shape = (rows - 1) * parts + 1 + 2 * margin, (columns - 1) * parts + 1 + 2 * margin
    lattice = make_lattice(at_rest(rows, columns), parts)
    live = interpolate(lattice, height, kind)[: shape[0] * shape[1]].reshape(shape)
    return live[margin:-margin, margin:-margin]


def draw_export(kind, height, rows, columns, parts):
    """Return a skin of the exports over a bed at rest but for its heights, row by row."""
    formed = over(at_rest(rows, columns).position, height)
    exported = skins.interpolate_skin(formed, height, kind, parts, 1e-3)
    return exported.reshape((rows - 1) * parts + 1, (columns - 1) * parts + 1)


def test_inside_the_bed_the_membrane_is_that_of_the_exports():
    height, bed_of = rough(at_rest(9, 8)), (9, 8, 4)
    exported = draw_export("membrane", height, *bed_of)
    assert_near(draw_inside(height, "membrane", *bed_of), exported, 1e-12)


def test_the_smooth_one_is_scipys_cubic_b_spline():
    height, rows, columns, parts = rough(at_rest(9, 8)), 9, 8, 4
    table = height.reshape(rows, columns)
    for axis, count in ((0, rows), (1, columns)):
        # Coefficients beyond the ends are not felt from one cell inside on.
        padded = np.concatenate([table.take([0], axis), table, table.take([-1], axis)], axis)
        places = np.linspace(0.0, count - 1.0, (count - 1) * parts + 1)
        table = BSpline(np.arange(-3.0, count + 3.0), padded, 3, axis=axis)(places)
    cut = slice(parts, -parts)
    drawn = draw_inside(height, "smooth", rows, columns, parts)
    assert_near(drawn[cut, cut], table[cut, cut], 1e-12)


def test_a_rounded_wall_shows_half_the_steps_of_a_spline_through_the_pins():
    side, parts = 41, 4
    place = at_rest(side, side).position
    pitch = float(np.diff(np.unique(place[:, 0].round(9)))[0])
    away = np.hypot(*place.T) / pitch
    # As steep as walls of brushes: level up to 12 pitches from the middle, then 8 mm down in three.
    height = 0.04 + 8e-3 * np.clip((15.0 - away) / 3.0, 0.0, 1.0)
    fine = np.linspace(place[:, 0].min(), place[:, 0].max(), (side - 1) * parts + 1)
    turns = np.linspace(0.0, 2.0 * np.pi, 1441)
    rim = 12.0 * pitch * np.column_stack([np.sin(turns), np.cos(turns)])
    smooth = draw_inside(height, "smooth", side, side, parts)
    through = draw_export("smooth", height, side, side, parts)
    steps = [np.ptp(RegularGridInterpolator((fine, fine), skin)(rim)) for skin in (smooth, through)]
    # Measured: 0.24 of 0.46 mm.
    assert steps[0] < 0.55 * steps[1]
    # What is level about a pin is drawn at its height; nothing is above or below the pins.
    assert smooth.max() == pytest.approx(height.max(), abs=ROUNDING)
    assert smooth.min() == pytest.approx(height.min(), abs=ROUNDING)


@pytest.mark.parametrize("rows, columns", [(1, 1), (1, 5), (5, 1), (2, 2)])
def test_the_smallest_beds_have_a_skin_too(rows, columns):
    lattice = make_lattice(at_rest(rows, columns), 4)
    skin = interpolate(lattice, np.full(rows * columns, 0.04), "smooth")
    assert_near(skin, np.where(lattice.sunk, 0.0, 0.04), ROUNDING)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_the_faces_of_the_top_cover_the_bed_once_and_face_upwards(arrangement):
    lattice = make_lattice(at_rest(4, 5, arrangement), 2)
    top = lattice.place[lattice.faces[~lattice.sunk[lattice.faces].any(axis=1)]]
    after = np.roll(top, -1, axis=1)
    area = 0.5 * (top[..., 0] * after[..., 1] - top[..., 1] * after[..., 0]).sum(axis=1)
    assert area.min() > 0.0
    assert area.sum() == pytest.approx(np.ptp(lattice.place, axis=0).prod(), rel=1e-9)


@pytest.mark.parametrize("count", [625, 10_000, 100_000])
def test_a_skin_has_no_more_points_than_a_tick_has_time_for(count):
    parts = choose_parts(count)
    assert parts**2 * count <= MOST_POINTS or parts == 1
    assert parts == 4 or (2 * parts) ** 2 * count > MOST_POINTS
