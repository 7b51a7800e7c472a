"""Benchmarks ``methods`` and ``ablation``: Method III on fast drags, on other devices, and without parts."""

import argparse
import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from digiclay.commands.progress import table
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import ParameterError
from digiclay.core.control.finger_estimate import Estimate
from digiclay.core.control.hybrid import HybridControl
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.metrics.summary import compute_rfd
from digiclay.core.model.control_interface import Controller, find_set_point
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Scene
from digiclay.core.studies.speed_limits import Drag, place_way

from digiclay_study.method_trials import PHASES, measure_trial, place_trial

from .report import Report, Steps, tabulate

Figures = Mapping[str, float | None]
Part = TypeVar("Part")

#: Drags at speeds that Method I does not follow: way, orifice, m, and speed, m/s.
FAST = {
    "ridge, 44 mm/s": (Drag(), 0.5e-3, 44e-3),
    "ridge, 50 mm/s": (Drag(), 0.5e-3, 50e-3),
    "surface, 50 mm/s": (Drag(height=-1.5e-3), 0.5e-3, 50e-3),
    "valley, 50 mm/s": (Drag(height=-10e-3), 0.5e-3, 50e-3),
    "ridge, orifice 0.8 mm, 80 mm/s": (Drag(), 0.8e-3, 80e-3),
}
#: Sensors with which the session is run, by name.
SENSORS = {"noise 2 mN": "sensors.force_noise=2 mN", "delay 1 period": "sensors.delay=1"}
#: Columns of the CSV by figure, and of the table.
WRITTEN = {
    "rfd": "rfd_N", "losses": "losses", "lag_mean": "lag_mean_m", "lag_max": "lag_max_m",
    "max_total_force": "largest_force_N",
}  # fmt: skip
COLUMNS = {
    "": "trial", "RFD, N": "rfd_N .4f", "lag, mm": "lag_mean_m .4f 1e3", "at most": "lag_max_m .4f 1e3",
    "largest force, N": "largest_force_N .4f", "lost": "losses g",
}  # fmt: skip
#: Parts of Method III that are left out by another value of a parameter.
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


def list_models(true: Scene) -> dict[str, Scene]:
    """Return scenes that differ from the true one, for controllers made for them."""
    sizes = ("length", "width", "height")
    # The laminar flow goes with the fourth power of the diameter.
    changes = {
        **{f"valve × {share}": ("valve", {"orifice_diameter": share**0.25}) for share in (0.7, 1.3, 3)},
        **{f"pulp stiffness × {share}": ("contact", {"stiffness": share}) for share in (0.5, 2)},
        **{f"exponent × {share}": ("contact", {"exponent": share}) for share in (0.7, 1.4)},
        **{f"fingertip × {share}": ("fingertip", dict.fromkeys(sizes, share)) for share in (0.75, 1.3)},
        "length × 1.5": ("fingertip", {"length": 1.5}),
        "width × 0.6": ("fingertip", {"width": 0.6}),
    }
    return {name: _scale(true, part, factors) for name, (part, factors) in changes.items()}


def _scale(scene: Scene, part: str, factors: Mapping[str, float]) -> Scene:
    """Return a scene with some numbers of a part times a factor."""
    section = scene.section(part)
    changed = {name: getattr(section, name) * by for name, by in factors.items()}
    return scene.with_sections(**{part: replace(section, **changed)})


def run_mismatched(true: Scene, model: Scene) -> Figures:
    """Return the figures of a session whose controller is made for another device, `model`."""
    controller = assemble(model).controller
    assert controller is not None  # scenes of the benchmark have one
    return run_controller(true, controller)


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Run the drags, and the session on other devices and with sensors."""
    true, sensing = _scene(), {name: _scene(change) for name, change in SENSORS.items()}
    jobs: dict[str, Callable[[], Figures]] = {
        **{name: partial(_follow, *drag) for name, drag in FAST.items()},
        **{name: partial(run_mismatched, true, model) for name, model in list_models(true).items()},
        **{name: partial(run_mismatched, scene, scene) for name, scene in sensing.items()},
    }
    names = list(jobs)[len(FAST) - 1 : len(FAST) + 1] if arguments.quick else list(jobs)
    rows = []
    for name in steps.through(names):
        figures = jobs[name]()
        rows.append({"trial": name, **{column: figures.get(key) for key, column in WRITTEN.items()}})
    title = (
        "\nMethod III: drags at speeds that Method I does not follow;\n"
        "then the session with a controller made for another device, or with sensors.\n"
        "Lost: of the session with lift-offs.\n"
    )
    return Report([title, *tabulate(rows, COLUMNS)], rows)


def _scene(*changes: str) -> Scene:
    """Return the paper's session with Method III and settings, key=value."""
    settings = [Setting(*change.split("=", 1)) for change in ("control.method=hybrid", *changes)]
    return load(find("ridge_mound_valley"), settings)


def _follow(way: Drag, orifice: float, speed: float) -> Figures:
    """Return the figures of a drag."""
    placed, start, end = place_way(_scene(f"valve.orifice_diameter={orifice}"), way, speed)
    record = measure_trial(placed, phase=(start, end))
    assert record is not None  # it is not stopped
    figures: Figures = record["figures"]
    return figures


# Method III with one of its parts left out at a time

#: Trajectories, and the noise of the force sensors on them.
TRIALS = (("session", "0"), ("session", "2 mN"), ("twisted", "0"), ("dead-stop", "0"), ("ridge-40", "0"))
#: Those of --quick.
FEW = (("ridge-40", "0"),)


def _override(part: Part, **methods: object) -> Part:
    """Return a copy of a part with other methods or values in place of its own."""
    other = copy.copy(part)
    vars(other).update(methods)
    return other


def _without_relaxation(control: HybridControl) -> HybridControl:
    touch = control.pulp.touch
    # As many filters as before, without weight: a controller's rows are the device's.
    assert isinstance(touch.pulp, Relaxation)
    stiff = replace(touch.pulp, weights=(1.0, *(0.0 for _ in touch.pulp.times)))
    return replace(control, pulp=replace(control.pulp, touch=replace(touch, pulp=stiff)))


def _without_prediction(control: HybridControl) -> HybridControl:
    # Commands for the heights now act as long as before.
    still = _override(replace(control.servo, ahead=0.0), span=control.servo.span)
    return replace(control, servo=still)


def _without_residuals(control: HybridControl) -> HybridControl:
    def correct(*arguments: Any) -> tuple[list[Estimate], Floats]:
        estimates, residuals = control.finger.correct(*arguments)
        return estimates, np.zeros_like(residuals)

    return replace(control, finger=_override(control.finger, correct=correct))


def _without_lead(control: HybridControl) -> HybridControl:
    def find_drop(distance: Floats, *_: Any) -> Floats:
        return np.where(distance > control.profile.level, np.inf, 0.0)

    unled = _override(control.profile, find_reach=lambda height, speed: 0.0, find_drop=find_drop)
    return replace(control, profile=unled)


def _without_load(control: HybridControl) -> HybridControl:
    def find_limits(force: Floats) -> Floats:
        return control.servo.find_limits(np.zeros_like(force))

    return replace(control, servo=_override(control.servo, find_limits=find_limits))


def _without_threshold(control: HybridControl) -> HybridControl:
    least = control.parameters.felt_force
    return replace(control, felt=least, pulp=replace(control.pulp, floor=least))


#: Parts that are left out by a controller put together otherwise.
PUT_TOGETHER: dict[str, Callable[[HybridControl], HybridControl]] = {
    "relaxation of the pulp": _without_relaxation,
    "prediction of the fingertip": _without_prediction,
    "residuals of the fit": _without_residuals,
    "lead and skirt": _without_lead,
    "commands in flight": lambda control: replace(
        control, servo=replace(control.servo, left=(0.0,) * len(control.servo.left))
    ),
    "load of the pins": _without_load,
    "threshold of the noise": _without_threshold,
}


def measure_ablation(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Run every trial without each part."""
    parts = [*PARAMETERS, *PUT_TOGETHER]
    if arguments.part is not None:
        if arguments.part not in parts:
            raise ParameterError("--part", "", f"must be one of {', '.join(parts)}", repr(arguments.part))
        parts = list(dict.fromkeys(("nothing", arguments.part)))
    trials = FEW if arguments.quick else TRIALS
    jobs = [(part, *trial) for part in parts for trial in trials]
    rows, cells = [], {part: [part] for part in parts}
    for job in steps.through(jobs, lambda job: job[0]):
        figures = run_without(*job)
        rfd, losses, force = (figures[name] or 0.0 for name in ("rfd", "losses", "max_total_force"))
        cells[job[0]].append(f"{rfd:.4f} ({losses:g}, {force:.2f})")
        names = ("left_out", "trajectory", "force_noise", "rfd_N", "losses", "largest_force_N")
        rows.append(dict(zip(names, (*job, *figures.values()), strict=True)))
    head = ["left out", *(f"{name}, {noise}" if noise != "0" else name for name, noise in trials)]
    title = "RFD, N, of the ridge drag alone, else in contact; losses with lift-offs, and largest force."
    return Report(["", title, "", *table(head, list(cells.values()))], rows)


def run_without(part: str, trajectory: str, noise: str) -> Figures:
    """Return the figures of a trial without a part of Method III; `trajectory`: of `method_trials.GROUPS`."""
    scene = _scene(
        f"sensors.force_noise={noise}",
        *(f"control.{name}={value}" for name, value in PARAMETERS.get(part, {}).items()),
    )
    phase: Sequence[float] | None = None
    if trajectory in PHASES:
        scene, *phase = place_way(scene, *PHASES[trajectory])
    else:
        scene, _ = place_trial(scene, trajectory)
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
