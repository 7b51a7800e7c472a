"""Preset fingers of the Press tool: semi-axes of hand and tools.

Contact law and relaxation stay those of the bed: no measured law of a palm, or of a hard tool against these
pins, is known. A hard tool presses as if it had the pulp of a finger.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..core.model.fingertip import Fingertip

#: Semi-axes that differ by less are the same, m.
SAME = 1e-6


@dataclass(frozen=True)
class FingerKind:
    """Preset finger: name, ellipsoid, and where its measures come from."""

    label: str
    finger: Fingertip
    source: str


FINGERS: Mapping[str, FingerKind] = {
    "fingertip": FingerKind("Fingertip", Fingertip(), "an index finger's tip, the device's own"),
    "thumb": FingerKind(
        "Thumb",
        Fingertip(14e-3, 11.5e-3, 11e-3),
        "23 mm broad and 22 mm thick, about the median of men's thumbs; its length is assumed",
    ),
    "palm": FingerKind("Palm", Fingertip(30e-3, 25e-3, 20e-3), "the heel of a hand; assumed"),
    "stylus": FingerKind("Stylus", Fingertip(3e-3, 3e-3, 8e-3), "the rounded end of a pen; assumed"),
    "ball": FingerKind("Ball Tool", Fingertip(6e-3, 6e-3, 6e-3), "a ball of 12 mm; assumed"),
}


def find_kind(finger: Fingertip) -> FingerKind | None:
    """Return the preset finger of the same semi-axes, or None."""
    return next((kind for kind in FINGERS.values() if _same(kind.finger, finger)), None)


def _same(one: Fingertip, other: Fingertip) -> bool:
    """Return whether two fingers have the same semi-axes."""
    pairs = ((one.length, other.length), (one.width, other.width), (one.height, other.height))
    return all(abs(a - b) < SAME for a, b in pairs)
