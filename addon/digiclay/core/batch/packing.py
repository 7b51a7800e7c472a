"""Batch: which scenes go together, the paths of their fingertips, and the runs that go on."""

import math
from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import DivergenceError
from ..engine.simulation import CHUNK, find_divergence
from ..engine.state import State
from ..engine.system import System
from ..model.layout import Grid, make_grid
from ..model.touch import FingerPath, join_paths, trace_finger
from ..model.trajectory import Trajectory
from ..scene.assembly import Motion, count_rows, make_motion
from ..scene.columns import Batch
from ..scene.schema import Scene
from ..steppers.bernoulli import BernoulliPlan


def classify(value: Any) -> Any:
    """Return all of a part but its numbers: parts of one kind can be merged."""
    if is_dataclass(value) and not isinstance(value, type):
        return type(value), *(classify(getattr(value, field.name)) for field in fields(value))
    if isinstance(value, tuple):
        return tuple(classify(one) for one in value)
    return float if isinstance(value, float) else value


def extend_path(
    path: FingerPath | None, systems: Sequence[System], ways: Sequence[Trajectory], period: int
) -> FingerPath | None:
    """Return the fingertip path of a batch in a period and some more; None where nothing touches."""
    if systems[0].cell.touch is None or (path and period < path.first + len(path.forms)):
        return path
    runs = {_list_causes(*run): run for run in zip(systems, ways, strict=True)}
    alone = runs.values() if len(runs) == 1 else zip(systems, ways, strict=True)
    return join_paths([_trace_run(system, way, period) for system, way in alone])


def _list_causes(system: System, way: Trajectory) -> tuple[Any, ...]:
    """Return what a run's fingertip path depends on."""
    arrays = (system.instants, way.times, way.positions, way.orientations)
    touch = system.cell.touch
    return touch and touch.fingertip, way.interpolation, system.period, *(one.tobytes() for one in arrays)


def _trace_run(system: System, way: Trajectory, first: int) -> FingerPath:
    """Compute the fingertip path of one run in some periods."""
    assert system.cell.touch is not None
    starts = (first + np.arange(CHUNK)) * system.period
    poses = way.poses((starts[:, None] + system.instants).ravel()).reshape(CHUNK, -1, 7)
    return trace_finger(system.cell.touch.fingertip, poses, first)


def find_diverged(state: State) -> NDArray[np.bool_]:
    """Return which runs, (b,), hold numbers that are not finite."""
    block = state.active.block
    # One sum tells that all is well, as it nearly always is.
    if math.isfinite(np.add.reduce(block, axis=None)):
        return np.zeros(block.shape[2], np.bool_)
    finite: NDArray[np.bool_] = np.isfinite(block.sum(axis=(0, 1)))
    return ~finite


def make_divergence_error(batch: Batch, state: State, run: int) -> DivergenceError:
    """Return the error of a run, by its index, with a number that is not finite after a control period."""
    former = state.active
    error = find_divergence(
        batch.systems[run], former.cells[:, run], former.block[..., run], state.period - 1
    )
    assert error is not None
    return error


def select_runs(state: State, runs: Sequence[int]) -> State:
    """Return the state of some of the runs. `runs`: their indices on the last axis."""
    chosen, former = np.array(runs, np.intp), state.active
    # The discs are not worth keeping: the set is made anew.
    active = replace(
        former,
        cells=former.cells[:, chosen],
        block=former.block[..., chosen],
        mode=former.mode[:, chosen],
        quadratic_basis=former.quadratic_basis[..., chosen],
        peak=former.peak[chosen],
        until=0,
        own=tuple(former.own[run] for run in runs) if former.own else (),
    )
    several = (state.rows, state.modes, state.aged)
    rows, modes, aged = (np.ascontiguousarray(one[..., chosen]) for one in several)
    memory = [state.memory[run] for run in runs]
    return State(state.period, rows, modes, aged, state.peak[chosen], active, memory)


#: The steppers that know how to move cells whose numbers differ from run to run.
CLOSED_FORM = ("bernoulli", "richardson")

#: Parts that decide how cells move.
PHYSICS = ("actuator", "supply", "fluid", "valve", "conduit", "valve_lag", "delay", "contact", "relaxation")


#: How many kinds of parts, motions of cells and beds are kept: a bed can have a million cells.
KINDS, MOTIONS, BEDS = 4096, 1024, 2


class Findings:
    """Results of functions of parts, kept for scenes with equal parts."""

    def __init__(self) -> None:
        self._known: dict[int, dict[Any, Any]] = {KINDS: {}, MOTIONS: {}, BEDS: {}}

    def find(self, most: int, key: Any, make: Callable[..., Any], *given: Any) -> Any:
        """Return what was made for an equal key, or make it; the first goes when there are `most`."""
        kept = self._known[most]
        if key not in kept:
            if len(kept) >= most:
                del kept[next(iter(kept))]
            kept[key] = make(*given)
        return kept[key]


def describe_structure(scene: Scene, findings: Findings | None = None) -> Any:
    """Return what scenes must have in common to stand in one batch.

    With the closed-form step and Richardson's form of it, it is the kinds of the parts, not their numbers.
    The other steppers know no runs, so for them all cells must be alike. `findings`: of scenes before.
    Raises ParameterError when the scene's parts do not go together.
    """
    if len(scene.fingers) != 1:
        return "one by one", len(scene.fingers)
    findings = findings or Findings()
    physics = tuple(scene.section(name) for name in PHYSICS)
    fingertips = tuple(finger.fingertip for finger in scene.fingers)
    sensors = scene.sensors and replace(scene.sensors, seed=0)
    rounds = sensors and bool(sensors.force_step or sensors.height_step)
    parts = fingertips, scene.control, scene.blister, sensors
    common = (
        scene.layout,
        scene.method if scene.control else None,
        scene.shape is None,
        *(findings.find(KINDS, part, classify, part) for part in parts),
        rounds,
        sensors and sensors.noisy,
        scene.recorder,
        scene.simulation.stepper,
    )
    if scene.simulation.stepper not in CLOSED_FORM:
        return (*common, physics, replace(scene.simulation, duration=0.0))
    steps = scene.simulation.control_period, scene.simulation.steps, scene.simulation.stepper
    motion: Motion = findings.find(MOTIONS, (physics, fingertips, steps), make_motion, scene)
    bed: Grid = findings.find(BEDS, scene.layout, make_grid, scene.layout)
    plan = motion.plan
    plans = (plan,) if isinstance(plan, BernoulliPlan) else (plan.coarse, plan.fine)
    nodes = tuple((plan.laminar, *((part.start, part.stop) for part in plan.nodes)) for plan in plans)
    kind = findings.find(KINDS, physics, classify, physics)
    return (*common, kind, count_rows(scene, bed, motion), nodes, motion.instants.size)
