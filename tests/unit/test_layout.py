"""Where the cells are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.layout import Layout, make_grid

ARRANGEMENTS = ["aligned", "staggered", "hexagonal"]


def table(arrangement: str, rows: int = 5, columns: int = 4) -> np.ndarray:
    """Return positions as (rows, columns, 2)."""
    return make_grid(Layout(rows, columns, 3e-3, arrangement)).positions.reshape(rows, columns, 2)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_x_grows_by_the_pitch_along_a_row(arrangement: str) -> None:
    assert np.diff(table(arrangement)[:, :, 0], axis=1) == pytest.approx(3e-3, abs=1e-17)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_row_has_one_y(arrangement: str) -> None:
    assert np.ptp(table(arrangement)[:, :, 1], axis=1).max() == 0.0


@pytest.mark.parametrize(
    ("arrangement", "spacing"),
    [("aligned", 3e-3), ("staggered", 3e-3), ("hexagonal", 3e-3 * math.sqrt(3) / 2)],
)
def test_y_grows_by_the_row_spacing(arrangement: str, spacing: float) -> None:
    assert np.diff(table(arrangement)[:, 0, 1]) == pytest.approx(spacing, abs=1e-17)


@pytest.mark.parametrize(
    ("arrangement", "shift"), [("aligned", 0.0), ("staggered", 1.5e-3), ("hexagonal", 1.5e-3)]
)
def test_odd_rows_are_shifted(arrangement: str, shift: float) -> None:
    x = table(arrangement)[:, 0, 0]
    assert x - x[0] == pytest.approx([0.0, shift, 0.0, shift, 0.0], abs=1e-17)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("shape", [(1, 1), (1, 6), (6, 1), (5, 4), (6, 7)])
def test_the_bed_is_centered_on_the_origin(arrangement: str, shape: tuple[int, int]) -> None:
    positions = make_grid(Layout(*shape, 3e-3, arrangement)).positions
    assert positions.min(axis=0) + positions.max(axis=0) == pytest.approx([0.0, 0.0], abs=1e-16)


def test_inner_cells_of_a_hexagonal_bed_have_six_neighbors_a_pitch_away() -> None:
    positions = table("hexagonal", 5, 5).reshape(-1, 2)
    away = np.linalg.norm(positions - positions[12], axis=1)
    assert np.isclose(away, 3e-3, rtol=1e-12).sum() == 6


def test_the_default_bed_is_72_mm_wide() -> None:
    bed = make_grid(Layout())
    assert (bed.count, bed.x.max(), bed.y.max()) == (625, pytest.approx(36e-3), pytest.approx(36e-3))


def test_a_disc_counts_cells_exactly_on_its_rim() -> None:
    assert make_grid(Layout(5, 5)).disc(0.0, 0.0, 3e-3).tolist() == [7, 11, 12, 13, 17]


def test_a_disc_beside_the_bed_is_empty() -> None:
    assert make_grid(Layout(5, 5)).disc(1.0, 0.0, 0.1).size == 0


def test_a_disc_partly_beside_the_bed_has_the_cells_there_are() -> None:
    assert make_grid(Layout(5, 5)).disc(-6e-3, -6e-3, 3e-3).tolist() == [0, 1, 5]


def test_zero_rows_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"^Layout\.rows must be at least 1 \(got 0\)\.$"):
        Layout(rows=0)


def test_a_bed_beyond_memory_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"^Layout\.rows \* columns must have at most 20 million cells"):
        Layout(rows=10_000, columns=10_000)
