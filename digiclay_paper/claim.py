"""Claims of the paper: their form, and those on relief and on following the fingertip."""

from __future__ import annotations

from typing import NamedTuple

from digiclay.core.studies.method_trials import find_free_speed
from digiclay.core.studies.speed_limits import Criterion, Follows

from .relief_sections import LIMITS, Section, sections
from .results import FULL, PAPER_SPEED, QUICK, WAYS, Results
from .scenes import METHODS, NAMES

MM = 1e3
ONE, TWO = METHODS
SHORT = {name: NAMES[name].split(",")[0] for name in METHODS}
#: Ends of the searches for a largest speed, m/s.
FASTEST = {speeds[1] for one in (FULL, QUICK) for speeds in (one.drags, one.lifts)}
HOLDS, PARTLY, DIFFERS = "holds", "holds in part", "differs"


class Claim(NamedTuple):
    """Row of the page: claim, measurement, result, and the reason of a failure."""

    printed: str
    measured: str
    verdict: str
    why: str = ""


def verdict(holds: list[bool]) -> str:
    """Say whether all, some or none of what a claim comes to was seen."""
    return HOLDS if all(holds) else PARTLY if any(holds) else DIFFERS


def speed(found: float | None) -> str:
    """Write a largest speed, m/s."""
    if found is None:
        return "below the slowest tried"
    return f"{'at least ' if found in FASTEST else ''}{found * MM:.1f} mm/s"


def times(results: Results) -> str:
    """Say how much slower than by itself the session was run; nothing if it was not."""
    return f" {results.slow:g} times as long" if results.slow > 1.0 else ""


def relief(results: Results) -> Claim:
    """Whether ridge, mound and valley have the sections asked for."""
    found = {method: list(sections(results.session[method])) for method in METHODS}
    told = [f"{SHORT[method]}, {_told(one)}" for method in METHODS for one in found[method]]
    level = {
        method: ", ".join(f"{part} {one.level * MM:.1f} mm" for part, one in _parts(found[method]).items())
        for method in METHODS
    }
    why = (
        f"A section holds when its shape is {LIMITS}. Asked for is the method's own blister carried along "
        "the finger's path, at the level that was formed: beyond the finger's lowest point by "
        + "; ".join(f"{SHORT[method]} {level[method]}" for method in METHODS)
        + ". "
    )
    missed = [one.name for one in found[TWO] if not one.meets(LIMITS)]
    if missed:
        why += (
            f"{SHORT[TWO]} misses {', '.join(missed)}: every cell under the finger keeps its own force, so "
            "the surface takes the shape of the fingertip, with a rim around it, and the cells that were "
            "left behind at different moments stay where they were."
        )
    return Claim(
        "The session leaves a ridge, a mound at its end, and a valley across the far edge (Fig. 10)",
        f"Sections, session{times(results)}, deviation from the section asked for: " + "; ".join(told),
        verdict([one.meets(LIMITS) for method in METHODS for one in found[method]]),
        why.strip(),
    )


def _parts(found: list[Section]) -> dict[str, Section]:
    return {one.part: one for one in found}


def _told(one: Section) -> str:
    rim = f", rim {one.rim * MM:.1f} mm over its middle, {one.pins * MM:.1f} mm by all pins of the {one.part}"
    rim = rim if max(one.rim, one.pins) > LIMITS.rim * one.relief else ""
    low = abs(one.level) > LIMITS.level * one.middle
    level = f", its middle {one.level * MM:+.1f} mm from {one.middle * MM:.1f} mm" if low else ""
    holds = "" if one.meets(LIMITS) else " (missed)"
    far = f"rms {one.rms * MM:.1f}, at most {one.largest * MM:.1f} of {one.relief * MM:.1f} mm"
    return f"{one.name}: {far}{rim}{level}{holds}"


def tracking(results: Results) -> Claim:
    """Both methods on the simple trajectories."""
    told = [
        f"{SHORT[method]}, {name}: {_followed(results.simple[method, name])}"
        for method in METHODS
        for name in WAYS
    ]
    found = results.simple
    missed = _missed(found, results.criterion)
    return Claim(
        f"Both methods track to {PAPER_SPEED * MM:g} mm/s on simple trajectories",
        "; ".join(told),
        verdict([one.meets(results.criterion) for one in found.values()]),
        f"Not followed: {missed}." if missed else "",
    )


def _followed(one: Follows) -> str:
    lost = "never lost" if one.losses == 0 and one.loss_share == 0.0 else _lost(one)
    return f"{lost}, lag ≤ {one.lag * MM:.1f} mm, RFD {one.rfd:.3f} N"


def _lost(one: Follows) -> str:
    return f"lost {one.losses} times, {one.loss_share:.0%} of the time without contact"


def _missed(found: dict[tuple[str, str], Follows], criterion: Criterion) -> str:
    missed = [f"{SHORT[method]}, {name}" for (method, name), one in found.items() if not one.meets(criterion)]
    return "; ".join(missed)


def largest_speed(results: Results) -> Claim:
    lifts = {(method, "a lift straight up"): limit for method, limit in results.lifting.items()}
    found = {key: limit for key, limit in (results.fastest | lifts).items() if key[0] in METHODS}
    told = [f"{SHORT[method]}, {name}: {speed(limit)}" for (method, name), limit in found.items()]
    free = find_free_speed(results.printed[ONE].scene)
    control = results.printed[TWO].scene.control
    gain = getattr(control, "force_gain", 0.0) * getattr(control, "force_setpoint", 0.0)
    why = (
        f"A pin without load rises at {free * MM:.1f} mm/s. A cell of {SHORT[TWO]} that feels nothing opens "
        f"its valve to K_FF F_ref = {gain:.2g}, and rises at {free * min(gain, 1.0) ** 2 * MM:.1f} mm/s "
        f"at the most."
    )
    return Claim(
        f"Up to {PAPER_SPEED * MM:g} mm/s, and how far beyond",
        "Largest speed of a straight level drag, and of a lift: " + "; ".join(told),
        verdict([(limit or 0.0) >= PAPER_SPEED for limit in found.values()]),
        why,
    )
