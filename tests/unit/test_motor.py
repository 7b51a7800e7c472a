"""Motor pins: v = v0 (K - F/F_stall), back-drivable or braked, against SciPy, alone and in batches."""

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.errors import DigiclayError
from digiclay.core.base.modes import Mode
from digiclay.core.batch.run_together import run_together
from digiclay.core.control.device_info import DeviceInfo
from digiclay.core.control.orders import Orders, Verb, repeat_order
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.model.laws import law_parameters
from digiclay.core.model.physics import find_speeds
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import format_scene, resolve
from digiclay.core.session.live_session import simulate_path
from digiclay.core.session.run_scene import run
from scipy.integrate import solve_ivp

from digiclay_fit.cell import CellModel
from digiclay_fit.records import Trial
from tests.assemble import (
    AWAY,
    Motion,
    assert_near,
    one_cell,
    over_middle,
    path,
    record,
    refused_in_a_line,
    scripted,
    table,
)

STALL, FREE, LAG, PERIOD = 1.0, 24e-3, 2e-3, 5e-3
COMMANDS = [0.2 + 0.3 * math.sin(0.3 * i) if i % 9 else 0.0 for i in range(40)]
MOVING = Motion(lambda t: 39.1e-3 - 0.5e-3 * np.sin(20.0 * t))
B, M, SHARE = 250.0, 2000.0, 0.34
RATES = 1.0 / np.array([4e-3, 70e-3, 1.4])
WEIGHTS = np.array([0.62, 0.20, 0.10])


def motor(hold="back_drivable", **known):
    given = {"stall_force": STALL, "free_speed": FREE, **known}
    return {"valve": law_parameters("valve")(law="motor", hold=hold, **given), "conduit": None}


def integrate(hold):
    """Return heights, m, and forces, N, at the ends of the periods, by the equations as they are written."""

    def feel(t, height, filters):
        depth = height - float(MOVING.height(np.array([t]))[0])
        pull = B / M * math.expm1(M * max(depth, 0.0))
        return pull, SHARE * max(pull - float(WEIGHTS @ filters), 0.0)

    def rate(t, y, command):
        pull, force = feel(t, y[0], y[2:])
        slope = 1.0 if hold == "back_drivable" else abs(y[1])
        speed = FREE * (y[1] - slope * force / STALL)
        return [speed, (command - y[1]) / LAG, *(RATES * (pull - y[2:]))]

    y, rows = np.array([40e-3, 0.0, 0.0, 0.0, 0.0]), []
    for number, command in enumerate(COMMANDS):
        span = number * PERIOD, (number + 1) * PERIOD
        done = solve_ivp(rate, span, y, "DOP853", args=(command,), rtol=1e-10, atol=1e-12)
        y = done.y[:, -1]
        rows.append((y[0], feel(span[1], y[0], y[2:])[1]))
    return np.array(rows).T


@pytest.mark.parametrize("hold", ["back_drivable", "braked"])
@pytest.mark.parametrize("stepper", ["bernoulli", "runge_kutta_4", "richardson", "adaptive"])
def test_heights_and_forces_are_scipy_s_within_3_um_and_3_mn_at_5_ms(hold, stepper):
    # Runge-Kutta 4 is not stable at 5 ms: the pulp's pole is 600 1/s.
    step = 0.5e-3 if stepper == "runge_kutta_4" else PERIOD
    script = scripted(lambda t, x, y: COMMANDS[round(t / PERIOD)])
    system = one_cell(stepper=stepper, step=step, dead_time=0.0, control=script, **motor(hold))
    run = record(system, MOVING, len(COMMANDS))
    height, force = integrate(hold)
    assert force.max() > 0.1
    assert np.ptp(height) > 0.3e-3
    assert_near(run.height[1:, 0], height, 3e-6)
    assert_near(run.force[1:, 0], force, 3e-3)


@pytest.mark.parametrize("hold, stalled", [("back_drivable", 1.0), ("braked", 0.0)])
@pytest.mark.parametrize("command", [1.0, 0.5, 0.25])
def test_a_motor_stalls_at_its_command_s_share_of_the_stall_force_or_at_all_of_it(
    hold, stalled, command
):
    script = scripted(lambda t, x, y: command)
    system = one_cell(relaxation=None, step=PERIOD, control=script, **motor(hold))
    force = record(system, path((0.0, 0.0, 0.0, 40.0)), 1000).force[-1, 0]
    # The slowest pole is 24 mm/s / 1 N * f_d b / 4 = 0.5 1/s at first touch, 12 1/s at a stall.
    assert force == pytest.approx(STALL * (command if stalled else 1.0), rel=1e-6)


@pytest.mark.parametrize("depth", [1.5, 30.0])
@pytest.mark.parametrize("hold", ["back_drivable", "braked"])
def test_without_a_command_a_load_moves_only_the_back_drivable_pin(hold, depth):
    finger = path((0.0, 0.0, 0.0, 41.0), (0.5, 0.0, 0.0, 40.0 - depth))
    for stepper, step in (("bernoulli", PERIOD), ("runge_kutta_4", 0.5e-3)):
        if stepper == "runge_kutta_4" and (hold, depth) == ("braked", 30.0):
            continue  # a force of 1e24 N
        system = one_cell(stepper=stepper, step=step, **motor(hold))
        height = record(system, finger, 100).height[-1, 0]
        if hold == "braked":
            assert height == 40e-3
        else:
            assert height < 40e-3 - depth * 1e-3 + 3e-3


def test_a_free_pin_has_the_free_speed_times_the_command():
    for command in (1.0, 0.5, -0.25):
        script = scripted(lambda t, x, y, command=command: command)
        for hold in ("back_drivable", "braked"):
            system = one_cell(valve_lag=None, dead_time=0.0, control=script, **motor(hold))
            height = record(system, AWAY, 3).height[:, 0]
            assert height[3] - height[2] == pytest.approx(command * FREE * PERIOD, rel=1e-9)
            assert system.fastest == find_speeds(system.cell).rise == pytest.approx(FREE, rel=1e-12)


MOTOR = {"valve": {"law": "motor", "stall_force": 0.3, "free_speed": FREE}, "conduit": "absent"}
PRESSED = {"trajectory": {"waypoints": over_middle((0.0, 0.05), (0.5, 0.05), (1.0, 0.0391))}}
SMALL = {"layout": {"rows": 11, "columns": 11}}


def pressed(hold, **sections):
    return resolve(
        {**SMALL, **MOTOR, **PRESSED, **sections, "valve": {**MOTOR["valve"], "hold": hold}}
    )


@table(
    "sections, apart",
    {
        # The force grows to 0.04 N a pin, 0.13 of a stall: a period late, 16 um in all.
        "a behavior holds a pin under load by K = F / F_stall": (
            {"control": {"method": "shape_display"}, "shape": {"rise": 0.2e-3}},
            30e-6,
        ),
        "so does Method III": ({"control": {"method": "hybrid"}}, 30e-6),
    },
)
def test_a_controller_that_knows_the_load_balances_it(sections, apart):
    free, braked = (run(pressed(hold, **sections)).history for hold in ("back_drivable", "braked"))
    assert free["force"].max() > 0.02
    assert np.abs(free["height"] - braked["height"]).max() < apart


def test_locked_pins_stay_where_they_are_up_to_the_stall_force():
    scene = pressed("back_drivable", control="absent")
    system, orders = assemble(scene), Orders(repeat_order(200, Verb.LOCK, radius=7e-3))
    poses = scene.trajectories()[0].poses(np.arange(201) * PERIOD)[:, None]
    *_, last = simulate_path(system, begin(system), poses, orders)
    *_, free = simulate_path(system, begin(system), poses)
    locked = last.mode() == Mode.LOCKED
    assert last.row(system.rows.force).max() > 0.02
    assert np.abs(last.row(0)[locked] - 40e-3).max() < 30e-6 < 0.2e-3 < 40e-3 - free.row(0).min()


def test_heights_tell_the_force_at_every_command_also_at_none():
    scene = pressed("back_drivable", control="absent", sensors={"observer": "valve"})
    system = assemble(scene)
    force, read = [], []
    for state in periods(system, scene.trajectories(), begin(system), 200):
        force.append(state.row(system.rows.force)[60])
        read.append(state.row(system.rows.sensed.start)[60])
    assert force[-1] > 0.02
    # The mean of a period is read: half a period late.
    assert np.abs(np.array(read[1:]) - 0.5 * np.add(force[1:], force[:-1])).max() < 1e-3


@table(
    "method, hold, count",
    {
        "two runs of a behavior": ("elastic", "back_drivable", 2),
        "two runs of Method III": ("hybrid", "back_drivable", 2),
        "masters one by one": ("virtual_master", "braked", 2),
        "masters in arrays": ("virtual_master", "back_drivable", 64),
    },
)
def test_runs_of_different_motors_are_the_same_alone_and_in_a_batch(method, hold, count):
    first = pressed(hold, control={"method": method})
    scenes = [
        first.with_sections(valve=replace(first.valve, free_speed=speed))
        for speed in np.linspace(30e-3, 20e-3, count).tolist()
    ]
    alone = {number: run(scenes[number]).history["height"] for number in (0, count - 1)}
    assert np.abs(alone[0] - alone[count - 1]).max() > 1e-6
    for number, result in run_together(scenes):
        if number in alone:  # sums in another order
            assert_near(result.history["height"], alone[number], 1e-9)


@pytest.mark.parametrize("hold, limit", [("back_drivable", math.inf), ("braked", STALL)])
def test_only_a_braked_pin_is_locked_when_its_load_is_more_than_the_stall_force(hold, limit):
    system = one_cell(**motor(hold))
    assert DeviceInfo(system.grid, system.cell, PERIOD).overload == pytest.approx(limit)


def test_pins_under_two_fingers_yield_as_much_as_under_one():
    one = run(pressed("back_drivable", control="absent")).history["height"]
    given = {**SMALL, **MOTOR, "control": "absent"}
    two = run(resolve({**given, "finger": [{**PRESSED, "contact": {"share": 0.17}}] * 2}))
    assert np.abs(one - 40e-3).max() > 0.1e-3
    assert_near(two.history["height"], one, 3e-6)


@table(
    "sections, said",
    {
        "a conduit": ({"conduit": {}}, "conduit must be absent with valve.law = motor"),
        "a supply": ({"supply": {"high": 6e4}}, "supply must be left out with valve.law = motor"),
        "a fluid": ({"fluid": {"density": 1e3}}, "fluid must be left out with valve.law = motor"),
        "no speed": ({"valve": {"law": "motor", "free_speed": -1}}, "must be above 0 m/s"),
        "a misspelt law": ({"valve": {"law": "moto"}}, "must be one of orifice, motor"),
        "a force that bursts the pin": (
            {"valve": {"law": "motor", "stall_force": 1e5}},
            "valve.stall_force must be at most 3.14e.04 N on this actuator.bore",
        ),
    },
)
def test_what_a_motor_has_not_is_refused(sections, said):
    with refused_in_a_line(DigiclayError, said):
        resolve({**MOTOR, **PRESSED, **sections})


def test_files_say_what_the_motor_is_and_a_fit_of_an_orifice_refuses_it():
    scene = pressed("braked")
    text = format_scene(scene)
    assert resolve(tomllib.loads(text)) == scene
    assert "orifice_diameter" not in text
    with refused_in_a_line(DigiclayError, "valve.law must be orifice to be fitted"):
        CellModel(scene, [Trial("a", np.arange(3.0), *np.ones((3, 3)))], ())
