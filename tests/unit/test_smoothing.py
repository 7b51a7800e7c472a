"""Pins in a disc are driven to smoothed heights: the bed gets even, keeps its volume, and stays elsewhere."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.control.drive import DriveParameters
from digiclay.core.control.methods import METHODS
from digiclay.core.control.smoothing import find_fault, order_periods
from digiclay.core.control.virtual_master import Master, Phase
from digiclay.core.engine.system import System
from digiclay.core.model.control_interface import Controller, Measurement
from digiclay.core.model.physics import find_speeds
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import snapshot
from digiclay.core.session.live_session import simulate_path

from tests.reliefs import heighten, make_orders, make_spike_and_ridge, measure_roughness, stay_away

ARRANGEMENTS = ("aligned", "staggered", "hexagonal")
BAND = DriveParameters().dead_band
RADIUS = 10e-3
#: A stroke between spike and ridge: both are in the disc.
STROKE = make_orders(100, -9e-3, 9e-3, -3e-3, RADIUS)


@cache
def bed(
    arrangement: str = "aligned", method: str = "virtual_master", size: int = 13, period: float = 5e-3
) -> System:
    """Return a small bed."""
    layout = {"rows": size, "columns": size, "arrangement": arrangement}
    control: object = "absent" if method == "absent" else {"method": method}
    simulation = {"control_period": period}
    return assemble(resolve({"layout": layout, "control": control, "simulation": simulation}))


def order(system: System, x: float, y: float, radius: float) -> Controller:
    """Return the controller of a period in which a disc is smoothed, m."""
    row = np.array([[x, y, radius, 1.0]])
    (control,) = order_periods(system.controller, system.grid, system.cell, system.period, row)
    assert control is not None
    return control


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_each_stroke_makes_a_spike_and_a_ridge_less_rough_and_keeps_the_volume(arrangement: str) -> None:
    system = bed(arrangement)
    state = heighten(system, make_spike_and_ridge(system.grid))
    first = state.row(0)
    rough = [measure_roughness(system.grid, first)]
    for _ in range(3):
        *_, state = simulate_path(system, state, stay_away(len(STROKE)), STROKE)
        rough.append(measure_roughness(system.grid, state.row(0)))
        # A pin stands within the dead band of its height; the heights' own sum does not change.
        assert abs((state.row(0) - first).sum()) <= BAND * first.size
        assert abs((state.row(system.rows.target) - first).sum()) < 1e-12
    assert rough[1] < 0.4 * rough[0]
    assert np.diff(rough).max() < 0.0


@pytest.mark.parametrize(("period", "swing"), [(5e-3, 1e-9), (20e-3, BAND)])
def test_a_spike_sinks_without_swinging_no_faster_than_valves_let_it(period: float, swing: float) -> None:
    system = bed(period=period)
    relief = make_spike_and_ridge(system.grid)
    state = heighten(system, relief)
    first, spike = state.row(0), int(relief.argmax())
    orders = make_orders(150, 0.0, 0.0, 0.0, RADIUS, 100)
    heights = np.array([one.row(0) for one in simulate_path(system, state, stay_away(len(orders)), orders)])
    assert np.diff(heights[:, spike]).max() <= swing
    # No pin leaves the range of the others; all stand still before the wait is over.
    assert heights.min() >= first.min() - BAND
    assert heights.max() <= first.max() + BAND
    assert np.abs(heights[-20:] - heights[-1]).max() < 1e-9
    speed, limit = np.diff(heights, axis=0) / system.period, find_speeds(system.cell)
    assert speed.max() <= limit.rise * (1.0 + 1e-9)
    assert limit.fall * (1.0 + 1e-9) <= speed.min() < 0.5 * limit.fall


def test_pins_are_in_the_mode_blister_until_they_have_arrived_and_then_hold_or_rest() -> None:
    system = bed(method="absent")
    rest = system.cell.actuator.rest_height
    state = heighten(system, np.where(system.grid.x < 0.0, 4e-3, 0.0))
    *_, state = simulate_path(system, state, stay_away(20), make_orders(20, 0.0, 0.0, 0.0, RADIUS, 0))
    inside = np.hypot(system.grid.x, system.grid.y) < RADIUS - 1e-9
    np.testing.assert_array_equal(state.mode() == Mode.BLISTER, inside)
    *_, state = simulate_path(system, state, stay_away(60), make_orders(0, 0.0, 0.0, 0.0, RADIUS))
    formed = np.abs(state.row(system.rows.target) - rest) > BAND
    np.testing.assert_array_equal(state.mode(), np.where(formed, Mode.HOLD, Mode.REST))


def test_a_finger_at_work_elsewhere_stays_under_the_methods_control() -> None:
    system, ends = bed(size=21), []
    path = stay_away(80)
    path[:, 0, :3] = np.column_stack([np.full(81, -15e-3), np.zeros(81), np.linspace(42e-3, 36e-3, 81)])
    for radius in (0.0, 7e-3):
        relief = np.zeros(system.grid.count)
        relief[system.grid.at(np.array([18e-3]), np.array([18e-3]))] = 5e-3
        orders = np.tile([18e-3, 18e-3, radius, 1.0], (80, 1))
        *_, state = simulate_path(system, heighten(system, relief), path, orders)
        ends.append(state.row(0))
    near = np.hypot(system.grid.x - 18e-3, system.grid.y - 18e-3) < 7e-3
    assert ends[0].min() < 38e-3
    # Sums over other cells round in another way.
    np.testing.assert_allclose(ends[0][~near], ends[1][~near], rtol=0, atol=1e-12)
    assert (ends[0] - ends[1])[near].max() > 2e-3


@pytest.mark.parametrize(
    ("place", "radius", "held"),
    [((12e-3, -9e-3), 5e-3, None), ((1e-3, 2e-3), 5e-3, 0), ((-3e-3, 1e-3), 60e-3, 1)],
)
def test_the_disc_of_a_period_holds_the_methods_and_the_smoothed_one_and_no_more(place, radius, held):
    system, memory = bed(), Master(Phase.SHAPING, 2e-3, -1e-3, 40e-3)
    cells, none = np.empty(0, np.intp), np.empty(0)
    basis, own = system.grid.compute_basis(cells), np.empty((0, 0))
    touched = Measurement(basis, none, none, none, np.empty(0, np.int8), own, cells)
    smoothed = order(bed(method="absent"), *place, radius)
    discs = [system.controller.locate(memory, touched)[1], smoothed.locate(None, touched)[1]]
    x, y, whole = order(system, *place, radius).locate(memory, touched)[1]
    for disc in discs:
        assert np.hypot(disc[0] - x, disc[1] - y) + disc[2] <= whole * (1.0 + 1e-12)
    (a, b, one), (c, d, other) = discs
    least = (np.hypot(a - c, b - d) + one + other) / 2.0
    assert whole == pytest.approx(least if held is None else (one, other)[held])


@pytest.mark.parametrize("method", [*METHODS, "absent"])
def test_every_method_lets_its_pins_be_smoothed_and_keeps_them_if_it_keeps_heights(method: str) -> None:
    system = bed(method=method)
    state = heighten(system, make_spike_and_ridge(system.grid))
    spike = int(state.row(0).argmax())
    before = float(state.row(0)[spike])
    *_, state = simulate_path(system, state, stay_away(100), STROKE[:100])
    assert float(state.row(0)[spike]) < before - 5e-3
    *_, state = simulate_path(system, state, stay_away(60), STROKE[100:])
    # The shape display goes on with its own shape elsewhere.
    near = np.hypot(system.grid.x, system.grid.y) < RADIUS
    assert method == "shape_display" or not (state.mode() == Mode.BLISTER)[near].any()
    if method in ("virtual_master", "cell_states", "plastic", "push_pull"):
        smoothed = state.row(0)
        *_, state = simulate_path(system, state, stay_away(100))
        assert np.abs(state.row(0) - smoothed).max() <= 2.0 * BAND


def test_pins_that_a_stroke_leaves_in_motion_are_driven_home_by_the_method() -> None:
    system = bed()
    state = heighten(system, make_spike_and_ridge(system.grid))
    *_, state = simulate_path(system, state, stay_away(5), make_orders(5, 0.0, 0.0, 0.0, RADIUS, 0))
    target = state.row(system.rows.target)
    assert np.abs(state.row(0) - target).max() > 1e-3
    *_, state = simulate_path(system, state, stay_away(300))
    # Method I comes to a height like 1/t.
    assert np.abs(state.row(0) - target).max() < 0.2e-3


def test_periods_without_an_order_are_those_of_the_method_alone() -> None:
    system, ends = bed(), []
    for orders in (None, np.zeros((60, 4))):
        path = stay_away(60)
        path[:, 0, 2] = np.linspace(44e-3, 36e-3, 61)
        *_, state = simulate_path(system, heighten(system, np.zeros(system.grid.count)), path, orders)
        ends.append(snapshot.dump(system, state))
    assert ends[0] == ends[1]


@pytest.mark.parametrize(
    ("order", "sound"),
    [((np.nan, 0.0, 1e-2, 1.0), False), ((0.0, np.inf, 1e-2, 1.0), False), ((0.0, 0.0, -1e-2, 1.0), False),
     ((0.0, 0.0, 1e-9, 1.0), False), ((0.0, 0.0, 1e9, 1.0), False), ((0.0, 0.0, 1e-2, 1.1), False),
     ((0.0, 0.0, 1e-2, -0.1), False), ((0.0, 0.0, 1e-6, 0.0), True), ((1e3, -1e3, 1e3, 1.0), True),
     ((0.0, 0.0, 0.0, 0.0), True)],
)  # fmt: skip
def test_an_order_out_of_its_range_and_orders_of_another_shape_are_found(order, sound):
    orders = np.zeros((3, 4))
    orders[1] = order
    assert find_fault(orders, 3) == "" if sound else find_fault(orders, 3).startswith("row 1 is [")
    for shape in ((0, 4), (2, 4), (3, 5), (12,)):
        assert find_fault(np.zeros(shape), 3) == f"an array of the shape {shape} of float64"
