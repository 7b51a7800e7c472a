"""Omission of model parts within a budget of height error, tried and measured.

Each omission is tried alone, in step with the full scene, in closed loop. Those that fit are
added one after another, in the order of saved work per error, and the whole is measured again
each time, since errors in a closed loop do not simply add. The final scene has been measured
as a whole, and the error of its integration is added.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from time import process_time
from typing import NamedTuple

import numpy as np

from ..base.errors import ParameterError
from ..engine.simulation import begin, periods
from ..engine.system import System
from ..scene.assembly import assemble
from ..scene.recorder import Recorder
from ..scene.schema import Scene
from ..session.accuracy import estimate_errors, explain_absence
from ..session.run_scene import run

#: Parts that can be omitted, and their descriptions.
PARTS = {
    "conduit": "no conduit behind the valve",
    "valve_lag": "valves that follow at once",
    "delay": "no dead time",
    "relaxation": "a fingertip that does not relax",
    "sensors": "perfect sensors",
}
#: Those of them without a row of a stepper's state.
WITHOUT_ROWS = ("conduit", "sensors")
#: Dead bands of the heights, as shares of the budget, with which cells come to rest earlier.
BANDS = (0.5, 0.25)


class Omission(NamedTuple):
    """Part or refinement that a scene can omit."""

    #: Only one omission of a kind is possible.
    kind: str
    #: Description of the scene with it.
    text: str
    #: Returns a scene with the omission.
    leave_out: Callable[[Scene], Scene]


class Tried(NamedTuple):
    """Effect of an omission."""

    text: str
    #: Largest difference of a height from the full scene, m; infinite for a trial that was aborted
    #: because it exceeded the budget.
    departure: float
    #: Remaining shares of the full scene's work and of its measured time; NaN for an aborted trial.
    work: float
    time: float
    #: Whether the final scene has the omission.
    kept: bool


@dataclass(frozen=True)
class Fitted:
    """Scene within a budget."""

    scene: Scene
    #: Allowed error, m; largest difference of a height from the full scene in closed loop, m; and
    #: estimated error of the integration, m. The sum of the last two is at most the first.
    budget: float
    departure: float
    own_error: float
    #: Remaining shares of the full scene's work, cells times steps times the parts of a cell, by
    #: which omissions are chosen because it is the same in every run; and of its measured time.
    work: float
    time: float
    tried: tuple[Tried, ...]

    @property
    def error(self) -> float:
        """Measured height error, m."""
        return self.departure + self.own_error

    @property
    def left_out(self) -> list[str]:
        """Omissions of the scene."""
        return [trial.text for trial in self.tried if trial.kept]


def propose_omissions(scene: Scene, budget: float) -> Iterator[Omission]:
    """Yield possible omissions of a scene: parts, physics steps, and cells almost at their heights."""
    simulation = scene.simulation
    steps = simulation.steps
    for fewer in range(1, steps):
        if steps % fewer == 0:
            step = simulation.control_period / fewer
            text = f"physics steps of {step * 1e3:g} ms, not {simulation.physics_step * 1e3:g} ms"
            yield Omission("steps", text, partial(_change, section="simulation", physics_step=step))
    for section, text in PARTS.items():
        if any(part is not None for part in scene.list_parts(section)):
            yield Omission(section, text, partial(_change, section=section))
    for band in (share * budget for share in BANDS):
        if getattr(scene.control, "dead_band", math.inf) < band:
            text = f"cells left alone within {band * 1e6:g} µm of their height"
            yield Omission("cells", text, partial(_change, section="control", dead_band=band))


def find_omissions(
    scene: Scene, budget: float, *, show: Callable[[str], object] = lambda text: None
) -> Fitted:
    """Return a scene with all omissions that fit within a budget of height error, m."""
    if not (math.isfinite(budget) and budget > 0.0):
        raise ParameterError("run", "budget", "must be above 0 m", f"{budget:g} m")
    if absent := explain_absence(replace(scene, recorder=Recorder())):
        rule = f"must be left out where errors cannot be estimated: {absent}"
        raise ParameterError("run", "budget", rule, f"{budget * 1e6:g} µm")
    show("the full scene")
    error = _estimate_error(scene)
    if error > budget:
        hint = "Allow more, or take a shorter simulation.physics_step or the stepper 'richardson'."
        rule = (
            f"must be at least the error of the full scene's own integration, {error * 1e6:.2g} µm"
        )
        raise ParameterError("run", "budget", rule, f"{budget * 1e6:g} µm", hint)
    alone: list[tuple[Omission, Tried]] = []
    for omission in propose_omissions(scene, budget):
        show(omission.text)
        trial = Tried(omission.text, *_measure(scene, omission.leave_out(scene), budget), False)
        alone.append((omission, trial))
    fits = [pair for pair in alone if pair[1].departure <= budget and pair[1].work < 1.0]
    fits.sort(key=lambda pair: -(1.0 - pair[1].work) / (pair[1].departure + 1e-3 * budget))
    best = Fitted(scene, budget, 0.0, error, 1.0, 1.0, tuple(tried for _, tried in alone))
    taken: list[Omission] = []
    for omission, _ in fits:
        if any(omission.kind == other.kind for other in taken):
            continue
        show(f"together + {omission.text}")
        less = omission.leave_out(best.scene)
        departure, work, time = _measure(scene, less, budget)
        if departure > budget or work >= best.work:
            continue
        error = _estimate_error(less)
        if departure + error <= budget:
            taken.append(omission)
            best = replace(
                best, scene=less, departure=departure, own_error=error, work=work, time=time
            )
    texts = {omission.text for omission in taken}
    return replace(
        best, tried=tuple(trial._replace(kept=trial.text in texts) for trial in best.tried)
    )


def _change(scene: Scene, section: str, **values: float) -> Scene:
    """Return a scene with other parameters of a part, or without the part if none are given."""
    part = replace(scene.section(section), **values) if values else None
    return scene.with_sections(**{section: part})


def _measure(full: Scene, less: Scene, budget: float) -> tuple[float, float, float]:
    """Run two scenes in step; return their largest difference, m, and shares of work and time."""
    apart, done, took = 0.0, np.zeros(2), np.zeros(2)
    pair = [assemble(full), assemble(less)]
    runs = [periods(system, full.trajectories(), begin(system), full.periods) for system in pair]
    weights = [_weight(scene, system) for scene, system in zip((full, less), pair, strict=True)]
    for _ in range(full.periods):
        heights = []
        for index, (steps, weight) in enumerate(zip(runs, weights, strict=True)):
            started = process_time()
            state = next(steps)
            took[index] += process_time() - started
            done[index] += weight * state.active.cells.size
            heights.append(state.row(0))
        apart = max(apart, float(np.abs(heights[0] - heights[1]).max()))
        if apart > budget:
            return math.inf, math.nan, math.nan
    return apart, float(done[1] / done[0]) if done[0] else 1.0, float(took[1] / took[0])


def _weight(scene: Scene, system: System) -> int:
    """Return the work of a cell in a control period: steps times the number of state rows and other parts."""
    rows: int = system.rows.driven.stop + sum(
        scene.section(part) is not None for part in WITHOUT_ROWS
    )
    return rows * scene.simulation.steps


def _estimate_error(scene: Scene) -> float:
    """Estimate the height error of the integration of a scene, m."""
    recorded = replace(scene, recorder=Recorder())
    errors = estimate_errors(recorded, run(recorded).history)
    assert errors is not None
    return errors.height
