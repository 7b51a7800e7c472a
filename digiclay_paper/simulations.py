"""All simulations of `digiclay paper`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from digiclay.core.base.modes import Mode
from digiclay.core.metrics.force import measure_amplitude, measure_frequency, measure_settling_time
from digiclay.core.model.control_interface import find_set_point
from digiclay.core.scene.recorder import Recorder
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import Result, run, select_rows
from digiclay.core.studies.method_trials import find_free_speed, find_unintended_losses
from digiclay.core.studies.speed_limits import Drag, Follows, Lift, find_largest_speed, track

from . import scenes
from .results import (
    AS_IT_IS,
    BEYOND,
    DRAGS,
    PAPER_SPEED,
    RIDGE,
    SESSION,
    WAYS,
    Extent,
    Results,
    Session,
    Swing,
)
from .scenes import METHODS, QUICKER, SINK, TALL, THIRD, Device
from .variants import dragged, vary
from .windows import measure_windows

#: The last part of a hold, in which an oscillation is looked for, s.
WATCHED = 1.0
#: Rows of a session of which one is kept; up to when all are kept besides, s.
THINNED, DETAIL = 4, 5.0


Told = Callable[[str], None]


def simulate(extent: Extent, told: Told) -> Results:
    """Simulate all of it; `told` hears what comes next, and may raise KeyboardInterrupt."""
    results = Results()
    for method in METHODS:
        _form_blisters(results, method, told)
    for method in METHODS:
        _track(results, method, extent, told)
    sessions(results, told)
    for position_gain in extent.position_gains:
        for gain in extent.gains:
            told(f"oscillation, K_p {position_gain:g} 1/m, K_f {gain:g} 1/N")
            found, done, quick = _swing(gain, position_gain)
            results.swings.append(found)
            small = {name: done.history[name] for name in ("time", "total_force")}
            results.details[gain, position_gain] = replace(done, history=small), quick
    for gain in extent.gains:
        told(f"oscillation, a quicker device, K_f {gain:g} 1/N")
        found, done, _ = _swing(gain, extent.position_gains[0], QUICKER)
        results.quicker.append(found)
        results.quicker_speed = find_free_speed(done.scene)
    for gain in extent.cell_gains:
        told(f"oscillation, Method II, K_FF {gain:g} 1/N")
        results.cell_swings.append(_swing(gain, extent.position_gains[0], None, METHODS[1])[0])
    _go_wild(results, told)
    vary(results, extent, told)
    results.third = _run_third(results.slow, extent, told)
    return results


def _form_blisters(results: Results, method: str, told: Told) -> None:
    """Raise and sink blisters with a method."""
    told(f"blisters, {method}")
    for shape, height in (("convex", TALL), ("concave", SINK)):
        for profile in ("cone", "gaussian"):
            results.blisters[method, shape, profile] = _run(scenes.blister(method, height, profile))


def _run_third(slow: float, extent: Extent, told: Told) -> Results:
    """Run blisters, drags, lifts and the session with Method III, which the paper does not have."""
    found = Results()
    if "blisters" in extent.third:
        _form_blisters(found, THIRD, told)
    if "tracks" in extent.third:
        highest, more = BEYOND
        wider = replace(extent, drags=(extent.drags[0], highest), speeds=(*extent.speeds, *more))
        _track(found, THIRD, wider, told)
    told(f"the paper's session, {THIRD}")
    scene = load(find(SESSION), [Setting("control.method", THIRD)])
    found.printed[THIRD] = _boiled_down(_run(scene))
    slowly = scenes.slowed(scene, slow)
    found.session[THIRD] = _boiled_down(_run(slowly)) if slow > 1.0 else found.printed[THIRD]
    return found


def _go_wild(results: Results, told: Told) -> None:
    """Run the first seconds of the paper's session with Method I at the first gain that oscillates."""
    gentle = results.printed[METHODS[0]].scene.control
    first = results.onset(getattr(gentle, "position_gain", 0.0))[1]
    if first is not None:
        told(f"the paper's session, K_f {first:g} 1/N")
        settings = [Setting("control.method", METHODS[0]), Setting("control.force_gain", f"{first!r}")]
        found = load(find(SESSION), settings)
        shorter = replace(found.simulation, duration=DETAIL)
        results.wild = _boiled_down(_run(replace(found, simulation=shorter)))


def _track(results: Results, method: str, extent: Extent, told: Told) -> None:
    """Measure how fast a finger a method follows; every drag of the bisection is one more of `tracks`."""
    found = load(find(SESSION), [Setting("control.method", method)])
    for name, way in DRAGS.items():
        told(f"drag at {PAPER_SPEED * 1e3:g} mm/s, {name}, {method}")
        results.dragged[AS_IT_IS, method, name], done = one, _ = dragged(found, way)
        if name in WAYS:
            results.simple[method, name] = one.follows
        if name == RIDGE:
            _, start, end = way.path(PAPER_SPEED, found.actuator.rest_height)
            results.drags[method] = done, start, end
    results.tracks[method] = []
    for speed in extent.speeds:
        told(f"drag at {speed * 1e3:g} mm/s, {method}")
        results.tracks[method].append(track(found, Drag(height=TALL), speed)[0])

    def tried(one: Follows) -> None:
        told(f"fastest drag, {name}, {one.speed * 1e3:.1f} mm/s, {method}")
        if name == RIDGE:
            results.tracks[method].append(one)

    for name, way in WAYS.items():
        results.fastest[method, name] = find_largest_speed(
            found, way, results.criterion,
            low=extent.drags[0], high=extent.drags[1], resolution=extent.resolution, told=tried,
        )  # fmt: skip
    results.tracks[method].sort(key=lambda one: one.speed)
    results.lifting[method] = find_largest_speed(
        found, Lift(), results.criterion,
        low=extent.lifts[0], high=extent.lifts[1], resolution=extent.resolution,
        told=lambda one: told(f"lift at {one.speed * 1e3:.1f} mm/s, {method}"),
    )  # fmt: skip


def sessions(results: Results, told: Told, session: str = SESSION) -> None:
    """Run the paper's session at its times, and again slowly where a method loses the finger."""
    for method in METHODS:
        told(f"the paper's session, {method}")
        found = load(find(session), [Setting("control.method", method)])
        results.printed[method] = _boiled_down(_run(found))
    results.session = dict(results.printed)
    if not any(done.lost for done in results.printed.values()):
        return
    lift = scenes.fastest_lift(results.printed[METHODS[0]].scene)
    able = min(speed or 2e-3 for speed in results.lifting.values())
    # Four fifths of what the slower method can lift, in steps of a tenth.
    results.slow = max(1.0, math.ceil(10.0 * lift / (0.8 * able)) / 10.0)
    for method in METHODS:
        told(f"the paper's session, {results.slow:g} times as long, {method}")
        slowly = scenes.slowed(results.printed[method].scene, results.slow)
        results.session[method] = _boiled_down(_run(slowly))


def _run(scene: Scene) -> Result:
    """Run a scene with a row a control period."""
    return run(replace(scene, recorder=Recorder()))


def _boiled_down(done: Result) -> Session:
    """Return what is drawn and judged of a session: its whole history takes a hundred megabytes."""
    follow = np.sum(done.history["mode"] == Mode.FORCE_FOLLOW, axis=1)
    kept = {
        name: np.concatenate([done.history[name][:-1:THINNED], done.history[name][-1:]])
        for name in ("time", "height", "total_force", "fingertip")
    }
    wanted = find_set_point(done.scene.set_point, follow)
    for name, values in (("set_point", wanted), ("following", follow)):
        kept[name] = np.concatenate([values[:-1:THINNED], values[-1:]])
    kept["position"] = done.history["position"]
    followers = float(follow[follow > 0].mean()) if np.any(follow) else 0.0
    early = done.history["time"] <= DETAIL
    detail = {name: done.history[name][early] for name in ("time", "height")}
    lost, windows = find_unintended_losses(done), measure_windows(done)
    return Session(done.scene, kept, detail, done.figures, lost, followers, windows)


def _swing(
    gain: float, position_gain: float, device: Device | None = None, method: str = METHODS[0]
) -> tuple[Swing, Result, float]:
    """Hold still after a quick press, and look whether the force comes to rest; also when it ended, s."""
    case, quick = scenes.held(gain, position_gain, device, method)
    done = _run(case)
    end = float(done.history["time"][-1])
    late, after = select_rows(done.history, end - WATCHED, end), select_rows(done.history, quick, end)
    wanted = find_set_point(case.set_point, np.count_nonzero(after["mode"] == Mode.FORCE_FOLLOW, axis=1))
    settled = measure_settling_time(after["time"], after["total_force"] / wanted, 1.0, 0.1)
    found = Swing(
        gain, position_gain, measure_amplitude(late["total_force"]),
        measure_frequency(late["time"], late["total_force"]), settled,
    )  # fmt: skip
    return found._replace(settling=None) if found.sustained else found, done, quick
