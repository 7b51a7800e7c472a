"""A session whose controller is listened to: what is measured, and when it lost the finger."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .assembly import assemble
from .metrics import METRICS, summary
from .recorder import Recorder, Recording, available_memory, refuse_what_cannot_fit
from .scene import Scene
from .simulation import begin, periods

__all__ = ["TRIAL_METRICS", "Trial", "trial"]

#: Every key of `Trial.metrics`: its unit and its meaning.
TRIAL_METRICS: dict[str, tuple[str, str]] = {
    **METRICS,
    "losses": ("1", "how often the controller lost the finger, at every lift-off too"),
    "run_time": ("s", "time the simulation took"),
    "real_time_factor": ("1", "simulated time over run time"),
}


@dataclass(frozen=True, eq=False)
class Trial:
    """What a session came to.

    Attributes
    ----------
    scene : Scene
    history : dict of ndarray
        The arrays of ``history.npz``.
    loss_times : ndarray (losses,) or None
        When the controller lost the finger, s; None for one that does not count.
    run_time : float
        Time the simulation took, s.
    """

    scene: Scene
    history: dict[str, NDArray[Any]]
    loss_times: NDArray[np.float64] | None
    run_time: float

    @property
    def losses(self) -> int | None:
        """How often the controller lost the finger; None for one that does not count."""
        return None if self.loss_times is None else len(self.loss_times)

    @property
    def metrics(self) -> dict[str, float | None]:
        """The keys of `TRIAL_METRICS`; SI. None where there is nothing to compute from."""
        judged = summary(self.history, self.scene.set_point or 0.0)
        if self.scene.set_point is None:
            judged |= dict.fromkeys(("set_point", "rfd", "rfd_shaping", "rfd_session"))
        simulated = float(self.history["time"][-1])
        return {
            **judged,
            "losses": self.losses,
            "run_time": self.run_time,
            "real_time_factor": simulated / self.run_time,
        }

    def between(self, start: float, end: float) -> dict[str, NDArray[Any]]:
        """Return the history's rows from one time to another, s."""
        moments = self.history["time"]
        rows = (moments >= start - 1e-9) & (moments <= end + 1e-9)
        return {name: array if name == "position" else array[rows] for name, array in self.history.items()}


def trial(
    scene: Scene,
    *,
    progress: Callable[[int, int], None] | None = None,
    stopped: Callable[[], bool] | None = None,
) -> Trial:
    """Run a scene from rest, a row a control period.

    Parameters
    ----------
    scene : Scene
        Its recorder is left aside.
    progress : callable, optional
        Told after each control period how many are done, and of how many.
    stopped : callable, optional
        Asked after each control period; KeyboardInterrupt when it says True.

    Raises
    ------
    ParameterError
        When the session cannot fit in memory.
    DivergenceError
        When the integration leaves the finite numbers.
    """
    system, way, recorder = assemble(scene), scene.trajectory.trajectory(), Recorder()
    refuse_what_cannot_fit(recorder, system.rows, scene.cells, scene.periods, available_memory())
    start = begin(system)
    recording = Recording(recorder, system.rows, start, scene.periods)
    counts = hasattr(start.memory, "losses")
    lost, losses = [], 0
    started = time.perf_counter()
    state = start
    for state in periods(system, way, start, scene.periods):
        recording.observe(state)
        if counts and state.memory.losses > losses:
            lost += [state.period * system.period] * (state.memory.losses - losses)
            losses = state.memory.losses
        if progress:
            progress(state.period, scene.periods)
        if stopped and stopped():
            raise KeyboardInterrupt
    took = time.perf_counter() - started
    recording.finish(state)
    rows = recording.arrays()
    moments = rows.pop("period") * system.period
    history = {
        "time": moments,
        **rows,
        "fingertip": way.poses(moments),
        "total_force": rows["force"].sum(axis=1),
        "position": system.grid.positions,
    }
    return Trial(scene, history, np.array(lost) if counts else None, took)
