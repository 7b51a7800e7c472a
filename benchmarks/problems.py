"""Problems of the benchmarks: scenes, recorded commands, and their solution by our steppers."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.engine.state import State
from digiclay.core.engine.system import System
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.accuracy import Replay
from numpy.typing import NDArray

#: Control period of all problems, s.
PERIOD = 5e-3
#: Rows and columns; waypoints (s; x, y, z in mm) and how they are joined; the command of all periods,
#: or None: the commands of Method I are recorded.
PROBLEMS: dict[str, tuple[int, tuple[tuple[float, float, float, float], ...], str, float | None]] = {
    "one cell, load step": (
        1, ((0.0, 0.0, 0.0, 40.3), (0.101, 0.0, 0.0, 40.3), (0.103, 0.0, 0.0, 39.0), (0.5, 0.0, 0.0, 39.0)),
        "linear", 0.6,
    ),
    "pressed and held": (
        11, ((0.0, 0.0, 0.0, 40.5), (0.3, 0.0, 0.0, 37.5), (0.8, 0.0, 0.0, 37.5)), "smooth", None,
    ),
    "session, lift and drag": (
        25, (
            (0.0, -21.0, -21.0, 40.2), (0.6, -21.0, -21.0, 36.5), (1.6, -21.0, -21.0, 42.5),
            (2.3, -15.0, -21.0, 42.5), (2.5, -15.0, -21.0, 42.5),
        ), "smooth", None,
    ),
    "fast drag": (
        15, (
            (0.0, -12.0, 0.0, 40.5), (0.15, -12.0, 0.0, 37.5), (0.65, 13.0, 0.0, 37.5),
            (0.7, 13.0, 0.0, 45.0),
        ), "smooth", None,
    ),
    "deep press": (
        11, ((0.0, 0.0, 0.0, 40.5), (0.15, 0.0, 0.0, 34.0), (0.5, 0.0, 0.0, 33.0)), "smooth", None,
    ),
}  # fmt: skip
#: Runs of a stepper that are timed.
REPEATS = 3
#: Evaluations of the rates a step takes; the closed-form step evaluates conductance and load once.
STAGES = {"bernoulli": 1, "richardson": 3, "euler": 1, "heun": 2, "runge_kutta_4": 4}


@dataclass(frozen=True)
class Work:
    """A point of the work-precision plot: SI units; `evaluations` of the rates of all cells."""

    problem: str
    method: str
    setting: float
    height_error: float
    force_error: float
    seconds: float
    evaluations: int
    peer: bool


@dataclass(frozen=True, eq=False)
class Problem:
    """A problem."""

    name: str
    scene: Scene
    commands: Floats
    """(t, n): Constant within a control period."""
    sets: list[tuple[NDArray[np.intp], int]]
    """(m,): Which cells take part in each period; how many of them, the first, the fingertip may touch."""

    @property
    def taking_part(self) -> float:
        """Mean number of cells that take part in a period."""
        return float(np.mean([cells.size for cells, _ in self.sets]))

    @property
    def dead_time(self) -> float:
        """Dead time of the valves, s."""
        return self.scene.delay.dead_time if self.scene.delay else 0.0

    def solve(self, stepper: str, step: float) -> Solution:
        """Integrate by one of our steppers; `step`, s."""
        return solve(self.with_stepper(stepper, step), self.commands)

    def with_stepper(self, stepper: str, step: float) -> Scene:
        """Return the scene with a stepper and its step, s."""
        simulation = replace(self.scene.simulation, stepper=stepper, physics_step=step)
        return replace(self.scene, simulation=simulation)


@dataclass(frozen=True, eq=False)
class Solution:
    """Heights, (t, n), m, total force, (t,), N, and our commands, (t, n), at the end of each period."""

    heights: Floats
    forces: Floats
    commands: Floats | None = None

    def compare(self, exact: Solution) -> tuple[float, float]:
        """Return the largest errors of a height, m, and of the total force, N."""
        height, force = self.heights - exact.heights, self.forces - exact.forces
        return float(np.abs(height).max()), float(np.abs(force).max())


def live(name: str, period: float = PERIOD, step: float = 1e-3, *, side: int | None = None) -> Scene:
    """Return a problem's scene under Method I, on its bed or one of `side` rows and columns; times in s."""
    rows, waypoints, joined, command = PROBLEMS[name]
    return resolve(
        {
            "layout": {"rows": side or rows, "columns": side or rows},
            "recorder": "absent",
            "control": {} if command is None else "absent",
            "simulation": {"control_period": period, "physics_step": step},
            "trajectory": {
                "interpolation": joined,
                "waypoints": [{"time": t, "position": [v * 1e-3 for v in place]} for t, *place in waypoints],
            },
        },
        name,
    )


def problem(name: str, *, side: int | None = None) -> Problem:
    """Record a problem's commands and which cells take part, on its own bed or one of `side` rows."""
    scene, command = live(name, side=side), PROBLEMS[name][3]
    commands = solve(scene).commands if command is None else np.full((scene.periods, scene.cells), command)
    assert commands is not None  # our own solutions have them
    return Problem(
        name, scene, commands, [(one.active.cells, one.active.near) for one in run(scene, commands)[1]]
    )


def replaying(scene: Scene, commands: Floats) -> System:
    """Return a scene's system that plays commands, (t, n), one row a control period."""
    system = assemble(scene)
    return replace(system, controller=Replay(system.grid, commands), rows=replace(system.rows, control=0))


def run(scene: Scene, commands: Floats | None = None) -> tuple[System, Iterator[State]]:
    """Return a scene's system, with its controller or under commands, (t, n), and its states to come."""
    system = assemble(scene) if commands is None else replaying(scene, commands)
    return system, periods(system, scene.trajectories(), begin(system), scene.periods)


def solve(scene: Scene, commands: Floats | None = None) -> Solution:
    """Integrate with the scene's controller, or under commands, (t, n)."""
    system, states = run(scene, commands)
    rows = [
        (state.row(0), state.row(system.rows.force).sum(), state.row(system.rows.command)) for state in states
    ]
    heights, forces, played = (np.array(column) for column in zip(*rows, strict=True))
    return Solution(heights, forces, played)


def time_run(scene: Scene, commands: Floats | None = None) -> float:
    """Return the CPU time of a run of which nothing is kept, s."""
    _, states = run(scene, commands)
    started = time.process_time()
    for _ in states:
        pass
    return time.process_time() - started


def run_stepper(task: Problem, exact: Solution, stepper: str, steps: tuple[float, ...]) -> Iterator[Work]:
    """Give the points of one of our steppers, one a step, s; the least time of `REPEATS` counts."""
    for step in steps:
        scene = task.with_stepper(stepper, step)
        with np.errstate(all="ignore"):
            errors = task.solve(stepper, step).compare(exact)
            took = min(time_run(scene, task.commands) for _ in range(REPEATS))
        count = scene.periods * round(PERIOD / step) * STAGES[stepper]
        yield Work(task.name, stepper, step, *errors, took, count, False)
