"""Method III holds the force where the others lose it: fast drags, wrong models, noise, turned fingers."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.control.hybrid_parameters import Hybrid
from digiclay.core.control.virtual_master import Phase
from digiclay.core.metrics.summary import compute_rfd
from digiclay.core.model.control_interface import find_set_point
from digiclay.core.model.trajectory import Path, Waypoint
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.run_scene import run
from digiclay.core.studies.speed_limits import Drag, Lift, track

from digiclay_study.method_trials import drag_row, with_paths
from tests.assemble import path, record, sample

REST = 40.0
BOTH = ("virtual_master", "hybrid")


def device(method="hybrid", **tables):
    """Return the default device with a method."""
    return resolve({"control": {"method": method}, **tables})


def along(scene, *waypoints, turn=0.0):
    """Return a scene whose finger goes through waypoints (s, then mm), and turns about the vertical, rad."""
    end = waypoints[-1][0]
    half = 0.5 * turn / end
    points = tuple(
        Waypoint(t, (x * 1e-3, y * 1e-3, z * 1e-3), (np.cos(half * t), 0.0, 0.0, np.sin(half * t)))
        for t, x, y, z in waypoints
    )
    finger = replace(scene.fingers[0], trajectory=Path("smooth", points))
    return replace(scene, fingers=(finger,), simulation=replace(scene.simulation, duration=end))


#: A press, a lift of 8 mm, and a drag of 15 mm at 15 mm/s.
STROKE = (
    (0.0, -8, 0, 41), (0.2, -8, 0, 38), (0.3, -8, 0, 38), (1.2, -8, 0, 46), (2.2, 7, 0, 46), (2.4, 7, 0, 46),
)  # fmt: skip


@cache
def stroke(method, turn=0.0):
    """Return the run of the stroke with a method."""
    return run(along(device(method), *STROKE, turn=turn))


@pytest.mark.parametrize("turn", [0.0, 1.2])
def test_it_holds_the_force_better_than_method_i_turned_finger_or_not(turn):
    one, three = (stroke(method, turn).metrics["rfd"] for method in ("virtual_master", "hybrid"))
    # Measured 0.36 and 0.4 of it.
    assert three < 0.55 * one


@pytest.mark.parametrize(
    "turn, pitch", [(90.0, 0.0), (105.0, 30.0)], ids=["across", "across, tilted"]
)
def test_a_finger_across_its_way_between_two_rows_of_pins_is_held_as_well(turn, pitch):
    poses = drag_row(np.radians(turn), np.radians(pitch))
    bed = {"columns": 25, "rows": 15}
    one, three = (
        run(with_paths(device(method, layout=bed), "linear", poses)).metrics for method in BOTH
    )
    assert three["contact_loss_share"] == 0.0
    # Measured 0.39 and 0.38; 2.8 and 0.9 by a filter of the angle, flat 90 degrees off where it
    # begins.
    assert three["rfd"] < 0.6 * one["rfd"]


# Speed


@pytest.mark.parametrize(
    "way, speed, orifice, deviation",
    [
        # Measured 0.009, 0.015 and 0.06 N; Method I loses all of them but the lift.
        (Drag(approach=9e-3), 50e-3, 0.5e-3, 0.02),
        (Drag(height=-10e-3), 50e-3, 0.5e-3, 0.03),
        (Lift(), 22e-3, 0.5e-3, 0.12),
        # The speed of exploring hands: 15 % of 0.4 N is what a finger can tell; measured 0.016 N.
        (Drag(height=6e-3, approach=9e-3), 80e-3, 0.8e-3, 0.15 * 0.4),
    ],
    ids=["ridge", "valley", "lift", "a wide orifice"],
)
def test_a_fingertip_is_followed_at(way, speed, orifice, deviation):
    found, _ = track(device(valve={"orifice_diameter": orifice}), way, speed)
    assert (found.losses, found.loss_share) == (0, 0.0)
    assert found.rfd < deviation


def test_the_skirt_leaves_no_lump_and_without_it_a_quick_drag_from_rest_is_blocked():
    result = run(along(device(), *STROKE, (2.5, 7, 0, 60), (3.3, 7, 0, 60)))
    end, (x, y) = result.history["height"][-1], result.history["position"].T
    # Beside and behind the ridge, beyond the blister's 15 mm and a pitch.
    off = np.hypot(np.clip(x, -8e-3, 7e-3) - x, y) > 18.5e-3
    assert off.sum() > 100
    assert np.abs(end[off] - REST * 1e-3).max() < 20e-6
    found, _ = track(
        resolve({"control": {"method": "hybrid", "skirt_speed": 0.0}}), Drag(approach=9e-3), 40e-3
    )
    assert found.rfd > 0.1


def test_the_force_of_a_slow_lift_does_not_swing():
    slow = sample("slow_press", "simulation.duration=3.0", "control.method=hybrid")
    force = run(slow).history["total_force"][500:]
    # Swings with a period of two control periods: 0.5 mN; with a dead band of 10 µm 9 mN.
    assert np.abs(np.diff(force, 2)).mean() / 4.0 < 2e-3


# What the controller knows wrongly


TRUE = along(device(), *STROKE)
#: By what numbers of a part are multiplied in the device that a controller is made for.
MODELS = {
    # The laminar flow goes with the fourth power of the diameter.
    "valve × 0.7": ("valve", {"orifice_diameter": 0.7**0.25}),
    "valve × 3": ("valve", {"orifice_diameter": 3**0.25}),
    "pulp stiffness × 2": ("contact", {"stiffness": 2}),
    "exponent × 0.7": ("contact", {"exponent": 0.7}),
    "fingertip × 0.75": ("fingertip", dict.fromkeys(("length", "width", "height"), 0.75)),
    "width × 0.6": ("fingertip", {"width": 0.6}),
}


def mismatched(known):
    """Return the true device under a controller made for another one."""
    part, factors = MODELS[known]
    section = TRUE.section(part)
    changed = replace(
        section, **{name: getattr(section, name) * by for name, by in factors.items()}
    )
    return replace(
        assemble(TRUE), controller=assemble(TRUE.with_sections(**{part: changed})).controller
    )


@pytest.mark.parametrize("known", MODELS)
def test_with_a_wrong_model_the_finger_is_held_no_worse_than_by_method_i(known):
    found = record(mismatched(known), TRUE.trajectories()[0], TRUE.periods)
    total = found.force[1:].sum(axis=1)
    assert found.last.memory.losses == 0
    assert total.max() < 1.0
    rfd = compute_rfd(found.time[1:], total, find_set_point(TRUE.set_point, total))
    assert rfd <= stroke("virtual_master").metrics["rfd"]


def test_method_i_takes_over_from_a_wrong_prediction_until_the_finger_has_left():
    found = record(mismatched("valve × 3"), path(*STROKE, (2.5, 7, 0, 80), (2.7, 7, 0, 80)), 540)
    taken = [memory.master.phase is Phase.SHAPING for memory in found.memory]
    assert (taken[100], taken[479], taken[-1]) == (True, True, False)
    assert not any(
        memory.master.phase for memory in record(assemble(TRUE), path(*STROKE), 480).memory
    )


def test_the_trim_stays_within_half_the_set_point():
    # Pins that end 1 mm above the surface do not rise far enough: the force stays too small.
    short = device(actuator={"stroke": 41e-3}, layout={"rows": 13, "columns": 13})
    way = path((0.0, 0, 0, 41), (0.3, 0, 0, 39), (0.6, 0, 0, 39.5), (2.2, 0, 0, 39.5))
    found = record(assemble(short), way, 440)
    assert 0.2 < found.force[-1].sum() < 0.35
    assert found.last.memory.trim == pytest.approx(0.2)
    # A force that pins do not reach is no failure of the prediction, which knows their end stops.
    assert found.last.memory.doubt**0.5 < 0.01


@pytest.mark.parametrize(
    "sensors",
    [{"force_noise": 15e-3}, {"delay": 1}],
    ids=["most noise", "delay"],
)
def test_noise_and_delay_of_the_sensors_lose_no_finger(sensors):
    found = run(along(device(sensors=sensors), *STROKE)).metrics
    one = run(along(device("virtual_master", sensors=sensors), *STROKE)).metrics
    assert (found["losses"], found["contact_loss_share"]) == (0, 0.0)
    assert found["rfd"] <= one["rfd"]


# Extremes


def test_a_finger_that_jumps_is_found_again_where_it_is():
    places = ((0.0, -20, 41), (0.5, -20, 37), (0.8, -20, 37), (0.805, 20, 37), (1.6, 20, 37))
    way = path(*((t, x, 0, z) for t, x, z in places), interpolation="linear")
    found = record(assemble(device()), way, 320)
    x, *_ = found.last.memory.estimate.mean
    assert x == pytest.approx(20e-3, abs=0.3e-3)
    assert found.force[300:].sum(axis=1) == pytest.approx(0.4, abs=0.03)


def test_a_touched_cell_is_never_frozen():
    found = record(assemble(device()), path(*STROKE, (3.4, -8, 0, 46), (3.6, -8, 0, 44)), 720)
    assert np.any(found.mode == Mode.FROZEN)
    assert not np.any(
        (found.mode == Mode.FROZEN)[:-1] & (found.force > Hybrid().release_force)[:-1]
    )


@pytest.mark.parametrize(
    "tables",
    [
        {"relaxation": "absent"},
        {"valve_lag": "absent", "conduit": "absent"},
        {"delay": {"dead_time": 12e-3}},
        {"simulation": {"control_period": 10e-3, "physics_step": 10e-3}},
        {"layout": {"rows": 11, "columns": 11}},
        {"layout": {"rows": 15, "columns": 15, "arrangement": "staggered"}},
        {"layout": {"rows": 13, "columns": 13}, "fingertip": {"length": 0.04, "width": 0.04, "height": 0.04}},
    ],
    ids=["no relaxation", "instant valve", "dead time of 12 ms", "10 ms period", "small bed", "staggered",
         "a fingertip larger than the bed"],
)  # fmt: skip
def test_it_holds_a_press_on_other_devices(tables):
    known = along(
        device(**tables), (0.0, 1.3, 0.4, 41), (0.4, 1.3, 0.4, 38.5), (1.2, 1.3, 0.4, 38.5)
    )
    found = run(known)
    late = found.history["total_force"][int(0.8 / known.simulation.control_period) :]
    # With commands under way for three periods it swings by 0.02 N about 0.44 N, and the trim takes
    # 0.5 s.
    assert late == pytest.approx(0.4, abs=0.08 if "delay" in tables else 0.02)
