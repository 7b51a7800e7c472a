"""Structure of scenes: a batch has scenes of one structure."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import Any

from ..model.layout import Grid, make_grid
from ..scene.assembly import Motion, count_rows, make_motion
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
PHYSICS = ("actuator", "supply", "fluid", "valve", "conduit", "valve_lag", "delay", "contact", "relaxation")


#: Most cached kinds of parts, motions of cells, and beds: a bed can have a million cells.
KINDS, MOTIONS, BEDS = 4096, 1024, 2


class Findings:
    """Cache of functions of parts, for scenes with equal parts."""

    def __init__(self) -> None:
        self._results: dict[int, dict[Any, Any]] = {KINDS: {}, MOTIONS: {}, BEDS: {}}

    def find(self, most: int, key: Any, make: Callable[..., Any], *given: Any) -> Any:
        """Return the result for a key, computed once; the oldest of `most` results is dropped."""
        results = self._results[most]
        if key not in results:
            if len(results) >= most:
                del results[next(iter(results))]
            results[key] = make(*given)
        return results[key]


def describe_structure(scene: Scene, findings: Findings | None = None) -> Any:
    """Return a key that scenes of one batch have in common.

    For the closed-form and the Richardson stepper it has the kinds of the parts, not their numbers. Other
    steppers have no axis of runs: all cells must be alike. `findings`: cache of earlier scenes. Raises
    ParameterError if the parts of the scene are not compatible.
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
