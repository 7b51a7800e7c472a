"""Runs of a scene, with its controller or under recorded commands, without a recording."""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.engine.state import State
from digiclay.core.engine.system import System
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene
from digiclay.core.session.accuracy import Replay


def replaying(scene: Scene, commands: Floats) -> System:
    """Return a scene's system that plays commands, (t, n), one row a control period."""
    system = assemble(scene)
    return replace(system, controller=Replay(system.grid, commands), rows=replace(system.rows, control=0))


def run(scene: Scene, commands: Floats | None = None) -> tuple[System, Iterator[State]]:
    """Return a scene's system, with its controller or under commands, (t, n), and its states to come."""
    system = assemble(scene) if commands is None else replaying(scene, commands)
    return system, periods(system, scene.trajectories(), begin(system), scene.periods)


def solve(scene: Scene, commands: Floats | None = None) -> list[Floats]:
    """Return heights, (t, n), m, total force, (t,), N, and commands, (t, n), at the ends of the periods."""
    system, states = run(scene, commands)
    rows = [
        (state.row(0), state.row(system.rows.force).sum(), state.row(system.rows.command)) for state in states
    ]
    return [np.array(column) for column in zip(*rows, strict=True)]


def time_run(scene: Scene, commands: Floats | None = None) -> float:
    """Return the CPU time of a run of which nothing is kept, s."""
    _, states = run(scene, commands)
    started = time.process_time()
    for _ in states:
        pass
    return time.process_time() - started
