"""Claims on how fast a finger is followed."""

from __future__ import annotations

from ..core.metrics_speed import Criterion, Follows
from . import scenes
from .claim import MM, ONE, SHORT, TWO, Claim, speed, verdict
from .scenes import METHODS
from .trials import PAPER_SPEED, WAYS, Results

__all__ = ["largest_speed", "tracking"]

#: The limits first chosen, drags of a ridge in view: a lag within a pitch, an RFD within half the set point.
NARROW = Criterion(lag=3e-3, deviation=0.2)


def tracking(results: Results) -> Claim:
    """Both methods on the simple trajectories."""
    told = [
        f"{SHORT[method]}, {name}: {_followed(results.simple[method, name])}"
        for method in METHODS
        for name in WAYS
    ]
    found = results.simple
    limits = f"{NARROW.lag * MM:g} mm and {NARROW.deviation:g} N"
    missed, narrow = _missed(found, results.criterion), _missed(found, NARROW)
    why = f"Not followed: {missed}. " if missed else ""
    why += f"Under the limits first chosen, {limits}, not followed: {narrow}." if narrow else ""
    # Limits that were widened afterwards decide nothing by themselves: it holds if both are met.
    met = [one.meets(limit) for one in found.values() for limit in (results.criterion, NARROW)]
    return Claim(
        f"Both methods track to {PAPER_SPEED * MM:g} mm/s on simple trajectories",
        "; ".join(told),
        verdict(met),
        why.strip(),
    )


def _followed(one: Follows) -> str:
    lost = "never lost" if one.losses == 0 and one.loss_share == 0.0 else _lost(one)
    return f"{lost}, lag ≤ {one.lag * MM:.1f} mm, RFD {one.rfd:.3f} N"


def _lost(one: Follows) -> str:
    return f"lost {one.losses} times, {one.loss_share:.0%} of the time without contact"


def _missed(found: dict[tuple[str, str], Follows], criterion: Criterion) -> str:
    missed = [f"{SHORT[method]}, {name}" for (method, name), one in found.items() if not one.meets(criterion)]
    return "; ".join(missed)


def _narrowly(results: Results) -> str:
    """Tell at which of the speeds tried the limits first chosen were kept."""
    told = []
    for method in METHODS:
        kept = [f"{one.speed * MM:.1f}" for one in results.tracks[method] if one.meets(NARROW)]
        told.append(f"{SHORT[method]} at {', '.join(kept)} mm/s" if kept else f"{SHORT[method]} at none")
    return "; ".join(told)


def largest_speed(results: Results) -> Claim:
    fast, lift = results.fastest, results.lifting
    drag = ", ".join(f"{SHORT[method]} {speed(fast[method])}" for method in METHODS)
    up = ", ".join(f"{SHORT[method]} {speed(lift[method])}" for method in METHODS)
    free = scenes.free_speed(results.printed[ONE].scene)
    control = results.printed[TWO].scene.control
    gain = getattr(control, "force_gain", 0.0) * getattr(control, "force_setpoint", 0.0)
    why = (
        f"A pin without load rises at {free * MM:.1f} mm/s. A cell of {SHORT[TWO]} that feels nothing opens "
        f"its valve to K_FF F_ref = {gain:.2g}, and rises at {free * min(gain, 1.0) ** 2 * MM:.1f} mm/s "
        f"at the most. Of the drags tried, these keep to the limits first chosen, {NARROW.lag * MM:g} mm and "
        f"{NARROW.deviation:g} N: {_narrowly(results)}."
    )
    return Claim(
        f"Up to {PAPER_SPEED * MM:g} mm/s, and how far beyond",
        f"Largest speed of a straight level drag of a ridge: {drag}; of a lift straight up: {up}",
        verdict([(one or 0.0) >= PAPER_SPEED for one in fast.values()]),
        why,
    )
