"""Session from scene to results: simulation, metrics, run folder."""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..base.errors import OutputError
from ..engine.simulation import begin, periods
from ..engine.state import State
from ..engine.system import System
from ..metrics.summary import METRICS, compute_metrics
from ..model.finger_range import describe_excess, find_largest_indentation
from ..model.fingertip import require_one
from ..scene.assembly import assemble
from ..scene.recorder import Recording, available_memory, refuse_what_cannot_fit, write
from ..scene.schema import Scene
from ..scene.toml_table import ABSENT, text
from .accuracy import Errors

__all__ = ["Ended", "Result", "busy_cells", "fits", "judged", "run", "save"]

History = dict[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Result:
    """Results of a session.

    Attributes
    ----------
    scene : Scene
    history : dict of ndarray, or None
        The arrays of ``history.npz``; None without a recorder.
    periods : int
        Control periods done.
    run_time : float
        Time the simulation took, s; neither building nor writing is in it.
    metrics : dict
        What ``metrics.json`` holds; SI units.
    """

    scene: Scene
    history: History | None
    periods: int
    run_time: float
    metrics: dict[str, Any]

    @property
    def incomplete(self) -> bool:
        """Whether the session was stopped before its end."""
        return self.periods < self.scene.periods

    def summary(self) -> str:
        """Return the session in one line."""
        rfd, share = self.metrics.get("rfd"), self.metrics.get("contact_share")
        felt = f", RFD {rfd:.2g} N" if rfd is not None else ", no contact" if share == 0.0 else ""
        simulated, factor = self.metrics["simulated"], self.metrics["real_time_factor"]
        end = " (incomplete: stopped)" if self.incomplete else ""
        errors = ""
        if "height_error" in self.metrics:
            height, force = self.metrics["height_error"] * 1e6, self.metrics["force_error"] * 1e3
            errors = f", height error about {height:.2g} µm, force error about {force:.2g} mN"
        beyond = self.metrics.get("beyond_a_finger")
        warning = f"; {beyond}" if beyond else ""
        speed = f"{self.run_time:.2g} s ({factor:.3g} x real time)"
        return f"{simulated:.1f} s simulated in {speed}{felt}{errors}{end}{warning}"

    def with_errors(self, errors: Errors) -> Result:
        """Return the result with its estimated errors among the metrics."""
        judged = {f"{name}_error": value for name, value in asdict(errors).items()}
        units = {name: "m" if name.startswith("height") else "N" for name in judged}
        return replace(self, metrics={**self.metrics, **judged, "units": {**self.metrics["units"], **units}})


def busy_cells(scene: Scene) -> int:
    """Return how many cells may take part at once: all, where a shape is displayed; else few."""
    return scene.cells if scene.shape is not None else 0


def fits(scene: Scene, system: System) -> None:
    """Refuse a session that cannot fit in memory, before it starts; ParameterError says what to change."""
    busy = busy_cells(scene)
    refuse_what_cannot_fit(scene.recorder, system.rows, scene.cells, scene.periods, available_memory(), busy)


def run(
    scene: Scene,
    *,
    progress: Callable[[int, int], None] | None = None,
    stopped: Callable[[], bool] | None = None,
    watched: Callable[[State], None] | None = None,
    versions: Mapping[str, str] | None = None,
) -> Result:
    """Run a scene from rest to its end.

    Parameters
    ----------
    scene : Scene
    progress : callable, optional
        Told after each control period how many are done, and of how many.
    stopped : callable, optional
        Asked after each control period; when it says True, the result is what there is so far.
    watched : callable, optional
        Shown the state after each control period; the next period uses its arrays up.
    versions : mapping, optional
        What else to note as versions the run was made with.

    Raises
    ------
    ParameterError
        When the session cannot fit in memory.
    DivergenceError
        When the integration leaves the finite numbers.
    """
    system, trajectories = assemble(scene), scene.trajectories()
    fits(scene, system)
    state = begin(system)
    recording = Recording(scene.recorder, system.rows, state, scene.periods) if scene.recorder else None
    started = time.perf_counter()
    start = state
    for state in periods(system, trajectories, start, scene.periods):
        if recording:
            recording.observe(state)
        if watched:
            watched(state)
        if progress:
            progress(state.period, scene.periods)
        if stopped and stopped():
            break
    took = time.perf_counter() - started
    if recording:
        recording.finish(state)
    rows = recording.arrays() if recording else None
    return judged(scene, system, rows, state, took, versions or {})


class Ended(Protocol):
    """Summary of a session's final state."""

    @property
    def period(self) -> int: ...

    @property
    def memory(self) -> Any: ...


def judged(
    scene: Scene,
    system: System,
    rows: History | None,
    state: Ended,
    took: float,
    versions: Mapping[str, str],
) -> Result:
    """Return the result of a session that has come to its end.

    Parameters
    ----------
    scene : Scene
    system : System
    rows : dict of ndarray, or None
        From `Recording.arrays`; None without a recorder.
    state : Ended
        The state it ended in.
    took : float
        Time the simulation took, s.
    versions : mapping
        What else to note as versions the run was made with.
    """
    history = None if rows is None else _history(scene, system, rows)
    metrics = _metrics(scene, system, history, state.period, took, versions)
    # Methods that track a finger count how often it was lost; the others have nothing to lose.
    metrics["losses"] = getattr(state.memory, "losses", None)
    return Result(scene, history, state.period, took, metrics)


def _history(scene: Scene, system: System, rows: History) -> History:
    """Return the arrays of ``history.npz``."""
    moments = rows.pop("period") * scene.simulation.control_period
    return {
        "time": moments,
        **rows,
        "fingertip": require_one(scene.trajectories()).poses(moments),
        "total_force": rows["force"].sum(axis=1),
        "position": system.grid.positions,
    }


def _metrics(
    scene: Scene,
    system: System,
    history: History | None,
    done: int,
    took: float,
    versions: Mapping[str, str],
) -> dict[str, Any]:
    """Return the metrics of a run, and the conditions of its simulation."""
    simulated = done * scene.simulation.control_period
    known: dict[str, Any] = {
        "scene": scene.name,
        "incomplete": done < scene.periods,
        "simulated": simulated,
        "run_time": took,
        "real_time_factor": simulated / took,
        "control_periods": done,
        "cells": scene.cells,
        "method": scene.method if scene.control else ABSENT,
        "stepper": scene.simulation.stepper,
        "versions": {
            **versions,
            "numpy": np.__version__,
            "python": platform.python_version(),
            "system": platform.system(),
        },
    }
    units = {"simulated": "s", "run_time": "s", "real_time_factor": "1"}
    if history is not None:
        judged = compute_metrics(history, scene.set_point)
        known |= judged
        units |= {name: METRICS[name][0] for name in judged}
        if system.cell.touch is not None:
            known["max_indentation"] = find_largest_indentation(system.cell.touch.fingertip, history)
            units["max_indentation"] = "m"
            known["beyond_a_finger"] = describe_excess(judged["max_total_force"], known["max_indentation"])
    return {**known, "units": units}


def save(result: Result, folder: Path) -> None:
    """Write ``scene.toml``, ``history.npz`` and ``metrics.json`` into an existing folder.

    Raises
    ------
    OutputError
        When the folder cannot be written.
    """
    try:
        (folder / "scene.toml").write_text(text(result.scene), encoding="utf-8")
        if result.history is not None:
            write(result.history, folder / "history.npz")
        judged = json.dumps(result.metrics, indent=2, ensure_ascii=False, allow_nan=False)
        (folder / "metrics.json").write_text(judged + "\n", encoding="utf-8")
    except OSError as error:
        raise OutputError(f"Cannot write into {folder}: {error.strerror or error}.") from None
