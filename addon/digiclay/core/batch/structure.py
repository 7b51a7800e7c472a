"""Structure of scenes: a batch has scenes of one structure."""

from dataclasses import fields, is_dataclass, replace
from typing import Any

from ..engine.system import System
from ..scene.assembly import assemble
from ..scene.schema import Scene
from ..steppers.bernoulli import BernoulliPlan


def classify(value: Any) -> Any:
    """Return a part without its numbers; parts for which it is equal can be merged."""
    if is_dataclass(value) and not isinstance(value, type):
        return type(value), *(classify(getattr(value, field.name)) for field in fields(value))
    if isinstance(value, tuple):
        return tuple(classify(part) for part in value)
    return float if isinstance(value, float) else value


#: Steppers for cells whose numbers differ from run to run.
CLOSED_FORM = ("bernoulli", "richardson")


#: Parts that decide how cells move.
PHYSICS = (
    "actuator",
    "supply",
    "fluid",
    "valve",
    "conduit",
    "valve_lag",
    "delay",
    "contact",
    "relaxation",
)


def describe_structure(scene: Scene, system: System | None = None) -> Any:
    """Return a key that scenes of one batch have in common.

    For the closed-form and the Richardson stepper it has the kinds of the parts, not their numbers.
    Other steppers have no axis of runs: all cells must be alike. Raises ParameterError if parts of
    the scene are not compatible, or for several fingers.
    """
    physics = tuple(scene.section(name) for name in PHYSICS)
    sensors = scene.sensors and replace(scene.sensors, seed=0)
    rounds = sensors and bool(sensors.force_step or sensors.height_step)
    parts = scene.section("fingertip"), scene.control, scene.blister, sensors
    common = (
        scene.layout,
        scene.method if scene.control else None,
        scene.shape is None,
        classify(parts),
        rounds,
        sensors and sensors.noisy,
        scene.recorder,
        scene.simulation.stepper,
    )
    if scene.simulation.stepper not in CLOSED_FORM:
        hand = classify(scene.section("hand"))
        return (*common, physics, hand, replace(scene.simulation, duration=0.0))
    system = system or assemble(scene)
    plan: Any = system.plan
    plans = (plan,) if isinstance(plan, BernoulliPlan) else (plan.coarse, plan.fine)
    nodes = tuple(
        (plan.laminar, *((part.start, part.stop) for part in plan.nodes)) for plan in plans
    )
    return (*common, classify(physics), system.rows, nodes, system.instants.size, len(system.hands))
