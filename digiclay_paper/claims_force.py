"""Claims on deviations of height and force, and on oscillation."""

from __future__ import annotations

import math

from digiclay.core.studies.method_trials import find_free_speed

from .claim import MM, ONE, SHORT, TWO, Claim, times, verdict
from .results import PAPER_SPEED, RIDGE, WAYS, Results, Swing, onset_among
from .scenes import METHODS, PRESSED
from .windows import WINDOWS

#: What counts as much greater, as a ratio.
MUCH = 1.5
#: A response is quicker that takes less than this share of the time.
QUICKER = 0.9


def _ratio(results: Results, name: str) -> float | None:
    one, two = (results.session[method].metrics[name] for method in METHODS)
    return None if one is None or two is None or one == 0.0 else two / one


DEVIATIONS = {
    "height_deviation": ("height under the finger, standard deviation over time", MM, "mm"),
    "ridge_error": ("what is left behind over the finger's path, rms", MM, "mm"),
    "ridge_unevenness": ("the same, standard deviation", MM, "mm"),
    "force_deviation": ("total force, standard deviation over time", 1.0, "N"),
    "rfd_shaping": ("total force from its set point while shaping, rms", 1.0, "N"),
}


#: Of them, what is compared in the paper's windows, too.
WINDOWED = {
    "rfd": ("RFD", 1.0, "N"), "force_deviation": ("total force", 1.0, "N"),
    "height_deviation": ("height under the finger", MM, "mm"),
}  # fmt: skip


def deviations(results: Results) -> Claim:
    """Whether Method II deviates much more, in the whole session and in each of the paper's windows."""
    sources = [("", DEVIATIONS, [results.session[method].metrics for method in METHODS])]
    for window, spans in WINDOWS.items():
        between = " and ".join(f"{start:g} to {end:g} s" for start, end in spans)
        values = [results.printed[method].windows.get(window, {}) for method in METHODS]
        sources.append((f"{between} ({window}), ", WINDOWED, values))
    told, ratios = [], []
    for when, compared, values in sources:
        for name, (meaning, factor, unit) in compared.items():
            one, two = (known.get(name) for known in values)
            both, ratio = "nothing to compute from", 0.0
            if one and two is not None:
                ratio = two / one
                both = f"{one * factor:.3g} and {two * factor:.3g} {unit}, ratio {ratio:.1f}"
            told.append(f"{when}{meaning}: {both}")
            ratios.append(ratio)
    known = results.session[TWO]
    control = known.scene.control
    each = getattr(control, "force_setpoint", 0.0)
    level = [f"{one.rfd:.3f} N {name}" for (method, name), one in results.simple.items() if method == TWO]
    why = (
        f"{SHORT[TWO]} holds a force per cell, {each:g} N, and {known.followers:.1f} cells follow it on "
        f"average. Its set point, {each:g} N times the cells that follow at the moment, is "
        f"{_newton(known.metrics['set_point'])} on average and changes as the finger passes from cell to "
        "cell. A cell that is to rise needs a force below its set point, so the force falls short while the "
        "finger lifts: in level drags the RFD is " + ", ".join(level) + ". "
        f"It holds where all are {MUCH:g} times as great."
    )
    return Claim(
        "Method II's deviations of height and force are much greater",
        f"Method I and II on the session{times(results)}: " + "; ".join(told),
        verdict([ratio > MUCH for ratio in ratios]),
        why,
    )


def reference_force(results: Results) -> Claim:
    told = []
    for method in METHODS:
        known = results.session[method].metrics
        drag = results.simple[method, RIDGE]
        told.append(
            f"{SHORT[method]}, set point {_newton(known['set_point'])}: {_newton(known['rfd'])} in contact, "
            f"{_newton(known['rfd_shaping'])} while shaping, "
            f"{drag.rfd:.3f} N dragging a ridge at {PAPER_SPEED * MM:g} mm/s"
        )
    ratios = [_ratio(results, name) or 0.0 for name in ("rfd", "rfd_shaping")]
    less = [results.simple[ONE, name].rfd < results.simple[TWO, name].rfd for name in WAYS]
    return Claim(
        "RFD of both methods, Method I's being the smaller",
        f"Session{times(results)}: " + "; ".join(told),
        verdict([*(ratio > 1.0 for ratio in ratios), *less]),
        "The paper's own values are not among what this project has of it, so ours stand alone.",
    )


def _newton(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f} N"


def _seconds(time: float | None) -> str:
    return "never" if time is None else f"{time:.2f} s"


def _gain(gain: float) -> str:
    return "none seen" if gain == math.inf else f"K_f = {gain:g} 1/N"


def _row(results: Results, position_gain: float) -> list[Swing]:
    return sorted(one for one in results.swings if one.position_gain == position_gain)


def _gains(results: Results) -> list[float]:
    return sorted({one.position_gain for one in results.swings})


def onset(results: Results) -> Claim:
    """Where the oscillation sets in, at each K_p, and with a quicker device."""
    rows = {f"K_p = {gain:g} 1/m": _row(results, gain) for gain in _gains(results)}
    told = [f"{label}: {_sets_in(row)}" for label, row in rows.items()]
    used = results.printed[ONE].scene.control
    position_gain, gain = getattr(used, "position_gain", 0.0), getattr(used, "force_gain", 0.0)
    first = results.onset(position_gain)[1]
    beyond = first is not None and gain >= first
    far = "" if first is None else f", {first / gain:.3g} times this K_f in another experiment"
    why = (
        f"Fig. 9 shows it in the session. The session's own gains here, K_p = {position_gain:g} 1/m and "
        f"K_f = {gain:g} 1/N, are {'beyond' if beyond else 'below'} the onset{far}. Flow goes with the "
        "square of the opening, so a small error hardly moves a pin: only a transient starts the cycle."
    )
    if results.quicker:
        free = find_free_speed(results.printed[ONE].scene)
        why += (
            f" The device decides where: with pins of {results.quicker_speed * MM:.1f} instead of "
            f"{free * MM:.1f} mm/s without load, slower valves and a longer dead time, at K_p = "
            f"{results.quicker[0].position_gain:g} 1/m: {_sets_in(results.quicker)}."
        )
    return Claim(
        "The virtual master makes a second-order loop that oscillates at high gain",
        f"Holding still after a quick press of {PRESSED * MM:g} mm, a cycle that goes on sets in "
        + "; ".join(told),
        verdict([*(onset_among(row)[1] is not None for row in rows.values()), beyond]),
        why,
    )


def _sets_in(swings: list[Swing]) -> str:
    """Tell between which gains the oscillation sets in, and what it is like then."""
    calm, first = onset_among(swings)
    if first is None:
        return f"none up to K_f = {calm or 0.0:g} 1/N"
    amplitude = {one.gain: one.amplitude for one in swings}
    one = next(one for one in swings if one.gain == first)
    pace = "" if one.frequency is None else f", {one.frequency:.0f} Hz"
    below = "at" if calm is None else f"above {calm:g} ({amplitude[calm]:.3f} N left), at"
    return f"{below} {first:g} 1/N (amplitude {one.amplitude:.3f} N{pace})"


def trade(results: Results) -> Claim:
    told, holds = [], []
    for position_gain in _gains(results):
        row = _row(results, position_gain)
        calm = [one for one in row if one.settling is not None]
        if not calm:
            told.append(f"K_p = {position_gain:g} 1/m: never settles")
            holds.append(False)
            continue
        best = min(calm, key=lambda one: one.settling or 0.0)
        ends = "and goes on for ever beyond" if len(calm) < len(row) else "the highest tried"
        told.append(
            f"K_p = {position_gain:g} 1/m: {calm[0].settling:.2f} s at K_f = {calm[0].gain:g}, "
            f"{best.settling:.2f} s at {best.gain:g}, {calm[-1].settling:.2f} s at {calm[-1].gain:g} 1/N, "
            f"{ends}"
        )
        quicker = (best.settling or 0.0) < QUICKER * (calm[0].settling or 0.0)
        holds += [len(calm) < len(row), quicker]
    slowest = [row[0].settling for row in (_row(results, known) for known in _gains(results))]
    onsets = [results.onset(position_gain)[1] or math.inf for position_gain in _gains(results)]
    return Claim(
        "Proportional gains trade oscillation for speed of response",
        "Time until the force stays within 10 % of its set point: " + "; ".join(told),
        verdict([*holds, sorted(onsets, reverse=True) == onsets]),
        f"From the lowest to the highest K_p, the time to settle at the lowest K_f goes from "
        f"{_seconds(slowest[0])} to {_seconds(slowest[-1])}, and the onset from "
        f"{_gain(onsets[0])} to {_gain(onsets[-1])}.",
    )
