"""Claims of the paper beside measurements, with numbers from the results alone."""

from __future__ import annotations

from . import scenes
from .claim import MM, ONE, SHORT, TWO, Claim, largest_speed, relief, speed, tracking, verdict
from .claims_force import deviations, onset, reference_force, trade
from .claims_variants import ahead, escape, gaussian, radius, rise, staggered
from .relief_sections import LIMITS, blister_section
from .results import PAPER_SPEED, Results
from .scenes import METHODS


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
        relief(results),
        rise(results),
        ahead(results),
        escape(results),
        radius(results),
        staggered(results),
        gaussian(results),
    ]


def _blister(results: Results) -> Claim:
    told, holds = [], []
    for (method, shape, profile), done in results.blisters.items():
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
    return Claim(
        "A blister is lifted by 15 mm, or sunk, with a cone or a Gaussian for its profile (Fig. 4)",
        "; ".join(told),
        verdict(holds),
        f"The finger is held {scenes.TALL * MM:g} mm over the bed, or {-scenes.SINK * MM:g} mm in it, and "
        f"the pins press into it. A section holds as those of Fig. 10 do. Radius: {size}; {SHORT[TWO]} "
        "counts its own from the nearest cell under the finger, and there the cells take the shape of the "
        "fingertip.",
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
