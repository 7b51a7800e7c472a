"""Sums over the cells of two, and what the finger leaves behind over its path on surfaces made by hand."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.metrics.summary import measure_ridge_errors, measure_surface_under, sum_cells
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: 21 pins 3 mm apart on a slanting line; the finger goes over all of them in 201 rows, 50 mm up.
LINE, ALONG = np.linspace(-30e-3, 30e-3, 21), (0.6, 0.8)
PLACE, TIP = np.outer(LINE, ALONG), np.zeros((201, 7))
TIP[:, :2], TIP[:, 2], TIP[:, 3] = np.outer(np.linspace(-30e-3, 30e-3, 201), ALONG), 50e-3, 1.0
ALL = np.ones(201, dtype=bool)


def errors(final: Floats, rows: NDArray[np.bool_] = ALL, tip: Floats = TIP, away: float = 11e-3) -> Floats:
    """The ridge errors in mm."""
    return measure_ridge_errors(PLACE, final, tip, rows, away) * 1e3


def test_a_ridge_has_its_height_over_the_path_at_each_pin() -> None:
    np.testing.assert_array_equal(errors(np.full(21, 50e-3)), 0.0)
    np.testing.assert_allclose(errors(np.full(21, 51.5e-3)), 1.5, rtol=1e-12)
    climbing = TIP.copy()
    climbing[:, 2] += 0.1 * np.linspace(-30e-3, 30e-3, 201)
    # The finger is nearest for 3 mm of its way and 1.5 mm past the pin when it was so last: 0.15 mm higher.
    np.testing.assert_allclose(errors(50e-3 + 0.1 * LINE, tip=climbing), -0.15, atol=0.031)
    # 2001 rows are looked at in eight parts alike.
    fine = np.repeat(TIP, 10, axis=0)
    np.testing.assert_array_equal(errors(np.full(21, 51e-3), np.ones(2010, dtype=bool), fine).size, 17)


def test_pins_the_finger_did_not_go_on_from_do_not_count() -> None:
    # Of the 21 pins the last four are less than 11 mm before the end of the way.
    final = np.where(LINE > 18.5e-3, 90e-3, 50e-3)
    found = errors(final)
    assert (len(found), found.max()) == (17, 0.0)
    # With 12 mm, as if none is given, the last of them is on the border.
    assert len(measure_ridge_errors(PLACE, final, TIP, ALL)) in (16, 17)


def test_neither_a_press_without_travel_nor_no_rows_leave_a_ridge() -> None:
    still = np.tile(TIP[100], (50, 1))
    assert measure_ridge_errors(PLACE, np.full(21, 60e-3), still, np.ones(50, dtype=bool)).size == 0
    assert errors(np.full(21, 50e-3), rows=~ALL).size == 0


def test_going_on_after_the_finger_was_lost_does_not_count() -> None:
    # Shaping stops in the middle, and goes on 12 mm later.
    rows = ALL.copy()
    rows[100:140] = False
    counted = measure_ridge_errors(PLACE, np.arange(21.0), TIP, rows, 11e-3) + 50e-3
    # Of pins 0 to 10, passed before, 11 mm of way must follow before the middle: up to pin 6, at -12 mm.
    assert [int(pin) for pin in np.rint(counted) if pin < 10] == list(range(7))


#: Two rows of two cells, at (1, 2) and (4, 6) mm.
HISTORY = {
    "height": np.array([[50e-3, 52e-3], [51e-3, 53e-3]]),
    "force": np.array([[0.0, 0.0], [0.3, 0.1]]),
    "mode": np.array([[Mode.REST, Mode.SPRING], [Mode.FORCE_FOLLOW, Mode.REST]]),
    "total_force": np.array([0.0, 0.4]),
    "position": np.array([[1e-3, 2e-3], [4e-3, 6e-3]]),
}
SUMS = sum_cells(HISTORY)


def test_the_surface_under_the_finger_counts_cells_by_their_force() -> None:
    # 0.3 N at 51 mm and 0.1 N at 53 mm: 51.5 mm, over a finger at 50 mm.
    assert measure_surface_under(SUMS, TIP[:2]) * 1e3 == pytest.approx([1.5], rel=1e-9)
    nothing = {**HISTORY, "force": np.zeros((2, 2)), "total_force": np.zeros(2)}
    assert measure_surface_under(sum_cells(nothing), TIP[:2]).size == 0
