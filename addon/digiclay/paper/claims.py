"""The paper's claims beside what was measured; every number comes from the results."""

from __future__ import annotations

import numpy as np

from . import scenes
from .claim import MM, ONE, SHORT, TWO, Claim, speed, times, verdict
from .claims_following import largest_speed, tracking
from .claims_force import deviations, onset, reference_force, trade
from .scenes import METHODS
from .trials import PAPER_SPEED, Results, Session

__all__ = ["carried_out", "claims"]


def claims(results: Results) -> list[Claim]:
    """Return all claims, in the order of the paper."""
    return [
        tracking(results),
        largest_speed(results),
        deviations(results),
        reference_force(results),
        onset(results),
        trade(results),
        _blister(results),
        _freezing(results),
        carried_out(results),
        _relief(results),
    ]


def _blister(results: Results) -> Claim:
    told, holds = [], []
    for method in METHODS:
        for profile in ("cone", "gaussian"):
            done = results.blisters[method, "convex", profile]
            rise = done.history["height"][-1] - done.scene.actuator.rest_height
            place = done.history["position"]
            middle = float(rise[np.hypot(*place.T) < 1e-6].max(initial=0.0))
            reach = float(np.hypot(*place[np.abs(rise) > 0.1e-3].T).max(initial=0.0))
            told.append(
                f"{SHORT[method]}, {profile}: {middle * MM:.1f} mm high in the middle, "
                f"pins moved to {reach * MM:.1f} mm from it"
            )
            holds.append(abs(middle - 15e-3) < 1.5e-3)
    radius = {method: results.blisters[method, "convex", "cone"].scene.blister for method in METHODS}
    size = ", ".join(f"{SHORT[method]} {one.radius * MM:g} mm" for method, one in radius.items() if one)
    return Claim(
        "A blister of 15 mm is lifted",
        "; ".join(told),
        verdict(holds),
        f"The finger is held {scenes.TALL * MM:g} mm over the bed, and the pins press into it. Radius asked "
        f"for: {size}; {SHORT[TWO]} counts its own from the nearest cell under the finger.",
    )


def _freezing(results: Results) -> Claim:
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
    return Claim(
        "Cells left behind freeze, and the ridge stays",
        f"Ridge dragged at {PAPER_SPEED * MM:g} mm/s. " + "; ".join(told),
        verdict(holds),
        "Over the path is how far the pins press into the finger, and what they rise once it has passed.",
    )


def carried_out(results: Results) -> Claim:
    """Whether the finger was lost on the way, and what it took not to lose it."""
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
    return Claim(
        "Both methods carry out the session of Fig. 8",
        "At its own times (lift-offs faster than a pin left aside): " + "; ".join(told),
        verdict([not results.printed[method].lost for method in METHODS]),
        why.strip(),
    )


def _relief(results: Results) -> Claim:
    told, holds = [], []
    for method in METHODS:
        ridge, mound, valley = _heights(results.session[method])
        told.append(
            f"{SHORT[method]}: ridge {ridge * MM:+.1f} mm, mound {mound * MM:+.1f} mm, "
            f"valley {valley * MM:+.1f} mm"
        )
        holds.append(mound > ridge > 5e-3 and valley < -2e-3)
    return Claim(
        "The session leaves a ridge, a mound at its end, and a valley across the far edge (Fig. 10)",
        f"Over the bed at rest, session{times(results)}: " + "; ".join(told),
        verdict(holds),
    )


def _heights(session: Session) -> tuple[float, float, float]:
    """Return median of the ridge, top of the mound, median of the valley over the bed at rest, m."""
    place, final = session.history["position"], session.history["height"][-1]
    over = final - session.scene.actuator.rest_height
    near, far = np.abs(place[:, 1] + 21e-3) < 1e-6, np.abs(place[:, 1] - 21e-3) < 1e-6
    along = np.abs(place[:, 0]) < 10e-3
    top = np.hypot(place[:, 0] - 21e-3, place[:, 1] + 21e-3) < 6e-3
    return float(np.median(over[near & along])), float(over[top].max()), float(np.median(over[far & along]))
