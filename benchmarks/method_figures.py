"""Benchmarks ``methods`` and ``ablation``: Methods I and III over paths, and Method III without parts."""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
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
from digiclay.core.session.run_scene import run
from digiclay.core.studies.axes import Record
from digiclay.core.studies.speed_limits import Drag, place_way

from digiclay_study.method_trials import (
    GROUPS,
    LIMITS,
    PHASES,
    Trial,
    drag_row,
    lift_off,
    list_trials,
    measure_trial,
    place_trial,
    with_path,
)

from .report import BLUE, RED, Report, Row, Steps

Figures = Mapping[str, float | None]

#: Methods with a set point of the total force, and their colors and marks: Okabe and Ito's.
SHOWN = {"virtual_master": ("Method I", BLUE, "o"), "hybrid": ("Method III", RED, "D")}
#: Random drags with --quick and without.
QUICK, FULL = 2, 20
#: Sessions that are timed, by turns.
TURNS = 5
#: Drags of Method III alone: way, orifice, m, and speed, m/s.
FAST = {
    "ridge, 44 mm/s": (Drag(), 0.5e-3, 44e-3),
    "ridge, 50 mm/s": (Drag(), 0.5e-3, 50e-3),
    "surface, 50 mm/s": (Drag(height=-1.5e-3), 0.5e-3, 50e-3),
    "valley, 50 mm/s": (Drag(height=-10e-3), 0.5e-3, 50e-3),
    "ridge, orifice 0.8 mm, 80 mm/s": (Drag(), 0.8e-3, 80e-3),
}
#: Columns of the CSV by figure.
WRITTEN = {
    "rfd": "rfd_N", "losses": "losses", "lag_mean": "lag_mean_m", "lag_max": "lag_max_m",
    "max_total_force": "largest_force_N", "ridge_unevenness": "unevenness_m", "relief_rms": "relief_rms_m",
    "relief_largest": "relief_largest_m",
}  # fmt: skip
#: Columns of the tables: heading, figure and factor.
COLUMNS = (
    ("RFD", "rfd", 1.0), ("lag mm", "lag_mean", 1e3), ("max lag", "lag_max", 1e3),
    ("max N", "max_total_force", 1.0),
)  # fmt: skip
#: Turns and tilts of the fingertip, degrees.
ANGLES, TILTS = tuple(range(0, 181, 15)), (0, 15, 30)
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
#: Those left out on the ridge drag of `methods`.
PARTS = {
    "all": {},
    **{f"without {name}": PARAMETERS[name] for name in ("skirt", "trim", "level margin")},
    "without turn and size": {**PARAMETERS["turn"], **PARAMETERS["size"]},
}
#: What the rows of Method III alone are.
TITLES = (
    "Method III at speeds that Method I does not follow",
    "Method III made for another device, or with sensors",
    "Method III with a part left out: ridge drag at 40 mm/s",
    "Turned and tilted fingertip: drag between two rows of pins at 15 mm/s",
)


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
    """Run every trial."""
    groups = tuple(group for group in GROUPS if group not in LIMITS)
    trials = list_trials(groups, QUICK if arguments.quick else FULL)
    compared = [(trial.name, method, _measure, _scene(method), trial) for method in SHOWN for trial in trials]
    true = _scene("hybrid")
    noisy = {"noise 2 mN": "sensors.force_noise=2 mN", "delay 1 period": "sensors.delay=1"}
    turns = (90,) if arguments.quick else ANGLES
    alone: tuple[list[tuple[Any, ...]], ...] = (
        [(name, "hybrid", _follow, _scene("hybrid", f"valve.orifice_diameter={bore}"), way, speed)
         for name, (way, bore, speed) in FAST.items()],
        [*((name, "hybrid", run_mismatched, true, model) for name, model in list_models(true).items()),
         *((name, "hybrid", _measure, _scene("hybrid", change), Trial("session", "session"))
           for name, change in noisy.items())],
        [(name, "hybrid", _follow, _scene("hybrid", *_write_settings(control)), *PHASES["ridge-40"])
         for name, control in PARTS.items()],
        [(f"turn {turn}°, tilt {tilt}°, {method}", method, _drag, _scene(method), turn, tilt)
         for tilt, turn, method in itertools.product(TILTS, turns, SHOWN)],
    )  # fmt: skip
    jobs = [job for some in (compared, *alone) for job in some]
    rows = [
        {"trial": name, "method": method, **trial(*given)}
        for name, method, trial, *given in steps.through(jobs, lambda job: str(job[0]))
    ]
    ends = list(itertools.accumulate(map(len, alone), initial=len(compared)))
    parts = [rows[start:end] for start, end in itertools.pairwise(ends)]
    cost = _compare_cost(2 if arguments.quick else TURNS)
    written = [
        {"trial": row["trial"], "method": row["method"], **{WRITTEN[key]: row.get(key) for key in WRITTEN}}
        for row in rows
    ]
    first = rows[: len(compared)]
    names = list(dict.fromkeys(row["trial"] for row in first))[::-1]
    return Report(
        list(_list_lines(first, parts, cost)), written, lambda figure: _draw(figure, names, first),
        (7.2, 0.8 + 0.22 * len(names)),
    )  # fmt: skip


def _scene(method: str, *changes: str) -> Scene:
    """Return the paper's session with a method and more settings, key=value."""
    settings = [Setting(*change.split("=", 1)) for change in (f"control.method={method}", *changes)]
    return load(find("ridge_mound_valley"), settings)


def _write_settings(control: Mapping[str, str]) -> list[str]:
    return [f"control.{name}={value}" for name, value in control.items()]


def _measure(scene: Scene, trial: Trial) -> Figures:
    """Return the figures of a trial."""
    placed, measure = place_trial(scene, trial)
    return _take(measure(placed, None))


def _follow(scene: Scene, way: Drag, speed: float) -> Figures:
    """Return the figures of a drag."""
    placed, start, end = place_way(scene, way, speed)
    return _take(measure_trial(placed, phase=(start, end)))


def _drag(scene: Scene, turn: float, tilt: float) -> Figures:
    """Return the figures of a drag between two rows of pins with a turned and tilted fingertip, degrees."""
    poses = drag_row(math.radians(turn), math.radians(tilt))
    return _take(measure_trial(lift_off(with_path(scene, poses, "linear"))))


def _take(record: Record | None) -> Figures:
    """Return the figures of a record."""
    assert record is not None  # no trial is stopped
    figures: Figures = record["figures"]
    return figures


def _compare_cost(turns: int) -> dict[str, float]:
    """Return the processor time of a control period by method, s: medians of sessions run by turns."""
    spent: dict[str, list[float]] = {method: [] for method in SHOWN}
    for _ in range(turns):
        for method, times in spent.items():
            scene = replace(_scene(method), recorder=None)
            start = time.process_time()
            run(scene)
            times.append((time.process_time() - start) / scene.periods)
    return {method: statistics.median(times) for method, times in spent.items()}


def _list_lines(
    rows: Sequence[Row], others: Sequence[Sequence[Row]], cost: Mapping[str, float]
) -> Iterator[str]:
    """Give the lines of the report; `others`: rows of Method III by `TITLES`."""
    yield "\nRFD, N, of a whole session, or of a drag where a speed is given. Lost: but for lift-offs.\n"
    by = {(row["trial"], row["method"]): row for row in rows}
    lines = []
    for name in dict.fromkeys(row["trial"] for row in rows):
        first, third = by[name, "virtual_master"], by[name, "hybrid"]
        ratio = (third["rfd"] or math.nan) / (first["rfd"] or math.nan)
        lines.append([name, *_list_cells(first), *_list_cells(third), f"{ratio:.2f}"])
    heads = [*(head for head, _, _ in COLUMNS), "lost"]
    yield from table(
        ("", *(f"I {head}" for head in heads), *(f"III {head}" for head in heads), "III / I"), lines
    )
    for title, some in zip(TITLES, others, strict=True):
        yield f"\n{title}\n"
        yield from table(("", *heads), [[row["trial"], *_list_cells(row)] for row in some])
    ratio = cost["hybrid"] / cost["virtual_master"]
    listed = ", ".join(f"{SHOWN[method][0]} {1e6 * spent:.0f} µs" for method, spent in cost.items())
    yield f"\nProcessor time a control period, medians by turns: {listed}; ratio {ratio:.2f}"


def _list_cells(row: Row) -> list[str]:
    """Return the cells of a table."""
    values = [(row.get(key), factor) for _, key, factor in COLUMNS]
    cells = ["" if value is None else f"{value * factor:.4f}" for value, factor in values]
    return [*cells, f"{row['losses'] or 0.0:g}"]


def _draw(figure: Any, names: Sequence[str], rows: Sequence[Row]) -> None:
    """Draw the RFD of all trials, one line a trial."""
    panel = figure.subplots()
    for method, (label, color, mark) in SHOWN.items():
        rfd = {row["trial"]: row["rfd"] or math.nan for row in rows if row["method"] == method}
        panel.plot([1e3 * rfd[name] for name in names], range(len(names)), mark, color=color, label=label)
    panel.set_yticks(range(len(names)), names)
    panel.set(xscale="log", xlabel="reference force deviation, mN")
    panel.grid(axis="x", which="both", alpha=0.3)
    panel.legend(loc="lower right")


# Method III with one of its parts left out at a time

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
    servo = _like(StillServo, replace(control.servo, ahead=0.0), aimed=control.servo.span)
    return replace(control, servo=servo)


def _without_threshold(control: HybridControl) -> HybridControl:
    least = control.parameters.felt_force
    return replace(control, felt=least, pulp=replace(control.pulp, floor=least))


#: Parts that are left out by a controller put together otherwise.
PUT_TOGETHER: dict[str, Callable[[HybridControl], HybridControl]] = {
    "relaxation of the pulp": _without_relaxation,
    "prediction of the fingertip": _without_prediction,
    "residuals of the fit": lambda control: replace(control, finger=_like(BareFilter, control.finger)),
    "lead and skirt": lambda control: replace(control, profile=_like(Unled, control.profile)),
    "commands in flight": lambda control: replace(
        control, servo=replace(control.servo, left=(0.0,) * len(control.servo.left))
    ),
    "load of the pins": lambda control: replace(control, servo=_like(UnloadedServo, control.servo)),
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
    scene = _scene("hybrid", f"sensors.force_noise={noise}", *_write_settings(PARAMETERS.get(part, {})))
    phase: Sequence[float] | None = None
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
