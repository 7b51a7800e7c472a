"""The behaviors' laws, on measurements handed to them: what each commands, remembers and refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.model.control_interface import Commands, Measurement
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve

BEHAVIORS = ("elastic", "plastic", "viscous", "push_pull", "force_display", "shape_display")
REST = 40e-3
#: Speed of a free pin at full valve without a conduit, m/s, two digits.
FREE = 24e-3


def control(method: str, **known: Any) -> Any:
    """Return a behavior, put together for a bed of 5 x 5 cells, without conduits."""
    table = {
        "layout": {"rows": 5, "columns": 5},
        "conduit": "absent",
        "control": {"method": method, **known},
    }
    return assemble(resolve(table)).controller


def seen(behavior: Any, height: Any = 0.0, force: Any = 0.0, target: Any = 0.0, mode: int = 0) -> Measurement:
    """Return a measurement of the whole 5 x 5 bed: heights above rest in mm, forces in mN."""
    x, y = np.tile((np.arange(5) - 2.0) * 3e-3, 5), np.repeat((np.arange(5) - 2.0) * 3e-3, 5)
    full = np.zeros(25)
    return Measurement(
        np.array([full + 1.0, x, y, x * x, x * y, y * y]),
        REST + (full + height) * 1e-3,
        (full + force) * 1e-3,
        REST + (full + target) * 1e-3,
        np.full(25, mode, np.int8),
        np.zeros((behavior.rows, 25)),
        np.arange(25),
    )


def middle(value: float) -> np.ndarray:
    """Return a row of the bed that is 0 but in the middle."""
    return np.where(np.arange(25) == 12, value, 0.0)


def orders(behavior: Any, measurement: Measurement) -> Commands:
    """Return what a behavior makes of a first measurement."""
    memory, _ = behavior.locate(behavior.begin(), measurement)
    return behavior.command(memory, measurement)[1]


def speeds(behavior: Any, command: np.ndarray) -> np.ndarray:
    """Return the speed of a pin without load under some commands: opening squared times the free speed."""
    return np.sign(command) * command**2 * behavior.drive.up[-1]


# All of them


@pytest.mark.parametrize("method", BEHAVIORS)
def test_commands_are_openings(method: str) -> None:
    behavior = control(method)
    chance = np.random.default_rng(1)
    wild = seen(
        behavior, chance.uniform(-40, 60, 25), chance.uniform(0, 500, 25), chance.uniform(-40, 60, 25)
    )
    command = orders(behavior, wild).command
    assert np.all(np.abs(command) <= 1.0)


@pytest.mark.parametrize("method", [m for m in BEHAVIORS if m != "shape_display"])
def test_an_untouched_bed_at_rest_is_left_alone(method: str) -> None:
    behavior = control(method)
    untouched = seen(behavior)
    nobody = Measurement(
        *(values[..., :0] for values in untouched[:-1])
    )  # all but the number of present cells
    memory, disc = behavior.locate(behavior.begin(), nobody)
    given = behavior.command(memory, untouched)[1]
    assert disc is None
    assert not given.command.any()
    assert set(given.mode.tolist()) == {int(Mode.REST)}


@pytest.mark.parametrize("method", ["elastic", "plastic", "viscous", "force_display", "shape_display"])
def test_a_cell_pressed_harder_than_its_reservoir_lifts_is_not_opened_to_it(method: str) -> None:
    # 0.157 N is what 0.5 bar lifts; opening to it would let the pin sink.
    behavior = control(method)
    given = orders(behavior, seen(behavior, height=-10.0, force=160.0, target=0.0))
    assert np.all(given.command <= 0.0)


@pytest.mark.parametrize("method", ["elastic", "plastic", "viscous", "force_display"])
@pytest.mark.parametrize(("force", "touched"), [(4.9, False), (5.1, True)])
def test_a_cell_is_touched_from_the_felt_force_on(method: str, force: float, touched: bool) -> None:
    behavior = control(method, felt_force=5e-3)
    assert (orders(behavior, seen(behavior, force=force)).mode[0] > Mode.HOLD) == touched


# Elastic


def test_an_elastic_cell_is_at_rest_where_spring_and_force_balance() -> None:
    behavior = control("elastic", stiffness=20.0)
    # 20 N/m x 3 mm = 60 mN; rounding only.
    assert orders(behavior, seen(behavior, height=-3.0, force=60.0)).command == pytest.approx(0.0, abs=1e-6)


def test_an_elastic_cell_moves_by_force_over_damping() -> None:
    behavior = control("elastic", stiffness=20.0, damping=5.0)
    given = orders(behavior, seen(behavior, height=-1.0, force=60.0)).command
    # (20 N/m x 1 mm - 60 mN) / 5 N s/m; between 129 openings the speed is off by up to 1/4 of a step squared.
    assert speeds(behavior, given) == pytest.approx(-8e-3, abs=2e-5 * FREE)


@pytest.mark.parametrize(("mode", "after"), [(Mode.REST, Mode.REST), (Mode.SPRING, Mode.SPRING)])
def test_an_elastic_cell_once_touched_stays_touched_by_less_force(mode: Mode, after: Mode) -> None:
    behavior = control("elastic", felt_force=5e-3)
    assert orders(behavior, seen(behavior, force=2.0, mode=mode)).mode[0] == after


# Plastic


def test_a_plastic_cell_pressed_below_yield_does_not_move() -> None:
    behavior = control("plastic", yield_force=0.03)
    assert not orders(behavior, seen(behavior, force=29.0)).command.any()


def test_a_plastic_cell_sinks_by_the_force_above_yield() -> None:
    behavior = control("plastic", yield_force=0.03, damping=5.0)
    given = orders(behavior, seen(behavior, force=50.0)).command
    assert speeds(behavior, given) == pytest.approx(-4e-3, abs=2e-5 * FREE)  # interpolation, as above


def test_a_plastic_cell_keeps_the_height_it_yielded_to() -> None:
    behavior = control("plastic")
    assert orders(behavior, seen(behavior, height=-2.0, force=50.0)).target == pytest.approx(REST - 2e-3)


def test_a_plastic_cell_never_forgets_a_deeper_press() -> None:
    behavior = control("plastic")
    given = orders(behavior, seen(behavior, height=-1.0, force=50.0, target=-2.0))
    assert given.target == pytest.approx(REST - 2e-3)


def test_a_plastic_cell_does_not_push_the_finger_back() -> None:
    behavior = control("plastic")
    given = orders(behavior, seen(behavior, height=-2.0, force=10.0, target=-1.9))
    assert not given.command.any()


def test_a_plastic_cell_left_alone_goes_back_to_where_it_yielded() -> None:
    behavior = control("plastic")
    assert np.all(orders(behavior, seen(behavior, height=-2.0, target=-1.9)).command > 0.0)


# Viscous


def test_the_exchange_with_neighbors_keeps_the_sum() -> None:
    behavior = control("viscous", recovery_time=1e6)
    given = orders(behavior, seen(behavior, target=middle(-5.0)))
    # 5 mm go over; rounding, and 5 ms of 1e6 s.
    assert (given.target - REST).sum() == pytest.approx(-5e-3, rel=1e-8)


def test_the_neighbors_of_a_dent_are_drawn_along() -> None:
    behavior = control("viscous")
    sunk = np.flatnonzero(orders(behavior, seen(behavior, target=middle(-5.0))).target < REST - 1e-6)
    assert sunk.tolist() == [7, 11, 12, 13, 17]


def test_cells_drawn_along_by_a_pressed_neighbor_show_it() -> None:
    behavior = control("viscous")
    given = orders(behavior, seen(behavior, target=middle(-5.0), force=middle(20.0)))
    assert np.flatnonzero(given.mode == Mode.BLISTER).tolist() == [7, 11, 13, 17]


def test_without_diffusivity_a_dent_stays_among_itself() -> None:
    behavior = control("viscous", diffusivity=0.0)
    sunk = np.flatnonzero(orders(behavior, seen(behavior, target=middle(-5.0))).target < REST)
    assert sunk.tolist() == [12]


def test_a_viscous_cell_relaxes_exactly_over_a_period() -> None:
    behavior = control("viscous", diffusivity=0.0, damping=10.0, recovery_time=0.5)
    given = orders(behavior, seen(behavior, force=50.0, target=-4.0)).target - REST
    # u' = -F/c - u/τ from -4 mm: equilibrium -F τ/c = -2.5 mm, reached with exp(-T/τ). Rounding.
    assert given == pytest.approx(-2.5e-3 - 1.5e-3 * np.exp(-0.01), rel=1e-12)


def test_the_cells_asked_for_hold_all_displaced_ones() -> None:
    behavior = control("viscous")
    dent = seen(behavior, target=middle(-5.0), force=middle(20.0))
    memory, _ = behavior.locate(behavior.begin(), dent)
    memory, _ = behavior.command(memory, dent)
    _, (x, y, radius) = behavior.locate(memory, dent)
    # The four neighbors, 3 mm away, in a box of 6 x 6 mm, and a margin of two pitches.
    assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert radius == pytest.approx(np.hypot(3e-3, 3e-3) + 6e-3)


# Push and pull


def cycle(behavior: Any, measurement: Measurement) -> Commands:
    """Return the orders at the end of a cycle of listening."""
    memory = behavior.begin()
    for _ in range(2):
        memory, _ = behavior.locate(memory, measurement)
        memory, given = behavior.command(memory, measurement)
    return given


def test_push_pull_never_reads_the_force() -> None:
    behavior = control("push_pull")
    blind = seen(behavior, height=middle(-0.5), force=np.nan)
    given = cycle(behavior, blind)
    for row in (given.target, given.command, blind.own):
        assert np.all(np.isfinite(row))
    assert np.flatnonzero(given.mode == Mode.FORCE_FOLLOW).tolist() == [12]


@pytest.mark.parametrize(("drift", "touched"), [(-0.09, False), (-0.11, True), (0.09, False), (0.11, True)])
def test_a_touch_is_a_drift_beyond_the_threshold_either_way(drift: float, touched: bool) -> None:
    behavior = control("push_pull", threshold=0.1e-3)
    given = cycle(behavior, seen(behavior, height=middle(drift)))
    assert (given.mode[12] == Mode.FORCE_FOLLOW) == touched


@pytest.mark.parametrize("drift", [-0.5, 0.5])
def test_a_pin_pushed_or_pulled_takes_its_commanded_height_along(drift: float) -> None:
    behavior = control("push_pull", threshold=0.1e-3)
    given = cycle(behavior, seen(behavior, height=middle(drift)))
    assert given.target[12] - REST == pytest.approx(np.sign(drift) * 0.4e-3)  # all but the threshold


def test_a_pin_let_go_stays_where_it_was_let_go() -> None:
    behavior = control("push_pull", release_time=0.02)
    still = seen(behavior, height=middle(-0.5))
    memory, target = behavior.begin(), still.target
    for _ in range(12):
        now = still._replace(target=target)
        memory, _ = behavior.locate(memory, now)
        memory, given = behavior.command(memory, now)
        target = given.target
    assert target[12] == pytest.approx(REST - 0.5e-3)
    assert given.mode[12] == Mode.HOLD


def test_a_listening_pin_goes_down_as_fast_as_up() -> None:
    behavior = control("push_pull")
    up = cycle(behavior, seen(behavior)).command
    down = orders(behavior, seen(behavior)).command
    assert np.all(up > 0.0)
    assert np.array_equal(up, -down)  # the reservoirs are alike


def test_a_listening_pin_s_speeds_are_alike_under_unlike_reservoirs() -> None:
    table = {"supply": {"high": 0.8e5, "low": -0.2e5}, "control": {"method": "push_pull"}}
    drive = assemble(resolve(table)).controller.drive
    up, down = drive.open_for(np.array([8e-3, -8e-3]))
    # Flow goes with the square of the opening and the pressure: 4 times the pressure, half the opening.
    # The conduit and the table's interpolation change it by some percent.
    assert -down / up == pytest.approx(2.0, rel=0.05)


# Force display


def test_a_force_display_cell_is_at_rest_under_the_force_of_the_field() -> None:
    behavior = control("force_display", field="flat", force=0.05)
    given = orders(behavior, seen(behavior, height=-2.0, force=50.0)).command
    assert given == pytest.approx(0.0, abs=1e-6)


def test_a_named_field_varies_by_the_contrast() -> None:
    field = control("force_display", field="ramp", force=0.05, contrast=0.4).field
    assert (field.min(), field.max()) == pytest.approx((0.03, 0.07))


def test_a_cell_of_the_force_display_rises_to_its_limit_at_most() -> None:
    behavior = control("force_display", rise=1e-3)
    given = orders(behavior, seen(behavior, height=1.1, force=10.0)).command
    assert np.all(given < 0.0)
