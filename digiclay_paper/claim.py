"""Claim of the paper, and common parts of the modules of claims."""

from __future__ import annotations

from typing import NamedTuple

from .results import FULL, QUICK, Results
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
