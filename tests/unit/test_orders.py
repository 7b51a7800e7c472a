"""Pins in a disc are driven to smoothed heights: the bed gets even, keeps its volume, and stays elsewhere."""

from functools import cache

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.control.methods import METHODS
from digiclay.core.control.orders import (
    Orders,
    Verb,
    find_fault,
    order_periods,
    place,
    repeat_order,
    share,
)
from digiclay.core.control.pin_motion import MotionParameters
from digiclay.core.control.virtual_master import Master, Phase
from digiclay.core.engine.simulation import begin
from digiclay.core.model.layout import enclose_discs
from digiclay.core.model.physics import find_speeds
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.live_session import has_arrived, simulate_path
from numpy.testing import assert_array_equal

from tests.assemble import assert_near, table
from tests.measured import measure
from tests.reliefs import heighten, make_orders, make_spike_and_ridge, measure_roughness, stay_away

ARRANGEMENTS = ("aligned", "staggered", "hexagonal")
BAND = MotionParameters().dead_band
RADIUS = 10e-3
KEEP_HEIGHTS = ("virtual_master", "cell_states", "plastic", "push_pull")
STIFF = {"preset": "fast", "actuator": {"bore": 1e-3}}
#: A stroke between spike and ridge: both are in the disc.
STROKE = make_orders(100, -9e-3, 9e-3, -3e-3, RADIUS)


@cache
def bed(arrangement="aligned", method="virtual_master", size=13, period=5e-3, *, shape=False):
    layout = {"rows": size, "columns": size, "arrangement": arrangement}
    control = "absent" if method == "absent" else {"method": method}
    simulation = {"control_period": period}
    shown = {"shape": {"file": "crater"}} if shape else {}
    return assemble(
        resolve({"layout": layout, "control": control, "simulation": simulation, **shown})
    )


def rough(system):
    """Return the state of a bed with a spike and a ridge."""
    return heighten(system, make_spike_and_ridge(system.grid))


def go_on(system, state, count, orders=None):
    """Return the state after so many periods without a finger."""
    *_, state = simulate_path(system, state, stay_away(count), orders)
    return state


@pytest.mark.parametrize("verb", [Verb.SMOOTH, Verb.AVERAGE])
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_each_stroke_makes_a_spike_and_a_ridge_less_rough_and_keeps_the_volume(arrangement, verb):
    system = bed(arrangement)
    stroke = make_orders(100, -9e-3, 9e-3, -3e-3, RADIUS, verb=verb)
    state = rough(system)
    first = state.row(0)
    roughness = [measure_roughness(system.grid, first)]
    for _ in range(3):
        state = go_on(system, state, len(stroke), stroke)
        roughness.append(measure_roughness(system.grid, state.row(0)))
        # A pin stands within the dead band of its height; the heights' own sum does not change.
        assert abs((state.row(0) - first).sum()) <= BAND * first.size
        assert abs((state.row(system.rows.target) - first).sum()) < 1e-12
    assert max(roughness[1:]) < 0.45 * roughness[0]
    # A quick one leaves so little that its own rim shows.
    assert verb is Verb.SMOOTH or np.diff(roughness).max() < 0.0


@pytest.mark.parametrize(
    "period, swing, verb",
    [(5e-3, 1e-9, Verb.AVERAGE), (20e-3, BAND, Verb.AVERAGE), (5e-3, BAND, Verb.SMOOTH)],
)
def test_a_spike_sinks_without_swinging_no_faster_than_valves_let_it(period, swing, verb):
    system = bed(period=period)
    relief = make_spike_and_ridge(system.grid)
    state = heighten(system, relief)
    first, spike = state.row(0), int(relief.argmax())
    orders = make_orders(150, 0.0, 0.0, 0.0, RADIUS, 100, verb)
    heights = np.array(
        [one.row(0) for one in simulate_path(system, state, stay_away(len(orders)), orders)]
    )
    assert np.diff(heights[:, spike]).max() <= swing
    # No pin leaves the range of the others; all stand still before the wait is over.
    assert heights.min() >= first.min() - BAND
    assert heights.max() <= first.max() + BAND
    assert np.abs(heights[-20:] - heights[-1]).max() < 1e-9
    speed, limit = np.diff(heights, axis=0) / system.period, find_speeds(system.cell)
    assert speed.max() <= limit.rise * (1.0 + 1e-9)
    assert limit.fall * (1.0 + 1e-9) <= speed.min() < 0.45 * limit.fall


def test_pins_are_in_the_mode_blister_until_they_arrive_and_are_driven_home_by_the_method():
    system = bed(method="absent")
    rest = system.cell.actuator.rest_height
    state = heighten(system, np.where(system.grid.x < 0.0, 4e-3, 0.0))
    state = go_on(system, state, 20, make_orders(20, 0.0, 0.0, 0.0, RADIUS, 0))
    inside = np.hypot(system.grid.x, system.grid.y) < RADIUS - 1e-9
    assert_array_equal(state.mode() == Mode.BLISTER, inside)
    state = go_on(system, state, 60, make_orders(0, 0.0, 0.0, 0.0, RADIUS))
    formed = np.abs(state.row(system.rows.target) - rest) > BAND
    assert_array_equal(state.mode(), np.where(formed, Mode.HOLD, Mode.REST))
    system = bed()
    state = rough(system)
    state = go_on(system, state, 5, make_orders(5, 0.0, 0.0, 0.0, RADIUS, 0))
    target = state.row(system.rows.target)
    assert np.abs(state.row(0) - target).max() > 1e-3
    state = go_on(system, state, 300)
    # Method I comes to a height like 1/t.
    assert np.abs(state.row(0) - target).max() < 0.2e-3


def test_a_finger_at_work_elsewhere_stays_under_the_methods_control():
    system, ends = bed(size=21), []
    path = stay_away(80)
    path[:, 0, :3] = np.column_stack(
        [np.full(81, -15e-3), np.zeros(81), np.linspace(42e-3, 36e-3, 81)]
    )
    for radius in (0.0, 7e-3):
        relief = np.zeros(system.grid.count)
        relief[system.grid.at(np.array([18e-3]), np.array([18e-3]))] = 5e-3
        orders = Orders(repeat_order(80, Verb.AVERAGE, 18e-3, 18e-3, radius, 1.0))
        *_, state = simulate_path(system, heighten(system, relief), path, orders)
        ends.append(state.row(0))
    near = np.hypot(system.grid.x - 18e-3, system.grid.y - 18e-3) < 7e-3
    assert ends[0].min() < 38e-3
    # Sums over other cells round in another way.
    assert_near(ends[0][~near], ends[1][~near], 1e-12)
    assert (ends[0] - ends[1])[near].max() > 2e-3


@pytest.mark.parametrize("method", [*METHODS, "absent"])
def test_every_method_lets_its_pins_be_smoothed_and_keeps_them_if_it_keeps_heights(method):
    system = bed(method=method)
    state = rough(system)
    spike = int(state.row(0).argmax())
    before = float(state.row(0)[spike])
    state = go_on(system, state, 100, Orders(STROKE.rows[:100]))
    assert float(state.row(0)[spike]) < before - 5e-3
    state = go_on(system, state, 60, Orders(STROKE.rows[100:]))
    # The shape display goes on with its own shape elsewhere.
    near = np.hypot(system.grid.x, system.grid.y) < RADIUS
    assert method == "shape_display" or not (state.mode() == Mode.BLISTER)[near].any()
    if method in KEEP_HEIGHTS:
        smoothed = state.row(0)
        state = go_on(system, state, 100)
        assert np.abs(state.row(0) - smoothed).max() <= 2.0 * BAND


def test_periods_without_an_order_or_with_locks_that_are_gone_are_those_of_the_method_alone():
    system, path, ends = bed(), stay_away(120), set()
    path[:, 0, 2] = np.linspace(46e-3, 36e-3, 121)
    nothing = Orders(np.zeros((120, 5)))
    for before, orders in (
        ((None, None), None),
        ((None, None), nothing),
        ((lock(Verb.LOCK), lock(Verb.UNLOCK)), None),
    ):
        state = begin(system)
        for one in before:
            state = go_on(system, state, 1, one)
        *_, state = simulate_path(system, state._replace(period=64), path, orders)
        ends.add((state.row(0).tobytes(), state.mode().tobytes()))
    assert len(ends) == 1


def bumpy(system, lowest=-8e-3, highest=8e-3):
    """Return random heights for the pins of a disc about the middle, NaN elsewhere, (n,), m."""
    grid, rest = system.grid, system.cell.actuator.rest_height
    heights = rest + np.random.default_rng(1).uniform(lowest, highest, grid.count)
    return np.where(np.hypot(grid.x, grid.y) < 12e-3, heights, np.nan)


def place_until_arrived(system, state, surface, patience=2.0):
    count = round(patience / system.period)
    for after in simulate_path(system, state, stay_away(count), place(count, surface)):
        if has_arrived(after):
            return after
    raise AssertionError("pins have not arrived")


@pytest.mark.parametrize("method", [*METHODS, "absent"])
def test_pins_are_placed_within_a_micrometer_and_stay_there_whatever_the_method(method):
    system = bed(method=method)
    surface = bumpy(system)
    driven, state = ~np.isnan(surface), begin(system)
    state = place_until_arrived(system, state, surface)
    assert np.abs(state.row(0) - surface)[driven].max() < 1e-6
    if method not in ("viscous", "shape_display"):
        assert np.abs(state.row(0) - system.cell.actuator.rest_height)[~driven].max() == 0.0
    if method in (*KEEP_HEIGHTS, "absent"):
        state = go_on(system, state, 60)
        assert np.abs(state.row(0) - surface)[driven].max() < 1e-6
        assert set(np.unique(state.mode()[driven])) <= {Mode.REST, Mode.HOLD}


@table(
    "table, longest, error, swing",
    {
        "paper": ({}, 0.4, 1e-6, 0.1e-6),
        "pins four times as fast": (STIFF, 0.15, 1e-6, 0.5e-6),
        "slow control": ({"simulation": {"control_period": 20e-3}}, 0.6, 1e-6, 0.5e-6),
        "dead time": ({"delay": {"dead_time": 20e-3}}, 0.6, 1e-6, 0.5e-6),
        "slow valve": ({"valve_lag": {"time_constant": 50e-3}}, 1.1, 1e-6, 4e-6),
        "ideal valve": ({"valve_lag": "absent", "delay": "absent"}, 0.4, 1e-6, 0.5e-6),
        "late readings": ({"sensors": {"delay": 4}}, 0.6, 1e-6, 0.5e-6),
        "noisy readings": ({"sensors": {"height_noise": 5e-6}}, 0.4, 25e-6, 5e-6),
    },
)
def test_placed_pins_come_fast_and_do_not_swing_behind_any_valve(table, longest, error, swing):
    system = assemble(resolve({"layout": {"rows": 13, "columns": 13}, **table}))
    surface, state = bumpy(system), begin(system)
    driven = ~np.isnan(surface)
    way, beyond = np.sign(surface - state.row(0))[driven], 0.0
    count = round(longest / system.period)
    for after in simulate_path(system, state, stay_away(count), place(count, surface)):
        beyond = max(beyond, float(((after.row(0) - surface)[driven] * way).max()))
    assert has_arrived(after)
    assert np.abs(after.row(0) - surface)[driven].max() < error
    assert beyond < swing


def test_a_pin_under_a_finger_that_is_too_strong_is_waited_for_and_holds_up_no_other():
    system = bed()
    surface, path = bumpy(system, 4e-3, 8e-3), stay_away(200)
    path[:, 0, 2] = 36e-3
    *_, state = simulate_path(system, begin(system), path, place(200, surface))
    moving = state.mode() == Mode.BLISTER
    assert moving.any()
    arrived = ~np.isnan(surface) & ~moving
    assert np.abs(state.row(0) - surface)[arrived].max() < 1e-6
    assert arrived.sum() > 10


def lock(verb, x=0.0, radius=7e-3):
    return Orders(repeat_order(1, verb, x, 0.0, radius))


@pytest.mark.parametrize(
    "method, shape",
    [*((method, False) for method in METHODS), ("virtual_master", True), ("absent", True)],
)
def test_a_locked_pin_stays_whatever_the_method_and_orders_command(method, shape):
    if shape:
        pytest.importorskip("PIL.Image", reason="the shape is a picture")
    system = bed(method=method, shape=shape)
    path = stay_away(160)
    path[:, 0, 2] = np.concatenate([np.linspace(46e-3, 36e-3, 81), np.linspace(36e-3, 60e-3, 80)])
    path[40:, 0, 0] = np.linspace(-9e-3, 9e-3, 121)
    state = go_on(system, begin(system), 1, lock(Verb.LOCK))
    locked = np.hypot(system.grid.x, system.grid.y) <= 7e-3
    assert_array_equal(state.mode() == Mode.LOCKED, locked)
    before = state.row(0)
    everywhere = np.full(system.grid.count, 45e-3)
    orders = Orders(
        np.concatenate(
            [
                repeat_order(80, Verb.SMOOTH, radius=20e-3, strength=1.0),
                repeat_order(40, Verb.ERASE, radius=20e-3, strength=1.0),
                repeat_order(40, Verb.PLACE),
            ]
        ),
        (everywhere,),
    )
    for part in (None, orders):
        *_, state = simulate_path(system, state, path, part)
        assert_array_equal(state.row(0)[locked], before[locked])
        assert_array_equal(state.mode() == Mode.LOCKED, locked)
    state = go_on(system, state, 1, lock(Verb.UNLOCK))
    assert not (state.mode() == Mode.LOCKED).any()
    assert np.abs(place_until_arrived(system, state, everywhere).row(0) - 45e-3).max() < 1e-6


def test_a_pin_locked_on_its_way_stops_there_and_stays_there_when_it_is_unlocked():
    system = bed()
    surface = np.full(system.grid.count, 48e-3)
    state = go_on(system, begin(system), 12, place(12, surface))
    state = go_on(system, state, 10, Orders(repeat_order(10, Verb.LOCK, radius=7e-3)))
    stopped = state.row(0)
    middle = int(system.grid.at(np.zeros(1), np.zeros(1))[0])
    assert 40.1e-3 < stopped[middle] < 47e-3
    state = go_on(system, state, 1, lock(Verb.UNLOCK))
    state = go_on(system, state, 200)
    assert abs(state.row(0)[middle] - stopped[middle]) <= BAND
    assert abs(state.row(0)[0] - 48e-3) < 0.2e-3


#: Rows of orders: x, y and radius, m, strength and verb.
FAULTY = [
    "nan 0 1e-2 1 0",
    "0 inf 1e-2 1 0",
    "0 0 -1e-2 1 0",
    "0 0 1e-9 1 0",
    "0 0 1e9 1 0",
    "0 0 1e-2 101 0",
    "0 0 1e-2 -0.1 0",
    "0 0 1e-2 1 0.5",
    "0 0 1e-2 1 8",
    "0 0 1e-2 1 -1",
    f"1 0 0 0 {Verb.PLACE:d}",
    f"-1 0 0 0 {Verb.PLACE:d}",
    f"0.5 0 0 0 {Verb.PLACE:d}",
    f"nan 0 0 0 {Verb.PLACE:d}",
    f"1 0 1e3 0 {Verb.SHARE:d}",
    f"0.5 0 1e3 0 {Verb.SHARE:d}",
]
SOUND = [
    f"0 0 0 0 {Verb.PLACE:d}",
    "0 0 1e-6 0 0",
    f"1e3 -1e3 1e3 100 {Verb.INVERT:d}",
    "0 0 0 0 0",
]


def fault_in(rows):
    """Return what is wrong with orders for three periods of nine pins of 80 mm."""
    return find_fault(Orders(rows, (np.full(9, 40e-3),)), 3, 9, 80e-3)


@pytest.mark.parametrize("order", [*FAULTY, *SOUND])
def test_an_order_out_of_its_range_is_found(order):
    rows = np.zeros((3, 5))
    rows[1] = order.split()
    assert fault_in(rows).startswith("row 1 is [" if order in FAULTY else "")
    assert bool(fault_in(rows)) == (order in FAULTY)


@pytest.mark.parametrize("wrong", [np.nan, -0.1, 1.1, np.inf])
def test_shares_of_locks_are_from_0_to_1(wrong):
    orders = share(np.linspace(0.0, 1.0, 9))
    assert find_fault(orders, 1, 9, 80e-3) == ""
    orders.surfaces[0][3] = wrong
    assert find_fault(orders, 1, 9, 80e-3) == "surface 0 has shares that are not from 0 to 1"


@pytest.mark.parametrize("shape", [(0, 5), (2, 5), (3, 4), (15,)])
def test_orders_of_another_shape_are_found(shape):
    assert fault_in(np.zeros(shape)) == f"an array of the shape {shape} of float64"


@pytest.mark.parametrize("ridge", [0.0, 6e-3])
@table(
    "pitch, radius, wave",
    {
        "paper, random": (3e-3, 8e-3, 0.0),
        "paper, 6 mm": (3e-3, 8e-3, 6e-3),
        "design, 3 mm": (1.5e-3, 4e-3, 3e-3),
        "fine, random": (1e-3, 8e-3 / 3.0, 0.0),
    },
)
def test_one_quick_pass_of_smooth_halves_what_varies_on_flat_ground_and_on_a_ridge(
    pitch, radius, wave, ridge
):
    layout = {"rows": 17, "columns": 41, "pitch": pitch}
    bore = {"bore": min(2e-3, pitch)}
    system = assemble(resolve({"layout": layout, "control": "absent", "actuator": bore}))
    x, y = system.grid.x, system.grid.y
    varied = np.random.default_rng(1).uniform(-1e-3, 1e-3, x.size)
    if wave:
        varied = 1e-3 * np.sin(2.0 * np.pi * x / wave + 0.7)
    end, count = 18.0 * pitch, round(36.0 * pitch / (0.1 * system.period))
    state = heighten(system, varied + ridge * np.exp(-((y / (0.75 * radius)) ** 2)))
    line = (np.abs(y) < 0.5 * pitch) & (np.abs(x) < 12.0 * pitch)
    before = float(state.row(0)[line].std())
    orders = make_orders(count, -end, end, 0.0, radius, verb=Verb.SMOOTH)
    state = go_on(system, state, len(orders), orders)
    assert float(state.row(0)[line].std()) < 0.5 * before


@table(
    "other, held",
    {
        "apart": ((12e-3, -9e-3, 5e-3), None),
        "within": ((1e-3, 2e-3, 5e-3), 0),
        "around": ((-3e-3, 1e-3, 60e-3), 1),
    },
)
def test_a_disc_that_holds_two_is_no_larger_than_it_must_be(other, held):
    both = (2e-3, -1e-3, 15e-3), other
    x, y, whole = enclose_discs(*both)
    for disc in both:
        assert np.hypot(disc[0] - x, disc[1] - y) + disc[2] <= whole * (1.0 + 1e-12)
    (a, b, radius), (c, d, another) = both
    least = (np.hypot(a - c, b - d) + radius + another) / 2.0
    assert whole == pytest.approx(least if held is None else both[held][2])


def test_the_disc_of_a_period_holds_that_of_the_method_too():
    system, memory = bed(), Master(Phase.SHAPING, 2e-3, -1e-3, 40e-3)
    orders = Orders(repeat_order(1, Verb.AVERAGE, 12e-3, -9e-3, 5e-3, 1.0))
    (control,) = order_periods(system.controller, system.grid, system.cell, system.period, orders)
    untouched = measure(*np.empty((2, 0)))
    (x, y, radius), (at_x, at_y, inner) = (
        each.locate(memory, untouched)[1] for each in (control, system.controller)
    )
    assert np.hypot(x - at_x, y - at_y) + inner <= radius * (1.0 + 1e-12)
