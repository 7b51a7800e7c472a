"""Parts of the behaviors: drive, exchange between neighbors, shapes; and their parameters in scene files."""

from __future__ import annotations

import itertools
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.control.displays import SHAPES, evaluate_shape
from digiclay.core.control.drive import Drive
from digiclay.core.control.exchange import make_exchange
from digiclay.core.control.methods import METHODS
from digiclay.core.model.layout import Grid, Layout, make_grid
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import format_scene, resolve

BEHAVIORS = ("elastic", "plastic", "viscous", "push_pull", "force_display", "shape_display")
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


def test_a_drive_is_limited_to_its_valve_and_approaches_a_height_in_its_settling_time() -> None:
    # More than a pin can do opens the valve fully, no speed shuts it.
    assert driven().open_for(np.array([-1.0, 0.0, 1.0])).tolist() == [-1.0, 0.0, 1.0]
    # 1 mm in 20 ms; nothing within the dead band.
    assert driven().approach(np.array([-9.9e-6, 9.9e-6, 1e-3])) == pytest.approx([0.0, 0.0, 50e-3])
    # Reservoirs that cannot raise a pin give finite commands.
    drive = driven(supply={"high": -0.1e5, "low": -0.5e5})
    assert np.all(np.abs(drive.open_for(np.array([-0.02, 0.0, 0.02]))) <= 1.0)


# Neighbors


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_the_nearest_cells_are_neighbors_each_pair_once(arrangement: str) -> None:
    plan = bed(arrangement)
    cells = np.random.default_rng(3).permutation(plan.count)
    pairs = [
        frozenset((int(cells[one]), int(cells[other])))
        for ones, others, _ in make_exchange(plan, 1e-5, 5e-3).find_pairs(cells)
        for one, other in zip(ones, others, strict=True)
    ]
    place = plan.positions
    # Aligned: 1 pitch; staggered: 1.118 to the next row; the next farther ones are at 1.41 and more.
    near = {
        frozenset(pair)
        for pair in itertools.combinations(range(plan.count), 2)
        if np.hypot(*(place[pair[0]] - place[pair[1]])) < 1.2 * 3e-3
    }
    assert (set(pairs), len(pairs)) == (near, len(near))


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
def test_an_exchange_keeps_the_sum_and_does_not_overshoot_however_long_the_period(arrangement: str) -> None:
    plan = bed(arrangement)
    some = np.random.default_rng(4).permutation(plan.count)[:30]
    values = np.random.default_rng(5).normal(size=30)
    evened = make_exchange(plan, 50e-6, 5e-3).even_out(some, values)
    assert evened.sum() == pytest.approx(values.sum(), abs=1e-13)  # rounding of 30 numbers of size 1
    assert np.abs(evened - values).max() > 0.01
    cells, given = np.arange(plan.count), np.zeros(plan.count)
    checkered = np.where(cells % 2, 1.0, 0.0)
    for period in (5e-3, 1.0, 1e3):
        evened = make_exchange(plan, 10e-6, period).even_out(cells, checkered)
        assert -1e-12 <= evened.min() <= evened.max() <= 1.0 + 1e-12  # rounding
    # In a long one a cell exchanges half of what its neighbors differ by.
    for ones, others, share in make_exchange(plan, 1e-5, 1e9).find_pairs(cells):
        np.add.at(given, np.concatenate((ones, others)), share)
    assert given[plan.count // 2] == pytest.approx(0.5, rel=1e-12)
    lonely = make_exchange(bed("aligned", 1, 1), 1e-5, 5e-3)
    assert lonely.even_out(np.zeros(1, np.intp), np.ones(1)).tolist() == [1.0]


# Shapes


#: At x = 0.5, y = 0.25 of the square from -1 to 1, 0.559 from its middle.
VALUES = {
    "dome": 1.0 - 0.3125, "saddle": 0.1875, "wave": 0.0, "ripple": np.cos(3.0 * np.pi * 0.3125**0.5),
    "crater": 0.930852, "pyramid": 0.5, "ramp": 0.5, "flat": 0.0,
}  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
def test_a_named_shape_has_the_values_of_its_formula_and_fits_a_bed_of_one_cell(shape: str) -> None:
    assert SHAPES[shape](np.array([0.5]), np.array([0.25]))[0] == pytest.approx(VALUES[shape], abs=1e-6)
    values = evaluate_shape(shape, bed("aligned", 41, 41))
    assert np.all(np.abs(values) <= 1.0 + 1e-12)
    assert shape == "flat" or np.ptp(values) > 0.9
    assert np.all(np.isfinite(evaluate_shape(shape, bed("aligned", 1, 1))))


# Scenes


def build(method: str, **known: Any) -> Any:
    """Return a behavior, put together for a bed of 5 x 5 cells."""
    return assemble(
        resolve({"layout": {"rows": 5, "columns": 5}, "control": {"method": method, **known}})
    ).controller


@pytest.mark.parametrize("method", BEHAVIORS)
def test_a_scene_names_the_behavior_and_reads_back_equal(method: str) -> None:
    scene = resolve({"control": {"method": method}})
    assert build(method).name == method
    assert METHODS[method].blister is None
    assert resolve(tomllib.loads(format_scene(scene))) == scene


WRONG = [
    ("elastic", {"stiffness": 0}, "stiffness must be above 0 N/m (got 0 N/m)."),
    ("plastic", {"yield_force": -0.1}, "yield_force must be above 0 N (got -0.1 N)."),
    ("plastic", {"yield_force": 1e-3}, "yield_force must be at least felt_force, 0.005 N (got 0.001 N)."),
    ("force_display", {"field": "ramp", "contrast": 0.95}, "0.005 N (got 0.0025 N at its smallest)."),
    ("force_display", {"field": "ramp", "force": 0.12}, "can press, 0.157 N (got 0.18 N at its largest)."),
    ("viscous", {"recovery": 1.0}, "Did you mean control.recovery_time?"),
    ("push_pull", {"following_speed": 1e-3}, "at least listening_speed, 0.008 m/s (got 0.001 m/s)."),
    ("push_pull", {"threshold": 20e-6}, "way in a control period, 4e-05 m (got 2e-05 m)."),
    ("shape_display", {"shape": "hat"}, "must be one of dome, "),
    ("shape_display", {"shape": "nowhere.npy"}, "(got nowhere.npy: No such file or directory)."),
    ("shape_display", {"refresh": "at_once"}, "refresh must be one of one_time, "),
    ("shape_display", {"amplitude": 70e-3}, "stroke, 0.1 m (got heights from 0.04 m to 0.11 m)."),
    ("elastic", {"settling_time": 5e-3}, "settling_time must be at least two control periods, 0.01 s (got"),
    ("elastic", {"damping": 1.0}, "damping must be at least 2.1 N s/m at this control period"),
]


@pytest.mark.parametrize(("method", "given", "said"), WRONG)
def test_a_bad_parameter_is_refused_in_one_line(method: str, given: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError, match=re.escape(said)) as caught:
        build(method, **given)
    assert str(caught.value).startswith("control.")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("array", "said"),
    [
        (np.zeros((4, 5)), "an array of the bed's 5 x 5 cells (got {}: 4 x 5)."),
        (np.full((5, 5), 0.2), "values from 0 to 0.1 m (got {}: 0.2 m)."),
        (np.full((5, 5), np.nan), "values from 0 to 0.1 m (got {}: nan m)."),
        (np.array([["a"] * 5] * 5), "one array of numbers (got {})."),
    ],
)
def test_a_file_that_does_not_fit_the_bed_is_refused(tmp_path: Path, array: Any, said: str) -> None:
    np.save(tmp_path / "mine.npy", array)
    with pytest.raises(ParameterError, match=re.escape(said.format(tmp_path / "mine.npy"))):
        build("shape_display", shape=str(tmp_path / "mine.npy"))
