"""Where the cells are, which of them are in a disc, and which discs hold each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from digiclay.core.model.layout import Layout, encloses, join_discs, make_grid

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
