"""Benchmark ``ablation``: Method III with one of its parts left out at a time."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from digiclay.commands.progress import table
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import ParameterError
from digiclay.core.control.finger_estimate import Estimate, FingerFilter
from digiclay.core.control.flow_servo import FlowServo
from digiclay.core.control.hybrid import HybridControl
from digiclay.core.control.led_blister import LeadProfile
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.metrics.force import compute_rfd
from digiclay.core.model.control_interface import Controller, find_set_point
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Scene
from digiclay.core.studies.speed_limits import place_way

from digiclay_study.method_trials import PHASES, Trial, place_trial

from .report import Report, Steps

#: Trajectories, and the noise of the force sensors on them.
TRIALS = (("session", "0"), ("session", "2 mN"), ("twisted", "0"), ("dead-stop", "0"), ("ridge-40", "0"))
#: Those of --quick.
FEW = (("ridge-40", "0"),)


@dataclass(frozen=True, eq=False)
class StillServo(FlowServo):
    """Servo for heights now: its controller does not predict the place of the fingertip."""

    aimed: float = 0.0

    @cached_property
    def span(self) -> float:
        """How long a new command acts until the heights aimed at, s."""
        return self.aimed


@dataclass(frozen=True, eq=False)
class UnloadedServo(FlowServo):
    """Servo of pins that are taken to be without load."""

    def find_limits(self, force: Floats) -> Floats:
        """Return lowest and highest speeds of pins without load, m/s."""
        return super().find_limits(np.zeros_like(force))


class Unled(LeadProfile):
    """Heights of which none is led."""

    def find_reach(self, height: float, speed: float) -> float:
        """Return the radius within which pins may be led, m."""
        return 0.0

    def find_drop(self, distance: Floats, ahead: Floats, speed: float, *, raised: bool) -> Floats:
        """Return how far pins may stand from the top, m."""
        return np.where(distance > self.level, np.inf, 0.0)


@dataclass(frozen=True, eq=False)
class BareFilter(FingerFilter):
    """Filter without the residuals of single undersides."""

    def correct(self, *arguments: Any) -> tuple[Estimate, Floats]:
        """Return the corrected estimate, and no residuals."""
        estimate, residuals = super().correct(*arguments)
        return estimate, np.zeros_like(residuals)


def _like(kind: type[Any], part: Any, **changes: Any) -> Any:
    """Return a part of another kind with the same fields."""
    return kind(**{item.name: getattr(part, item.name) for item in fields(part)}, **changes)


def _without_relaxation(control: HybridControl) -> HybridControl:
    touch = control.pulp.touch
    # As many filters as before, without weight: a controller's rows are the device's.
    assert isinstance(touch.pulp, Relaxation)
    stiff = replace(touch.pulp, weights=(1.0, *(0.0 for _ in touch.pulp.times)))
    return replace(control, pulp=replace(control.pulp, touch=replace(touch, pulp=stiff)))


def _without_prediction(control: HybridControl) -> HybridControl:
    return replace(
        control, servo=_like(StillServo, replace(control.servo, ahead=0.0), aimed=control.servo.span)
    )


def _without_commands_in_flight(control: HybridControl) -> HybridControl:
    return replace(control, servo=replace(control.servo, left=(0.0,) * len(control.servo.left)))


def _without_load(control: HybridControl) -> HybridControl:
    return replace(control, servo=_like(UnloadedServo, control.servo))


def _without_lead(control: HybridControl) -> HybridControl:
    return replace(control, profile=_like(Unled, control.profile))


def _without_residuals(control: HybridControl) -> HybridControl:
    return replace(control, finger=_like(BareFilter, control.finger))


def _without_threshold(control: HybridControl) -> HybridControl:
    least = control.parameters.felt_force
    return replace(control, felt=least, pulp=replace(control.pulp, floor=least))


#: Parts that are left out by another value of a parameter.
PARAMETERS: dict[str, Mapping[str, str]] = {
    "nothing": {},
    "skirt": {"skirt_speed": "0"},
    "trim": {"trim_time": "1e6"},
    "level margin": {"level_margin": "0"},
    "share of the free speed": {"speed_share": "1"},
    "turn": {"turn": "0"},
    "size": {"size_drift": "0"},
    "release by contact": {"release_force": "1e3"},
}
#: Parts that are left out by a controller put together otherwise.
PUT_TOGETHER: dict[str, Callable[[HybridControl], HybridControl]] = {
    "relaxation of the pulp": _without_relaxation,
    "prediction of the fingertip": _without_prediction,
    "residuals of the fit": _without_residuals,
    "lead and skirt": _without_lead,
    "commands in flight": _without_commands_in_flight,
    "load of the pins": _without_load,
    "threshold of the noise": _without_threshold,
}


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Run every trial without each part."""
    parts = [*PARAMETERS, *PUT_TOGETHER]
    if arguments.part is not None:
        if arguments.part not in parts:
            raise ParameterError("--part", "", f"must be one of {', '.join(parts)}", repr(arguments.part))
        parts = list(dict.fromkeys(("nothing", arguments.part)))
    trials = FEW if arguments.quick else TRIALS
    jobs = [(part, *trial) for part in parts for trial in trials]
    figures = {job: run_without(*job) for job in steps.through(jobs, lambda job: job[0])}
    head = ["left out", *(f"{name}, {noise}" if noise != "0" else name for name, noise in trials)]
    cells = [[part, *(_write(figures[part, *trial]) for trial in trials)] for part in parts]
    title = "RFD, N, of the ridge drag alone, else in contact; losses with lift-offs, and largest force."
    names = ("left_out", "trajectory", "force_noise", "rfd_N", "losses", "largest_force_N")
    rows = [[*job, *values.values()] for job, values in figures.items()]
    return Report(["", title, "", *table(head, cells)], names, rows)


def run_without(part: str, trajectory: str, noise: str) -> dict[str, float | None]:
    """Return the figures of a trial without a part of Method III; `trajectory`: of `method_trials.GROUPS`."""
    settings = [Setting("control.method", "hybrid"), Setting("sensors.force_noise", noise)]
    settings += [Setting(f"control.{name}", value) for name, value in PARAMETERS.get(part, {}).items()]
    scene, phase = load(find("ridge_mound_valley"), settings), None
    if trajectory in PHASES:
        scene, *phase = place_way(scene, *PHASES[trajectory])
    else:
        scene, _ = place_trial(scene, Trial(trajectory, trajectory))
    controller = assemble(scene).controller
    assert isinstance(controller, HybridControl)
    if part in PUT_TOGETHER:
        controller = PUT_TOGETHER[part](controller)
    return run_controller(scene, controller, phase)


def run_controller(
    scene: Scene, controller: Controller, phase: Sequence[float] | None = None
) -> dict[str, float | None]:
    """Return RFD, losses and largest force of a session with a controller in place of the scene's.

    `phase`: start and end of the part over whose rows the RFD is taken, s; by default rows in contact.
    """
    system = replace(assemble(scene), controller=controller)
    forces, losses = [], 0
    for state in periods(system, scene.trajectories(), begin(system), scene.periods):
        forces.append(float(state.active.all.force.sum()))
        losses = state.memory.losses
    total = np.array(forces)
    wanted = find_set_point(scene.set_point, total)
    moments = np.arange(1, total.size + 1) * system.period
    rows = None if phase is None else (moments >= phase[0]) & (moments <= phase[1])
    rfd = compute_rfd(moments, total, wanted, rows)
    return {"rfd": rfd, "losses": float(losses), "max_total_force": float(total.max())}


def _write(figures: Mapping[str, float | None]) -> str:
    """Write a cell of the table."""
    rfd, losses, force = (figures[name] or 0.0 for name in ("rfd", "losses", "max_total_force"))
    return f"{rfd:.4f} ({losses:g}, {force:.2f})"
