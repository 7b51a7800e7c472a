"""Method I around its master: blister, edge heights, freezing; on the bed and at its rim."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.control.blister import Blister
from digiclay.core.control.virtual_master import Master, Phase, VirtualMaster
from digiclay.core.model.control_interface import Commands, Measurement
from digiclay.core.model.layout import Layout, make_grid

from tests.assemble import make_system, master, path, record

BED = make_grid(Layout(15, 15))
#: A little beside a cell, so that no cell lies exactly on a circle.
BESIDE = {"x": 0.4e-3, "y": 0.2e-3}


def bed(height: float = 40.0, mode: Mode = Mode.REST) -> Measurement:
    """Return a measurement of a whole bed that nobody touches."""
    level, modes = np.full(BED.count, height * 1e-3), np.full(BED.count, mode, np.int8)
    cells, free, own = np.arange(BED.count), np.zeros(BED.count), np.empty((0, BED.count))
    return Measurement(BED.compute_basis(cells), level, free, level.copy(), modes, own, cells)


def at(x: float, y: float) -> int:
    """Return the cell at a place in mm."""
    return int(np.hypot(BED.x - x * 1e-3, BED.y - y * 1e-3).argmin())


def created(memory: Master, seen: Measurement, blister: Blister | None = None) -> tuple[Master, Commands]:
    """Return what Method I commands."""
    system = make_system(Layout(15, 15), control=VirtualMaster(), blister=blister)
    return system.controller.command(memory, seen)


# Blister


@pytest.mark.parametrize("profile", ["cone", "gaussian"])
def test_cells_of_the_blister_are_commanded_to_its_profile(profile: str) -> None:
    blister = Blister(profile=profile)
    _, orders = created(master(), bed(), blister)
    inside = np.hypot(BED.x, BED.y) <= 15e-3
    expected = 40e-3 + blister.evaluate_profile(np.hypot(BED.x, BED.y)[inside]) * 5e-3
    # A circle may be widened by a billionth, for the sake of cells exactly on it.
    assert orders.target[inside] == pytest.approx(expected, abs=1e-10)


def test_cells_outside_the_blister_keep_their_target() -> None:
    outside = np.hypot(BED.x, BED.y) > 15.1e-3
    seen = bed()
    seen.target[outside] = 47e-3
    assert np.all(created(master(), seen)[1].target[outside] == 47e-3)


def test_blister_targets_stay_within_the_stroke() -> None:
    _, orders = created(master(height=100e-3, edge=130e-3), bed()._replace(height=np.full(BED.count, 0.13)))
    assert orders.target.max() == 100e-3


def test_cells_under_the_finger_follow_the_force_while_shaping() -> None:
    seen = bed()
    seen.force[at(0, 0)] = 0.1
    assert created(master(), seen)[1].mode[at(0, 0)] == Mode.FORCE_FOLLOW


def test_cells_under_the_finger_are_springs_before_that() -> None:
    seen = bed()
    seen.force[at(0, 0)] = 0.1
    assert created(master(phase=Phase.SPRING), seen)[1].mode[at(0, 0)] == Mode.SPRING


def test_cells_just_outside_are_the_edge() -> None:
    distance = np.hypot(BED.x - BESIDE["x"], BED.y - BESIDE["y"])
    ring = (distance > 15e-3) & (distance < 18.5e-3)
    assert np.array_equal(created(master(**BESIDE), bed())[1].mode == Mode.EDGE, ring)


@pytest.mark.parametrize(
    "place", [(15, 0), (-15, 0), (0, 15), (0, -15), (9, 12), (-9, 12), (12, -9), (-12, -9)]
)
def test_cells_exactly_on_the_rim_belong_to_the_blister_on_every_side(place: tuple[float, float]) -> None:
    # Else a bell, which is still a tenth of its height there, would be lopsided by rounding alone.
    assert created(master(), bed())[1].mode[at(*place)] == Mode.BLISTER


def test_at_rest_the_edge_height_is_the_mean_of_the_whole_ring() -> None:
    seen = bed()
    seen.height[BED.x > 0] += 2e-3
    seen.height[BED.x < 0] -= 1e-3
    ring = np.abs(np.hypot(BED.x - BESIDE["x"], BED.y - BESIDE["y"]) - 16.75e-3) < 1.75e-3
    assert created(master(**BESIDE), seen)[0].edge == pytest.approx(seen.height[ring].mean(), abs=1e-16)


def test_while_moving_only_the_ring_ahead_gives_the_edge_height() -> None:
    seen = bed()
    seen.height[BED.x < -0.1e-3] = 60e-3  # the finished ridge
    assert created(master(1.0, 0.0), seen)[0].edge == pytest.approx(40e-3, abs=1e-16)


def test_where_no_edge_cell_lies_ahead_the_edge_height_is_kept() -> None:
    memory = master(1.0, 0.0, x=22e-3, edge=41.5e-3)
    assert created(memory, bed())[0].edge == 41.5e-3


# Freezing


def ridge(mode: Mode = Mode.BLISTER) -> Measurement:
    """Return a bed whose cells behind a finger that moves along x stand higher than the profile."""
    return bed()._replace(target=np.full(BED.count, 44e-3), mode=bed(mode=mode).mode)


EAST, WEST = (1.0, 0.0), (-1.0, 0.0)


def test_cells_behind_a_traveling_finger_keep_their_command() -> None:
    _, orders = created(master(*EAST), ridge())
    assert (orders.mode[at(-12, 0)], orders.target[at(-12, 0)]) == (Mode.FROZEN, 44e-3)


def test_cells_ahead_and_beside_are_not_frozen() -> None:
    mode = created(master(*EAST), ridge())[1].mode
    assert [mode[at(12, 0)], mode[at(0, 12)], mode[at(0, -12)]] == [Mode.BLISTER] * 3


def test_cells_of_the_flat_top_are_never_newly_frozen() -> None:
    assert created(master(*EAST), ridge())[1].mode[at(-3, 0)] == Mode.BLISTER


def test_cells_exactly_on_the_rim_of_the_flat_top_are_treated_alike_on_every_side() -> None:
    ways = [(1, 0), (-1, 0), (0, 1), (0, -1)]
    modes = [created(master(x, y), ridge())[1].mode[at(-6 * x, -6 * y)] for x, y in ways]
    assert len(set(modes)) == 1


def test_nothing_freezes_before_the_finger_has_a_direction() -> None:
    assert not np.any(created(master(), ridge())[1].mode == Mode.FROZEN)


def test_a_frozen_cell_stays_frozen_when_the_finger_turns_back() -> None:
    assert created(master(*WEST), ridge(Mode.FROZEN))[1].mode[at(-12, 0)] == Mode.FROZEN


def test_a_blister_that_outgrows_a_frozen_cell_takes_it_along() -> None:
    # 12 mm from the master a third of the cone is left: 40 mm and a third of 15 mm.
    _, orders = created(master(*EAST, height=55e-3), ridge(Mode.FROZEN))
    assert orders.mode[at(-12, 0)] == Mode.FROZEN
    assert orders.target[at(-12, 0)] == pytest.approx(45e-3, abs=1e-9)


@pytest.mark.parametrize(("risen", "kept"), [(1.4e-3, False), (1.6e-3, True)])
def test_a_blister_in_search_of_the_finger_takes_frozen_cells_along_by_a_tenth_of_its_radius(
    risen: float, kept: bool
) -> None:
    # It has not felt the finger for a period.
    searching = master(*EAST, height=55e-3)._replace(felt=55e-3 - risen, alone=1)
    target = created(searching, ridge(Mode.FROZEN))[1].target[at(-12, 0)]
    assert target == pytest.approx(44e-3 if kept else 45e-3, abs=1e-9)


def test_a_dent_that_outgrows_a_frozen_cell_takes_it_along() -> None:
    seen = ridge(Mode.FROZEN)._replace(target=np.full(BED.count, 39e-3))
    _, orders = created(master(*EAST, height=31e-3), seen)
    assert orders.target[at(-12, 0)] == pytest.approx(37e-3, abs=1e-9)


def test_a_frozen_cell_touched_lightly_stays_frozen() -> None:
    seen = ridge(Mode.FROZEN)
    seen.force[at(-12, 0)] = 0.019
    assert created(master(*EAST), seen)[1].mode[at(-12, 0)] == Mode.FROZEN


def test_a_frozen_cell_that_is_pressed_is_freed() -> None:
    seen = ridge(Mode.FROZEN)
    seen.force[at(-12, 0)] = 0.02
    _, orders = created(master(*EAST), seen)
    assert orders.mode[at(-12, 0)] == Mode.FORCE_FOLLOW
    assert orders.target[at(-12, 0)] != 44e-3


def test_noise_neither_frees_a_frozen_cell_nor_marks_one_as_touched() -> None:
    noisy = replace(make_system(Layout(15, 15), control=VirtualMaster()).controller, floor=30e-3)
    seen = ridge(Mode.BLISTER)
    seen.mode[at(-12, 0)] = Mode.FROZEN
    seen.force[[at(-12, 0), at(0, 0)]] = 29e-3
    mode = noisy.command(master(*EAST), seen)[1].mode
    assert [mode[at(-12, 0)], mode[at(0, 0)]] == [Mode.FROZEN, Mode.BLISTER]


def test_a_frozen_cell_out_of_the_blister_holds() -> None:
    mode = created(master(*EAST), ridge(Mode.FROZEN))[1].mode
    assert mode[at(-21, 0)] == Mode.HOLD


def test_a_cell_that_was_never_formed_rests() -> None:
    assert created(master(*EAST), bed())[1].mode[at(-21, 0)] == Mode.REST


def test_without_a_finger_every_cell_goes_on_to_its_target() -> None:
    seen = bed()
    seen.target[5] += 1e-3
    _, orders = created(Master(), seen)
    assert (orders.command[5], orders.mode[5]) == (pytest.approx(0.5), Mode.HOLD)


# On the bed

PRESS_AND_LIFT = [(0, 46.0), (0.4, 35.5), (0.6, 35.5), (1.4, 43.0)]


def formed(x: float, y: float, profile: str = "cone") -> np.ndarray:
    """Return the final heights (15, 15) after a press at (x, y), mm, and a slow lift."""
    system = make_system(Layout(15, 15), control=VirtualMaster(), blister=Blister(profile=profile))
    run = record(system, path(*((t, x, y, z) for t, z in PRESS_AND_LIFT)), 280)
    assert run.memory[-1].losses == 0
    return run.height[-1].reshape(15, 15)


@pytest.mark.parametrize("profile", ["cone", "gaussian"])
def test_a_lifting_finger_takes_the_surface_along(profile: str) -> None:
    # From 4.5 mm below the surface to 3 mm above; with its pulp pressed 1.5 mm the pin stands at 44.5 mm.
    assert formed(0.0, 0.0, profile)[7, 7] == pytest.approx(44.5e-3, abs=0.7e-3)


@pytest.mark.parametrize(("x", "y", "row", "column"), [(21, 0, 7, 14), (-21, -21, 0, 0), (23, 23, 14, 14)])
def test_a_blister_partly_off_the_bed_rises_as_well(x: float, y: float, row: int, column: int) -> None:
    heights = formed(x, y)
    assert heights[row, column] > 43e-3
    assert heights.min() > 39.9e-3


def test_a_finger_off_the_bed_changes_nothing() -> None:
    assert np.all(formed(40.0, 0.0) == 40e-3)
