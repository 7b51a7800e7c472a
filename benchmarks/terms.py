"""``python -m benchmarks terms``: cost and effect of each part of the model."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from digiclay.commands.arguments import add_scene, scene_of
from digiclay.commands.progress import table
from digiclay.core.base.arrays import Floats
from digiclay.core.control.replay import Replay
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene

from .numpy_calls import period_calls
from .report import add_kind, kept, made_with, progress

#: What can be left out, and its section of the scene.
TERMS = {
    "conduit": "conduit",
    "valve lag": "valve_lag",
    "dead time": "delay",
    "relaxation": "relaxation",
    "sensors": "sensors",
}
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


def without(scene: Scene, term: str) -> Scene | None:
    """Return a scene without a term; None where it has none. `term`: key of `TERMS`, or `LONGER`."""
    if term == LONGER:
        simulation = replace(scene.simulation, physics_step=scene.simulation.control_period)
        return None if simulation == scene.simulation else replace(scene, simulation=simulation)
    section = TERMS[term]
    return None if scene.section(section) is None else scene.with_sections(**{section: None})


def _run(scene: Scene, commands: Floats | None, repeats: int) -> Run:
    """Run a scene live, or under commands."""
    spent = []
    for repeat in range(repeats + 1):
        system, kept_rows = assemble(scene), []
        if commands is not None:
            system = replace(
                system, controller=Replay(system.grid, commands), rows=replace(system.rows, control=0)
            )
        start = begin(system)
        rows = system.rows
        started = time.process_time()
        for state in periods(system, scene.trajectories(), start, scene.periods):
            if not repeat:
                kept_rows.append((state.row(0), state.row(rows.force).sum(), state.row(rows.command)))
        if repeat:
            spent.append((time.process_time() - started) / scene.periods)
            continue
        heights, forces, given = (np.array([row[i] for row in kept_rows]) for i in range(3))
    return Run(heights, forces, given, float(np.median(spent)))


def effect(scene: Scene, full: Run, repeats: int = 1) -> Effect:
    """Judge a scene against the run of the full one.

    `full`: of the full scene; `repeats`: timed runs; the median counts.
    """
    alive, played = _run(scene, None, repeats), _run(scene, full.commands, 1)
    system = assemble(scene)
    calls = period_calls(system, scene.trajectories(), min(scene.periods, 400))[0]
    apart = [
        (float(np.abs(one.heights - full.heights).max()), float(np.abs(one.forces - full.forces).max()))
        for one in (played, alive)
    ]
    return Effect(float(np.median(calls)), alive.seconds, 8 * system.rows.count, apart[0], apart[1])


def add(kinds: Any) -> None:
    """Add the benchmark."""
    examples = (
        "  python -m benchmarks terms tap\n  python -m benchmarks terms ridge_mound_valley --out results\n"
    )
    parser = add_kind(kinds, "terms", "cost and effect of each part of the model", examples)
    add_scene(parser)
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Leave out every term by itself, then all of them, and print the table."""
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
    found: dict[str, Effect] = {}
    with progress(arguments, "terms", len(scenes)) as bar:
        for name, one in scenes.items():
            found[name] = effect(one, full, repeats)
            bar(name)
    text = "\n".join(_text(scene, found))
    print(text)
    head = ("scene", "calls", "seconds", "bytes", "replayed_m", "replayed_N", "live_m", "live_N")
    rows = [
        [name, one.calls, one.seconds, one.bytes_a_pin, *one.replayed, *one.live]
        for name, one in found.items()
    ]
    kept(arguments.out, f"terms_{scene.name}", text, head, rows)
    return 0


def _text(scene: Scene, found: Mapping[str, Effect]) -> Iterator[str]:
    """Give the lines of the report."""
    yield made_with()
    period = scene.simulation.control_period * 1e3
    yield f"\n{scene.name}: {scene.cells} cells, {scene.periods} control periods of {period:g} ms."
    yield "What it takes, and the largest difference of a height and of the total force from the full scene:"
    yield "under the commands recorded there, and live. What the recorder takes is in `benchmarks session`.\n"
    head = (
        "scene", "calls", "µs a period", "bytes a pin", "replayed, µm", "mN", "live, µm", "mN",
    )  # fmt: skip
    rows = [
        [
            name, f"{one.calls:g}", f"{one.seconds * 1e6:.0f}", str(one.bytes_a_pin),
            f"{one.replayed[0] * 1e6:.3g}", f"{one.replayed[1] * 1e3:.3g}",
            f"{one.live[0] * 1e6:.3g}", f"{one.live[1] * 1e3:.3g}",
        ]
        for name, one in found.items()
    ]  # fmt: skip
    yield from table(head, rows)
