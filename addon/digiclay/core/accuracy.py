"""How far a run is from the exact solution: integrated once more, by Richardson's form at half the step.

The commands are those recorded, so what differs is the integration alone. Richardson's form is
more accurate than the other methods and cannot blow up: a method that did does not judge
itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .assembly import assemble
from .control.replay import Replay
from .scene import Scene, Simulation
from .simulation import begin, periods

__all__ = ["SHARE", "Errors", "can_be_estimated", "estimated", "judging"]

#: The judge's own error is taken to be a quarter of that of the run: halving the step leaves so much of an
#: error of second order, which is what remains of a higher one across a kink. What comes out is an estimate,
#: no bound, and is said as "about".
SHARE = 4.0 / 3.0


@dataclass(frozen=True)
class Errors:
    """Largest errors over all cells and rows of a run.

    Attributes
    ----------
    height : float
        m.
    force : float
        Of a cell, N.
    total_force : float
        Of all cells together, N.
    """

    height: float
    force: float
    total_force: float


def can_be_estimated(scene: Scene) -> bool:
    """Tell whether a run of this scene keeps every command: with a recorder that keeps every period."""
    return scene.recorder is not None and scene.recorder.every == 1


def judging(simulation: Simulation) -> Simulation:
    """Return what a run is judged by: half the physics step, by Richardson's form or to a tolerance."""
    finer = simulation.refined(2)
    return finer if finer.stepper == "adaptive" else replace(finer, stepper="richardson")


def estimated(
    scene: Scene,
    history: dict[str, NDArray[Any]],
    *,
    progress: Callable[[int, int], None] | None = None,
    stopped: Callable[[], bool] | None = None,
) -> Errors | None:
    """Estimate the errors of a run by integrating its commands as `judging` says.

    Parameters
    ----------
    scene : Scene
        One that `can_be_estimated`.
    history : dict of ndarray
        What its run recorded.
    progress : callable, optional
        Told after each control period how many are done, and of how many.
    stopped : callable, optional
        Asked after each control period; when it says True, there is no estimate: None.
    """
    system = assemble(replace(scene, simulation=judging(scene.simulation)))
    system = replace(
        system, controller=Replay(system.grid, history["command"]), rows=replace(system.rows, control=0)
    )
    done = len(history["time"]) - 1
    height = force = total = 0.0
    start = begin(system)
    for row, state in enumerate(periods(system, scene.trajectory.trajectory(), start, done), 1):
        felt = state.row(system.rows.force)
        height = max(height, float(np.abs(state.row(0) - history["height"][row]).max()))
        force = max(force, float(np.abs(felt - history["force"][row]).max()))
        total = max(total, abs(float(felt.sum() - history["total_force"][row])))
        if progress:
            progress(row, done)
        if stopped and stopped():
            return None
    return Errors(SHARE * height, SHARE * force, SHARE * total)
