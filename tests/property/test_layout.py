"""Discs and bounds of cells, against a search through the whole bed."""

from __future__ import annotations

import numpy as np
from digiclay.core.model.layout import Layout, make_grid
from hypothesis import given
from hypothesis import strategies as st

layouts = st.builds(
    Layout,
    rows=st.integers(1, 12),
    columns=st.integers(1, 12),
    pitch=st.sampled_from([1e-3, 2.6e-3, 3e-3]),
    arrangement=st.sampled_from(["aligned", "staggered", "hexagonal"]),
)
places = st.floats(-40e-3, 40e-3)
radii = st.floats(0.0, 40e-3)


@given(layouts, places, places, radii)
def test_a_disc_has_all_cells_within_its_radius_and_no_other(
    layout: Layout, x: float, y: float, radius: float
) -> None:
    bed = make_grid(layout)
    # On the rim itself rounding may decide either way; a disc widened by 1e-9 has those too.
    distance = np.hypot(bed.x - x, bed.y - y)
    surely, perhaps = distance <= radius * (1 - 1e-12), distance <= radius * (1 + 2e-9) + 1e-17
    found = np.isin(np.arange(bed.count), bed.disc(x, y, radius))
    assert np.all(found >= surely)
    assert np.all(found <= perhaps)


@given(layouts, places, places, radii)
def test_bounds_have_at_least_the_cells_of_the_disc(
    layout: Layout, x: float, y: float, radius: float
) -> None:
    bed = make_grid(layout)
    assert np.isin(bed.disc(x, y, radius), bed.within(bed.bounds(x, y, radius))).all()


@given(layouts, places, places, radii)
def test_bounds_have_no_cell_far_outside_it(layout: Layout, x: float, y: float, radius: float) -> None:
    bed = make_grid(layout)
    cells = bed.within(bed.bounds(x, y, radius))
    # Rows that are shifted share the columns of those that are not: half a pitch more.
    slack = radius + layout.pitch / 2 + 1e-9
    assert np.all(np.abs(bed.x[cells] - x) <= slack)
    assert np.all(np.abs(bed.y[cells] - y) <= slack)


@given(layouts, places, places, radii)
def test_cells_within_bounds_come_in_ascending_order(
    layout: Layout, x: float, y: float, radius: float
) -> None:
    bed = make_grid(layout)
    assert np.all(np.diff(bed.within(bed.bounds(x, y, radius))) > 0)


@given(layouts)
def test_no_two_cells_are_closer_than_a_pitch(layout: Layout) -> None:
    bed = make_grid(layout)
    gaps = np.hypot(bed.x - bed.x[:, None], bed.y - bed.y[:, None])
    np.fill_diagonal(gaps, 1.0)
    # A staggered bed has neighbors sqrt(5/4) pitches apart, a hexagonal one exactly one; rounding.
    assert gaps.min() >= layout.pitch * (1 - 1e-12)


@given(layouts)
def test_the_places_of_cells_are_the_powers_of_their_positions(layout: Layout) -> None:
    bed = make_grid(layout)
    one, x, y, xx, xy, yy = bed.compute_basis(np.arange(bed.count))
    assert np.all(one == 1.0)
    assert np.array_equal(np.array([x, y]).T, bed.positions)
    assert np.array_equal([xx, xy, yy], [x * x, x * y, y * y])
