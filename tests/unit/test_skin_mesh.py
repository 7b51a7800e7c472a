"""The skin over the pins and the solid under it, on beds small enough to reason about."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.surface.skin_mesh import (
    BASE_THICKNESS,
    find_base_level,
    find_grid_shape,
    make_skin,
    make_solid,
)

from tests.prisms import prism_volume

ARRANGEMENTS = ("aligned", "staggered", "hexagonal")


def pins(rows: int, columns: int, arrangement: str = "aligned") -> np.ndarray:
    """Positions of a bed with the default pitch of 3 mm."""
    return make_grid(Layout(rows=rows, columns=columns, arrangement=arrangement)).positions


def turn(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Twice the area of flat triangles by two edges each, positive counterclockwise."""
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_flat_bed_has_the_volume_of_its_outline_times_its_thickness(arrangement):
    # Every strip between two rows is a parallelogram (columns - 1) pitches wide, also between shifted rows.
    layout = Layout(rows=5, columns=4, arrangement=arrangement)
    outline = 4 * layout.row_spacing * 3 * layout.pitch
    volume = prism_volume(pins(5, 4, arrangement), np.full(20, 0.04), 5, 4, base=0.01)
    assert volume == pytest.approx(outline * 0.03, rel=1e-12)  # rounding of some 20 additions


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_one_raised_pin_adds_a_third_of_its_height_over_its_triangles(arrangement):
    place, height = pins(5, 5, arrangement), np.full(25, 0.04)
    raised = height.copy()
    raised[12] += 0.006
    around = make_skin(place, raised, 5, 5)
    a, b, c = (place[around[np.any(around == 12, axis=1)][:, k]] for k in range(3))
    area = 0.5 * np.abs(turn(b - a, c - a)).sum()
    added = prism_volume(place, raised, 5, 5, base=0.0) - prism_volume(place, height, 5, 5, base=0.0)
    assert added == pytest.approx(area * 0.006 / 3, rel=1e-9)  # a difference of volumes 1000 times as large


def test_the_skin_passes_through_every_pin_top():
    place, height = pins(4, 6), np.random.default_rng(1).uniform(0.0, 0.1, 24)
    vertices, faces = make_solid(place, height, 4, 6)
    np.testing.assert_array_equal(vertices[:24], np.column_stack([place, height]))
    assert set(faces[: 2 * 3 * 5].ravel()) == set(range(24))


def test_by_default_the_base_lies_3_mm_under_the_lowest_pin_top():
    vertices, _ = make_solid(pins(2, 2), [0.04, 0.03, 0.05, 0.06], 2, 2)
    assert BASE_THICKNESS == 3e-3
    np.testing.assert_allclose(vertices[4:, 2], 0.027, rtol=1e-12)  # rounding of one subtraction


def test_the_base_can_be_the_floor_of_the_bed():
    vertices, _ = make_solid(pins(2, 2), [0.04, 0.03, 0.05, 0.06], 2, 2, base=0.0)
    assert np.all(vertices[4:, 2] == 0.0)


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
    assert (
        sides.max() < 1.2 * 3e-3
    )  # half a pitch across and one along: 1.118 pitches; the longer one has 1.803


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_every_triangle_of_the_skin_faces_up(arrangement):
    place = pins(5, 7, arrangement)
    a, b, c = (place[make_skin(place, np.linspace(0.0, 0.1, 35), 5, 7)[:, k]] for k in range(3))
    assert np.all(turn(b - a, c - a) > 0.0)


def test_rows_that_run_the_other_way_still_face_up():
    place, height = pins(5, 7) * (-1.0, 1.0), np.linspace(0.0, 0.1, 35)
    a, b, c = (place[make_skin(place, height, 5, 7)[:, k]] for k in range(3))
    assert np.all(turn(b - a, c - a) > 0.0)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1), (2, 2), (4, 7), (7, 4)])
def test_rows_and_columns_are_found_from_the_positions(shape, arrangement):
    assert find_grid_shape(pins(*shape, arrangement)) == shape


def test_pins_that_do_not_fill_their_rows_are_refused():
    with pytest.raises(
        ParameterError, match=r"^Surface\.position must fill rows of 4 pins \(got 11 pins\)\.$"
    ):
        find_grid_shape(pins(3, 4)[:-1])


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1)])
def test_a_single_row_or_column_has_no_skin(shape):
    count = shape[0] * shape[1]
    with pytest.raises(ParameterError, match=r"2 x 2 pins at least to carry a skin \(got \d x \d\)\.$"):
        make_solid(pins(*shape), np.full(count, 0.04), *shape)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_heights_that_are_not_finite_are_refused_by_cell(bad):
    height = np.full(9, 0.04)
    height[5] = bad
    with pytest.raises(
        ParameterError, match=r"^Surface\.height must be finite \(got -?(nan|inf) at cell 5\)\.$"
    ):
        make_solid(pins(3, 3), height, 3, 3)


def test_positions_that_are_not_finite_are_refused_by_cell():
    place = pins(3, 3)
    place[4, 1] = np.nan
    with pytest.raises(ParameterError, match=r"^Surface\.position must be finite \(got nan at cell 4\)\.$"):
        make_solid(place, np.full(9, 0.04), 3, 3)


def test_heights_that_do_not_fit_the_bed_are_refused():
    with pytest.raises(ParameterError, match=r"each of the 3 x 3 pins \(got 8 values at 9 positions\)\.$"):
        make_solid(pins(3, 3), np.full(8, 0.04), 3, 3)


def test_pins_out_of_order_are_refused():
    place = pins(3, 3)[[0, 1, 2, 6, 4, 5, 3, 7, 8]]
    with pytest.raises(ParameterError, match=r"must order the pins row by row"):
        make_solid(place, np.full(9, 0.04), 3, 3)


@pytest.mark.parametrize("base", [0.04, 0.05, np.nan])
def test_a_base_that_is_not_below_every_pin_is_refused(base):
    with pytest.raises(ParameterError, match=r"^Surface\.base must be below the lowest pin top at 40 mm"):
        find_base_level(np.array([0.05, 0.04]), base=base)


@pytest.mark.parametrize("thickness", [0.0, -1e-3, np.nan, np.inf])
def test_a_base_without_thickness_is_refused(thickness):
    with pytest.raises(ParameterError, match=r"^Surface\.base_thickness must be above 0 mm"):
        find_base_level(np.array([0.04]), base_thickness=thickness)
