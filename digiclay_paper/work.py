"""Steps from the simulations to the folder: figures, page, and measured numbers."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from digiclay import __version__
from digiclay.core.files.run_folder import write_whole
from digiclay.plots.figure import save

from . import figures_session, paper_figures
from .claims import claims
from .page import page
from .panel import curves, letter, table
from .relief_sections import LIMITS, sections
from .results import Extent, Results
from .scenes import COMPARED
from .simulations import Told, simulate

#: The figure whose data are heights of pins, and no curves.
SURFACES = "fig10_surfaces"


def produce(folder: Path, extent: Extent, told: Told) -> list[str]:
    """Simulate, draw and write into an existing folder; return the claims' verdicts as lines."""
    started = time.perf_counter()
    results = simulate(extent, told)
    took = time.perf_counter() - started
    drawn = {}
    shown = results.compared()
    for name, (caption, draw) in _pictures(shown).items():
        told(f"drawing {name}")
        picture = draw()
        if name == SURFACES:
            rows = table(figures_session.surface_rows(shown.session), ("method", *"xy", "height (mm)"))
        else:
            letter(picture)
            rows = table(curves(picture))
        save(picture, folder / f"{name}.svg")
        write_whole(folder / f"{name}.csv", rows.encode())
        drawn[name] = caption
    found = claims(results)
    (folder / "paper.md").write_text(page(results, found, drawn, took, __version__), encoding="utf-8")
    numbers = json.dumps(_numbers(shown), indent=2, ensure_ascii=False, allow_nan=False)
    (folder / "metrics.json").write_text(numbers + "\n", encoding="utf-8")
    return [f"{claim.verdict:14} {claim.printed}" for claim in found]


def _pictures(results: Results) -> dict[str, tuple[str, Callable[[], Any]]]:
    """Return what is drawn: file name to caption and what draws it."""
    slow = f", {results.slow:g} times as long" if results.slow > 1.0 else ""
    title = f"The paper's session{slow}"
    pictures: dict[str, tuple[str, Callable[[], Any]]] = {
        "fig04_blisters": (
            "Fig. 4: blisters in section, convex and concave, both profiles and all methods",
            lambda: paper_figures.blisters(results),
        ),
        "fig06_freezing": (
            "Fig. 6: sections along a drag at several times, with the frozen cells",
            lambda: paper_figures.freezing(results),
        ),
        "fig08_session": (
            f"Fig. 8: heights of selected cells and total force over time{slow}",
            lambda: figures_session.heights_and_force(results.session, title),
        ),
    }
    if slow:
        pictures["fig08_own_times.png"] = (
            "Fig. 8 again, at the session's own times",
            lambda: figures_session.heights_and_force(
                results.printed, "The paper's session at its own times"
            ),
        )
    return pictures | {
        "fig09_details": (
            "Fig. 9: a detail of the session's heights: the first press, and what swings in the lift",
            lambda: figures_session.details(results, "Details of the heights in the paper's session"),
        ),
        SURFACES: (
            f"Fig. 10: final surfaces{slow}",
            lambda: figures_session.surfaces(results.session, f"Final surfaces. {title}"),
        ),
        "fig10_sections": (
            f"Sections through the surfaces of Fig. 10, formed and asked for{slow}",
            lambda: figures_session.profiles(results.session, f"Sections. {title}"),
        ),
        "oscillation": (
            "Oscillation of the virtual master, and where it sets in",
            lambda: paper_figures.oscillation(results),
        ),
        "tracking": (
            "How fast a finger is followed: RFD and lag against speed",
            lambda: paper_figures.tracking(results),
        ),
        "variants": (
            "What the rise, the search radius and Method II's gain do",
            lambda: paper_figures.variants(results),
        ),
    }


def _numbers(results: Results) -> dict[str, Any]:
    """Return what was measured, as it is written to ``metrics.json``; SI units."""
    methods = [method for method in COMPARED if method in results.session]
    return {
        "criterion": {"lag": results.criterion.lag, "rfd": results.criterion.deviation},
        "slow": results.slow,
        "session": {method: results.session[method].metrics for method in methods},
        "session_at_its_own_times": {method: results.printed[method].metrics for method in methods},
        "lost_at_its_own_times": {method: results.printed[method].lost for method in methods},
        "windows_of_the_paper": {method: results.printed[method].windows for method in methods},
        "largest_drag_speed": {", ".join(key): speed for key, speed in results.fastest.items()},
        "largest_lift_speed": results.lifting,
        "drags": {
            method: [_finite(asdict(one)) for one in results.tracks.get(method, [])] for method in methods
        },
        "simple_at_15_mm_a_second": {
            f"{method}, {name}": _finite(asdict(one)) for (method, name), one in results.simple.items()
        },
        "oscillation": [one._asdict() for one in results.swings],
        "oscillation_of_a_quicker_device": [one._asdict() for one in results.quicker],
        "oscillation_of_method_two": [one._asdict() for one in results.cell_swings],
        "variants": {
            ", ".join(key): {**one._asdict(), "follows": _finite(asdict(one.follows))}
            for key, one in results.dragged.items()
        },
        "located": [one._asdict() for one in results.located],
        "sections": {
            method: {
                one.name: {
                    "rms": one.rms,
                    "largest": one.largest,
                    "rim": one.rim,
                    "rim_by_pins": one.pins,
                    "relief": one.relief,
                    "level": one.level,
                    "meets": one.meets(LIMITS),
                }
                for one in sections(results.session[method])
            }
            for method in methods
        },
    }


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    """Return a table without the infinite lag of a finger that never touches."""
    return {name: None if value == float("inf") else value for name, value in values.items()}
