"""Benchmark ``terms``: cost and effect of each part of the model."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from digiclay.commands.arguments import scene_of
from digiclay.commands.progress import table
from digiclay.core.base.arrays import Floats
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene

from .numpy_calls import period_calls
from .problems import replaying
from .report import Report, Steps, cells

#: What can be left out, and its section of the scene.
TERMS = {
    "conduit": "conduit", "valve lag": "valve_lag", "dead time": "delay", "relaxation": "relaxation",
    "sensors": "sensors",
}  # fmt: skip
#: Physics steps that are longer: they cost less too.
LONGER = "physics step = control period"
ALL = "all of these"


@dataclass(frozen=True)
class Effect:
    """Cost of a scene, and its difference from the full one; SI units.

    Attributes
    ----------
    calls, seconds : float
        Numpy calls, the median, and CPU time, the mean, of a control period.
    bytes_a_pin : int
        Of state.
    replayed, live : (float, float)
        Largest difference of a height, m, and of the total force, N, under the full scene's
        commands, and with the controller acting on what it then sees.
    """

    calls: float
    seconds: float
    bytes_a_pin: int
    replayed: tuple[float, float]
    live: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Run:
    """Heights and commands, (t, n), total force, (t,), and the CPU time of a period, s."""

    heights: Floats
    forces: Floats
    commands: Floats
    seconds: float

    def compare(self, full: Run) -> tuple[float, float]:
        """Return the largest differences of a height, m, and of the total force, N, from the full scene."""
        heights, forces = np.abs(self.heights - full.heights), np.abs(self.forces - full.forces)
        return float(heights.max()), float(forces.max())


def without(scene: Scene, term: str) -> Scene | None:
    """Return a scene without a term; None where it has none. `term`: key of `TERMS`, or `LONGER`."""
    if term == LONGER:
        simulation = replace(scene.simulation, physics_step=scene.simulation.control_period)
        return None if simulation == scene.simulation else replace(scene, simulation=simulation)
    section = TERMS[term]
    return None if scene.section(section) is None else scene.with_sections(**{section: None})


def _run(scene: Scene, commands: Floats | None, repeats: int) -> Run:
    """Run a scene live, or under commands; the runs after the first are timed."""
    spent, rows = [], []
    for repeat in range(repeats + 1):
        system = assemble(scene) if commands is None else replaying(scene, commands)
        start = begin(system)
        force, command = system.rows.force, system.rows.command
        started = time.process_time()
        for state in periods(system, scene.trajectories(), start, scene.periods):
            if not repeat:
                rows.append((state.row(0), state.row(force).sum(), state.row(command)))
        if repeat:
            spent.append((time.process_time() - started) / scene.periods)
    heights, forces, given = (np.array(column) for column in zip(*rows, strict=True))
    return Run(heights, forces, given, float(np.median(spent)))


def _compare(scene: Scene, full: Run, repeats: int) -> Effect:
    """Compare a scene with the run of the full one."""
    live, replayed = _run(scene, None, repeats), _run(scene, full.commands, 1)
    system = assemble(scene)
    calls = period_calls(system, scene.trajectories(), min(scene.periods, 400))[0]
    apart = replayed.compare(full), live.compare(full)
    return Effect(float(np.median(calls)), live.seconds, 8 * system.rows.count, *apart)


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Leave out every term by itself, then all of them."""
    scene, _ = scene_of(arguments)
    if arguments.quick:
        simulation = replace(scene.simulation, duration=min(scene.simulation.duration, 2.0))
        scene = replace(scene, simulation=simulation)
    repeats = 1 if arguments.quick else 3
    full = _run(scene, None, repeats)
    scenes: dict[str, Scene] = {"the full scene": scene}
    rest: Scene | None = scene
    for term in (*TERMS, LONGER):
        less = without(scene, term)
        if less is not None:
            scenes[f"without {term}" if term in TERMS else term] = less
            rest = without(rest, term) if rest else None
    if rest:
        scenes[ALL] = rest
    effects = {name: _compare(scenes[name], full, repeats) for name in steps.through(list(scenes))}
    head = ("scene", "calls", "seconds", "bytes", "replayed_m", "replayed_N", "live_m", "live_N")
    rows = [
        [name, one.calls, one.seconds, one.bytes_a_pin, *one.replayed, *one.live]
        for name, one in effects.items()
    ]
    return Report(_list_lines(scene, effects), head, rows, name=f"terms_{scene.name}")


def _list_lines(scene: Scene, effects: Mapping[str, Effect]) -> Iterator[str]:
    """Give the lines of the report."""
    period = scene.simulation.control_period * 1e3
    yield f"\n{scene.name}: {scene.cells} cells, {scene.periods} control periods of {period:g} ms."
    yield "Cost, and the largest difference of a height and of the total force from the full scene: under"
    yield "the commands recorded there, and live. The cost of the recorder is in `benchmarks session`.\n"
    head = ("scene", "calls", "µs a period", "bytes a pin", "replayed, µm", "mN", "live, µm", "mN")
    rows = [
        cells(
            "s g .0f d .3g .3g .3g .3g", name, one.calls, one.seconds * 1e6, one.bytes_a_pin,
            one.replayed[0] * 1e6, one.replayed[1] * 1e3, one.live[0] * 1e6, one.live[1] * 1e3,
        )
        for name, one in effects.items()
    ]  # fmt: skip
    yield from table(head, rows)
