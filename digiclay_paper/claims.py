"""Claims of the paper beside measurements, with numbers from the results alone."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from .evidence import (
    MM,
    MUCH,
    ONE,
    SHORT,
    TWO,
    Evidence,
    blister,
    carried_out,
    deviations,
    freezing,
    largest_speed,
    onset,
    reference_force,
    relief,
    tracking,
    trade,
)
from .results import (
    AHEAD,
    AS_IT_IS,
    DRAGS,
    PAPER_SPEED,
    Dragged,
    Results,
    onset_among,
)
from .scenes import METHODS, PRESSED
from .simulations import GAUSSIAN, NO_RISE, STAGGERED


class Claim(NamedTuple):
    """Row of the page: claim, measurement, result, and the reason of a failure."""

    printed: str
    measured: str
    verdict: str
    why: str = ""


#: Cells ahead count as lowered by this share of how far the fingertip is in the surface.
LOWERED = 0.1
#: A search radius rejects noise that leaves at most this share of the scatter there is without it.
REJECTED = 0.5


def rise(results: Results) -> Evidence:
    """Whether Method II's forces come from the slight rise of its blister."""
    told, holds = [], []
    for variant, method, name in results.dragged:
        if variant != NO_RISE:
            continue
        less, more = results.dragged[variant, method, name], results.dragged[AS_IT_IS, method, name]
        told.append(
            f"{name}: {more.force:.2f} N with the rise and {less.force:.2f} N without, "
            f"{more.followers:.1f} and {less.followers:.1f} cells follow, "
            f"RFD {more.follows.rfd:.3f} and {less.follows.rfd:.3f} N{_write_losses(less)}"
        )
        holds += [more.force > MUCH * less.force, more.follows.rfd > MUCH * less.follows.rfd]
    return Evidence(
        told,
        holds,
        f"It holds where both the force and the RFD are {MUCH:g} times as great with the rise. The rise has "
        "cells around the finger feel it, and each that follows asks for its own force; without it fewer "
        "cells follow, and along a ridge too few to keep the finger.",
    )


def ahead(results: Results) -> Evidence:
    """Whether Method I lowers cells before the fingertip is over them."""
    told, holds = [], []
    for variant, method, name in results.dragged:
        one = results.dragged[variant, method, name]
        if variant != AS_IT_IS or method not in METHODS or name not in DEPTH or one.ahead is None:
            continue
        told.append(f"{SHORT[method]}, {name}, {DEPTH[name] * MM:g} mm deep: {one.ahead * MM:+.2f} mm")
        if method == ONE:
            holds.append(-one.ahead > LOWERED * DEPTH[name])
    return Evidence(
        told,
        holds or [False],
        f"It holds where they are lowered by {LOWERED:.0%} of the finger's depth or more. {SHORT[TWO]} is "
        "there for comparison: its blister stands higher by the rise.",
    )


#: How far the fingertip is in the surface, m.
DEPTH = {name: -way.height for name, way in DRAGS.items() if way.height < 0.0}


def escape(results: Results) -> Evidence:
    """Whether Method II stays clear of the oscillation of Method I."""
    row, used = sorted(results.cell_swings), results.printed[ONE]
    calm, first = onset_among(row)
    own = results.printed[TWO].gain("force_gain")
    told = [
        f"K_FF = {one.gain:g} 1/N: {one.amplitude:.3f} N"
        + (f" at {one.frequency:.0f} Hz" if one.sustained and one.frequency else "")
        for one in row
    ]
    wild = results.onset(used.gain("position_gain"))[1]
    why = f"Its own gain is {own:g} 1/N. "
    if first is not None:
        why += (
            f"A cycle that goes on sets in {'' if calm is None else f'above {calm:g}, '}at {first:g} 1/N, "
            f"{first / own:.1f} times that; each cell has a valve and a dead time of its own. "
        )
    if wild is not None:
        why += f"Method I's sets in at {wild / used.gain('force_gain'):.1f} times its own K_f."
    return Evidence(told, [not one.sustained for one in row], why.strip())


def _find_radius(results: Results) -> float:
    """Return r_VM, m."""
    return min((one.radius for one in results.located), default=0.0)


def radius(results: Results) -> Evidence:
    """Whether looking for the fingertip only near the master rejects what noisy sensors add elsewhere."""
    told, holds, lost = [], [], []
    least = _find_radius(results)
    for near in (one for one in results.located if one.radius == least):
        same = near.noise, near.thresholds
        (wide,) = (
            one for one in results.located if (one.noise, one.thresholds) == same and one.radius != least
        )
        called = "thresholds by the noise" if near.thresholds else "no such thresholds"
        told.append(
            f"{near.noise * MM:g} mN, {called}: {_scatter(near.scatter)} with and {_scatter(wide.scatter)} "
            "without the radius"
        )
        known = near.scatter is not None and wide.scatter is not None
        holds.append(known and (near.scatter or 0.0) <= REJECTED * (wide.scatter or 0.0))
        if near.losses or wide.losses:
            lost.append(f"{near.noise * MM:g} mN, {called}: {near.losses} and {wide.losses} times")
    return Evidence(
        told,
        holds or [False],
        f"It holds where the radius leaves {REJECTED:.0%} at most of what there is without it. Without it "
        "all cells the fingertip may touch are looked at. Where readings below five standard deviations "
        "count as none, as they do in this program, few are left outside the radius for it to reject. "
        + (f"The finger was lost with and without the radius: {', '.join(lost)}." if lost else ""),
    )


def _scatter(value: float | None) -> str:
    return "never shapes" if value is None else f"{value * MM:.3f} mm"


def varied(variant: str, results: Results) -> Evidence:
    """Compare the drags of a variant with those of the scene as it is."""
    called = variant.capitalize() if variant == GAUSSIAN else variant
    told, holds, worse = [], [], []
    for which, method, name in results.dragged:
        if which != variant:
            continue
        one, other = results.dragged[which, method, name], results.dragged[AS_IT_IS, method, name]
        told.append(f"{SHORT[method]}, {name}: {_beside(other)}, {called} {_beside(one)}")
        if other.follows.meets(results.criterion):
            holds.append(one.follows.meets(results.criterion))
            worse += [] if holds[-1] else [f"{SHORT[method]}, {name}"]
    return Evidence(
        told,
        holds or [False],
        "It holds where what is followed without the change is followed with it. "
        + (f"Not so: {'; '.join(worse)}." if worse else ""),
    )


def _beside(one: Dragged) -> str:
    return f"{one.follows.lag * MM:.1f} mm, {one.follows.rfd:.3f} N{_write_losses(one)}"


def _write_losses(one: Dragged) -> str:
    lost = one.follows.losses
    return f" (finger lost {lost} time{'' if lost == 1 else 's'})" if lost else ""


#: What the paper says, the beginning of what was measured, and what judges it, in the order of the paper.
CLAIMS: tuple[tuple[str, str, Callable[[Results], Evidence]], ...] = (
    (f"Both methods track to {PAPER_SPEED * MM:g} mm/s on simple trajectories", "", tracking),
    (
        f"Up to {PAPER_SPEED * MM:g} mm/s, and how far beyond",
        "Largest speed of a straight level drag, and of a lift: ", largest_speed,
    ),
    (
        "Method II's deviations of height and force are much greater",
        "Method I and II on the session{slow}: ", deviations,
    ),
    ("RFD of both methods, Method I's being the smaller", "Session{slow}: ", reference_force),
    (
        "The virtual master makes a second-order loop that oscillates at high gain",
        f"Holding still after a quick press of {PRESSED * MM:g} mm, a cycle that goes on sets in ", onset,
    ),
    (
        "Proportional gains trade oscillation for speed of response",
        "Time until the force stays within 10 % of its set point: ", trade,
    ),
    (
        "A blister is lifted by 15 mm, or sunk, with a cone or a Gaussian for its profile (Fig. 4)", "",
        blister,
    ),
    (
        "Cells left behind freeze, and the ridge stays",
        f"Ridge dragged at {PAPER_SPEED * MM:g} mm/s. ", freezing,
    ),
    (
        "Both methods carry out the session of Fig. 8",
        "At its own times (lift-offs faster than a pin left aside): ", carried_out,
    ),
    (
        "The session leaves a ridge, a mound at its end, and a valley across the far edge (Fig. 10)",
        "Sections, session{slow}, deviation from the section asked for: ", relief,
    ),
    (
        "The slight rise of Method II's blister causes its greater forces",
        f"Drags at {PAPER_SPEED * MM:g} mm/s: ", rise,
    ),
    (
        "Method I lowers the cells ahead of a finger in the surface, however deep",
        f"Mean height over the bed at rest, {AHEAD[0] * MM:g} to {AHEAD[1] * MM:g} mm ahead of the finger, "
        "of cells that do not feel it: ", ahead,
    ),
    (
        "Method II, without a virtual master, escapes the oscillation",
        f"Amplitude of the force in the last second of a hold after a quick press of {PRESSED * MM:g} mm: ",
        escape,
    ),
    (
        "A search radius around the virtual master rejects noise",
        "How far Method I's master wanders under a finger held still (rms), r_VM {radius} mm, by noise of "
        "the force sensors: ", radius,
    ),
    (
        "Both methods work on a staggered bed",
        f"Drags at {PAPER_SPEED * MM:g} mm/s, lag and RFD: ", partial(varied, STAGGERED),
    ),
    (
        "Both methods drag a Gaussian blister as they do a cone",
        f"Drags at {PAPER_SPEED * MM:g} mm/s, lag and RFD: ", partial(varied, GAUSSIAN),
    ),
)  # fmt: skip


def claims(results: Results) -> list[Claim]:
    """Return all claims, in the order of the paper."""
    # Nothing is said of a session at its own speed.
    slow = f" {results.slow:g} times as long" if results.slow > 1.0 else ""
    least = f"{_find_radius(results) * MM:g}"
    return [
        Claim(printed, what.format(slow=slow, radius=least) + seen.measured, seen.verdict, seen.why)
        for printed, what, seen in ((printed, what, judge(results)) for printed, what, judge in CLAIMS)
    ]
