"""The servo drive: commanded heights frame by frame, a dead zone, quantized heights."""

import tomllib
from dataclasses import dataclass, replace

import digiclay
import numpy as np
import pytest
from digiclay.core.base.errors import DigiclayError
from digiclay.core.control.methods import METHODS
from digiclay.core.control.orders import share
from digiclay.core.control.own_method import Orders, OwnMethod
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import format_scene, resolve, tabulate
from digiclay.core.session import snapshot
from digiclay.core.session.live_session import simulate_path
from digiclay.core.session.run_scene import run

from tests.assemble import (
    AWAY,
    Scripted,
    assert_goes_on,
    assert_near,
    over_middle,
    record,
    refused_in_a_line,
    table,
)
from tests.own_methods import forgotten

PERIOD = 5e-3
MOTOR = {"valve": {"law": "motor", "hold": "braked", "free_speed": 0.2}, "conduit": "absent"}


class Heights(Scripted):
    """Controller whose script has heights for all pins, and no valve commands."""

    def command(self, memory, seen):
        memory, orders = super().command(memory, seen)
        target, none = orders.command, np.zeros(orders.command.size)
        return memory, orders._replace(target=target, command=none)


def rise_at(speed):
    """Return a controller that asks all pins for heights that grow with time."""
    return Heights(lambda time, x, y: 40e-3 + speed * time, PERIOD)


def rest(time, x, y):
    return 40e-3


def servo(**known):
    given = {"kind": "servo", **known}
    return resolve(
        {
            **MOTOR,
            "layout": {"rows": 5, "columns": 5},
            "control": "absent",
            "drive": given,
            "trajectory": {"waypoints": over_middle((0.0, 0.5), (1.0, 0.5))},
        }
    )


def follow(scene, speed, count=120):
    system = replace(assemble(scene), controller=rise_at(speed))
    return record(system, AWAY, count).height[:, 0]


def test_a_servo_lags_a_moving_height_by_the_speed_over_its_gain():
    # v = v0 K_s e: 0.1 m/s per mm.
    height = follow(servo(), 20e-3)
    behind = 40e-3 + 20e-3 * PERIOD * np.arange(121) - height
    assert behind[-1] == pytest.approx(20e-3 / (0.2 * 500.0), rel=1e-6)
    assert behind[-1] == pytest.approx(behind[-20], rel=1e-6)


def test_heights_are_held_for_a_frame():
    speed, frame = 20e-3, 60e-3
    height = follow(servo(frame=frame), speed)
    # At the end of a frame a pin has arrived at the height of its start.
    ends = height[12::12]
    starts = 40e-3 + speed * frame * np.arange(ends.size)
    assert np.abs(ends - starts).max() < 10e-6
    # The pole of 0.2 m/s * 500 1/m: exp(-5.2) of a step of 1.2 mm after 52 ms.


@pytest.mark.parametrize("zone", [0.2e-3, 1e-3])
def test_within_the_dead_zone_a_pin_is_not_moved(zone):
    height = follow(servo(dead_zone=zone), zone / (100 * PERIOD) * 0.9, 101)
    assert np.abs(height - 40e-3).max() == 0.0
    height = follow(servo(dead_zone=zone), zone / (100 * PERIOD) * 1.5, 101)
    # The valve is shut within its dead time and lag of the edge of the dead zone.
    left = 40e-3 + 1.5 * zone - height[-1]
    assert 0.0 < left <= 1.02 * zone


def test_heights_are_multiples_of_the_step_of_heights():
    height = follow(servo(height_step=1e-3), 10e-3, 81)[-1]
    assert height == pytest.approx(44e-3, abs=5e-6)


def test_pins_follow_a_shape_after_the_method_has_commanded_them_and_a_state_keeps_their_heights():
    drive = {"kind": "servo", "frame": 0.3, "dead_zone": 5e-6}
    sections = {
        "layout": {"rows": 9, "columns": 9},
        "control": {"method": "shape_display"},
        "shape": {"rise": 5e-3},
        "trajectory": {"waypoints": over_middle((0.0, 0.5), (3.0, 0.5))},
    }
    scene = resolve({**MOTOR, **sections, "drive": drive})
    plain, driven = (
        run(one).history["height"][-1] for one in (scene.with_sections(drive=None), scene)
    )
    assert np.ptp(plain) > 1e-3
    assert np.abs(driven - plain).max() < 20e-6
    assert_goes_on(scene, 33, 50)
    assert resolve(tomllib.loads(format_scene(scene))) == scene
    assert "sections" not in format_scene(scene)


def test_a_gain_at_which_pins_would_swing_is_refused():
    # K_s v0 T_c = 1 brings a pin without load to its height within a period.
    assert assemble(servo(servo_gain=1000.0)).drive.parameters.servo_gain == 1000.0
    with refused_in_a_line(DigiclayError, "drive.servo_gain must be at most 1e.03 1/m at this con"):
        assemble(servo(servo_gain=1010.0))


@table(
    "drive, said",
    {
        "lines of a matrix": (
            {"sections": 3},
            "drive.sections must be left out with drive.kind = s",
        ),
        "a frame of 7 ms": (
            {"frame": 7e-3},
            "drive.frame must be a whole number of control periods",
        ),
        "a dead zone of a matrix": ({"kind": "matrix", "dead_zone": 1e-3}, "must be left out with"),
    },
)
def test_what_a_servo_has_not_is_refused(drive, said):
    with refused_in_a_line(DigiclayError, said):
        servo(**drive)


class Once(Heights):
    """Controller that asks for a height in the first periods alone, after those of a frame's start."""

    def locate(self, memory, touched):
        return memory, (0.0, 0.0, 1.0) if memory < 5 else None

    def command(self, memory, seen):
        memory, orders = super().command(memory, seen)
        target = np.full(seen.height.shape, 41e-3 if memory > 1 else 40e-3)
        return memory, orders._replace(target=target, mode=np.zeros(target.size, np.int8))


def test_a_pin_waits_for_its_frame():
    system = replace(assemble(servo(frame=0.5)), controller=Once(rest, PERIOD))
    height = record(system, AWAY, 200).height[:, 12]
    assert height[100] == 40e-3
    assert height[-1] == pytest.approx(41e-3, abs=5e-6)


class Late(Once):
    """Controller that asks for a height from the middle of a frame on."""

    def locate(self, memory, touched):
        return memory + 1, (0.0, 0.0, 1.0) if memory >= 150 else None


def test_a_formed_pin_that_a_method_reaches_within_a_frame_holds_until_its_end():
    scene = servo(frame=0.5)
    formed = begin(assemble(scene))
    formed.rows[0] = formed.rows[formed.active.rows.target] = 45e-3
    system = replace(assemble(scene), controller=Late(rest, PERIOD))
    start = snapshot.transfer_heights(system, snapshot.dump(assemble(scene), formed))
    *_, state = periods(system, scene.trajectories(), start, 190)
    assert np.array_equal(state.row(0), formed.row(0))
    *_, state = periods(system, scene.trajectories(), state, 60)
    assert_near(state.row(0), 41e-3, 5e-6)


@pytest.mark.parametrize("hold", ["braked", "back_drivable"])
def test_a_locked_pin_stays_whatever_its_servo_followed(hold):
    drive = {"frame": 0.2, "height_step": 2e-3}
    scene = servo(**drive).with_sections(
        valve=replace(servo().section("valve"), hold=hold), delay=None
    )
    system = replace(assemble(scene), controller=rise_at(20e-3))
    *_, state = periods(system, scene.trajectories(), begin(system), 43)
    poses = np.tile([0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0], (101, 1, 1))
    *_, state = simulate_path(system, state, poses[:2], share(np.ones(25)))
    *_, state = simulate_path(system, state, poses[:5])  # its motor stops
    there = state.row(0).copy()
    *_, state = simulate_path(system, state, poses)
    assert 42.2e-3 < there[0] < 43.8e-3  # no multiple of the step, and its servo followed 44 mm
    assert_near(state.row(0), there, 1e-7)


@pytest.mark.parametrize("method", METHODS)
def test_a_servo_follows_methods_that_command_heights_and_others_are_refused(method):
    damping = (
        {"damping": 50.0} if method in ("elastic", "plastic", "viscous", "force_display") else {}
    )
    tables = {
        **MOTOR,
        "layout": {"rows": 15, "columns": 15},
        "control": {"method": method, **damping},
    }
    path = over_middle((0, 44e-3), (0.5, 38e-3), (1.0, 38e-3))
    tables |= {
        "trajectory": {"waypoints": path},
        "valve": {**MOTOR["valve"], "free_speed": 50e-3},
    }
    if METHODS[method].by_speed:
        with refused_in_a_line(
            DigiclayError, f"drive.kind must be matrix: control.method = {method}"
        ):
            resolve({**tables, "drive": {"kind": "servo"}})
        return
    plain, driven = (
        run(resolve({**tables, **drive})).history["height"][-1]
        for drive in ({}, {"drive": {"kind": "servo", "servo_gain": 1500.0}})
    )
    # Of a method whose heights are not those wanted, pins would not move.
    assert np.ptp(plain) > 0.4e-3
    assert np.ptp(driven) == pytest.approx(np.ptp(plain), rel=0.3)


@dataclass(frozen=True)
class Openings(OwnMethod):
    """Valves that open, to no height that servos could follow."""

    def locate(self, memory, touched, device):
        return memory, (0.0, 0.0, 1.0)

    def command(self, memory, cells, device):
        return memory, Orders(opening=np.ones(cells.height.shape))


def test_a_method_of_ones_own_orders_heights_to_servos():
    with forgotten():
        scene = digiclay.scene(tabulate(servo()), {"control.method": Openings})
        with refused_in_a_line(
            DigiclayError, "must order heights with drive.kind = servo, not open"
        ):
            run(scene)
        assert np.ptp(run(scene.with_sections(drive=None)).history["height"]) > 1e-3
