"""The skin over the pins, the solid under it and the stepped bed, on beds small enough to reason about."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.surface.formed import Formed
from digiclay.core.surface.pins_solid import BRIDGE, make_parts, make_pins_solid
from digiclay.core.surface.skin_mesh import (
    BASE_THICKNESS,
    find_base_level,
    find_grid_shape,
    make_skin,
    make_solid,
)
from hypothesis import given
from hypothesis import strategies as st

from tests.prisms import prism_volume

ARRANGEMENTS = ("aligned", "staggered", "hexagonal")


def pins(rows: int, columns: int, arrangement: str = "aligned") -> np.ndarray:
    """Positions of a bed with the default pitch of 3 mm."""
    return make_grid(Layout(rows=rows, columns=columns, arrangement=arrangement)).positions


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_flat_bed_has_the_volume_of_its_outline_times_its_thickness(arrangement):
    # Every strip between two rows is a parallelogram (columns - 1) pitches wide, also between shifted rows.
    layout = Layout(rows=5, columns=4, arrangement=arrangement)
    outline = 4 * layout.row_spacing * 3 * layout.pitch
    volume = prism_volume(pins(5, 4, arrangement), np.full(20, 0.04), 5, 4, base=0.01)
    assert volume == pytest.approx(outline * 0.03, rel=1e-12)  # rounding of some 20 additions


def test_the_skin_passes_through_every_pin_top():
    place, height = pins(4, 6), np.random.default_rng(1).uniform(0.0, 0.1, 24)
    vertices, faces = make_solid(place, height, 4, 6)
    np.testing.assert_array_equal(vertices[:24], np.column_stack([place, height]))
    assert set(faces[: 2 * 3 * 5].ravel()) == set(range(24))


@pytest.mark.parametrize("thickness", [BASE_THICKNESS, 0.01])
def test_the_base_lies_under_the_lowest_pin_top(thickness):
    vertices, _ = make_solid(pins(2, 2), [0.04, 0.03, 0.05, 0.06], 2, 2, thickness)
    np.testing.assert_allclose(vertices[4:, 2], 0.03 - thickness, rtol=1e-12)  # rounding of one subtraction


@pytest.mark.parametrize("corner", range(4))
def test_a_square_of_pins_is_cut_between_the_two_ends_that_are_level(corner):
    # With one corner raised the level diagonal is the one that does not end in it.
    height = np.full(4, 0.04)
    height[corner] = 0.05
    raised = np.any(make_skin(pins(2, 2), height, 2, 2) == corner, axis=1)
    assert raised.sum() == 1


def test_a_ridge_is_not_cut_across():
    # Pins 1 and 2, on a diagonal, are the ridge; 0 and 3 are level too, but low: the higher one wins.
    faces = make_skin(pins(2, 2), [0.04, 0.05, 0.05, 0.04], 2, 2)
    assert all({1, 2} <= set(face) for face in faces.tolist())


def test_shifted_rows_are_joined_by_the_shorter_diagonal_whatever_the_heights():
    place = pins(6, 6, "staggered")
    random = np.random.default_rng(2)
    first, second = (make_skin(place, random.uniform(0.0, 0.1, 36), 6, 6) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    sides = np.hypot(*np.moveaxis(place[first] - place[np.roll(first, 1, axis=1)], -1, 0))
    # Half a pitch across and one along: 1.118 pitches; the longer one has 1.803.
    assert sides.max() < 1.2 * 3e-3


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1), (2, 2), (4, 7), (7, 4)])
def test_rows_and_columns_are_found_from_the_positions(shape, arrangement):
    assert find_grid_shape(pins(*shape, arrangement)) == shape


def test_pins_that_do_not_fill_their_rows_are_refused():
    with pytest.raises(ParameterError, match=r"^Surface\.position must fill rows of 4 pins \(got 11 pins"):
        find_grid_shape(pins(3, 4)[:-1])


BROKEN = np.where(np.arange(18).reshape(9, 2) == 9, np.nan, pins(3, 3))


@pytest.mark.parametrize(
    ("place", "height", "shape", "said"),
    [
        (BROKEN, np.full(9, 0.04), (3, 3), r"^Surface\.position must be finite \(got nan at cell 4\)\.$"),
        (pins(3, 3), np.full(8, 0.04), (3, 3), r"each of the 3 x 3 pins \(got 8 values at 9 positions\)\.$"),
        (pins(3, 3)[[0, 1, 2, 6, 4, 5, 3, 7, 8]], np.full(9, 0.04), (3, 3), "must order the pins row by row"),
        (pins(1, 1), [0.04], (1, 1), r"2 x 2 pins at least to carry a skin \(got 1 x 1\)\.$"),
        (pins(1, 9), np.full(9, 0.04), (1, 9), r"2 x 2 pins at least to carry a skin \(got 1 x 9\)\.$"),
        (pins(9, 1), np.full(9, 0.04), (9, 1), r"2 x 2 pins at least to carry a skin \(got 9 x 1\)\.$"),
        (pins(2, 2), [0, 0, np.nan, 0], (2, 2), r"^Surface\.height must be finite \(got nan at cell 2\)"),
        (pins(2, 2), [0, 0, 0, -np.inf], (2, 2), r"^Surface\.height must be finite \(got -inf at cell 3\)"),
    ],
)
def test_pins_that_carry_no_skin_are_refused(place, height, shape, said):
    with pytest.raises(ParameterError, match=said):
        make_solid(place, height, *shape)


@pytest.mark.parametrize("thickness", [0.0, -1e-3, np.nan, np.inf])
def test_a_base_that_is_not_below_every_pin_is_refused(thickness):
    with pytest.raises(ParameterError, match=r"^Surface\.base_thickness must be above 0 mm"):
        find_base_level(np.array([0.05, 0.04]), thickness)


def formed(heights_mm, rows: int, columns: int, arrangement: str = "aligned") -> Formed:
    place = make_grid(Layout(rows=rows, columns=columns, arrangement=arrangement)).positions
    return Formed.of(place, np.asarray(heights_mm, float) * 1e-3, 0.04, 0.0, 0)


@st.composite
def beds(draw):
    """Beds with steps of all kinds, many of them of equal height."""
    layout = Layout(
        rows=draw(st.integers(2, 9)),
        columns=draw(st.integers(2, 9)),
        arrangement=draw(st.sampled_from(ARRANGEMENTS)),
    )
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    levels = draw(st.sampled_from([1, 2, 3, 5, 1000]))
    height = 0.03 + 1e-3 * random.integers(0, levels, layout.rows * layout.columns)
    turned = draw(st.sampled_from([(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]))
    return Formed.of(make_grid(layout).positions * turned, height, 0.04, 0.0, 0)


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
    np.testing.assert_allclose(vertices[: len(tops)], tops, rtol=0.0, atol=0.51e-7)  # in steps of 0.1 µm


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_bed_without_bridges_has_the_volume_of_its_prisms(arrangement):
    layout = Layout(rows=4, columns=5, arrangement=arrangement)
    heights = np.random.default_rng(2).integers(300, 600, 20) / 10.0
    if arrangement == "aligned":
        heights = np.arange(20.0) + 30.0  # a stair: no two corners are above both others
    thickness = 1e-3 * heights.min() - 0.01
    vertices, faces, _ = make_pins_solid(formed(heights, 4, 5, arrangement), thickness)
    prisms = (heights * 1e-3 - 0.01).sum() * layout.pitch * layout.row_spacing
    assert trimesh.Trimesh(vertices, faces, process=False).volume == pytest.approx(prisms, rel=1e-12)


def test_squares_that_meet_at_a_corner_are_joined_by_a_bridge():
    bed = formed([50, 40, 40, 50], 2, 2)
    made = make_parts(bed)
    assert len(made.corner) == 10  # nine and one more: the middle is two
    between = made.corner[np.abs(made.corner).max(axis=1) < 0.5e-3]
    np.testing.assert_allclose(np.abs(between), BRIDGE * 3e-3, rtol=1e-9)
    high = {0, 3}
    met = made.twin >= 0
    assert any({int(p), int(o)} == high for p, o in zip(made.pin[met], made.pin[made.twin[met]], strict=True))


def test_differences_no_file_can_hold_make_no_wall():
    heights = 40.0 + np.array([0.0, 1e-6, 2e-5, 0.0, 5.0, 5.0])
    vertices, faces, _ = make_pins_solid(formed(heights, 2, 3))
    corners = vertices[faces].astype(np.float32)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert area.min() > 1e-8  # m²; a wall of the least step would have 3e-10
