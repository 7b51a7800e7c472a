"""``digiclay run --budget``: report of the omitted parts and of the measured error."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from typing import Any

from ..core.scene.schema import Scene
from ..core.studies.omissions import Fitted, find_omissions
from .arguments import told_as_options
from .progress import Line
from .tables import table


def within(scene: Scene, budget: float, *, quiet: bool) -> Fitted:
    """Leave out of a scene what a budget of height error, m, allows; print what that is.

    `budget`, m; `quiet`: print nothing.
    """
    with Line(sys.stderr) as line:
        told = None if quiet else lambda said: line.draw(f"trying: {said}")
        with told_as_options("run"):
            found = find_omissions(scene, budget, told=told)
    if not quiet:
        print("\n".join(report(found)))
    return found


def noted(found: Fitted) -> dict[str, Any]:
    """Return what ``metrics.json`` holds of it."""
    return {
        "allowed": found.budget,
        "measured": found.error,
        "departure": found.departure,
        "own_error": found.own_error,
        "work": found.work,
        "left_out": found.left_out,
        "units": {"allowed": "m", "measured": "m", "departure": "m", "own_error": "m", "work": "1"},
    }


def report(found: Fitted) -> Iterator[str]:
    """Give the lines of the report."""
    yield f"What {found.scene.name} can do without, within {found.budget * 1e6:g} µm of height:"
    rows = [
        [
            one.said,
            f"> {found.budget * 1e6:g}" if math.isinf(one.departure) else f"{one.departure * 1e6:.3g}",
            "" if math.isnan(one.work) else f"{100 * one.work:.0f} %",
            "left out" if one.kept else "",
        ]
        for one in found.tried
    ]
    yield from table(("it would have", "off by, µm", "work left", ""), rows)
    said = "; ".join(found.left_out) or "nothing: all of it is needed"
    yield f"Left out: {said}."
    yield (
        f"Measured then: {found.error * 1e6:.3g} µm "
        f"({found.departure * 1e6:.3g} µm from the full model, {found.own_error * 1e6:.3g} of integration), "
        f"for {100 * found.work:.0f} % of its work."
    )
