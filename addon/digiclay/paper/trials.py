"""Everything `digiclay paper` simulates, as one value the figures and the claims are made from."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.metrics_signal import amplitude, frequency, settling_time
from ..core.metrics_speed import Criterion, Drag, Follows, Lift, followed, largest_speed
from ..core.metrics_trial import Trial, trial
from ..core.modes import Mode
from ..core.scene import Scene
from ..core.scene_file import Setting, find, load
from ..core.set_point import asked
from . import scenes
from .scenes import METHODS, QUICKER, SINK, TALL, Device

__all__ = [
    "FULL",
    "PAPER_SPEED",
    "QUICK",
    "SESSION",
    "WAYS",
    "Extent",
    "Results",
    "Session",
    "Swing",
    "onset_among",
    "sessions",
    "simulate",
]

#: The speed up to which the paper says both methods track, m/s, and its session.
PAPER_SPEED, SESSION = 15e-3, "ridge_mound_valley"
#: The simple trajectories: straight and level drags over the finger's height, m.
WAYS = {
    "in the surface": Drag(height=-4.5e-3),
    "a ridge 15 mm high": Drag(height=TALL),
    "a valley": Drag(height=SINK),
}
#: Smallest amplitude of an oscillation that goes on, a fortieth of the set point, N.
SUSTAINED = 0.01
#: The last part of a hold, in which an oscillation is looked for, s.
WATCHED = 1.0
#: Rows of a session of which one is kept.
THINNED = 4


@dataclass(frozen=True)
class Extent:
    """How much is simulated.

    Attributes
    ----------
    resolution : float
        Of the largest speeds, m/s.
    speeds : tuple of float
        Of the drags that are drawn, m/s.
    gains, position_gains : tuple of float
        Of the sweep, 1/N and 1/m.
    """

    resolution: float
    speeds: tuple[float, ...]
    gains: tuple[float, ...]
    position_gains: tuple[float, ...]


FULL = Extent(
    0.5e-3,
    (10e-3, 15e-3, 20e-3, 25e-3),
    (2.0, 2.5, 3.0, 5.0, 7.0, 10.0, 14.0, 20.0, 28.0, 40.0, 57.0, 80.0, 113.0, 160.0),
    (500.0, 1000.0, 2000.0),
)
QUICK = Extent(12e-3, (), (5.0, 80.0), (500.0, 1000.0))
#: Where the largest speeds are looked for, m/s.
SLOWEST, QUICKEST = 5e-3, 32e-3


class Swing(NamedTuple):
    """What a hold after a quick press came to, at one pair of gains.

    Attributes
    ----------
    gain, position_gain : float
        K_f, 1/N, and K_p, 1/m.
    amplitude : float
        Of the force in the last second, N.
    frequency : float or None
        Hz.
    settling : float or None
        From the press until the force stays within 10 % of its set point, s; None: it goes on swinging.
    """

    gain: float
    position_gain: float
    amplitude: float
    frequency: float | None
    settling: float | None

    @property
    def sustained(self) -> bool:
        """Whether the force still swings, and does not only drift, in the last second."""
        return self.frequency is not None and self.amplitude > SUSTAINED


class Session(NamedTuple):
    """A session boiled down to what is drawn and judged.

    Attributes
    ----------
    scene : Scene
    history : dict of ndarray
        Every `THINNED`-th row of time, height, total force, total force asked for (``set_point``)
        and fingertip; and the positions.
    metrics : dict
        As `Trial.metrics`.
    lost : list of float
        When the finger was lost though it rose no faster than a pin can, s.
    followers : float
        Mean number of cells that follow the force while there are any.
    """

    scene: Scene
    history: dict[str, NDArray[Any]]
    metrics: dict[str, float | None]
    lost: list[float]
    followers: float


@dataclass
class Results:
    """What was simulated, by method where methods are set beside each other.

    Attributes
    ----------
    blisters : by method, shape ("convex", "concave"), profile
    drags : a drag of a ridge, and when it starts and ends, s
    printed, session : the paper's session at its own times; at times both methods can follow
    slow : how many times as long the latter takes
    simple : the simple trajectories at 15 mm/s, by method and name
    tracks : ridge drags at several speeds
    fastest, lifting : largest speed of a ridge drag, and of a lift, m/s
    swings, details : the sweep of the gains; its sessions, by gains
    quicker : the same sweep with a quicker device, and how fast its pins are without load, m/s
    """

    criterion: Criterion = field(default_factory=Criterion)
    blisters: dict[tuple[str, str, str], Trial] = field(default_factory=dict)
    drags: dict[str, tuple[Trial, float, float]] = field(default_factory=dict)
    printed: dict[str, Session] = field(default_factory=dict)
    session: dict[str, Session] = field(default_factory=dict)
    slow: float = 1.0
    simple: dict[tuple[str, str], Follows] = field(default_factory=dict)
    tracks: dict[str, list[Follows]] = field(default_factory=dict)
    fastest: dict[str, float | None] = field(default_factory=dict)
    lifting: dict[str, float | None] = field(default_factory=dict)
    swings: list[Swing] = field(default_factory=list)
    details: dict[tuple[float, float], tuple[Trial, float]] = field(default_factory=dict)
    quicker: list[Swing] = field(default_factory=list)
    quicker_speed: float = 0.0

    def onset(self, position_gain: float) -> tuple[float | None, float | None]:
        """Return the `onset_among` those at one K_p, 1/m."""
        return onset_among([one for one in self.swings if one.position_gain == position_gain])


def onset_among(swings: list[Swing]) -> tuple[float | None, float | None]:
    """Return the largest K_f below the first sustained oscillation, and the one that has it, 1/N."""
    row = sorted(swings, key=lambda one: one.gain)
    first = next((i for i, one in enumerate(row) if one.sustained), None)
    if first is None:
        return (row[-1].gain if row else None), None
    return (row[first - 1].gain if first else None), row[first].gain


Told = Callable[[str], None]


def simulate(extent: Extent, told: Told) -> Results:
    """Simulate all of it; `told` hears what comes next, and may raise KeyboardInterrupt."""
    results = Results()
    for method in METHODS:
        told(f"blisters, {method}")
        for shape, height in (("convex", TALL), ("concave", SINK)):
            for profile in ("cone", "gaussian"):
                results.blisters[method, shape, profile] = trial(scenes.blister(method, height, profile))
    for method in METHODS:
        _track(results, method, extent, told)
    sessions(results, told)
    for position_gain in extent.position_gains:
        for gain in extent.gains:
            told(f"oscillation, K_p {position_gain:g} 1/m, K_f {gain:g} 1/N")
            found, done, quick = _swing(gain, position_gain)
            results.swings.append(found)
            small = {name: done.history[name] for name in ("time", "total_force")}
            results.details[gain, position_gain] = replace(done, history=small), quick
    for gain in extent.gains:
        told(f"oscillation, a quicker device, K_f {gain:g} 1/N")
        found, done, _ = _swing(gain, extent.position_gains[0], QUICKER)
        results.quicker.append(found)
        results.quicker_speed = scenes.free_speed(done.scene)
    return results


def _track(results: Results, method: str, extent: Extent, told: Told) -> None:
    """Measure how fast a finger a method follows; every drag of the bisection is one more of `tracks`."""
    found = load(find(SESSION), [Setting("control.method", method)])
    for name, way in WAYS.items():
        told(f"drag at {PAPER_SPEED * 1e3:g} mm/s, {name}, {method}")
        results.simple[method, name], done = followed(found, way, PAPER_SPEED)
        if way.height == TALL:
            _, start, end = way.path(PAPER_SPEED, found.actuator.rest_height)
            results.drags[method] = done, start, end
    results.tracks[method] = []
    for speed in extent.speeds:
        told(f"drag at {speed * 1e3:g} mm/s, {method}")
        results.tracks[method].append(followed(found, Drag(height=TALL), speed)[0])
    told(f"fastest drag, {method}")
    tracks = results.tracks[method]
    results.fastest[method] = largest_speed(
        found, Drag(height=TALL), results.criterion,
        low=SLOWEST, high=QUICKEST, resolution=extent.resolution,
        told=lambda one: (told(f"drag at {one.speed * 1e3:.1f} mm/s, {method}"), tracks.append(one)),
    )  # fmt: skip
    tracks.sort(key=lambda one: one.speed)
    results.lifting[method] = largest_speed(
        found, Lift(), results.criterion, resolution=extent.resolution,
        told=lambda one: told(f"lift at {one.speed * 1e3:.1f} mm/s, {method}"),
    )  # fmt: skip


def sessions(results: Results, told: Told, session: str = SESSION) -> None:
    """Run the paper's session at its times, and again slowly where a method loses the finger."""
    for method in METHODS:
        told(f"the paper's session, {method}")
        found = load(find(session), [Setting("control.method", method)])
        results.printed[method] = _boiled_down(trial(found))
    results.session = dict(results.printed)
    if not any(done.lost for done in results.printed.values()):
        return
    lift = scenes.fastest_lift(results.printed[METHODS[0]].scene)
    able = min(speed or 2e-3 for speed in results.lifting.values())
    # Four fifths of what the slower method can lift, in steps of a tenth.
    results.slow = max(1.0, math.ceil(10.0 * lift / (0.8 * able)) / 10.0)
    for method in METHODS:
        told(f"the paper's session, {results.slow:g} times as long, {method}")
        slowly = scenes.slowed(results.printed[method].scene, results.slow)
        results.session[method] = _boiled_down(trial(slowly))


def _boiled_down(done: Trial) -> Session:
    """Return what is drawn and judged of a session: its whole history takes a hundred megabytes."""
    follow = np.sum(done.history["mode"] == Mode.FORCE_FOLLOW, axis=1)
    kept = {
        name: np.concatenate([done.history[name][:-1:THINNED], done.history[name][-1:]])
        for name in ("time", "height", "total_force", "fingertip")
    }
    wanted = asked(done.scene.set_point, follow)
    kept["set_point"] = np.concatenate([wanted[:-1:THINNED], wanted[-1:]])
    kept["position"] = done.history["position"]
    followers = float(follow[follow > 0].mean()) if np.any(follow) else 0.0
    return Session(done.scene, kept, done.metrics, scenes.unintended(done), followers)


def _swing(gain: float, position_gain: float, device: Device | None = None) -> tuple[Swing, Trial, float]:
    """Hold still after a quick press, and look whether the force comes to rest; also when it ended, s."""
    case, quick = scenes.held(gain, position_gain, device)
    done = trial(case)
    assert case.set_point is not None  # Method I has one
    set_point = case.set_point.force
    end = float(done.history["time"][-1])
    late, after = done.between(end - WATCHED, end), done.between(quick, end)
    settled = settling_time(after["time"], after["total_force"], set_point, 0.1 * set_point)
    found = Swing(
        gain, position_gain, amplitude(late["total_force"]),
        frequency(late["time"], late["total_force"]), settled,
    )  # fmt: skip
    return found._replace(settling=None) if found.sustained else found, done, quick
