"""Claims on the tracking speed."""

from __future__ import annotations

from digiclay.core.studies.method_trials import find_free_speed
from digiclay.core.studies.speed_limits import Criterion, Follows

from .claim import MM, ONE, SHORT, TWO, Claim, speed, verdict
from .results import PAPER_SPEED, WAYS, Results
from .scenes import METHODS


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
