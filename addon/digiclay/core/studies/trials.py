"""Trial session with an observed controller: its measurements and the instants of loss."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..engine.state import State
from ..metrics.summary import METRICS, compute_metrics
from ..scene.recorder import Recorder
from ..scene.schema import Scene
from ..session.run_scene import run

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
    """Results of a trial session.

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
        """Number of losses; None for a controller that does not count them."""
        return None if self.loss_times is None else len(self.loss_times)

    @property
    def metrics(self) -> dict[str, float | None]:
        """The keys of `TRIAL_METRICS`; SI. None where there is nothing to compute from."""
        simulated = float(self.history["time"][-1])
        return {
            **compute_metrics(self.history, self.scene.set_point),
            "losses": self.losses,
            "run_time": self.run_time,
            "real_time_factor": simulated / self.run_time,
        }

    def between(self, start: float, end: float) -> dict[str, NDArray[Any]]:
        """Return the history's rows from one time to another, s.

        Parameters
        ----------
        start, end : float
            s.
        """
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
    lost: list[float] = []
    period = scene.simulation.control_period

    def listen(state: State) -> None:
        losses = getattr(state.memory, "losses", None) or 0  # a method that has no finger to lose counts none
        lost.extend([state.period * period] * (losses - len(lost)))

    done = run(replace(scene, recorder=Recorder()), progress=progress, stopped=stopped, watched=listen)
    if done.incomplete:
        raise KeyboardInterrupt
    assert done.history is not None  # there is a recorder
    counts = done.metrics["losses"] is not None
    return Trial(scene, done.history, np.array(lost) if counts else None, done.run_time)
