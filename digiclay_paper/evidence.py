"""Measurements for the claims of the paper, with numbers from the results alone."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

from digiclay.core.studies.speed_limits import find_free_speed

from . import scenes
from .relief_sections import LIMITS, Section, blister_section, sections
from .results import (
    AS_IT_IS,
    DRAGS,
    FULL,
    PAPER_SPEED,
    QUICK,
    RIDGE,
    WAYS,
    Dragged,
    Results,
    Swing,
    onset_among,
)
from .scenes import METHODS, NAMES
from .simulations import GAUSSIAN, NO_RISE, STAGGERED, WINDOWS

MM = 1e3
ONE, TWO = METHODS
SHORT = {name: NAMES[name].split(",")[0] for name in METHODS}
#: Ends of the searches for a largest speed, m/s.
FASTEST = {speeds[1] for extent in (FULL, QUICK) for speeds in (extent.drags, extent.lifts)}
Value = TypeVar("Value")


@dataclass
class Evidence:
    """What was measured for a claim, item by item; whether each part of it holds; and remarks."""

    items: list[str] = field(default_factory=list)
    holds: list[bool] = field(default_factory=list)
    #: Names of the items that do not hold.
    missed: list[str] = field(default_factory=list)
    why: str = ""

    def add(self, name: str, text: str, *holds: bool) -> None:
        """Add an item, and whether each of its parts holds."""
        self.items.append(f"{name}: {text}")
        self.holds += holds
        self.missed += [] if all(holds) else [name]

    @property
    def measured(self) -> str:
        """All items in one text."""
        return "; ".join(self.items)

    @property
    def verdict(self) -> str:
        """Whether all, some or none of the parts hold."""
        return "differs" if not any(self.holds) else "holds" if all(self.holds) else "holds in part"


def _of_paper(values: Mapping[tuple[str, str], Value]) -> Iterator[tuple[str, str, Value]]:
    """Yield method, name of the trajectory and value of the paper's methods, without Method III's."""
    return ((method, name, value) for (method, name), value in values.items() if method in METHODS)


def speed(limit: float | None) -> str:
    """Write a largest speed, m/s."""
    if limit is None:
        return "below the slowest tried"
    return f"{'at least ' if limit in FASTEST else ''}{limit * MM:.1f} mm/s"


def relief(results: Results) -> Evidence:
    """Whether ridge, mound and valley have the sections asked for."""
    evidence, missed = Evidence(), []
    for method in METHODS:
        for section in sections(results.session[method]):
            evidence.add(
                f"{SHORT[method]}, {section.name}", _write_section(section), section.meets(LIMITS)
            )
            missed += [section.name] if method == TWO and not section.meets(LIMITS) else []
    evidence.why = (
        f"A section holds when its shape is {LIMITS}. Nominal is the method's own blister carried along "
        "the fingertip's path, at the level that was formed."
    )
    if missed:
        evidence.why += (
            f" {SHORT[TWO]} misses {', '.join(missed)}: it holds the force of each cell, so the surface "
            "takes the shape of the fingertip, with a rim around it."
        )
    return evidence


def _write_section(section: Section) -> str:
    rim = (
        f", rim {section.rim * MM:.1f} mm over its middle, {section.pins * MM:.1f} mm by all pins "
        f"of the {section.part}"
    )
    rim = rim if max(section.rim, section.pins) > LIMITS.rim * section.relief else ""
    low = abs(section.level) > LIMITS.level * section.middle
    middle = f", its middle {section.level * MM:+.1f} mm from {section.middle * MM:.1f} mm"
    holds = "" if section.meets(LIMITS) else " (missed)"
    size = f"{section.largest * MM:.1f} of {section.relief * MM:.1f} mm"
    return f"rms {section.rms * MM:.1f}, at most {size}{rim}{middle if low else ''}{holds}"


def tracking(results: Results) -> Evidence:
    """Both methods on the simple trajectories."""
    evidence = Evidence()
    for method, name, follows in _of_paper(results.simple):
        lost = f"lost {follows.losses} times, {follows.loss_share:.0%} of the time without contact"
        if follows.losses == 0 and follows.loss_share == 0.0:
            lost = "never lost"
        text = f"{lost}, lag ≤ {follows.lag * MM:.1f} mm, RFD {follows.rfd:.3f} N"
        evidence.add(f"{SHORT[method]}, {name}", text, follows.meets(results.criterion))
    evidence.why = f"Not followed: {'; '.join(evidence.missed)}." if evidence.missed else ""
    return evidence


def largest_speed(results: Results) -> Evidence:
    """Whether both methods follow the paper's speed, and how far beyond."""
    evidence = Evidence()
    lifts = {(method, "a lift straight up"): limit for method, limit in results.lifting.items()}
    for method, name, limit in _of_paper(results.fastest | lifts):
        evidence.add(f"{SHORT[method]}, {name}", speed(limit), (limit or 0.0) >= PAPER_SPEED)
    free = find_free_speed(results.printed[ONE].scene)
    gain = results.printed[TWO].gain("force_gain") * results.printed[TWO].gain("force_setpoint")
    evidence.why = (
        f"A pin without load rises at {free * MM:.1f} mm/s. A cell of {SHORT[TWO]} that feels nothing opens "
        f"its valve to K_FF F_ref = {gain:.2g}, and rises at {free * min(gain, 1.0) ** 2 * MM:.1f} mm/s "
        f"at the most."
    )
    return evidence


#: What counts as much greater, as a ratio.
MUCH = 1.5
#: A response is quicker that takes less than this share of the time.
QUICKER = 0.9
DEVIATIONS = {
    "height_deviation": ("height under the fingertip, standard deviation over time", MM, "mm"),
    "ridge_error": ("what is left behind over the fingertip's path, rms", MM, "mm"),
    "ridge_unevenness": ("the same, standard deviation", MM, "mm"),
    "force_deviation": ("total force, standard deviation over time", 1.0, "N"),
    "rfd_shaping": ("total force from its set point while shaping, rms", 1.0, "N"),
}
#: Of them, what is compared in the paper's windows, too.
WINDOWED = {
    "rfd": ("RFD", 1.0, "N"),
    "force_deviation": ("total force", 1.0, "N"),
    "height_deviation": ("height under the fingertip", MM, "mm"),
}


def deviations(results: Results) -> Evidence:
    """Whether Method II deviates much more, in the whole session and in each of the paper's windows."""
    evidence = Evidence()
    sources = [("", DEVIATIONS, [results.session[method].metrics for method in METHODS])]
    for window, spans in WINDOWS.items():
        between = " and ".join(f"{start:g} to {end:g} s" for start, end in spans)
        values = [results.printed[method].windows.get(window, {}) for method in METHODS]
        sources.append((f"{between} ({window}), ", WINDOWED, values))
    for when, compared, values in sources:
        for name, (meaning, factor, unit) in compared.items():
            one, two = (metrics.get(name) for metrics in values)
            both, ratio = "nothing to compute from", 0.0
            if one and two is not None:
                ratio = two / one
                both = f"{one * factor:.3g} and {two * factor:.3g} {unit}, ratio {ratio:.1f}"
            evidence.add(f"{when}{meaning}", both, ratio > MUCH)
    each = results.session[TWO].gain("force_setpoint")
    evidence.why = (
        f"It holds where all are {MUCH:g} times as great. {SHORT[TWO]} holds {each:g} N per cell: its set "
        "point changes as the fingertip passes from cell to cell. A cell that is to rise needs a force below "
        "its set point, so the force falls short while the fingertip lifts."
    )
    return evidence


def reference_force(results: Results) -> Evidence:
    """Whether Method I's RFD is the smaller one."""
    evidence = Evidence(
        why="The paper's own values are not among what this project has of it, so ours stand alone."
    )
    one, two = (results.session[method].metrics for method in METHODS)
    for method, metrics in ((ONE, one), (TWO, two)):
        text = (
            f"{_newton(metrics['rfd'])} in contact, {_newton(metrics['rfd_shaping'])} while shaping, "
            f"{results.simple[method, RIDGE].rfd:.3f} N dragging a ridge at {PAPER_SPEED * MM:g} mm/s"
        )
        evidence.add(f"{SHORT[method]}, set point {_newton(metrics['set_point'])}", text)
    for name in ("rfd", "rfd_shaping"):
        smaller, greater = one[name], two[name]
        evidence.holds.append(bool(smaller and greater and greater > smaller))
    evidence.holds += [
        results.simple[ONE, name].rfd < results.simple[TWO, name].rfd for name in WAYS
    ]
    return evidence


def _newton(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f} N"


def onset(results: Results) -> Evidence:
    """Where the oscillation sets in, at each K_p, and with a quicker device."""
    evidence, used = Evidence(), results.printed[ONE]
    for gain, row in results.sweeps.items():
        evidence.add(f"K_p = {gain:g} 1/m", _sets_in(row), onset_among(row)[1] is not None)
    position_gain, gain = used.gain("position_gain"), used.gain("force_gain")
    first = results.onset(position_gain)[1]
    beyond = first is not None and gain >= first
    evidence.holds.append(beyond)
    far = "" if first is None else f", {first / gain:.3g} times this K_f in another experiment"
    evidence.why = (
        f"Fig. 9 shows it in the session. The session's own gains here, K_p = {position_gain:g} 1/m and "
        f"K_f = {gain:g} 1/N, are {'beyond' if beyond else 'below'} the onset{far}. Flow goes with the "
        "square of the opening, so a small error hardly moves a pin: only a transient starts the cycle."
    )
    if results.quicker:
        free = find_free_speed(used.scene)
        evidence.why += (
            f" The device decides where: with pins of {results.quicker_speed * MM:.1f} instead of "
            f"{free * MM:.1f} mm/s without load, slower valves and a longer dead time, at K_p = "
            f"{results.quicker[0].position_gain:g} 1/m: {_sets_in(results.quicker)}."
        )
    return evidence


def _sets_in(swings: list[Swing]) -> str:
    """Write between which gains the oscillation sets in, and what it is like then."""
    calm, first = onset_among(swings)
    if first is None:
        return f"none up to K_f = {calm or 0.0:g} 1/N"
    by_gain = {swing.gain: swing for swing in swings}
    swing = by_gain[first]
    pace = "" if swing.frequency is None else f", {swing.frequency:.0f} Hz"
    below = "at" if calm is None else f"above {calm:g} ({by_gain[calm].amplitude:.3f} N left), at"
    return f"{below} {first:g} 1/N (amplitude {swing.amplitude:.3f} N{pace})"


def trade(results: Results) -> Evidence:
    """Whether a higher gain is quicker until it oscillates."""
    evidence = Evidence()
    for position_gain, row in results.sweeps.items():
        name = f"K_p = {position_gain:g} 1/m"
        calm = [(one.gain, one.settling) for one in row if one.settling is not None]
        if not calm:
            evidence.add(name, "never settles", False)
            continue
        (low, slow), (high, end) = calm[0], calm[-1]
        best, quick = min(calm, key=lambda one: one[1])
        ends = "and oscillates beyond" if len(calm) < len(row) else "the highest tried"
        times = (
            f"{slow:.2f} s at K_f = {low:g}, {quick:.2f} s at {best:g}, {end:.2f} s at {high:g} 1/N"
        )
        evidence.add(name, f"{times}, {ends}", len(calm) < len(row), quick < QUICKER * slow)
    onsets = [onset_among(row)[1] or math.inf for row in results.sweeps.values()]
    evidence.holds.append(sorted(onsets, reverse=True) == onsets)
    evidence.why = (
        "It holds if settling is quicker at a higher K_f until the force oscillates, and if the oscillation "
        "begins at a lower K_f with a higher K_p."
    )
    return evidence


HIGH = {"convex": "high", "concave": "deep"}


def blister(results: Results) -> Evidence:
    """Whether blisters have the sections asked for."""
    evidence = Evidence()
    for (method, shape, profile), done in results.blisters.items():
        if method in METHODS:
            section = blister_section(done)
            rim = f", rim {section.pins * MM:.1f} mm beyond it"
            rim = rim if section.pins > LIMITS.rim * section.relief else ""
            text = (
                f"{section.relief * MM:.1f} mm {HIGH[shape]} in the middle{rim}, "
                f"section rms {section.rms * MM:.1f}, "
                f"at most {section.largest * MM:.1f} mm from its profile"
                f"{'' if section.meets(LIMITS) else ' (missed)'}"
            )
            evidence.add(f"{SHORT[method]}, {shape}, {profile}", text, section.meets(LIMITS))
    forms = {method: results.blisters[method, "convex", "cone"].scene.blister for method in METHODS}
    size = ", ".join(
        f"{SHORT[method]} {form.radius * MM:g} mm" for method, form in forms.items() if form
    )
    evidence.why = (
        f"The fingertip is held {scenes.TALL * MM:g} mm over the bed, or {-scenes.SINK * MM:g} mm in it, and "
        f"the pins press into it. A section holds as those of Fig. 10 do. Radius: {size}; {SHORT[TWO]} "
        "counts its own from the nearest cell under the fingertip, and there the cells take the shape of the "
        "fingertip."
    )
    return evidence


def freezing(results: Results) -> Evidence:
    """Whether the cells left behind stay where the fingertip left them."""
    why = "Over the path is how far the pins press into the fingertip, and what they rise once it has passed."
    evidence = Evidence(why=why)
    for method in METHODS:
        metrics = results.drags[method][0].metrics
        offset, uneven = metrics["ridge_offset"], metrics["ridge_unevenness"]
        if offset is None or uneven is None:
            evidence.add(SHORT[method], "left nothing behind", False)
        else:
            text = (
                f"left {offset * MM:.2f} mm over the fingertip's path, even to {uneven * MM:.2f} mm"
            )
            evidence.add(SHORT[method], text, uneven < 1e-3)
    return evidence


def carried_out(results: Results) -> Evidence:
    """Whether the fingertip was lost on the way, and what it took not to lose it."""
    evidence, lift = Evidence(), scenes.fastest_lift(results.printed[ONE].scene)
    for method in METHODS:
        lost = results.printed[method].lost
        moments = ", ".join(f"{time:.2f} s" for time in lost)
        evidence.add(SHORT[method], f"finger lost at {moments}" if lost else "never lost", not lost)
        if lost:
            evidence.why += (
                f"The session lifts at up to {lift * MM:.1f} mm/s, and {SHORT[method]} follows a lift of "
                f"{speed(results.lifting[method])} with its default gains. "
            )
    if results.slow > 1.0:
        again = ", ".join(
            f"{SHORT[method]} {'lost again' if results.session[method].lost else 'never lost'}"
            for method in METHODS
        )
        evidence.why += f"Both were run again {results.slow:g} times as long: {again}."
    evidence.why = evidence.why.strip()
    return evidence


#: Cells ahead count as lowered by this share of how far the fingertip is in the surface.
LOWERED = 0.1
#: A search radius rejects noise that leaves at most this share of the scatter there is without it.
REJECTED = 0.5
#: How far the fingertip is in the surface, m.
DEPTH = {name: -way.height for name, way in DRAGS.items() if way.height < 0.0}


def _list_drags(results: Results, variant: str) -> Iterator[tuple[str, str, Dragged, Dragged]]:
    """Yield method, trajectory and result of each drag of a variant, and the result of the scene as it is."""
    for (which, method, name), changed in results.dragged.items():
        if which == variant:
            yield method, name, changed, results.dragged[AS_IT_IS, method, name]


def rise(results: Results) -> Evidence:
    """Whether Method II's forces come from the slight rise of its blister."""
    evidence = Evidence(
        why=f"It holds where both the force and the RFD are {MUCH:g} times as great with the rise. The rise "
        "has cells around the fingertip feel it, and each that follows asks for its own force; without it "
        "fewer cells follow, and along a ridge too few to keep the fingertip."
    )
    for _, name, less, more in _list_drags(results, NO_RISE):
        text = (
            f"{more.force:.2f} N with the rise and {less.force:.2f} N without, "
            f"{more.followers:.1f} and {less.followers:.1f} cells follow, "
            f"RFD {more.follows.rfd:.3f} and {less.follows.rfd:.3f} N{_write_losses(less)}"
        )
        evidence.add(
            name, text, more.force > MUCH * less.force, more.follows.rfd > MUCH * less.follows.rfd
        )
    return evidence


def ahead(results: Results) -> Evidence:
    """Whether Method I lowers cells before the fingertip is over them."""
    evidence = Evidence(
        why=f"It holds where they are lowered by {LOWERED:.0%} of the fingertip's depth or more. "
        f"{SHORT[TWO]} is there for comparison: its blister stands higher by the rise."
    )
    for method, name, drag, _ in _list_drags(results, AS_IT_IS):
        if method in METHODS and name in DEPTH and drag.ahead is not None:
            lowered = [-drag.ahead > LOWERED * DEPTH[name]] if method == ONE else []
            depth = f"{DEPTH[name] * MM:g} mm deep"
            evidence.add(
                f"{SHORT[method]}, {name}, {depth}", f"{drag.ahead * MM:+.2f} mm", *lowered
            )
    return evidence


def escape(results: Results) -> Evidence:
    """Whether Method II stays clear of the oscillation of Method I."""
    evidence, row = Evidence(), sorted(results.cell_swings)
    for swing in row:
        pace = f" at {swing.frequency:.0f} Hz" if swing.sustained and swing.frequency else ""
        evidence.add(
            f"K_FF = {swing.gain:g} 1/N", f"{swing.amplitude:.3f} N{pace}", not swing.sustained
        )
    calm, first = onset_among(row)
    own = results.printed[TWO].gain("force_gain")
    evidence.why = f"Its own gain is {own:g} 1/N."
    if first is not None:
        evidence.why += (
            f" The oscillation begins {'' if calm is None else f'above {calm:g}, '}at {first:g} 1/N, "
            f"{first / own:.1f} times that; each cell has its own valve and dead time."
        )
    return evidence


def find_radius(results: Results) -> float:
    """Return r_VM, m."""
    return min((finger.radius for finger in results.located), default=0.0)


def radius(results: Results) -> Evidence:
    """Whether looking for the fingertip only near the master rejects what noisy sensors add elsewhere."""
    evidence, lost, least = Evidence(), [], find_radius(results)
    wider = {(one.noise, one.thresholds): one for one in results.located if one.radius != least}
    for near in (one for one in results.located if one.radius == least):
        wide = wider[near.noise, near.thresholds]
        kind = "thresholds by the noise" if near.thresholds else "no such thresholds"
        name = f"{near.noise * MM:g} mN, {kind}"
        text = f"{_scatter(near.scatter)} with and {_scatter(wide.scatter)} without the radius"
        measured = near.scatter is not None and wide.scatter is not None
        evidence.add(
            name, text, measured and (near.scatter or 0.0) <= REJECTED * (wide.scatter or 0.0)
        )
        if near.losses or wide.losses:
            lost.append(f"{name}: {near.losses} and {wide.losses} times")
    evidence.why = (
        f"It holds where the radius leaves {REJECTED:.0%} at most of what there is without it. Without it "
        "all cells the fingertip may touch are looked at. Where readings below five standard deviations "
        "count as none, as they do in this program, few are left outside the radius for it to reject. "
        + (
            f"The fingertip was lost with and without the radius: {', '.join(lost)}."
            if lost
            else ""
        )
    )
    return evidence


def _scatter(value: float | None) -> str:
    return "never shapes" if value is None else f"{value * MM:.3f} mm"


def varied(variant: str, results: Results) -> Evidence:
    """Compare the drags of a variant with those of the scene as it is."""
    title, evidence = variant.capitalize() if variant == GAUSSIAN else variant, Evidence()
    for method, name, changed, usual in _list_drags(results, variant):
        # What fails anyway says nothing of the variant.
        holds = (
            [changed.follows.meets(results.criterion)]
            if usual.follows.meets(results.criterion)
            else []
        )
        text = f"{_write_drag(usual)}, {title} {_write_drag(changed)}"
        evidence.add(f"{SHORT[method]}, {name}", text, *holds)
    evidence.why = "It holds where what is followed without the change is followed with it. "
    evidence.why += f"Not so: {'; '.join(evidence.missed)}." if evidence.missed else ""
    return evidence


staggered, gaussian = (partial(varied, variant) for variant in (STAGGERED, GAUSSIAN))


def _write_drag(drag: Dragged) -> str:
    return f"{drag.follows.lag * MM:.1f} mm, {drag.follows.rfd:.3f} N{_write_losses(drag)}"


def _write_losses(drag: Dragged) -> str:
    lost = drag.follows.losses
    return f" (finger lost {lost} time{'' if lost == 1 else 's'})" if lost else ""
