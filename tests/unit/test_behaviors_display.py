"""Shape display: its moves, its patience, its files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.control.named_shapes import SHAPES
from digiclay.core.model.control_interface import Measurement
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve


def control(**known: Any) -> Any:
    """Return a display, put together for a bed of 5 x 5 cells."""
    table = {"layout": {"rows": 5, "columns": 5}, "control": {"method": "shape_display", **known}}
    return assemble(resolve(table)).controller


def test_the_rows_of_a_one_time_refresh_go_one_after_another() -> None:
    behavior = control(refresh="one_time")
    assert [move[:2] for move in behavior.moves] == [(row, row) for row in range(5)]


def test_a_gradual_refresh_goes_through_its_surfaces_row_by_row() -> None:
    behavior = control(refresh="gradual", surfaces=2)
    assert [tuple(move) for move in behavior.moves] == [(r, r, s) for s in (0.5, 1.0) for r in range(5)]


def test_an_approximate_gradual_refresh_moves_all_rows_at_once() -> None:
    behavior = control(refresh="approximate_gradual", surfaces=2)
    assert [tuple(move) for move in behavior.moves] == [(0, 4, 0.5), (0, 4, 1.0)]


def test_a_move_waits_no_longer_than_its_patience() -> None:
    # Every pin is held down by something; each row is given up in its turn.
    behavior = control(shape="pyramid", refresh="one_time", patience=0.05)
    bed, full = make_grid(Layout(5, 5)), np.full(25, 40e-3)
    place, mode = bed.compute_basis(np.arange(25)), np.zeros(25, np.int8)
    stuck = Measurement(place, full, np.zeros(25), full, mode, np.zeros((0, 25)), np.arange(25))
    memory = behavior.begin()
    for _ in range(5 * 10 + 1):
        memory, _ = behavior.command(memory, stuck)
    assert memory.move == 5


def test_a_move_waits_as_long_as_its_patience() -> None:
    behavior = control(shape="pyramid", refresh="one_time", patience=0.0525)
    place, full = make_grid(Layout(5, 5)).compute_basis(np.arange(25)), np.full(25, 40e-3)
    stuck = Measurement(
        place, full, np.zeros(25), full, np.zeros(25, np.int8), np.zeros((0, 25)), np.arange(25)
    )
    memory, moves = behavior.begin(), []
    for _ in range(25):
        memory, _ = behavior.command(memory, stuck)
        moves.append(memory.move)
    # The pyramid's first row is at rest already; 11 periods of 5 ms are the first to be longer than 52.5 ms.
    assert np.flatnonzero(np.diff([0, *moves])).tolist() == [0, 11, 22]


def test_heights_are_read_from_a_file(tmp_path: Path) -> None:
    heights = np.linspace(30e-3, 50e-3, 25).reshape(5, 5)
    np.save(tmp_path / "mine.npy", heights)
    assert np.array_equal(control(shape=str(tmp_path / "mine.npy")).heights, heights.ravel())


@pytest.mark.parametrize(
    ("name", "value"),
    [
        # At x = 0.5, y = 0.25 of the square from -1 to 1.
        ("dome", 1.0 - 0.3125),
        ("saddle", 0.1875),
        ("wave", 0.0),
        ("ripple", np.cos(3.0 * np.pi * 0.3125**0.5)),
        ("pyramid", 0.5),
        ("ramp", 0.5),
        ("flat", 0.0),
    ],
)
def test_a_named_shape_has_the_values_of_its_formula(name: str, value: float) -> None:
    found = SHAPES[name](np.array([0.5]), np.array([0.25]))
    assert found[0] == pytest.approx(value, abs=1e-12)


def test_a_cell_of_the_force_display_is_kept_for_its_release_time_after_the_finger_left() -> None:
    table = {
        "layout": {"rows": 1, "columns": 1},
        "control": {"method": "force_display", "release_time": 0.0225},
    }
    behavior = assemble(resolve(table)).controller
    place, full = make_grid(Layout(1, 1)).compute_basis(np.arange(1)), np.full(1, 40e-3)
    mode, own, follows = np.full(1, Mode.FORCE_FOLLOW, np.int8), np.zeros((behavior.rows, 1)), []
    for _ in range(6):
        _, given = behavior.command(
            None, Measurement(place, full, np.zeros(1), full, mode, own, np.arange(1))
        )
        mode = given.mode
        follows.append(bool(mode[0] == Mode.FORCE_FOLLOW))
    # 4 periods of 5 ms are within 22.5 ms, 5 are not.
    assert follows == [True] * 4 + [False] * 2
