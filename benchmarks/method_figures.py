"""Benchmark ``methods``: force deviation of Methods I and III over paths and drags."""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from digiclay.commands.progress import table
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import run
from digiclay.core.studies.axes import Record
from digiclay.core.studies.speed_limits import Drag, place_way
from digiclay.plots.figure import empty

from digiclay_study.method_trials import (
    GROUPS,
    LIMITS,
    Trial,
    drag_row,
    lift_off,
    list_trials,
    measure_trial,
    place_trial,
    with_path,
)

from .ablation import run_controller
from .report import BLUE, RED, STYLE, Report, Steps

SESSION = "ridge_mound_valley"
#: Methods with a set point of the total force, and their colors and marks: Okabe and Ito's.
SHOWN = {"virtual_master": ("Method I", BLUE, "o"), "hybrid": ("Method III", RED, "D")}
#: Random drags with --quick and without.
QUICK, FULL = 2, 20
#: Sessions that are timed, by turns.
TURNS = 5
#: Drags of Method III alone: name, way, orifice, m, and speed, m/s.
FAST = (
    ("ridge, 44 mm/s", Drag(), 0.5e-3, 44e-3),
    ("ridge, 50 mm/s", Drag(), 0.5e-3, 50e-3),
    ("surface, 50 mm/s", Drag(height=-1.5e-3), 0.5e-3, 50e-3),
    ("valley, 50 mm/s", Drag(height=-10e-3), 0.5e-3, 50e-3),
    ("ridge, orifice 0.8 mm, 80 mm/s", Drag(), 0.8e-3, 80e-3),
)
#: Columns of the CSV by figure.
WRITTEN = {
    "rfd": "rfd_N", "losses": "losses", "lag_mean": "lag_mean_m", "lag_max": "lag_max_m",
    "max_total_force": "largest_force_N", "ridge_unevenness": "unevenness_m", "relief_rms": "relief_rms_m",
    "relief_largest": "relief_largest_m",
}  # fmt: skip
#: Speed of the ridge drag with parts left out, m/s.
PARTS_SPEED = 40e-3
#: Turns and tilts of the fingertip, degrees.
ANGLES, TILTS = tuple(range(0, 181, 15)), (0, 15, 30)
#: Parameters with which a part of Method III is left out.
PARTS: dict[str, dict[str, str]] = {
    "all": {},
    "without skirt": {"skirt_speed": "0"},
    "without trim": {"trim_time": "1e6"},
    "without level margin": {"level_margin": "0"},
    "without turn and size": {"turn": "0", "size_drift": "0"},
}
#: What the rows of Method III alone are.
TITLES = (
    "Method III at speeds that Method I does not follow",
    "Method III made for another device, or with sensors",
    "Method III with a part left out: ridge drag at 40 mm/s",
    "Turned and tilted fingertip: drag between two rows of pins at 15 mm/s",
)

Figures = Mapping[str, float | None]
Row = tuple[str, str, Figures]


def _scale(scene: Scene, part: str, **factors: float) -> Scene:
    """Return a scene with some numbers of a part of its fingertip times a factor."""
    section = scene.section(part)
    changed = {name: getattr(section, name) * by for name, by in factors.items()}
    return scene.with_sections(**{part: replace(section, **changed)})


def list_models(true: Scene) -> dict[str, Scene]:
    """Return scenes that differ from the true one, for controllers made for them."""
    sizes = ("length", "width", "height")
    # The laminar flow goes with the fourth power of the diameter.
    valves = {
        f"valve × {share}": replace(
            true, valve=replace(true.valve, orifice_diameter=true.valve.orifice_diameter * share**0.25)
        )
        for share in (0.7, 1.3, 3)
    }
    return {
        **valves,
        "pulp stiffness × 0.5": _scale(true, "contact", stiffness=0.5),
        "pulp stiffness × 2": _scale(true, "contact", stiffness=2.0),
        "exponent × 0.7": _scale(true, "contact", exponent=0.7),
        "exponent × 1.4": _scale(true, "contact", exponent=1.4),
        "fingertip × 0.75": _scale(true, "fingertip", **dict.fromkeys(sizes, 0.75)),
        "fingertip × 1.3": _scale(true, "fingertip", **dict.fromkeys(sizes, 1.3)),
        "length × 1.5": _scale(true, "fingertip", length=1.5),
        "width × 0.6": _scale(true, "fingertip", width=0.6),
    }


def run_mismatched(true: Scene, model: Scene) -> dict[str, float | None]:
    """Return the figures of a session whose controller is made for another device, `model`."""
    controller = assemble(model).controller
    assert controller is not None  # scenes of the benchmark have one
    return run_controller(true, controller)


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Run every trial."""
    groups = tuple(group for group in GROUPS if group not in LIMITS)
    trials = list_trials(groups, QUICK if arguments.quick else FULL)
    steps.total = len(SHOWN) * len(trials) + len(FAST) + 13 + len(PARTS)
    steps.total += len(SHOWN) * len(TILTS) * (1 if arguments.quick else len(ANGLES))
    rows = list(_run_trials(trials, steps))
    fast = [
        (name, "hybrid", _run(steps, name, _follow, _scene("hybrid", orifice=bore), way, speed))
        for name, way, bore, speed in FAST
    ]
    wrong = list(_run_models(steps))
    parts = [
        (name, "hybrid", _run(steps, name, _follow, _scene("hybrid", control), Drag(), PARTS_SPEED))
        for name, control in PARTS.items()
    ]
    turned = list(_run_turns((90,) if arguments.quick else ANGLES, steps))
    cost = _compare_cost(2 if arguments.quick else TURNS)
    every = [*rows, *fast, *wrong, *parts, *turned]
    figures = [[name, method, *map(values.get, WRITTEN)] for name, method, values in every]
    lines = list(_list_lines(rows, (fast, wrong, parts, turned), cost))
    return Report(lines, ("trial", "method", *WRITTEN.values()), figures, lambda: _draw(rows))


def _scene(method: str, control: Mapping[str, str] = MappingProxyType({}), orifice: float = 0.5e-3) -> Scene:
    """Return the paper's session with a method."""
    settings = [Setting("control.method", method), Setting("valve.orifice_diameter", str(orifice))]
    settings += [Setting(f"control.{name}", value) for name, value in control.items()]
    return load(find(SESSION), settings)


def _run(bar: Callable[[str], None], name: str, trial: Callable[..., Figures], *arguments: Any) -> Figures:
    """Return the figures of a trial, and step the bar."""
    found = trial(*arguments)
    bar(name)
    return found


def _measure(scene: Scene, trial: Trial) -> Figures:
    """Return the figures of a trial."""
    placed, measure = place_trial(scene, trial)
    return _take(measure(placed, None))


def _follow(scene: Scene, way: Drag, speed: float) -> Figures:
    """Return the figures of a drag."""
    placed, start, end = place_way(scene, way, speed)
    return _take(measure_trial(placed, phase=(start, end)))


def _take(record: Record | None) -> Figures:
    """Return the figures of a record."""
    assert record is not None  # nobody stops it
    figures: Figures = record["figures"]
    return figures


def _run_trials(trials: Sequence[Trial], bar: Callable[[str], None]) -> Iterator[Row]:
    """Run all trials with both methods."""
    for method in SHOWN:
        for trial in trials:
            yield trial.name, method, _run(bar, trial.name, _measure, _scene(method), trial)


def _run_models(bar: Callable[[str], None]) -> Iterator[Row]:
    """Run the session with controllers made for other devices, with noise and with delay."""
    true = _scene("hybrid")
    for name, model in list_models(true).items():
        yield name, "hybrid", _run(bar, name, run_mismatched, true, model)
    for name, key, value in (("noise 2 mN", "force_noise", "2 mN"), ("delay 1 period", "delay", "1")):
        scene = load(find(SESSION), [Setting("control.method", "hybrid"), Setting(f"sensors.{key}", value)])
        yield name, "hybrid", _run(bar, name, _measure, scene, Trial("session", "session"))


def _run_turns(turns: Sequence[int], bar: Callable[[str], None]) -> Iterator[Row]:
    """Run drags between two rows of pins with a turned and tilted fingertip, degrees, by both methods."""
    for tilt, turn, method in itertools.product(TILTS, turns, SHOWN):
        poses, name = (
            drag_row(math.radians(turn), math.radians(tilt)),
            f"turn {turn}°, tilt {tilt}°, {method}",
        )
        scene = lift_off(with_path(_scene(method), poses, "linear"))
        yield name, method, _run(bar, name, lambda known: _take(measure_trial(known)), scene)


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


def _list_lines(rows: list[Row], others: tuple[list[Row], ...], cost: dict[str, float]) -> Iterator[str]:
    """Give the lines of the report; `others`: rows of Method III by `TITLES`."""
    yield "\nRFD, N, of a whole session, or of a drag where a speed is given. Lost: but for lift-offs.\n"
    by = {(name, method): figures for name, method, figures in rows}
    lines = []
    for name in dict.fromkeys(name for name, _, _ in rows):
        first, third = by[name, "virtual_master"], by[name, "hybrid"]
        ratio = (third["rfd"] or math.nan) / (first["rfd"] or math.nan)
        lines.append([name, *_list_cells(first), *_list_cells(third), f"{ratio:.2f}"])
    columns = ("RFD", "lag mm", "max lag", "max N", "lost")
    yield from table(("", *(f"I {c}" for c in columns), *(f"III {c}" for c in columns), "III / I"), lines)
    for title, some in zip(TITLES, others, strict=True):
        yield f"\n{title}\n"
        yield from table(("", *columns), [[name, *_list_cells(figures)] for name, _, figures in some])
    ratio = cost["hybrid"] / cost["virtual_master"]
    listed = ", ".join(f"{SHOWN[method][0]} {1e6 * spent:.0f} µs" for method, spent in cost.items())
    yield f"\nProcessor time a control period, medians by turns: {listed}; ratio {ratio:.2f}"


def _list_cells(figures: Figures) -> list[str]:
    """Return the cells of a table."""
    lags = [figures.get("lag_mean"), figures.get("lag_max")]
    numbers = [
        figures["rfd"],
        *(None if lag is None else 1e3 * lag for lag in lags),
        figures["max_total_force"],
    ]
    listed = ["" if number is None else f"{number:.4f}" for number in numbers]
    return [*listed, f"{figures['losses'] or 0.0:g}"]


def _draw(rows: list[Row]) -> Any:
    """Draw the RFD of all trials, one line a trial."""
    names = list(dict.fromkeys(name for name, _, _ in rows))[::-1]
    with empty(7.2, 0.8 + 0.22 * len(names), STYLE, layout="constrained") as figure:
        panel = figure.subplots()
        for method, (label, color, mark) in SHOWN.items():
            rfd = {name: figures["rfd"] or math.nan for name, run, figures in rows if run == method}
            panel.plot([1e3 * rfd[name] for name in names], range(len(names)), mark, color=color, label=label)
        panel.set_yticks(range(len(names)), names)
        panel.set(xscale="log", xlabel="reference force deviation, mN")
        panel.grid(axis="x", which="both", alpha=0.3)
        panel.legend(loc="lower right")
        return figure
