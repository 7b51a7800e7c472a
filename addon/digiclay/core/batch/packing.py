"""Assembly of a batch from scenes, and their compatibility."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, cast

from ..engine.system import System
from ..model.interfaces import Stepper
from ..model.layout import Grid, make_grid
from ..scene.assembly import Motion, count_rows, make_motion
from ..scene.schema import Scene
from ..steppers.bernoulli_plan import BernoulliPlan
from .advance import Batch
from .broadcasting import classify, list_numbers, merge_parts
from .movement import BatchStepper
from .padding import OwnSelection, PaddedSelection
from .run_by_run import join_controllers

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
        """Return what was made for an equal key, or make it; the first one goes when there are too many.

        `most`: `KINDS`, `MOTIONS` or `BEDS`; `key` hashable; `given`: its arguments.
        """
        known = self._known[most]
        if key not in known:
            if len(known) >= most:
                del known[next(iter(known))]
            known[key] = make(*given)
        return known[key]


def describe_structure(scene: Scene, known: Findings | None = None) -> Any:
    """Return what scenes must have in common to stand in one batch.

    With the closed-form step and Richardson's form of it, it is the kinds of the parts, not their numbers.
    The other steppers know no runs, so for them all cells must be alike.

    `known`: of scenes before, with which this one has parts in common. Raises ParameterError when the scene's
    parts do not go together.
    """
    known = known or Findings()
    physics = tuple(scene.section(name) for name in PHYSICS)
    fingertips = tuple(finger.fingertip for finger in scene.fingers)
    sensors = scene.sensors and replace(scene.sensors, seed=0)
    rounds = sensors and bool(sensors.force_step or sensors.height_step)
    parts = fingertips, scene.control, scene.blister, sensors
    common = (
        scene.layout,
        scene.method if scene.control else None,
        scene.shape is None,
        *(known.find(KINDS, part, classify, part) for part in parts),
        rounds,
        sensors and sensors.noisy,
        scene.recorder,
        scene.simulation.stepper,
    )
    if scene.simulation.stepper not in CLOSED_FORM:
        return (*common, physics, replace(scene.simulation, duration=0.0))
    steps = scene.simulation.control_period, scene.simulation.steps, scene.simulation.stepper
    motion: Motion = known.find(MOTIONS, (physics, fingertips, steps), make_motion, scene)
    bed: Grid = known.find(BEDS, scene.layout, make_grid, scene.layout)
    nodes = tuple(
        (plan.laminar, *((part.start, part.stop) for part in plan.nodes)) for plan in _plans(motion)
    )
    kind = known.find(KINDS, physics, classify, physics)
    return (*common, kind, count_rows(scene, bed, motion), nodes, motion.instants.size)


def _plans(motion: Motion) -> tuple[BernoulliPlan, ...]:
    """Return the plans of closed-form steps, the coarse one first; none with another stepper."""
    match motion.stepper.name:
        case "bernoulli":
            return (motion.plan,)
        case "richardson":
            return motion.plan.coarse, motion.plan.fine
    return ()


def make_batch(systems: Sequence[System]) -> Batch:
    """Return the batch of systems of one structure."""
    first, cell = systems[0], merge_parts([system.cell for system in systems])
    period = list_numbers([system.period for system in systems])
    fastest = list_numbers([system.fastest for system in systems])
    plan = merge_parts([system.plan for system in systems])
    # Of its stepper a control period uses `prepare` alone.
    stepper = cast(Stepper, BatchStepper(first.stepper, plan is first.plan, cell.lag_rows.start))
    common = first.grid, first.rows, cell, period, fastest
    own = tuple(system.selection for system in systems)
    return Batch(
        grid=first.grid,
        cell=cell,
        sensors=merge_parts([system.sensors for system in systems]),
        controller=join_controllers([system.controller for system in systems], by_set=first.by_set),
        stepper=stepper,
        plan=plan,
        period=period,
        fastest=fastest,
        selection=OwnSelection(*common, own) if first.by_set else PaddedSelection(*common),
        instants=first.instants,
        rows=first.rows,
        by_set=first.by_set,
        systems=tuple(systems),
    )
