"""Folder of `digiclay paper`: figures with data, the page, and measured numbers."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from digiclay import __version__
from digiclay.core.base.modes import MEANINGS, Mode
from digiclay.core.control.cell_states import BY_FORCE, BY_PLACE, VIRTUAL_SPRING, Arrow
from digiclay.core.files.run_folder import write_whole
from digiclay.plots.figure import save

from . import figures_session, paper_figures
from .claims import Claim, claims
from .paper_figures import curves, letter, list_methods, table
from .relief_sections import LIMITS, sections
from .results import PAPER_SPEED, WAYS, Extent, Results, Session
from .scenes import NAMES, THIRD
from .simulations import Told, simulate

#: Metrics of the session: key, name, factor and unit.
METRICS = (
    ("rfd", "RFD in the session", 1.0, "N"),
    ("rfd_jnd_least", "the same, at least", 1.0, "JND"),
    ("rfd_jnd_most", "the same, at most", 1.0, "JND"),
    ("rfd_shaping", "RFD while shaping", 1.0, "N"),
    ("force_deviation", "deviation of the force", 1.0, "N"),
    ("height_deviation", "deviation of the height under the fingertip", 1e3, "mm"),
    ("lag_mean", "mean lag", 1e3, "mm"),
    ("ridge_unevenness", "unevenness of the ridge", 1e3, "mm"),
    ("ridge_unevenness_touch", "the same", 1.0, "spatial resolutions"),
    ("max_total_force", "largest force", 1.0, "N"),
)


def compare_methods(results: Results) -> Iterator[str]:
    """Give the lines of the table, a method a column, in Markdown."""
    methods = list_methods(results.session)
    yield f"| | {' | '.join(NAMES[method] for method in methods)} |"
    yield f"| --- |{' ---: |' * len(methods)}"
    for key, name, factor, unit in METRICS:
        values = [results.session[method].metrics.get(key) for method in methods]
        yield _number_row(f"{name} ({unit})", [None if value is None else value * factor for value in values])
    for way in WAYS:
        found = [results.simple.get((method, way)) for method in methods]
        speed = f"drag at {PAPER_SPEED * 1e3:g} mm/s, {way}"
        yield _number_row(f"{speed}: RFD (N)", [one.rfd if one else None for one in found])
        yield _number_row(f"{speed}: largest lag (mm)", [one.lag * 1e3 if one else None for one in found])
    drags = {f"drag, {way}": [results.fastest.get((method, way)) for method in methods] for way in WAYS}
    for name, known in {**drags, "lift": [results.lifting.get(method) for method in methods]}.items():
        yield _number_row(
            f"largest speed, {name} (mm/s)", [None if one is None else one * 1e3 for one in known]
        )
    for title, measure in SECTIONS:
        values = [measure(results.session[method]) * 1e3 for method in methods]
        yield _number_row(f"{title} (mm)", list(values))


def _number_row(name: str, values: list[float | None]) -> str:
    """Return a row of the table."""
    return f"| {name} | {' | '.join('–' if value is None else f'{value:.3g}' for value in values)} |"


#: Deviations of the sections through ridge, mound and valley: name and measure, m.
SECTIONS: tuple[tuple[str, Callable[[Session], float]], ...] = (
    ("sections, largest rms deviation", lambda session: max(one.rms for one in sections(session))),
    ("sections, largest deviation", lambda session: max(one.largest for one in sections(session))),
)


#: The chain of Fig. 3, from the fingertip to the pins.
CHAIN = (
    ("VM Locate", "centroid of the forces within r_VM of the master's last place (equation 13)"),
    ("VM Control", "virtual spring until the force reaches F_trig, then force control to F_ref"),
    ("VM Model", "a cylinder and valve like a real cell's turn the effort into the master's height"),
    ("Blister Creation", "edge + profile(r) (master - edge) for the cells around; cells left behind freeze"),
    ("Cells", "proportional control of height, K_p"),
)


def list_lines(
    results: Results, found: list[Claim], pictures: Mapping[str, str], took: float, version: str
) -> Iterator[str]:
    """Give the lines of the page; `pictures`: files' names to captions; `took`: time of simulations, s."""
    yield "# The paper's results, and ours\n"
    yield (
        "After Askins and Book, *Digital Clay: User Interaction Model for Control of a Fluidically Actuated "
        "Haptics Device* (Georgia Tech, 2003). What stands under *Measured here* and *Remarks* was measured "
        f"by the run that wrote this page: `digiclay paper`, digiclay {version}, {took:.0f} s of simulation. "
        "What a metric means: docs/metrics.md.\n"
    )
    yield (
        f"A finger counts as followed when {results.criterion}. The paper's own limits are not known to this "
        "project. These are a pitch, and half of Method I's set point. Method II's set point is F_ref times "
        "the cells that follow at the moment.\n"
    )
    yield "## Claims\n"
    yield "| The paper | Measured here | | Remarks |"
    yield "| --- | --- | --- | --- |"
    for claim in found:
        measured = claim.measured.replace("; ", ";<br>")
        yield f"| {claim.printed} | {measured} | **{claim.verdict}** | {claim.why} |"
    yield "\n## Figures\n"
    for name, caption in pictures.items():
        yield f"![{caption}]({name}.svg)\n"
        yield f"*{caption}.* [Data]({name}.csv)\n"
    yield "Fig. 7, pins, forces and modes in motion, is the view in Blender.\n"
    if THIRD in results.session:
        yield "## Method III\n"
        yield (
            "The paper's conclusion asks for regional height *and* force commands; docs/hybrid.md derives "
            "this method. The session is the one of Fig. 10, and the figures above show it beside the other "
            "two. At rest its blister is as wide as its skirt, for drags to come; what stays behind is the "
            "nominal blister (Fig. 6). JND: just noticeable differences, docs/perception.md.\n"
        )
        yield from compare_methods(results)
        yield ""
    yield "## Fig. 3: Method I, the virtual master\n"
    yield "| Stage | What it does |"
    yield "| --- | --- |"
    for stage, what in CHAIN:
        yield f"| {stage} | {what} |"
    yield "\n## Fig. 5: Method II, the states of a cell\n"
    yield "Made from the table the controller itself follows. *Virtual spring* stands for: " + (
        "; ".join(f"{_word(mode)} ({MEANINGS[mode]})" for mode in VIRTUAL_SPRING) + ".\n"
    )
    yield "| From | To | When | Decided by |"
    yield "| --- | --- | --- | --- |"
    for arrows, by in ((BY_FORCE, "its own force"), (BY_PLACE, "the nearest cell under the finger")):
        for arrow in arrows:
            yield _row(arrow, by)


def _row(arrow: Arrow, by: str) -> str:
    """Return an arrow as a row of the table."""
    source = list(arrow.source)
    if set(VIRTUAL_SPRING) <= set(source):
        words = ["virtual spring", *(_word(mode) for mode in source if mode not in VIRTUAL_SPRING)]
    else:
        words = [_word(mode) for mode in source]
    return f"| {', '.join(words)} | {_word(arrow.goal)} | {arrow.condition.replace('_', ' ')} | {by} |"


def _word(mode: Mode) -> str:
    return mode.name.lower().replace("_", " ")


#: The figure whose data are heights of pins, and no curves.
SURFACES = "fig10_surfaces"


def produce(folder: Path, extent: Extent, told: Told) -> list[str]:
    """Simulate, draw and write into an existing folder; return the claims' verdicts as lines."""
    started = time.perf_counter()
    results = simulate(extent, told)
    took = time.perf_counter() - started
    drawn = {}
    for name, (caption, draw) in _pictures(results).items():
        told(f"drawing {name}")
        picture = draw()
        if name == SURFACES:
            rows = table(figures_session.surface_rows(results.session), ("method", *"xy", "height (mm)"))
        else:
            letter(picture)
            rows = table(curves(picture))
        save(picture, folder / f"{name}.svg")
        write_whole(folder / f"{name}.csv", rows.encode())
        drawn[name] = caption
    found = claims(results)
    lines = list_lines(results, found, drawn, took, __version__)
    (folder / "paper.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    numbers = json.dumps(_numbers(results), indent=2, ensure_ascii=False, allow_nan=False)
    (folder / "metrics.json").write_text(numbers + "\n", encoding="utf-8")
    return [f"{claim.verdict:14} {claim.printed}" for claim in found]


def _pictures(results: Results) -> dict[str, tuple[str, Callable[[], Any]]]:
    """Return what is drawn: file name to caption and what draws it."""
    slow = f", {results.slow:g} times as long" if results.slow > 1.0 else ""
    title, session, own = (
        f"The paper's session{slow}",
        results.session,
        "The paper's session at its own times",
    )
    rows = (
        ("fig04_blisters", "Fig. 4: blisters in section, convex and concave, both profiles and all methods",
         lambda: paper_figures.blisters(results)),
        ("fig06_freezing", "Fig. 6: sections along a drag at several times, with the frozen cells",
         lambda: paper_figures.freezing(results)),
        ("fig08_session", f"Fig. 8: heights of selected cells and total force over time{slow}",
         lambda: figures_session.heights_and_force(session, title)),
        ("fig08_own_times" if slow else "", "Fig. 8 again, at the session's own times",
         lambda: figures_session.heights_and_force(results.printed, own)),
        ("fig09_details",
         "Fig. 9: a detail of the session's heights: the first press, and what swings in the lift",
         lambda: figures_session.details(results, "Details of the heights in the paper's session")),
        (SURFACES, f"Fig. 10: final surfaces{slow}",
         lambda: figures_session.surfaces(session, f"Final surfaces. {title}")),
        ("fig10_sections", f"Sections through the surfaces of Fig. 10, formed and asked for{slow}",
         lambda: figures_session.profiles(session, f"Sections. {title}")),
        ("oscillation", "Oscillation of the virtual master, and where it sets in",
         lambda: paper_figures.oscillation(results)),
        ("tracking", "How fast a finger is followed: RFD and lag against speed",
         lambda: paper_figures.tracking(results)),
        ("variants", "What the rise, the search radius and Method II's gain do",
         lambda: paper_figures.variants(results)),
    )  # fmt: skip
    return {name: (caption, draw) for name, caption, draw in rows if name}


def _numbers(results: Results) -> dict[str, Any]:
    """Return what was measured, as it is written to ``metrics.json``; SI units."""
    methods = list_methods(results.session)
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
                    "rms": one.rms, "largest": one.largest, "rim": one.rim, "rim_by_pins": one.pins,
                    "relief": one.relief, "level": one.level, "meets": one.meets(LIMITS),
                }
                for one in sections(results.session[method])
            }
            for method in methods
        },
    }  # fmt: skip


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    """Return a table without the infinite lag of a fingertip that never touches."""
    return {name: None if value == float("inf") else value for name, value in values.items()}
