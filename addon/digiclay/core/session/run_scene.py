"""Session from scene to results: simulation, recording, evaluation, run folder."""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from ..base.arrays import Array, Floats
from ..base.errors import OutputError, explain_os_error
from ..base.quantity import show_digits
from ..engine.simulation import Progress, Stopped, begin, periods
from ..engine.system import System
from ..files.tables import Described, Record, Table
from ..metrics.metric_table import (
    ERRORS,
    METRICS,
    RUN,
    describe_errors,
    describe_losses,
    describe_time,
    list_beyond,
)
from ..metrics.signals import compute_weights
from ..metrics.summary import (
    compute_metrics,
    find_contact_rows,
    find_losses,
    measure_bodies,
    split_fingers,
    take_worst,
)
from ..model.control_interface import count_losses
from ..model.touch import describe_excess, find_indentations, is_beyond
from ..model.trajectory import sample_poses
from ..scene.assembly import assemble
from ..scene.recorder import RunRecording, write
from ..scene.schema import Scene
from ..scene.toml_table import ABSENT, format_scene
from ..version import __version__
from .accuracy import Errors, describe_bends, estimate_errors, explain_absence
from .memory_limit import check_memory
from .plate import list_cautions
from .probes import free_speed

History = dict[str, Array]

#: Metrics of every run with a history.
RUN_METRICS = {
    **METRICS,
    **{name: RUN[name] for name in ("losses", "run_time", "real_time_factor")},
}


class Contact(NamedTuple):
    """Contact of a finger over a session."""

    contact_time: float
    """Time in which it touches, s."""
    losses: int
    """How often contact ended though the finger rose no faster than a pin can; 0 without a set point."""
    lost_time: float
    """Time until the next contact after these losses, s."""


@dataclass(frozen=True, eq=False, repr=False)
class Result(Described):
    """Results of a session."""

    scene: Scene
    history: History
    """The arrays of ``history.npz``; empty without a recorder."""
    periods: int
    """Simulated control periods."""
    run_time: float
    """Wall time of the simulation, s, without building and writing."""
    metrics: Record
    """Content of ``metrics.json``, in SI units."""

    @property
    def name(self) -> str:
        """Name of the scene."""
        return self.scene.name

    @property
    def figures(self) -> dict[str, float | None]:
        """The metrics of `RUN_METRICS`."""
        return {name: self.metrics[name] for name in RUN_METRICS}

    @property
    def incomplete(self) -> bool:
        """Whether the session was stopped before its end."""
        return self.periods < self.scene.periods

    @property
    def finger_force(self) -> Floats:
        """Total force on each finger over time, (t, f), N."""
        self.require_history("finger_force")
        total = self.history["total_force"]
        return self.history.get("finger_force", total).reshape(len(total), -1)

    @property
    def fingers(self) -> tuple[Contact, ...]:
        """Contact of each finger: its time, losses, and the time these lasted."""
        self.require_history("fingers")
        time, weights = self.history["time"], compute_weights(self.history["time"])
        felt = [
            (finger["total_force"], finger["fingertip"][:, 2])
            for finger in split_fingers(self.history)
        ]
        fastest = float(free_speed(self.scene).rise)
        lost = measure_losses(self.scene, fastest, time, felt).get("lost", [NEVER] * len(felt))
        return tuple(
            Contact(
                float(weights[find_contact_rows(force)].sum()), int(loss["losses"]), loss["time"]
            )
            for (force, _), loss in zip(felt, lost, strict=True)
        )

    def require_history(self, name: str) -> None:
        """Refuse what needs a history, by its name, of a run without one."""
        if not self.history:
            raise OutputError(f"{name} needs a recorder, and the scene has recorder = 'absent'.")

    def describe(self) -> dict[str, str]:
        """Return what matters most of it, by name."""
        largest = self.metrics.get("max_total_force")
        reached = "not recorded" if largest is None else f"at most {show_digits(largest)} N"
        cautions = "; ".join((*list_beyond(self.metrics), *list_cautions(self.scene)))
        rows, pins = len(self.history.get("time", ())), self.scene.cells
        return {
            "time": describe_time(self.metrics)
            + (", stopped before its end" if self.incomplete else ""),
            "force": self._describe_force() or reached,
            **({"bodies": bodies} if (bodies := self._describe_bodies()) else {}),
            "errors": describe_errors(self.metrics),
            **({"caution": cautions} if cautions else {}),
            "history": f"{rows} rows of {pins} pins: {', '.join(self.history)}" if rows else "none",
            "metrics": f"{len(self.metrics)}, in SI units",
        }

    def summary(self) -> str:
        """Return the session in one line."""
        felt = self._describe_force(), self._describe_bodies(), describe_errors(self.metrics)
        end = " (incomplete: stopped)" if self.incomplete else ""
        line = ", ".join(filter(None, (describe_time(self.metrics), *felt))) + end
        return "; ".join((line, *list_beyond(self.metrics)))

    def _describe_force(self) -> str:
        """Return the deviation of the force, and the losses, or ``""``."""
        rfd, share = self.metrics.get("rfd"), self.metrics.get("contact_share")
        felt = ""
        if share == 0.0:
            thinned = self.scene.recorder is not None and self.scene.recorder.every > 1
            felt = "no contact in the rows kept" if thinned else "no contact"
        if rfd is not None:
            felt = f"RFD {show_digits(rfd)} N{self._name_worst()}"
        if self.metrics.get("rfd_jnd_least") is not None:
            ends = (show_digits(self.metrics[f"rfd_jnd_{end}"]) for end in ("least", "most"))
            felt += f" ({' to '.join(ends)} JND)"
        return ", ".join(filter(None, (felt, describe_losses(self.metrics))))

    def _describe_bodies(self) -> str:
        """Return the largest force on each body, and the most pins that it pressed, or ``""``."""
        bodies = enumerate(self.metrics.get("bodies", ()), 1)
        return ", ".join(
            f"body {number} at most {show_digits(felt['max_total_force'])} N on {felt['pressed_pins']} pins"
            for number, felt in bodies
        )

    def _name_worst(self) -> str:
        """Return which of several fingers has the largest RFD."""
        each = [finger["rfd"] or 0.0 for finger in self.metrics.get("fingers", ())]
        return f" at finger {1 + each.index(max(each))} of {len(each)}" if each else ""

    def with_errors(self, errors: Errors) -> Result:
        """Return the result with its estimated errors among the metrics."""
        added = {f"{name}_error": value for name, value in errors._asdict().items()}
        units = {**self.metrics["units"], **{name: ERRORS[name].unit for name in added}}
        doubt = {"errors_in_doubt": text} if (text := describe_bends(self.scene)) else {}
        return replace(self, metrics={**self.metrics, **added, **doubt, "units": units})

    def without_errors(self, why: str) -> Result:
        """Return the result with the reason why its errors are not estimated."""
        return replace(self, metrics={**self.metrics, "errors_absent": why})

    def estimate_errors(self, progress: Progress = None, stopped: Stopped = None) -> Result | None:
        """Return the result with its errors, or the reason why it has none; None when `stopped`."""
        if absent := "the session was stopped" if self.incomplete else explain_absence(self.scene):
            return self.without_errors(absent)
        errors = estimate_errors(self.scene, self.history, progress=progress, stopped=stopped)
        return self.with_errors(errors) if errors else None


class Ended(NamedTuple):
    """End of a session: control periods, their wall time, s, and losses if the controller counts them."""

    periods: int
    run_time: float
    losses: int | None


#: A finger that was not lost.
NEVER = {"losses": 0, "time": 0.0}


def measure_losses(
    scene: Scene, fastest: float, time: Floats, felt: Iterable[tuple[Floats, Floats]]
) -> dict[str, list[dict[str, float]]]:
    """Return losses and time without contact, s, of fingers by force, N, and height, m, (t,); {}: no loss."""
    lost = []
    for total_force, height in felt:
        losses = find_losses(time, total_force, height, fastest)
        lost.append({"losses": len(losses), "time": sum(loss.time for loss in losses)})
    # Only a method that holds a force can lose a fingertip.
    return {"lost": lost} if scene.set_point and any(finger["losses"] for finger in lost) else {}


def evaluate(
    scene: Scene,
    system: System,
    rows: History,
    ended: Ended,
    versions: Mapping[str, str] = MappingProxyType({}),
) -> Result:
    """Return the result of an ended session; `rows`: of `HistoryWriter.finish`, or none."""
    if not rows:
        return report(scene, ended, {}, versions)
    history = _complete(scene, system, rows)
    each, depths, felt = [], [], []
    for finger, of_finger in zip(scene.fingers, split_fingers(history), strict=True):
        each.append(compute_metrics(of_finger, scene.set_point))
        felt.append((of_finger["total_force"], of_finger["fingertip"][:, 2]))
        if system.cell.touch is not None and finger.fingertip:
            depths.append(find_indentations(finger.fingertip, of_finger))
    metrics: Record = take_worst(each)
    if len(scene.fingers) > 1:
        metrics["fingers"] = each
    if scene.bodies:
        from ..engine.bodies import describe_falls

        metrics["bodies"] = measure_bodies(history)
        ends = np.arange(1, ended.periods + 1) * scene.simulation.control_period
        pressed = history["body_force"].any(axis=2)[history["time"].searchsorted(ends)]
        metrics["beyond_cap"] = describe_falls(system, pressed)
    metrics |= measure_losses(scene, system.fastest, history["time"], felt)
    if depths:
        depth = np.max(depths, axis=0)
        metrics["max_indentation"] = float(depth.max())
        metrics["beyond_a_finger"] = describe_excess(
            metrics["max_total_force"], metrics["max_indentation"]
        )
        if metrics["beyond_a_finger"]:
            pressing = history.get("finger_force", history["total_force"]).reshape(len(depth), -1)
            history["beyond_a_finger"] = np.asarray(is_beyond(pressing.max(axis=1), depth))
    return replace(report(scene, ended, metrics, versions), history=history)


def _complete(scene: Scene, system: System, rows: History) -> History:
    """Return the arrays of a history, with paths and sums, from the rows of `evaluate`."""

    def per_finger(values: Array) -> Array:
        return values[:, 0] if len(scene.fingers) == 1 else values

    moments = rows.pop("period") * scene.simulation.control_period
    history, poses = {"time": moments, **rows}, sample_poses(scene.trajectories(), moments)
    if "deflection" in rows:
        history["intended_height"] = per_finger(poses[..., 2].copy())
        poses[..., 2] += history.pop("deflection")
    if scene.bodies:
        pressing = history.pop("finger_force")[:, : len(scene.fingers)]
        if any(scene.list_parts("fingertip")):
            history["finger_force"] = per_finger(pressing)
        paths = [each.trajectory.trajectory() for each in scene.bodies]
        history["body"] = sample_poses(paths, moments)
    history["fingertip"] = per_finger(poses)
    if scene.drive:
        line, _ = scene.drive.locate(scene.layout, np.arange(scene.cells))
        history["served"] = history["served"][:, line]
    history["total_force"] = rows["force"].sum(axis=1)
    history["position"] = system.grid.positions
    return history


def report(
    scene: Scene,
    ended: Ended,
    figures: Table,
    versions: Mapping[str, str] = MappingProxyType({}),
) -> Result:
    """Return the result of an ended session without its history, but with figures of it."""
    simulated = ended.periods * scene.simulation.control_period
    metrics: Record = {
        "scene": scene.name,
        "incomplete": ended.periods < scene.periods,
        "simulated": simulated,
        "run_time": ended.run_time,
        "real_time_factor": simulated / ended.run_time,
        "control_periods": ended.periods,
        "cells": scene.cells,
        "method": scene.method if scene.control else ABSENT,
        "stepper": scene.simulation.stepper,
        "versions": {
            "digiclay": __version__,
            **versions,
            "numpy": np.__version__,
            "python": platform.python_version(),
            "system": platform.system(),
        },
        **figures,
    }
    units = {**METRICS, **RUN}
    metrics["units"] = {name: units[name].unit for name in metrics if name in units}
    metrics["losses"] = ended.losses
    return Result(scene, {}, ended.periods, ended.run_time, metrics)


def select_rows(history: History, start: float, end: float) -> History:
    """Return the rows of a history from one time to another. `start`, `end`, s."""
    moments = history["time"]
    rows = (moments >= start - 1e-9) & (moments <= end + 1e-9)
    return {name: array if name == "position" else array[rows] for name, array in history.items()}


def run(
    scene: Scene,
    *,
    progress: Progress = None,
    stopped: Stopped = None,
    versions: Mapping[str, str] | None = None,
) -> Result:
    """Run a scene from rest to its end.

    `progress`: called after each control period with the number done and the number of all;
    `stopped`: called then too; when it returns True, the result is that so far; `versions`: further
    versions to note. Raises ParameterError when the session does not fit in memory, DivergenceError
    when the integration diverges.
    """
    system = assemble(scene)
    check_memory(scene, system.rows)
    start = begin(system)
    recording = (
        RunRecording(scene.recorder, system.rows, start, scene.periods, len(scene.bodies))
        if scene.recorder
        else None
    )
    started = time.perf_counter()
    for state in periods(system, scene.trajectories(), start, scene.periods):
        if recording:
            recording.observe(state)
        if progress:
            progress(state.period, scene.periods)
        if stopped and stopped():
            break
    took, losses = time.perf_counter() - started, count_losses(state.memory)
    rows = recording.finish(state.period) if recording else {}
    return evaluate(scene, system, rows, Ended(state.period, took, losses), versions or {})


def save(result: Result, folder: Path) -> None:
    """Write scene.toml, history.npz and metrics.json into a folder; OutputError when that fails."""
    with explain_os_error(f"Cannot write into {folder}"):
        (folder / "scene.toml").write_text(format_scene(result.scene), encoding="utf-8")
        if result.history:
            write(result.history, folder / "history.npz")
        metrics = json.dumps(result.metrics, indent=2, ensure_ascii=False, allow_nan=False)
        (folder / "metrics.json").write_text(metrics + "\n", encoding="utf-8")
