"""Simulations with one change: no rise, a staggered bed, a Gaussian, noise, gains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from digiclay.core.base.modes import Mode
from digiclay.core.control.virtual_master import Master, Phase, VirtualMaster
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import Result, select_rows
from digiclay.core.studies.speed_limits import Drag, track

from . import scenes
from .results import AHEAD, PAPER_SPEED, SESSION, WAYS, Dragged, Extent, Located, Results
from .scenes import METHODS

NO_RISE, STAGGERED, GAUSSIAN = "without the rise", "staggered", "gaussian"
#: What each variant sets, and for which methods.
VARIANTS: dict[str, tuple[Setting, tuple[str, ...]]] = {
    NO_RISE: (Setting("control.rise", "0"), (METHODS[1],)),
    STAGGERED: (Setting("layout.arrangement", "staggered"), METHODS),
    GAUSSIAN: (Setting("blister.profile", "gaussian"), METHODS),
}
#: A search radius as wide as no bed of ours: every cell the finger may touch is looked at, m.
EVERYWHERE = 1.0
#: Control periods at the end in which the place of the finger is looked at.
WATCHED = 300

Told = Callable[[str], None]


def vary(results: Results, extent: Extent, told: Told) -> None:
    """Run the drags of every variant, and locate a finger under noise.

    `results`: takes them in; `told`: hears what comes next.
    """
    for variant, (setting, methods) in VARIANTS.items():
        for method in methods:
            for name in extent.ways:
                told(f"drag {variant}, {name}, {method}")
                changed = load(find(SESSION), [Setting("control.method", method), setting])
                results.dragged[variant, method, name] = dragged(changed, WAYS[name])[0]
    for noise in extent.noises:
        told(f"finger located under a noise of {noise * 1e3:g} mN")
        for thresholds in (False, True):
            for radius in (None, EVERYWHERE):
                results.located.append(located(noise, radius, thresholds=thresholds))


def dragged(scene: Scene, way: Drag, speed: float = PAPER_SPEED) -> tuple[Dragged, Result]:
    """Run a drag, and return what it came to, and the whole of it.

    `scene`: its device and method; `speed`, m/s.
    """
    follows, done = track(scene, way, speed)
    _, start, end = way.path(speed, scene.actuator.rest_height)
    part = select_rows(done.history, start, end)
    total, following = part["total_force"], np.count_nonzero(part["mode"] == Mode.FORCE_FOLLOW, axis=1)
    # The cells in the finger's line, short of the place where it stops.
    place = part["position"]
    line = np.abs(place[:, 1]) < 0.5 * scene.layout.pitch
    away = place[line, 0] - part["fingertip"][:, :1]
    seen = (away >= AHEAD[0]) & (away < AHEAD[1]) & (part["force"][:, line] == 0.0)
    seen &= place[line, 0] < 0.5 * way.length + AHEAD[0]
    over = part["height"][:, line] - scene.actuator.rest_height
    found = Dragged(
        follows, float(total.mean()), float(total.std()), float(following.mean()),
        done.figures["ridge_unevenness"], float(over[seen].mean()) if np.any(seen) else None,
    )  # fmt: skip
    return found, done


def located(noise: float, radius: float | None, *, thresholds: bool) -> Located:
    """Hold a finger still under Method I with noisy force sensors, and look where it is located.

    `noise`: standard deviation of a cell's force sensor, N; `radius`: r_VM, m; None: its default;
    `thresholds`: whether the controller knows of the noise, and takes readings below its threshold for none.
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
        if master.phase is Phase.SHAPING and state.period > case.periods - WATCHED:
            places.append((master.x, master.y))
    place = np.array(places or [(np.nan, np.nan)])
    scatter = float(np.sqrt(np.mean(np.sum((place - place.mean(axis=0)) ** 2, axis=1))))
    return Located(noise, case.control.radius, thresholds, scatter if places else None, losses)
