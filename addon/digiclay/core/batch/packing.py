"""Batch: parts merged from those of compatible scenes, its steppers and controllers, its control period."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import DivergenceError
from ..control.servo import BatchControl
from ..engine.active_set import OwnSelection, PaddedSelection
from ..engine.simulation import CHUNK, find_divergence
from ..engine.state import ActiveSet, State, make_initial_state
from ..engine.system import System
from ..model.control_interface import Commands, Controller, Measurement
from ..model.interfaces import Movement
from ..model.layout import Grid, make_grid
from ..model.null_parts import Uncontrolled
from ..model.touch import FingerPath, join_paths, trace_finger
from ..model.trajectory import Trajectory
from ..scene.assembly import Motion, count_rows, make_motion
from ..scene.schema import Scene
from ..steppers.bernoulli import BernoulliPlan

Part = TypeVar("Part")


def classify(value: Any) -> Any:
    """Return all of a part but its numbers: parts of one kind can be merged."""
    if is_dataclass(value) and not isinstance(value, type):
        return type(value), *(classify(getattr(value, field.name)) for field in fields(value))
    if isinstance(value, tuple):
        return tuple(classify(one) for one in value)
    return float if isinstance(value, float) else value


def merge_parts(parts: Sequence[Part]) -> Part:
    """Return a part that stands for those of all runs; the first one itself where all are alike.

    What is the same in all, of one `classify`, stays; a number that is not becomes an array (b,), an array
    gets a last axis, parts within the parts likewise. The rules of parameters are not checked again.
    """
    first: Any = parts[0]
    own = {field.name: _one([getattr(one, field.name) for one in parts]) for field in fields(first)}
    if all(value is getattr(first, name) for name, value in own.items()):
        return parts[0]
    part: Any = object.__new__(type(first))
    for name, value in own.items():
        object.__setattr__(part, name, value)
    stands_for_all: Part = part
    return stands_for_all


def _one(values: list[Any]) -> Any:
    """Return what stands for a value in all runs."""
    first = values[0]
    if isinstance(first, np.ndarray):
        alike = all(value is first or np.array_equal(value, first) for value in values)
        return first if alike else np.stack(values, axis=-1)
    if is_dataclass(first):
        return merge_parts(values)
    if isinstance(first, tuple):
        own = tuple(_one(list(several)) for several in zip(*values, strict=True))
        return first if all(map(operator.is_, own, first)) else own
    return first if all(value is first or value == first for value in values) else np.array(values)


@dataclass(frozen=True, eq=False)
class RunByRun:
    """Calls each run's controller separately; correct for any method, not vectorized.

    What it asks about are the cells that take part in the run; the others get no orders.
    """

    controllers: tuple[Controller, ...]

    def locate(self, memory: list[Any], touched: Measurement) -> tuple[list[Any], list[Any]]:
        """Let each take in its cells."""
        located = [
            controller.locate(own, _take_run(touched, run))
            for run, (controller, own) in enumerate(zip(self.controllers, memory, strict=True))
        ]
        return [own for own, _ in located], [disc for _, disc in located]

    def command(self, memory: list[Any], seen: Measurement) -> tuple[list[Any], Commands]:
        """Let each give its orders."""
        given = [
            controller.command(own, _take_run(seen, run))
            for run, (controller, own) in enumerate(zip(self.controllers, memory, strict=True))
        ]
        targets, modes, commands = seen.target.copy(), seen.mode.copy(), np.zeros(seen.target.shape)
        for run, (_, orders) in enumerate(given):
            own = slice(orders.target.size)
            targets[own, run], modes[own, run], commands[own, run] = orders
        return [own for own, _ in given], Commands(targets, modes, commands)


def join_controllers(controllers: Sequence[Any], *, by_set: bool = False) -> Any:
    """Return one controller for all runs: the method's own where its formulas hold for many at once."""
    first = controllers[0]
    if isinstance(first, BatchControl) and not by_set:
        merged = merge_parts(controllers)
        parts = {part.name: getattr(merged, part.name) for part in fields(merged)}
        return merged.batch_class(**parts | {"runs": tuple(controllers)})
    return first if isinstance(first, Uncontrolled) else RunByRun(tuple(controllers))


def _take_run(seen: Measurement, run: int) -> Measurement:
    """Return what is measured of one run."""
    own = slice(seen.present[run] if seen.present else None)
    rows: Any = seen[:-1]
    basis, *others = (one[..., own, run] for one in rows)
    return Measurement(np.ascontiguousarray(basis), *others)


#: Cells moved at a time: as many as stay in a core's cache, and few enough for the matrix products to stay
#: on one core (waking a second one takes longer than the product).
PIECE = 2048
#: Cells of a run out of the fingertip's reach are moved by so many at a time, or a multiple: workspaces of
#: few sizes serve for any number of them.
GROUP = 8


class BatchMovement:
    """Moves one set of cells of b runs, period by period; see `interfaces.Stepper.prepare`."""

    def __init__(self, batch: Batch, rows: Floats, near: int) -> None:
        self._stepper, self._plan = stepper, plan = batch.stepper, batch.plan
        # Where the cells of all runs are alike, they are moved as those of one large bed.
        self._alike = alike = plan is batch.systems[0].plan
        # What moves a pin without a fingertip: its opening and its commands.
        self._rows, self._near, self._valves = rows, near, rows[batch.cell.lag_rows.start :, near:]
        own = self._beds(rows)
        count = near * rows.shape[2] if alike else near
        parts = _pieces(count, 1 if alike else rows.shape[2])
        self._touched = [
            (part, stepper.prepare(plan, own[:, part], part.stop - part.start)) for part in parts
        ]
        self._others: dict[int, tuple[Floats, Movement]] = {}

    def _beds(self, values: Floats) -> Floats:
        """Return values (r, n, b) as the stepper takes them: (r, n b) where all cells are alike."""
        return values.reshape(len(values), -1) if self._alike else values

    def __call__(self, under: Floats) -> Floats:
        """Move the cells on by one control period, in place; return the force on the near ones, (k, b), N."""
        force = np.empty((1, *under.shape[1:]))
        own, seen = self._beds(force)[0], self._beds(under)
        for part, move in self._touched:
            own[part] = move(seen[:, part])
        # Beyond the fingers nothing moves whose valve is shut, with no command on its way: squares sum to 0.
        awake = self._near + np.flatnonzero(np.einsum("rwb,rwb->w", self._valves, self._valves))
        for part in _pieces(awake.size, force.shape[2]):
            self._move_others(awake[part], under[:, :0])
        felt: Floats = force[0]
        return felt

    def _move_others(self, cells: Any, none: Floats) -> None:
        """Move some cells out of the fingers' reach, each of all runs."""
        size = -(-cells.size // GROUP) * GROUP
        if size not in self._others:
            rows = np.zeros((len(self._rows), size, self._rows.shape[2]))
            self._others[size] = rows, self._stepper.prepare(self._plan, self._beds(rows), 0)
        rows, move = self._others[size]
        rows[:, : cells.size] = self._rows[:, cells]
        move(self._beds(none))
        self._rows[:, cells] = rows[:, : cells.size]


def _pieces(count: int, runs: int) -> Iterator[slice]:
    """Cut some cells of each run into pieces of about one size, none larger than `PIECE` in all runs."""
    pieces = -(-count * runs // PIECE)
    for i in range(pieces):
        yield slice(count * i // pieces, count * (i + 1) // pieces)


@dataclass(frozen=True, eq=False)
class Batch(System):
    """All that does not change in b sessions on one layout."""

    systems: tuple[System, ...]
    """Those of the runs."""

    def prepare(self, active: ActiveSet) -> BatchMovement:
        """Prepare to move one set of cells of all runs."""
        return BatchMovement(self, active.driven, active.near)


def begin(batch: Batch) -> State:
    """Return the state before the sessions."""
    memory = [system.controller.begin() for system in batch.systems]
    heights = np.array([system.cell.actuator.rest_height for system in batch.systems], np.float64)
    return make_initial_state(batch.rows, batch.grid.count, heights, memory)


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


def make_batch(systems: Sequence[System]) -> Batch:
    """Return the batch of systems of one structure."""
    first, cell = systems[0], merge_parts([system.cell for system in systems])
    period, fastest = np.array([(system.period, system.fastest) for system in systems], np.float64).T
    common = first.grid, first.rows, cell, period, fastest
    own = tuple(system.selection for system in systems)
    return Batch(
        grid=first.grid,
        cell=cell,
        sensors=merge_parts([system.sensors for system in systems]),
        controller=join_controllers([system.controller for system in systems], by_set=first.by_set),
        stepper=first.stepper,
        plan=merge_parts([system.plan for system in systems]),
        period=period,
        fastest=fastest,
        selection=OwnSelection(*common, own) if first.by_set else PaddedSelection(*common),
        instants=first.instants,
        rows=first.rows,
        by_set=first.by_set,
        latency=first.latency,
        height_floor=first.height_floor,
        systems=tuple(systems),
    )
