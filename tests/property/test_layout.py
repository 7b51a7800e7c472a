"""Where the cells are, which of them are in a disc, and which discs hold each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from digiclay.core.model.layout import Layout, encloses, join_discs, make_grid, widen_disc
from hypothesis import given
from hypothesis import strategies as st

#: Distance of rows and shift of odd ones, in pitches.
ARRANGEMENTS = {"aligned": (1.0, 0.0), "staggered": (1.0, 0.5), "hexagonal": (math.sqrt(3) / 2, 0.5)}


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_the_cells_stand_row_by_row_a_pitch_apart(arrangement: str) -> None:
    spacing, shift = 3e-3 * np.array(ARRANGEMENTS[arrangement])
    table = make_grid(Layout(5, 4, 3e-3, arrangement)).positions.reshape(5, 4, 2)
    assert np.diff(table[:, :, 0], axis=1) == pytest.approx(3e-3, abs=1e-17)
    assert np.ptp(table[:, :, 1], axis=1).max() == 0.0
    assert np.diff(table[:, 0, 1]) == pytest.approx(spacing, abs=1e-17)
    assert table[:, 0, 0] - table[0, 0, 0] == pytest.approx([0.0, shift, 0.0, shift, 0.0], abs=1e-17)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("shape", [(1, 1), (1, 6), (6, 1), (5, 4), (6, 7)])
def test_the_bed_is_centered_on_the_origin(arrangement: str, shape: tuple[int, int]) -> None:
    positions = make_grid(Layout(*shape, 3e-3, arrangement)).positions
    assert positions.min(axis=0) + positions.max(axis=0) == pytest.approx([0.0, 0.0], abs=1e-16)


@pytest.mark.parametrize(
    ("arrangement", "corners", "farthest"),
    [("aligned", True, 1.5), ("aligned", False, 1.1), ("staggered", True, 1.2), ("hexagonal", False, 1.1)],
)
def test_neighbors_are_the_nearest_cells_counter_clockwise(arrangement, corners, farthest):
    layout = Layout(5, 6, 3e-3, arrangement)
    x, y = make_grid(layout).positions.T
    for cell, beside in enumerate(layout.find_neighbors(corners=corners)):
        near = [other for other in beside if other >= 0]
        away = np.hypot(x - x[cell], y - y[cell])
        assert sorted([cell, *near]) == np.flatnonzero(away < farthest * 3e-3).tolist()
        assert np.all(np.diff(np.arctan2(y[near] - y[cell], x[near] - x[cell]) % (2.0 * np.pi)) > 0.0)


SMALL, LARGE, ASIDE = (1e-3, 0.0, 2e-3), (0.0, 0.0, 3e-3), (2e-3, 0.0, 2e-3)


@pytest.mark.parametrize(
    ("outer", "inner", "holds"),
    [
        (LARGE, SMALL, True),  # from inside it touches the rim
        (LARGE, ASIDE, False),
        (SMALL, LARGE, False),
        (None, SMALL, False),
        (SMALL, None, True),
        (None, None, True),
    ],
)
def test_a_disc_holds_another_alone_and_in_a_batch(outer: object, inner: object, holds: bool) -> None:
    assert encloses(outer, inner) == holds
    assert encloses(join_discs([LARGE, outer]), join_discs([SMALL, inner])) == holds
    assert encloses(None, join_discs([inner])) is False
    assert math.isinf(join_discs([None])[2][0])


layouts = st.builds(
    Layout,
    rows=st.integers(1, 12),
    columns=st.integers(1, 12),
    pitch=st.sampled_from([1e-3, 2.6e-3, 3e-3]),
    arrangement=st.sampled_from(["aligned", "staggered", "hexagonal"]),
)
places = st.floats(-40e-3, 40e-3)


@given(layouts, places, places, st.floats(0.0, 40e-3))
def test_a_disc_has_all_cells_within_its_radius_and_bounds_hold_it_closely(layout, x, y, radius):
    bed = make_grid(layout)
    # On the rim itself rounding may decide either way; a disc widened by 1e-9 has those too.
    distance = np.hypot(bed.x - x, bed.y - y)
    surely, perhaps = distance <= radius * (1 - 1e-12), distance <= radius * (1 + 2e-9) + 1e-17
    disc, cells = bed.disc(x, y, radius), bed.box(x, y, radius)
    # Of a batch a run may have none.
    none, covered = bed.covered(widen_disc(join_discs([None, (x, y, radius)]), 1e-9 * radius)).T
    assert not none.any()
    for found in (np.isin(np.arange(bed.count), disc), covered):
        assert np.all(found >= surely)
        assert np.all(found <= perhaps)
    assert np.isin(disc, cells).all()
    assert np.all(np.diff(cells) > 0)
    # Rows that are shifted share the columns of those that are not: half a pitch more.
    slack = radius + layout.pitch / 2 + 1e-9
    assert np.all(np.maximum(np.abs(bed.x[cells] - x), np.abs(bed.y[cells] - y)) <= slack)


@given(layouts)
def test_no_two_cells_are_closer_than_a_pitch_and_the_basis_has_the_powers_of_their_positions(layout):
    bed = make_grid(layout)
    gaps = np.hypot(bed.x - bed.x[:, None], bed.y - bed.y[:, None])
    np.fill_diagonal(gaps, 1.0)
    # A staggered bed has neighbors sqrt(5/4) pitches apart, a hexagonal one exactly one; rounding.
    assert gaps.min() >= layout.pitch * (1 - 1e-12)
    x, y = bed.positions.T
    powers = [np.ones(bed.count), x, y, x * x, x * y, y * y]
    assert np.array_equal(bed.compute_basis(np.arange(bed.count)), powers)
