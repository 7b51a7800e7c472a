"""Claim on the relief of the session, evaluated by the shape of its sections."""

from __future__ import annotations

from .claim import MM, SHORT, TWO, Claim, times, verdict
from .relief_sections import LIMITS, Section, sections
from .results import Results
from .scenes import METHODS


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
