"""``python -m benchmarks ablation``: Method III with one of its parts left out at a time."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
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
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.studies.method_trials import PHASES, Trial, place_trial
from digiclay.core.studies.speed_limits import place_way

from .report import add_kind, kept, made_with, progress
from .wrong_models import run_controller

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
    """Filter that keeps nothing of what it leaves of single undersides."""

    def correct(self, *arguments: Any) -> tuple[Estimate, Floats]:
        """Return the corrected estimate, and no residuals."""
        found, left = super().correct(*arguments)
        return found, np.zeros_like(left)


def _like(kind: type[Any], part: Any, **changes: Any) -> Any:
    """Return a part of another kind with the same fields."""
    return kind(**{item.name: getattr(part, item.name) for item in fields(part)}, **changes)


def _without_relaxation(known: HybridControl) -> HybridControl:
    touch = known.pulp.touch
    # As many filters as before, without weight: a controller's rows are the device's.
    assert isinstance(touch.pulp, Relaxation)
    stiff = replace(touch.pulp, weights=(1.0, *(0.0 for _ in touch.pulp.times)))
    return replace(known, pulp=replace(known.pulp, touch=replace(touch, pulp=stiff)))


def _without_prediction(known: HybridControl) -> HybridControl:
    return replace(known, servo=_like(StillServo, replace(known.servo, ahead=0.0), aimed=known.servo.span))


def _without_commands_in_flight(known: HybridControl) -> HybridControl:
    return replace(known, servo=replace(known.servo, left=(0.0,) * len(known.servo.left)))


def _without_load(known: HybridControl) -> HybridControl:
    return replace(known, servo=_like(UnloadedServo, known.servo))


def _without_lead(known: HybridControl) -> HybridControl:
    return replace(known, profile=_like(Unled, known.profile))


def _without_residuals(known: HybridControl) -> HybridControl:
    return replace(known, finger=_like(BareFilter, known.finger))


def _without_threshold(known: HybridControl) -> HybridControl:
    least = known.parameters.felt_force
    return replace(known, felt=least, pulp=replace(known.pulp, floor=least))


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


def add(kinds: Any) -> None:
    """Add the benchmark."""
    examples = "  python -m benchmarks ablation\n  python -m benchmarks ablation --part skirt\n"
    parser = add_kind(kinds, "ablation", "Method III with one part left out at a time", examples)
    parser.add_argument("--part", metavar="P", help=f"one of {', '.join([*PARAMETERS, *PUT_TOGETHER])}")
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Run every trial without each part, and print the table."""
    parts = [*PARAMETERS, *PUT_TOGETHER]
    if arguments.part is not None:
        if arguments.part not in parts:
            raise ParameterError("--part", "", f"must be one of {', '.join(parts)}", repr(arguments.part))
        parts = list(dict.fromkeys(("nothing", arguments.part)))
    trials = FEW if arguments.quick else TRIALS
    rows: list[tuple[str, str, str, dict[str, float | None]]] = []
    with progress(arguments, "trials", len(parts) * len(trials)) as bar:
        for part in parts:
            for trajectory, noise in trials:
                rows.append((part, trajectory, noise, run_without(part, trajectory, noise)))
                bar(part)
    lines = [
        made_with(),
        "",
        "RFD, N, of the ridge drag alone, else in contact; losses, lift-offs included, and largest force, N.",
        "",
    ]
    head = ["left out", *(f"{name}, {noise}" if noise != "0" else name for name, noise in trials)]
    cells = [[part, *(_write(found) for own, *_, found in rows if own == part)] for part in parts]
    lines += list(table(head, cells))
    text = "\n".join(lines)
    print(text)
    names = ("left_out", "trajectory", "force_noise", "rfd_N", "losses", "largest_force_N")
    kept(arguments.out, "ablation", text, names, [[*row[:3], *row[3].values()] for row in rows])
    return 0


def run_without(part: str, trajectory: str, noise: str) -> dict[str, float | None]:
    """Return the figures of a trial without a part of Method III.

    `part`: in `PARAMETERS` or `PUT_TOGETHER`; `trajectory`: see `method_trials.GROUPS`; `noise`: standard
    deviation of the force sensors.
    """
    settings = [Setting("control.method", "hybrid"), Setting("sensors.force_noise", noise)]
    settings += [Setting(f"control.{name}", value) for name, value in PARAMETERS.get(part, {}).items()]
    scene, phase = load(find("ridge_mound_valley"), settings), None
    if trajectory in PHASES:
        scene, *phase = place_way(scene, *PHASES[trajectory])
    else:
        scene, _ = place_trial(scene, Trial(trajectory, trajectory))
    controller = assemble(scene).controller
    assert isinstance(controller, HybridControl)
    own = PUT_TOGETHER[part](controller) if part in PUT_TOGETHER else controller
    return run_controller(scene, own, phase)


def _write(found: Mapping[str, float | None]) -> str:
    """Write a cell of the table."""
    rfd, losses, force = (found[name] or 0.0 for name in ("rfd", "losses", "max_total_force"))
    return f"{rfd:.4f} ({losses:g}, {force:.2f})"
