"""What the behaviors are made of: the drive, the exchange between neighbors, shapes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from digiclay.core.control.drive import Drive
from digiclay.core.control.exchange import make_exchange
from digiclay.core.control.named_shapes import SHAPES, evaluate_shape
from digiclay.core.model.layout import Grid, Layout, make_grid
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve

ARRANGEMENTS = ("aligned", "staggered", "hexagonal")


def driven(**table: object) -> Drive:
    """Return the drive of a device."""
    return assemble(resolve({"control": {"method": "elastic"}, **table})).controller.drive


def bed(arrangement: str, rows: int = 7, columns: int = 7) -> Grid:
    """Return a bed."""
    return make_grid(Layout(rows, columns, arrangement=arrangement))


# Drive


@pytest.mark.parametrize("gap", ["stroke", "opening"])
@pytest.mark.parametrize("share", [-0.9, -0.1, -0.01, 0.01, 0.1, 0.9])
def test_a_pin_without_load_moves_at_the_speed_asked_for(gap: str, share: float) -> None:
    table = {"valve": {"gap": gap}, "control": {"method": "elastic"}}
    system = assemble(resolve(table))
    cell, drive = system.cell, system.controller.drive
    wanted = np.array([share * drive.up[-1]])
    opening = drive.open_for(wanted)
    speed = cell.flow.flow(opening, cell.supply.pressure(opening)) / cell.actuator.area
    # A chord of the parabola between two of 128 steps is off by at most 1/4 of a step squared, 1.5e-5.
    assert speed == pytest.approx(wanted, abs=2e-5 * drive.up[-1])


def test_more_than_a_pin_can_do_opens_the_valve_fully() -> None:
    assert driven().open_for(np.array([-1.0, 1.0])).tolist() == [-1.0, 1.0]


def test_no_speed_is_a_shut_valve() -> None:
    assert driven().open_for(np.zeros(1))[0] == 0.0


def test_a_height_within_the_dead_band_is_left_alone() -> None:
    assert driven().approach(np.array([-9.9e-6, 9.9e-6])).tolist() == [0.0, 0.0]


def test_a_height_amiss_is_mended_with_the_settling_time() -> None:
    assert driven().approach(np.array([1e-3])) == pytest.approx(50e-3)  # 1 mm in 20 ms


def test_reservoirs_that_cannot_raise_a_pin_give_finite_commands() -> None:
    drive = driven(supply={"high": -0.1e5, "low": -0.5e5})
    assert np.all(np.abs(drive.open_for(np.array([-0.02, 0.0, 0.02]))) <= 1.0)


# Neighbors


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_neighbors_are_the_nearest_cells(arrangement: str) -> None:
    plan = bed(arrangement)
    cells = np.random.default_rng(3).permutation(plan.count)
    found = {
        frozenset((int(cells[one]), int(cells[other])))
        for ones, others, _ in make_exchange(plan, 1e-5, 5e-3).find_pairs(cells)
        for one, other in zip(ones, others, strict=True)
    }
    place = plan.positions
    # Aligned: 1 pitch; staggered: 1.118 to the next row; the next farther ones are at 1.41 and more.
    near = {
        frozenset(pair)
        for pair in itertools.combinations(range(plan.count), 2)
        if np.hypot(*(place[pair[0]] - place[pair[1]])) < 1.2 * 3e-3
    }
    assert found == near


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_no_pair_of_neighbors_exchanges_twice(arrangement: str) -> None:
    plan = bed(arrangement)
    pairs = [
        frozenset(map(int, pair))
        for ones, others, _ in make_exchange(plan, 1e-5, 5e-3).find_pairs(np.arange(plan.count))
        for pair in zip(ones, others, strict=True)
    ]
    assert len(pairs) == len(set(pairs))


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_values_spread_alike_along_x_and_y(arrangement: str) -> None:
    plan = bed(arrangement, 31, 31)
    rule, cells = make_exchange(plan, 10e-6, 5e-3), np.arange(plan.count)
    values = np.zeros(plan.count)
    center = plan.count // 2
    values[center] = 1.0
    for _ in range(50):
        values = rule.even_out(cells, values)
    x, y = plan.x - plan.x[center], plan.y - plan.y[center]
    spread = np.array([values @ x**2, values @ y**2])
    # Variance 2 D t = 2 x 10 mm²/s x 0.25 s; the limit on the rates takes 1 - (1 - e^-a)/a of it, with
    # a = 2 x 4 D T / p² = 0.044: 2 %. The bed's edge is 9 standard deviations away.
    assert spread == pytest.approx(5e-6, rel=0.03)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("period", [5e-3, 1.0, 1e3])
def test_no_exchange_overshoots_however_long_the_period(arrangement: str, period: float) -> None:
    plan = bed(arrangement)
    values = np.where(np.arange(plan.count) % 2, 1.0, 0.0)
    evened = make_exchange(plan, 10e-6, period).even_out(np.arange(plan.count), values)
    assert evened.min() >= -1e-12  # rounding
    assert evened.max() <= 1.0 + 1e-12


def test_what_neighbors_exchange_adds_up_to_nothing() -> None:
    plan = bed("hexagonal")
    cells = np.random.default_rng(4).permutation(plan.count)[:30]
    values = np.random.default_rng(5).normal(size=30)
    evened = make_exchange(plan, 50e-6, 5e-3).even_out(cells, values)
    assert evened.sum() == pytest.approx(values.sum(), abs=1e-13)  # rounding of 30 numbers of size 1
    assert np.abs(evened - values).max() > 0.01


def test_a_bed_of_one_cell_has_no_neighbors() -> None:
    rule = make_exchange(bed("aligned", 1, 1), 1e-5, 5e-3)
    assert rule.even_out(np.zeros(1, np.intp), np.ones(1)).tolist() == [1.0]


# Shapes


@pytest.mark.parametrize("shape", SHAPES)
def test_a_named_shape_lies_between_minus_one_and_one(shape: str) -> None:
    values = evaluate_shape(shape, bed("aligned", 41, 41))
    assert np.all(np.abs(values) <= 1.0 + 1e-12)


@pytest.mark.parametrize("shape", [name for name in SHAPES if name != "flat"])
def test_a_named_shape_has_heights_to_show(shape: str) -> None:
    assert np.ptp(evaluate_shape(shape, bed("aligned", 41, 41))) > 0.9


@pytest.mark.parametrize("shape", SHAPES)
def test_a_named_shape_fits_a_bed_of_one_cell(shape: str) -> None:
    assert np.all(np.isfinite(evaluate_shape(shape, bed("aligned", 1, 1))))
