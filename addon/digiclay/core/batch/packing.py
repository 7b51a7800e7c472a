"""Assembly of a batch from scenes, and their compatibility."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..engine.system import System
from ..model.physics import Cell, Speeds, speeds
from ..scene.assembly import assemble
from ..scene.schema import Scene
from ..steppers.bernoulli_plan import BernoulliPlan
from .advance import Stack
from .alike import Alike, Extrapolated, Movement, cell_of_all, touches
from .broadcasting import kind, numbers
from .padding import Gathering
from .run_by_run import join_controllers

__all__ = ["STACKED", "put_together", "structure", "why_not"]

#: The steppers that know how to move cells whose numbers differ from run to run.
CLOSED_FORM = ("bernoulli", "richardson")

#: Parts that decide how cells move.
PHYSICS = ("actuator", "supply", "fluid", "valve", "conduit", "valve_lag", "delay", "contact", "relaxation")

#: Methods whose orders for a cell are the same whichever others take part.
STACKED = (
    "virtual_master", "cell_states", "elastic", "plastic", "force_display", "shape_display",
)  # fmt: skip


def why_not(scene: Scene) -> str:
    """Return why a scene cannot stand in a stack; empty for one that can."""
    if scene.sensors is not None:
        return "their sensors are no part of a stack yet"
    if scene.shape and not (scene.control and scene.method == "shape_display"):
        return "a shape comes up before their method takes over"
    if scene.control and scene.method not in STACKED:
        return f"what {scene.method} does depends on which cells take part"
    return ""


def structure(scene: Scene) -> Any:
    """Return what scenes must have in common to stand in one stack; see also `why_not`.

    With the closed-form step and Richardson's form of it, it is the kinds of the parts, not their numbers.
    The other steppers know no runs, so for them all cells must be alike.

    Raises
    ------
    ParameterError
        When the scene's parts do not go together.
    """
    physics = tuple(scene.section(name) for name in PHYSICS)
    common = (
        scene.layout,
        scene.method if scene.control else None,
        *(
            kind(part)
            for part in (tuple(finger.fingertip for finger in scene.fingers), scene.control, scene.blister)
        ),
        scene.recorder,
        scene.simulation.stepper,
    )
    if scene.simulation.stepper not in CLOSED_FORM:
        return (*common, physics, replace(scene.simulation, duration=0.0))
    system = assemble(scene)
    nodes = tuple((part.start, part.stop) for plan in _plans(system) for part in plan.nodes)
    return (*common, kind(physics), system.rows, nodes, system.instants.size)


def _plans(system: System) -> tuple[BernoulliPlan, ...]:
    """Return the plans of closed-form steps, the coarse one first; none with another stepper."""
    match system.stepper.name:
        case "bernoulli":
            return (system.plan,)
        case "richardson":
            return system.plan.coarse, system.plan.fine
    return ()


def put_together(systems: Sequence[System]) -> Stack:
    """Put systems of one structure together."""
    first, cell = systems[0], cell_of_all([system.cell for system in systems])
    period = numbers([system.period for system in systems])
    rise = period * numbers([system.fastest for system in systems])
    parts = [system.cell.touch for system in systems if system.cell.touch]
    touch = touches(parts) if parts else None
    return Stack(
        tuple(systems),
        first.rows,
        touch,
        cell.pulp_rows,
        join_controllers([system.controller for system in systems]) if first.controller else None,
        _movement(systems, cell),
        Gathering(first.grid, first.rows, cell, touch, period, rise),
    )


def _movement(systems: Sequence[System], cell: Cell) -> Movement:
    """Return how the cells of all runs are moved."""
    first = systems[0]
    plans = tuple(zip(*(_plans(system) for system in systems), strict=True))
    if not plans or (len(plans) == 1 and all(_as(first, system) for system in systems)):
        return Alike(first.stepper, first.plan)
    from .unlike import unlike

    movements = [unlike(cell, of_all) for of_all in plans]
    if len(movements) == 1:
        return movements[0]
    alone = [speeds(system.cell) for system in systems]
    of_all_runs = Speeds(numbers([one.fall for one in alone]), numbers([one.rise for one in alone]))
    coarse, fine = movements
    return Extrapolated(cell, coarse, fine, of_all_runs, numbers([system.period for system in systems]))


def _as(first: System, system: System) -> bool:
    """Return whether a run's cells move as those of the first one; how its finger is made does not matter."""
    own, other = system.cell, first.cell
    if own.touch and other.touch:
        own = replace(own, touch=replace(own.touch, fingertip=other.touch.fingertip))
    alike = own == other and system.period == first.period
    plans = zip(_plans(system), _plans(first), strict=True)
    return alike and all(np.array_equal(one.response, another.response) for one, another in plans)
