"""Trials of control methods: trajectories by name, each run with sensor noise, and what is measured of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ..base.errors import ParameterError
from ..base.quantity import find_nearest_name
from ..metrics.finger_path import sum_cells
from ..metrics.force import find_contact_ends, perceive
from ..metrics.metric_table import METHOD, METRICS, Metric
from ..metrics.summary import compute_metrics
from ..scene.assembly import assemble
from ..scene.recorder import Recorder
from ..scene.schema import Scene
from ..session.run_scene import Result, run, select_rows
from .nominal_relief import measure_relief
from .speed_limits import Criterion, Drag, Follows, Lift, find_largest_speed, judge, place_way
from .trial_paths import draw_drags, lift_off, list_paths, with_path

Record = dict[str, Any]
Stopped = Callable[[], bool] | None

#: Groups of the random drags and of the paper's session.
RANDOM, SESSION = "random", "session"
#: Judged phases of drags and lifts: name, motion, speed, m/s.
PHASES: dict[str, tuple[Drag | Lift, float]] = {
    "ridge-15": (Drag(), 15e-3),
    "ridge-25": (Drag(), 25e-3),
    "ridge-40": (Drag(), 40e-3),
    "surface": (Drag(height=-1.5e-3), 15e-3),
    "valley": (Drag(height=-10e-3), 15e-3),
    "lift": (Lift(), 15e-3),
}
#: Motions whose largest speed is searched.
LIMITS: dict[str, Drag | Lift] = {"ridge-limit": Drag(), "lift-limit": Lift()}
#: Between which speeds, m/s.
LOW, HIGH = 5e-3, 80e-3
#: All trajectories, and those of a quick suite.
GROUPS = (SESSION, *list_paths(), *PHASES, RANDOM, *LIMITS)
QUICK = ("ridge-25", "surface", "lift")

#: Metrics of a trial.
OUTCOMES: dict[str, Metric] = {
    name: METHOD.get(name) or METRICS[name]
    for name in (
        "set_point", "rfd", "rfd_jnd_least", "rfd_jnd_most", "lag_mean", "lag_max", "ridge_unevenness",
        "ridge_unevenness_touch", "relief_rms", "relief_largest", "max_total_force", "contact_loss_share",
        "losses", "speed_limit", "period_cost",
    )
}  # fmt: skip


@dataclass(frozen=True)
class Trial:
    """Trial of a method.

    Attributes
    ----------
    name : str
        Of its trajectory; a random drag has a number.
    group : str
        Name by which it is chosen, in `GROUPS`.
    number : int
        Of a random drag; 0 otherwise.
    """

    name: str
    group: str
    number: int = 0


class _StoppedError(Exception):
    """Stop in the middle of a search."""


def read_groups(words: Sequence[str]) -> tuple[str, ...]:
    """Return trajectories in the order of `GROUPS`; an unknown one is refused.

    Raises ParameterError: in one line, with the nearest name.
    """
    if not words:
        raise ParameterError("--trajectories", "", "must name at least one trajectory", "none")
    for word in words:
        if word not in GROUPS:
            close = find_nearest_name(word, list(GROUPS))
            hint = f"Did you mean {close}?" if close else ""
            raise ParameterError("--trajectories", "", f"must be among {', '.join(GROUPS)}", repr(word), hint)
    return tuple(group for group in GROUPS if group in words)


def list_trials(groups: Sequence[str], drags: int) -> list[Trial]:
    """Return the trials of trajectories. `groups`: among `GROUPS`; `drags`: number of random drags."""
    trials: list[Trial] = []
    for group in groups:
        if group == RANDOM:
            trials += [Trial(f"{RANDOM}-{number + 1}", RANDOM, number) for number in range(drags)]
        else:
            trials.append(Trial(group, group))
    return trials


def place_trial(scene: Scene, trial: Trial) -> tuple[Scene, Callable[[Scene, Stopped], Record | None]]:
    """Return a scene with the trajectory of a trial, and what measures it.

    `scene`: its device and method, and the trajectory of the session. Raises ParameterError when the bed is
    too small.
    """
    if trial.group in LIMITS:
        way = LIMITS[trial.group]
        place_way(scene, way, HIGH)
        return scene, partial(search_limit, way=way)
    if trial.group in PHASES:
        placed, start, end = place_way(scene, *PHASES[trial.group])
        return lift_off(placed), partial(measure_trial, phase=(start, end))
    recorded = replace(scene, recorder=Recorder())
    if trial.group == SESSION:
        return recorded, measure_trial
    drawn = draw_drags(trial.number + 1)[-1] if trial.group == RANDOM else list_paths()[trial.group]
    interpolation, poses = drawn
    return lift_off(with_path(recorded, poses, interpolation)), measure_trial


def measure_trial(
    scene: Scene, stopped: Stopped = None, *, phase: tuple[float, float] | None = None
) -> Record | None:
    """Run a trial, and return its record; None after a stop.

    `scene`: with a recorder; `stopped`: asked after each control period; `phase`: when the judged part starts
    and ends, s; by default all of it. Then the RFD is that of all rows, and the losses are those of the
    phase.
    """
    begun = time.thread_time()
    done = run(scene, stopped=stopped)
    spent = time.thread_time() - begun
    if done.incomplete:
        return None
    found = dict(done.figures)
    found["losses"] = float(len(find_unintended_losses(done)))
    if phase is not None:
        judged, part = judge(done, *phase, 0.0), select_rows(done.history, *phase)
        own = compute_metrics(part, scene.set_point)
        found |= {name: own[name] for name in ("lag_mean", "lag_max", "max_total_force")}
        found |= {"rfd": own["rfd_session"], "losses": float(judged.losses)}
        found["contact_loss_share"] = judged.loss_share
        felt = perceive(found["rfd"], found["set_point"], found["ridge_unevenness"])
        found |= felt.figures()
    relief = measure_relief(scene, done.history, sum_cells(done.history).following, found["ridge_offset"])
    found |= {"relief_rms": relief.rms, "relief_largest": relief.largest}
    found["period_cost"] = spent / done.periods
    return {"figures": {name: found.get(name) for name in OUTCOMES}}


def search_limit(scene: Scene, stopped: Stopped = None, *, way: Drag | Lift) -> Record | None:
    """Search the largest speed at which a motion is followed, and return the record; None after a stop.

    `scene`: its device and method; `stopped`: asked after each speed.
    """

    def told(_: Follows) -> None:
        if stopped and stopped():
            raise _StoppedError

    try:
        speed = find_largest_speed(scene, way, Criterion(), low=LOW, high=HIGH, told=told)
    except _StoppedError:
        return None
    return {"figures": {**dict.fromkeys(OUTCOMES), "speed_limit": speed}}


def find_free_speed(scene: Scene) -> float:
    """Return how fast a pin without load rises through an open valve, m/s."""
    fastest: float = assemble(scene).fastest
    return fastest


def find_unintended_losses(done: Result) -> list[float]:
    """Return when contact ended, s, though the fingertip rose no faster than a pin can just then."""
    limit, moments = find_free_speed(done.scene), done.history["time"]
    rise = np.gradient(done.history["fingertip"][:, 2], moments)
    lost = find_contact_ends(moments, done.history["total_force"])
    return [float(t) for t in lost if rise[(moments > t - 0.2) & (moments <= t + 0.1)].max() <= limit]
