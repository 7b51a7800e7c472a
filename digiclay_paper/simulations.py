"""All simulations of `digiclay paper`."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
from digiclay.core.base.modes import Mode
from digiclay.core.control.virtual_master import Master, Phase, VirtualMaster
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.metrics import signals, summary
from digiclay.core.model.control_interface import find_set_point
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.recorder import Recorder
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import Result, run, select_rows
from digiclay.core.studies import speed_limits

from . import scenes
from .results import (
    AHEAD,
    AS_IT_IS,
    BEYOND,
    DRAGS,
    PAPER_SPEED,
    RIDGE,
    SESSION,
    WAYS,
    Dragged,
    Extent,
    Located,
    Results,
    Session,
    Swing,
)
from .scenes import METHODS, QUICKER, SINK, TALL, THIRD, Device

#: Along the ridge and along the valley, s.
ALONG_RIDGE, ALONG_VALLEY = (5.0, 10.0), (18.0, 25.0)
WINDOWS = {
    "both": (ALONG_RIDGE, ALONG_VALLEY),
    "ridge alone": (ALONG_RIDGE,),
    "valley alone": (ALONG_VALLEY,),
}


def measure_windows(done: Result) -> dict[str, dict[str, float | None]]:
    """Return RFD, N, and deviations of force, N, and height, m, while shaping, by the names of `WINDOWS`."""
    time, sums = done.history["time"], summary.sum_cells(done.history)
    weight = signals.compute_weights(time)
    wanted = find_set_point(done.scene.set_point, sums.following)
    above = np.full(len(time), np.nan)
    above[sums.touching] = summary.measure_surface_under(sums, done.history["fingertip"])
    windows = {}
    for name, spans in WINDOWS.items():
        rows = sums.shaping & np.any(
            [(time >= start) & (time <= end) for start, end in spans], axis=0
        )
        windows[name] = {
            "rfd": summary.compute_rfd(time, sums.total, wanted, rows),
            "force_deviation": signals.compute_deviation(sums.total[rows], weight[rows]),
            "height_deviation": signals.compute_deviation(above[rows], weight[rows]),
        }
    return windows


NO_RISE, STAGGERED, GAUSSIAN = "without the rise", "staggered", "gaussian"
#: What each variant sets, and for which methods.
VARIANTS: dict[str, tuple[Setting, tuple[str, ...]]] = {
    NO_RISE: (Setting("control.rise", "0"), (METHODS[1],)),
    STAGGERED: (Setting("layout.arrangement", "staggered"), METHODS),
    GAUSSIAN: (Setting("blister.profile", "gaussian"), METHODS),
}
#: A search radius as wide as no bed of ours: every cell the fingertip may touch is looked at, m.
EVERYWHERE = 1.0
#: Control periods at the end in which the place of the fingertip is looked at.
STILL = 300

Announce = Callable[[str], None]


def vary(results: Results, extent: Extent, announce: Announce) -> None:
    """Run the drags of every variant, and locate a fingertip under noise."""
    for variant, (setting, methods) in VARIANTS.items():
        for method in methods:
            for name in extent.ways:
                announce(f"drag {variant}, {name}, {method}")
                results.dragged[variant, method, name] = dragged(
                    _load(method, setting), WAYS[name]
                )[0]
    for noise in extent.noises:
        announce(f"finger located under a noise of {noise * 1e3:g} mN")
        for thresholds in (False, True):
            for radius in (None, EVERYWHERE):
                results.located.append(located(noise, radius, thresholds=thresholds))


def dragged(
    scene: Scene, way: speed_limits.Drag, speed: float = PAPER_SPEED
) -> tuple[Dragged, Result]:
    """Run a drag with a scene's device and method, and return what it came to, and the whole of it."""
    follows, done = speed_limits.track(scene, way, speed)
    _, start, end = way.path(speed, scene.actuator.rest_height)
    part = select_rows(done.history, start, end)
    total = part["total_force"]
    following = np.count_nonzero(part["mode"] == Mode.FORCE_FOLLOW, axis=1)
    # The cells in the fingertip's line, short of the place where it stops.
    place = part["position"]
    line = np.abs(place[:, 1]) < 0.5 * scene.layout.pitch
    away = place[line, 0] - part["fingertip"][:, :1]
    seen = (away >= AHEAD[0]) & (away < AHEAD[1]) & (part["force"][:, line] == 0.0)
    seen &= place[line, 0] < 0.5 * way.length + AHEAD[0]
    over = part["height"][:, line] - scene.actuator.rest_height
    measured = Dragged(
        follows,
        float(total.mean()),
        float(total.std()),
        float(following.mean()),
        done.figures["ridge_unevenness"],
        float(over[seen].mean()) if np.any(seen) else None,
    )
    return measured, done


def located(noise: float, radius: float | None, *, thresholds: bool) -> Located:
    """Hold a fingertip still under Method I with noisy force sensors, and look where it is located.

    `noise`: standard deviation of a cell's force sensor, N; `radius`: r_VM, m; None: its default;
    `thresholds`: whether the controller knows of the noise, and takes readings below its threshold
    for none.
    """
    case = scenes.at_rest(noise, radius)
    assert isinstance(case.control, VirtualMaster)
    system = assemble(case)
    if not thresholds:
        system = replace(system, controller=assemble(replace(case, sensors=None)).controller)
    places: list[tuple[float, float]] = []
    losses, trajectories = 0, case.trajectories()
    for state in periods(system, trajectories, begin(system), case.periods):
        master = state.memory
        assert isinstance(master, Master)
        losses = master.losses
        if master.phase is Phase.SHAPING and state.period > case.periods - STILL:
            places.append((master.x, master.y))
    place = np.array(places or [(np.nan, np.nan)])
    scatter = float(np.sqrt(np.mean(np.sum((place - place.mean(axis=0)) ** 2, axis=1))))
    return Located(noise, case.control.radius, thresholds, scatter if places else None, losses)


#: The last part of a hold, in which an oscillation is looked for, s.
WATCHED = 1.0
#: Rows of a session of which one is kept; up to when all are kept besides, s.
THINNED, DETAIL = 4, 5.0


def simulate(extent: Extent, announce: Announce) -> Results:
    """Simulate all of it; `announce` hears what comes next, and may raise KeyboardInterrupt."""
    results = Results()
    for method in METHODS:
        _form_blisters(results, method, announce)
    for method in METHODS:
        _track(results, method, extent, announce)
    sessions(results, announce)
    for position_gain, gain in product(extent.position_gains, extent.gains):
        announce(f"oscillation, K_p {position_gain:g} 1/m, K_f {gain:g} 1/N")
        swing, done, quick = _swing(gain, position_gain)
        results.swings.append(swing)
        results.details[gain, position_gain] = (
            done.history["time"] - quick,
            done.history["total_force"],
        )
    for gain in extent.gains:
        announce(f"oscillation, a quicker device, K_f {gain:g} 1/N")
        swing, done, _ = _swing(gain, extent.position_gains[0], QUICKER)
        results.quicker.append(swing)
        results.quicker_speed = speed_limits.find_free_speed(done.scene)
    for gain in extent.cell_gains:
        announce(f"oscillation, Method II, K_FF {gain:g} 1/N")
        results.cell_swings.append(_swing(gain, extent.position_gains[0], None, METHODS[1])[0])
    _go_wild(results, announce)
    vary(results, extent, announce)
    _run_third(results, extent, announce)
    return results


def _form_blisters(results: Results, method: str, announce: Announce) -> None:
    """Raise and sink blisters with a method."""
    announce(f"blisters, {method}")
    for shape, height in (("convex", TALL), ("concave", SINK)):
        for profile in ("cone", "gaussian"):
            results.blisters[method, shape, profile] = _run(scenes.blister(method, height, profile))


def _run_third(results: Results, extent: Extent, announce: Announce) -> None:
    """Run blisters, drags, lifts and the session with Method III, which the paper does not have."""
    if "blisters" in extent.third:
        _form_blisters(results, THIRD, announce)
    if "tracks" in extent.third:
        highest, more = BEYOND
        wider = replace(extent, drags=(extent.drags[0], highest), speeds=(*extent.speeds, *more))
        _track(results, THIRD, wider, announce)
    announce(f"the paper's session, {THIRD}")
    scene = _load(THIRD)
    results.printed[THIRD] = results.session[THIRD] = _boil_down(scene)
    if results.slow > 1.0:
        results.session[THIRD] = _boil_down(scenes.slowed(scene, results.slow))


def _go_wild(results: Results, announce: Announce) -> None:
    """Run the first seconds of the paper's session with Method I at the first gain that oscillates."""
    first = results.onset(results.printed[METHODS[0]].gain("position_gain"))[1]
    if first is not None:
        announce(f"the paper's session, K_f {first:g} 1/N")
        scene = _load(METHODS[0], Setting("control.force_gain", f"{first!r}"))
        shorter = replace(scene.simulation, duration=DETAIL)
        results.wild = _boil_down(replace(scene, simulation=shorter))


def _track(results: Results, method: str, extent: Extent, announce: Announce) -> None:
    """Measure how fast a fingertip a method follows; every drag of the bisection is one more of `tracks`."""
    scene = _load(method)
    for name, way in DRAGS.items():
        announce(f"drag at {PAPER_SPEED * 1e3:g} mm/s, {name}, {method}")
        results.dragged[AS_IT_IS, method, name], done = one, _ = dragged(scene, way)
        if name in WAYS:
            results.simple[method, name] = one.follows
        if name == RIDGE:
            _, start, end = way.path(PAPER_SPEED, scene.actuator.rest_height)
            results.drags[method] = done, start, end
    results.tracks[method] = []
    for speed in extent.speeds:
        announce(f"drag at {speed * 1e3:g} mm/s, {method}")
        results.tracks[method].append(
            speed_limits.track(scene, speed_limits.Drag(height=TALL), speed)[0]
        )

    def tried(one: speed_limits.Follows) -> None:
        announce(f"fastest drag, {name}, {one.speed * 1e3:.1f} mm/s, {method}")
        if name == RIDGE:
            results.tracks[method].append(one)

    for name, way in WAYS.items():
        results.fastest[method, name] = speed_limits.find_largest_speed(
            scene,
            way,
            results.criterion,
            low=extent.drags[0],
            high=extent.drags[1],
            resolution=extent.resolution,
            report=tried,
        )
    results.tracks[method].sort(key=lambda one: one.speed)
    results.lifting[method] = speed_limits.find_largest_speed(
        scene,
        speed_limits.Lift(),
        results.criterion,
        low=extent.lifts[0],
        high=extent.lifts[1],
        resolution=extent.resolution,
        report=lambda one: announce(f"lift at {one.speed * 1e3:.1f} mm/s, {method}"),
    )


def sessions(results: Results, announce: Announce, session: str = SESSION) -> None:
    """Run the paper's session at its times, and again slowly where a method loses the fingertip."""
    for method in METHODS:
        announce(f"the paper's session, {method}")
        results.printed[method] = _boil_down(_load(method, session=session))
    results.session = dict(results.printed)
    if not any(done.lost for done in results.printed.values()):
        return
    lift = scenes.fastest_lift(results.printed[METHODS[0]].scene)
    able = min(speed or 2e-3 for speed in results.lifting.values())
    # Four fifths of what the slower method can lift, in steps of a tenth.
    results.slow = max(1.0, math.ceil(10.0 * lift / (0.8 * able)) / 10.0)
    for method in METHODS:
        announce(f"the paper's session, {results.slow:g} times as long, {method}")
        slowly = scenes.slowed(results.printed[method].scene, results.slow)
        results.session[method] = _boil_down(slowly)


def _load(method: str, *settings: Setting, session: str = SESSION) -> Scene:
    """Return the scene of a session with a method and other settings."""
    return load(find(session), [Setting("control.method", method), *settings])


def _run(scene: Scene) -> Result:
    """Run a scene with a row a control period."""
    return run(replace(scene, recorder=Recorder()))


def _boil_down(scene: Scene) -> Session:
    """Run a session, and return what is drawn and judged: its whole history takes a hundred megabytes."""
    done = _run(scene)
    follow = np.sum(done.history["mode"] == Mode.FORCE_FOLLOW, axis=1)
    rows = {name: done.history[name] for name in ("time", "height", "total_force", "fingertip")}
    rows |= {"set_point": find_set_point(done.scene.set_point, follow), "following": follow}
    kept = {
        name: np.concatenate([values[:-1:THINNED], values[-1:]]) for name, values in rows.items()
    }
    kept["position"] = done.history["position"]
    early = done.history["time"] <= DETAIL
    detail = {name: done.history[name][early] for name in ("time", "height")}
    lost, windows = speed_limits.find_unintended_losses(done), measure_windows(done)
    return Session(done.scene, kept, detail, done.figures, lost, windows)


def _swing(
    gain: float, position_gain: float, device: Device | None = None, method: str = METHODS[0]
) -> tuple[Swing, Result, float]:
    """Hold still after a quick press, and look whether the force comes to rest; also when it ended, s."""
    case, quick = scenes.held(gain, position_gain, device, method)
    done = _run(case)
    end = float(done.history["time"][-1])
    late = select_rows(done.history, end - WATCHED, end)
    after = select_rows(done.history, quick, end)
    wanted = find_set_point(
        case.set_point, np.count_nonzero(after["mode"] == Mode.FORCE_FOLLOW, axis=1)
    )
    settled = signals.measure_settling_time(after["time"], after["total_force"] / wanted, 1.0, 0.1)
    swing = Swing(
        gain,
        position_gain,
        signals.measure_amplitude(late["total_force"]),
        signals.measure_frequency(late["time"], late["total_force"]),
        settled,
    )
    return swing._replace(settling=None) if swing.sustained else swing, done, quick
