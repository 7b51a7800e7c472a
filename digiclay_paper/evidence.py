"""Measurements for the claims of the paper, with numbers from the results alone."""

from __future__ import annotations

import math
from typing import NamedTuple

from digiclay.core.studies.speed_limits import Follows, find_free_speed

from . import scenes
from .relief_sections import LIMITS, Section, blister_section, sections
from .results import (
    FULL,
    PAPER_SPEED,
    QUICK,
    RIDGE,
    WAYS,
    Results,
    Swing,
    onset_among,
)
from .scenes import METHODS, NAMES
from .simulations import WINDOWS

MM = 1e3
ONE, TWO = METHODS
SHORT = {name: NAMES[name].split(",")[0] for name in METHODS}
#: Ends of the searches for a largest speed, m/s.
FASTEST = {speeds[1] for one in (FULL, QUICK) for speeds in (one.drags, one.lifts)}


class Evidence(NamedTuple):
    """What was measured for a claim, item by item; whether each part of it holds; and remarks."""

    items: list[str]
    holds: list[bool]
    why: str = ""

    @property
    def measured(self) -> str:
        """All items in one text."""
        return "; ".join(self.items)

    @property
    def verdict(self) -> str:
        """Whether all, some or none of the parts hold."""
        return "holds" if all(self.holds) else "holds in part" if any(self.holds) else "differs"


def speed(found: float | None) -> str:
    """Write a largest speed, m/s."""
    if found is None:
        return "below the slowest tried"
    return f"{'at least ' if found in FASTEST else ''}{found * MM:.1f} mm/s"


def relief(results: Results) -> Evidence:
    """Whether ridge, mound and valley have the sections asked for."""
    found = {method: list(sections(results.session[method])) for method in METHODS}
    told = [f"{SHORT[method]}, {_write_section(one)}" for method in METHODS for one in found[method]]
    levels = []
    for method in METHODS:
        parts = {one.part: f"{one.part} {one.level * MM:.1f} mm" for one in found[method]}
        levels.append(f"{SHORT[method]} {', '.join(parts.values())}")
    why = (
        f"A section holds when its shape is {LIMITS}. Asked for is the method's own blister carried along "
        "the finger's path, at the level that was formed: beyond the finger's lowest point by "
        f"{'; '.join(levels)}. "
    )
    missed = [one.name for one in found[TWO] if not one.meets(LIMITS)]
    if missed:
        why += (
            f"{SHORT[TWO]} misses {', '.join(missed)}: every cell under the finger keeps its own force, so "
            "the surface takes the shape of the fingertip, with a rim around it, and the cells that were "
            "left behind at different moments stay where they were."
        )
    return Evidence(told, [one.meets(LIMITS) for method in METHODS for one in found[method]], why.strip())


def _write_section(one: Section) -> str:
    rim = f", rim {one.rim * MM:.1f} mm over its middle, {one.pins * MM:.1f} mm by all pins of the {one.part}"
    rim = rim if max(one.rim, one.pins) > LIMITS.rim * one.relief else ""
    low = abs(one.level) > LIMITS.level * one.middle
    level = f", its middle {one.level * MM:+.1f} mm from {one.middle * MM:.1f} mm" if low else ""
    holds = "" if one.meets(LIMITS) else " (missed)"
    far = f"rms {one.rms * MM:.1f}, at most {one.largest * MM:.1f} of {one.relief * MM:.1f} mm"
    return f"{one.name}: {far}{rim}{level}{holds}"


def tracking(results: Results) -> Evidence:
    """Both methods on the simple trajectories."""
    told = [
        f"{SHORT[method]}, {name}: {_followed(results.simple[method, name])}"
        for method in METHODS
        for name in WAYS
    ]
    holds = {key: one.meets(results.criterion) for key, one in results.simple.items() if key[0] in METHODS}
    missed = "; ".join(f"{SHORT[method]}, {name}" for (method, name), follows in holds.items() if not follows)
    return Evidence(told, list(holds.values()), f"Not followed: {missed}." if missed else "")


def _followed(one: Follows) -> str:
    lost = f"lost {one.losses} times, {one.loss_share:.0%} of the time without contact"
    if one.losses == 0 and one.loss_share == 0.0:
        lost = "never lost"
    return f"{lost}, lag ≤ {one.lag * MM:.1f} mm, RFD {one.rfd:.3f} N"


def largest_speed(results: Results) -> Evidence:
    lifts = {(method, "a lift straight up"): limit for method, limit in results.lifting.items()}
    found = {key: limit for key, limit in (results.fastest | lifts).items() if key[0] in METHODS}
    told = [f"{SHORT[method]}, {name}: {speed(limit)}" for (method, name), limit in found.items()]
    free = find_free_speed(results.printed[ONE].scene)
    gain = results.printed[TWO].gain("force_gain") * results.printed[TWO].gain("force_setpoint")
    why = (
        f"A pin without load rises at {free * MM:.1f} mm/s. A cell of {SHORT[TWO]} that feels nothing opens "
        f"its valve to K_FF F_ref = {gain:.2g}, and rises at {free * min(gain, 1.0) ** 2 * MM:.1f} mm/s "
        f"at the most."
    )
    return Evidence(told, [(limit or 0.0) >= PAPER_SPEED for limit in found.values()], why)


#: What counts as much greater, as a ratio.
MUCH = 1.5
#: A response is quicker that takes less than this share of the time.
QUICKER = 0.9


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


def deviations(results: Results) -> Evidence:
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
    each = known.gain("force_setpoint")
    level = [f"{one.rfd:.3f} N {name}" for (method, name), one in results.simple.items() if method == TWO]
    why = (
        f"{SHORT[TWO]} holds a force per cell, {each:g} N, and {known.followers:.1f} cells follow it on "
        f"average. Its set point, {each:g} N times the cells that follow at the moment, is "
        f"{_newton(known.metrics['set_point'])} on average and changes as the finger passes from cell to "
        "cell. A cell that is to rise needs a force below its set point, so the force falls short while the "
        "finger lifts: in level drags the RFD is " + ", ".join(level) + ". "
        f"It holds where all are {MUCH:g} times as great."
    )
    return Evidence(told, [ratio > MUCH for ratio in ratios], why)


def reference_force(results: Results) -> Evidence:
    told = []
    for method in METHODS:
        known = results.session[method].metrics
        drag = results.simple[method, RIDGE]
        told.append(
            f"{SHORT[method]}, set point {_newton(known['set_point'])}: {_newton(known['rfd'])} in contact, "
            f"{_newton(known['rfd_shaping'])} while shaping, "
            f"{drag.rfd:.3f} N dragging a ridge at {PAPER_SPEED * MM:g} mm/s"
        )
    pairs = [[results.session[method].metrics[name] for method in METHODS] for name in ("rfd", "rfd_shaping")]
    greater = [bool(one and two and two > one) for one, two in pairs]
    less = [results.simple[ONE, name].rfd < results.simple[TWO, name].rfd for name in WAYS]
    return Evidence(
        told,
        [*greater, *less],
        "The paper's own values are not among what this project has of it, so ours stand alone.",
    )


def _newton(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f} N"


def _seconds(time: float | None) -> str:
    return "never" if time is None else f"{time:.2f} s"


def _gain(gain: float) -> str:
    return "none seen" if gain == math.inf else f"K_f = {gain:g} 1/N"


def onset(results: Results) -> Evidence:
    """Where the oscillation sets in, at each K_p, and with a quicker device."""
    sweeps, used = results.sweeps, results.printed[ONE]
    told = [f"K_p = {gain:g} 1/m: {_sets_in(row)}" for gain, row in sweeps.items()]
    position_gain, gain = used.gain("position_gain"), used.gain("force_gain")
    first = results.onset(position_gain)[1]
    beyond = first is not None and gain >= first
    far = "" if first is None else f", {first / gain:.3g} times this K_f in another experiment"
    why = (
        f"Fig. 9 shows it in the session. The session's own gains here, K_p = {position_gain:g} 1/m and "
        f"K_f = {gain:g} 1/N, are {'beyond' if beyond else 'below'} the onset{far}. Flow goes with the "
        "square of the opening, so a small error hardly moves a pin: only a transient starts the cycle."
    )
    if results.quicker:
        free = find_free_speed(used.scene)
        why += (
            f" The device decides where: with pins of {results.quicker_speed * MM:.1f} instead of "
            f"{free * MM:.1f} mm/s without load, slower valves and a longer dead time, at K_p = "
            f"{results.quicker[0].position_gain:g} 1/m: {_sets_in(results.quicker)}."
        )
    return Evidence(told, [*(onset_among(row)[1] is not None for row in sweeps.values()), beyond], why)


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


def trade(results: Results) -> Evidence:
    told, holds = [], []
    for position_gain, row in results.sweeps.items():
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
    slowest = [_seconds(row[0].settling) for row in results.sweeps.values()]
    onsets = [onset_among(row)[1] or math.inf for row in results.sweeps.values()]
    return Evidence(
        told,
        [*holds, sorted(onsets, reverse=True) == onsets],
        f"From the lowest to the highest K_p, the time to settle at the lowest K_f goes from "
        f"{slowest[0]} to {slowest[-1]}, and the onset from "
        f"{_gain(onsets[0])} to {_gain(onsets[-1])}.",
    )


def blister(results: Results) -> Evidence:
    told, holds = [], []
    for (method, shape, profile), done in results.blisters.items():
        if method not in METHODS:
            continue
        one = blister_section(done)
        high = "high" if shape == "convex" else "deep"
        rim = f", rim {one.pins * MM:.1f} mm beyond it" if one.pins > LIMITS.rim * one.relief else ""
        told.append(
            f"{SHORT[method]}, {shape}, {profile}: {one.relief * MM:.1f} mm {high} in the middle{rim}, "
            f"section rms {one.rms * MM:.1f}, at most {one.largest * MM:.1f} mm from its profile"
            f"{'' if one.meets(LIMITS) else ' (missed)'}"
        )
        holds.append(one.meets(LIMITS))
    radius = {method: results.blisters[method, "convex", "cone"].scene.blister for method in METHODS}
    size = ", ".join(f"{SHORT[method]} {one.radius * MM:g} mm" for method, one in radius.items() if one)
    return Evidence(
        told,
        holds,
        f"The finger is held {scenes.TALL * MM:g} mm over the bed, or {-scenes.SINK * MM:g} mm in it, and "
        f"the pins press into it. A section holds as those of Fig. 10 do. Radius: {size}; {SHORT[TWO]} "
        "counts its own from the nearest cell under the finger, and there the cells take the shape of the "
        "fingertip.",
    )


def freezing(results: Results) -> Evidence:
    told, holds = [], []
    for method in METHODS:
        known = results.drags[method][0].metrics
        offset, uneven = known["ridge_offset"], known["ridge_unevenness"]
        if offset is None or uneven is None:
            told.append(f"{SHORT[method]}: left nothing behind")
            holds.append(False)
            continue
        told.append(
            f"{SHORT[method]}: left {offset * MM:.2f} mm over the finger's path, even to {uneven * MM:.2f} mm"
        )
        holds.append(uneven < 1e-3)
    why = "Over the path is how far the pins press into the finger, and what they rise once it has passed."
    return Evidence(told, holds, why)


def carried_out(results: Results) -> Evidence:
    """Whether the fingertip was lost on the way, and what it took not to lose it."""
    told = []
    for method in METHODS:
        known = results.printed[method]
        moments = ", ".join(f"{time:.2f} s" for time in known.lost)
        told.append(f"{SHORT[method]}: " + (f"finger lost at {moments}" if known.lost else "never lost"))
    lift, why = scenes.fastest_lift(results.printed[ONE].scene), ""
    for method in METHODS:
        if results.printed[method].lost:
            why += (
                f"The session lifts at up to {lift * MM:.1f} mm/s, and {SHORT[method]} follows a lift of "
                f"{speed(results.lifting[method])} with its default gains. "
            )
    if results.slow > 1.0:
        again = ", ".join(
            f"{SHORT[method]} {'lost again' if results.session[method].lost else 'never lost'}"
            for method in METHODS
        )
        why += f"Both were run again {results.slow:g} times as long: {again}."
    return Evidence(told, [not results.printed[method].lost for method in METHODS], why.strip())
