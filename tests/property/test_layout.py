"""Discs and bounds of cells, against a search through the whole bed."""

from __future__ import annotations

import numpy as np
from digiclay.core.model.layout import Layout, join_discs, make_grid, widen_disc
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


@given(layouts, places, places, st.floats(0.0, 40e-3))
def test_a_disc_has_all_cells_within_its_radius_and_bounds_hold_it_closely(
    layout: Layout, x: float, y: float, radius: float
) -> None:
    bed = make_grid(layout)
    # On the rim itself rounding may decide either way; a disc widened by 1e-9 has those too.
    distance = np.hypot(bed.x - x, bed.y - y)
    surely, perhaps = distance <= radius * (1 - 1e-12), distance <= radius * (1 + 2e-9) + 1e-17
    disc, cells = bed.disc(x, y, radius), bed.within(bed.bounds(x, y, radius))
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
def test_no_two_cells_are_closer_than_a_pitch_and_the_basis_has_the_powers_of_their_positions(
    layout: Layout,
) -> None:
    bed = make_grid(layout)
    gaps = np.hypot(bed.x - bed.x[:, None], bed.y - bed.y[:, None])
    np.fill_diagonal(gaps, 1.0)
    # A staggered bed has neighbors sqrt(5/4) pitches apart, a hexagonal one exactly one; rounding.
    assert gaps.min() >= layout.pitch * (1 - 1e-12)
    x, y = bed.positions.T
    powers = [np.ones(bed.count), x, y, x * x, x * y, y * y]
    assert np.array_equal(bed.compute_basis(np.arange(bed.count)), powers)
