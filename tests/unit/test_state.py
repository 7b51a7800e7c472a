"""The rows of a state, states as values, stored modes, and how long a set of active cells serves."""

import itertools

import numpy as np
import pytest
from digiclay.core.base.modes import COLORS, MEANINGS, Mode
from digiclay.core.control.virtual_master import VirtualMaster
from digiclay.core.engine.simulation import begin
from digiclay.core.model.layout import Layout

from tests.assemble import make_system, one_cell, path, record


def test_a_copy_a_row_and_the_modes_share_no_array_with_a_state_that_has_active_cells():
    system = make_system(Layout(9, 9), control=VirtualMaster())
    pressed = record(system, path((0, 0, 0, 41), (0.2, 0, 0, 37)), 40).last
    copy = pressed.copy()
    pairs = [(getattr(pressed, name), getattr(copy, name)) for name in ("rows", "modes", "aged")]
    pairs += [
        (getattr(pressed.active, name), getattr(copy.active, name)) for name in ("block", "mode")
    ]
    assert [np.shares_memory(*pair) for pair in pairs] == [False] * 5
    cells = pressed.active.cells
    assert cells.size
    assert np.array_equal(pressed.row(0)[cells], pressed.active.block[0])
    assert np.array_equal(pressed.mode()[cells], pressed.active.mode)
    pressed.row(0)[:] = -1.0
    assert pressed.row(0).min() > 0.0


@pytest.mark.parametrize(
    "absent, rows",
    [(("",), 5), (("valve_lag",), 4), (("relaxation",), 2), (("valve_lag", "relaxation"), 1)],
)
def test_a_part_that_is_left_out_owns_no_row(absent, rows):
    system = one_cell(dead_time=0.0, **dict.fromkeys(filter(None, absent)))
    start = begin(system)
    assert start.rows.shape[0] == rows + 3  # command, target, force
    # At rest every pin is at its target, and every valve is shut.
    assert (start.rows[[0, system.rows.target]] == 40e-3).all()
    assert not np.delete(start.rows, [0, system.rows.target], axis=0).any()
    assert (start.active.cells.size, start.mode().tolist()) == (0, [Mode.REST])


@pytest.mark.parametrize(
    "disc, serves",
    [((3, -6, 5), True), ((5, -6, 5), True), ((3, -8, 5), True), ((3, -6, 7), True), ((3, -6, 9), False),
     ((6.1, -6, 5), False), ((3, -2.9, 5), False), ((-6, 3, 5), False)],
)  # fmt: skip
def test_an_active_set_serves_while_the_controlled_disc_is_within_a_pitch_around_it(disc, serves):
    system = make_system(Layout(11, 11))
    select, (x, y) = system.selection, system.grid.positions.T
    first = select.update(begin(system), None, (3e-3, -6e-3, 5e-3)).active
    assert first.cells.tolist() == np.flatnonzero(np.hypot(x - 3e-3, y + 6e-3) < 8e-3).tolist()
    assert select.serves(first, 0, None, tuple(1e-3 * one for one in disc)) == serves


def test_stored_codes_never_change_and_every_mode_has_a_meaning_and_a_color_unlike_all_others():
    # Histories on disk hold them.
    assert {mode.name: int(mode) for mode in Mode} == {
        "REST": 0, "HOLD": 1, "EDGE": 2, "BLISTER": 3,
        "SPRING": 4, "FORCE_FOLLOW": 5, "CRITICAL": 6, "FROZEN": 7, "LOCKED": 8,
    }  # fmt: skip
    assert MEANINGS.keys() == COLORS.keys() == set(Mode)
    colors = np.array(list(COLORS.values()))
    assert 0.0 <= colors.min() <= colors.max() <= 1.0
    # 0.15 apart in the unit cube: the two nearest, the blues, are 0.4 apart.
    assert min(np.linalg.norm(a - b) for a, b in itertools.combinations(colors, 2)) > 0.15
