"""Assembly of a batch from scenes, and their compatibility."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

from ..engine.system import System
from ..model.interfaces import Stepper
from ..scene.assembly import assemble
from ..scene.schema import Scene
from ..steppers.bernoulli_plan import BernoulliPlan
from .advance import Batch
from .broadcasting import classify, list_numbers, merge_parts
from .movement import BatchStepper
from .padding import OwnSelection, PaddedSelection
from .run_by_run import join_controllers

__all__ = ["describe_structure", "make_batch"]

#: The steppers that know how to move cells whose numbers differ from run to run.
CLOSED_FORM = ("bernoulli", "richardson")

#: Parts that decide how cells move.
PHYSICS = ("actuator", "supply", "fluid", "valve", "conduit", "valve_lag", "delay", "contact", "relaxation")


def describe_structure(scene: Scene) -> Any:
    """Return what scenes must have in common to stand in one batch.

    With the closed-form step and Richardson's form of it, it is the kinds of the parts, not their numbers.
    The other steppers know no runs, so for them all cells must be alike.

    Raises
    ------
    ParameterError
        When the scene's parts do not go together.
    """
    physics = tuple(scene.section(name) for name in PHYSICS)
    fingertips = tuple(finger.fingertip for finger in scene.fingers)
    sensors = scene.sensors and replace(scene.sensors, seed=0)
    rounds = sensors and bool(sensors.force_step or sensors.height_step)
    common = (
        scene.layout,
        scene.method if scene.control else None,
        scene.shape is None,
        *(classify(part) for part in (fingertips, scene.control, scene.blister, sensors)),
        rounds,
        sensors and sensors.noisy,
        scene.recorder,
        scene.simulation.stepper,
    )
    if scene.simulation.stepper not in CLOSED_FORM:
        return (*common, physics, replace(scene.simulation, duration=0.0))
    system = assemble(scene)
    steps = tuple(
        (plan.laminar, *((part.start, part.stop) for part in plan.nodes)) for plan in _plans(system)
    )
    return (*common, classify(physics), system.rows, steps, system.instants.size)


def _plans(system: System) -> tuple[BernoulliPlan, ...]:
    """Return the plans of closed-form steps, the coarse one first; none with another stepper."""
    match system.stepper.name:
        case "bernoulli":
            return (system.plan,)
        case "richardson":
            return system.plan.coarse, system.plan.fine
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
        sensors=merge_parts([system.sensors for system in systems]) if first.sensors else None,
        controller=join_controllers([system.controller for system in systems], by_set=first.by_set)
        if first.controller
        else None,
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
