"""Folder of `digiclay paper`: figures with data, the page, and measured numbers."""

import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from digiclay import __version__
from digiclay.core.base.modes import MEANINGS, Mode
from digiclay.core.control.cell_states import BY_FORCE, BY_PLACE, VIRTUAL_SPRING, Arrow
from digiclay.core.files.run_folder import format_json, write_whole
from digiclay.core.studies.speed_limits import Follows
from digiclay.plots.figure import MM, save

from . import figures_session, paper_figures
from .claims import Claim, claims
from .paper_figures import curves, letter, list_methods, table
from .relief_sections import LIMITS, sections
from .results import PAPER_SPEED, WAYS, Extent, Results
from .scenes import NAMES, THIRD
from .simulations import Announce, simulate

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
    for name, values in _list_rows(results, methods):
        yield f"| {name} | {' | '.join('–' if value is None else f'{value:.3g}' for value in values)} |"


def _list_rows(results: Results, methods: list[str]) -> Iterator[tuple[str, list[float | None]]]:
    """Give the name and the values of each row of the table."""
    for key, name, factor, unit in METRICS:
        yield f"{name} ({unit})", _scale([results.session[each].metrics.get(key) for each in methods], factor)
    for way in WAYS:
        follows = [results.simple.get((method, way)) for method in methods]
        name = f"drag at {PAPER_SPEED * MM:g} mm/s, {way}"
        yield f"{name}: RFD (N)", [one.rfd if one else None for one in follows]
        yield f"{name}: largest lag (mm)", _scale([one.lag if one else None for one in follows], MM)
    for way in WAYS:
        speeds = [results.fastest.get((method, way)) for method in methods]
        yield f"largest speed, drag, {way} (mm/s)", _scale(speeds, MM)
    yield "largest speed, lift (mm/s)", _scale([results.lifting.get(method) for method in methods], MM)
    formed = [list(sections(results.session[method])) for method in methods]
    yield "sections, largest rms deviation (mm)", [MM * max(one.rms for one in row) for row in formed]
    yield "sections, largest deviation (mm)", [MM * max(one.largest for one in row) for row in formed]


def _scale(values: list[float | None], factor: float) -> list[float | None]:
    return [None if value is None else value * factor for value in values]


#: The chain of Fig. 3, from the fingertip to the pins.
CHAIN = (
    ("VM Locate", "centroid of the forces within r_VM of the master's last place (equation 13)"),
    ("VM Control", "virtual spring until the force reaches F_trig, then force control to F_ref"),
    ("VM Model", "a cylinder and valve like a real cell's turn the effort into the master's height"),
    ("Blister Creation", "edge + profile(r) (master - edge) for the cells around; cells left behind freeze"),
    ("Cells", "proportional control of height, K_p"),
)


def list_lines(
    results: Results, judged: list[Claim], pictures: Mapping[str, str], took: float, version: str
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
    for claim in judged:
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
    for arrows, by in ((BY_FORCE, "its own force"), (BY_PLACE, "the nearest cell under the fingertip")):
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


#: The figure whose data are heights of pins, and no curves; and the one of a session that was slowed.
SURFACES, OWN_TIMES = "fig10_surfaces", "fig08_own_times"
#: Figures: name of the file, caption, and what draws it.
FIGURES: tuple[tuple[str, str, Callable[[Results], Any]], ...] = (
    ("fig04_blisters", "Fig. 4: blisters in section, convex and concave, both profiles and all methods",
     paper_figures.blisters),
    ("fig06_freezing", "Fig. 6: sections along a drag at several times, with the frozen cells",
     paper_figures.freezing),
    ("fig08_session", "Fig. 8: heights of selected cells and total force over time{slow}",
     lambda results: figures_session.heights_and_force(
         results.session, f"The paper's session{results.slowness}")),
    (OWN_TIMES, "Fig. 8 again, at the session's own times",
     lambda results: figures_session.heights_and_force(
         results.printed, "The paper's session at its own times")),
    ("fig09_details",
     "Fig. 9: a detail of the session's heights: the first press, and what swings in the lift",
     figures_session.details),
    (SURFACES, "Fig. 10: final surfaces{slow}", figures_session.surfaces),
    ("fig10_sections", "Sections through the surfaces of Fig. 10, formed and asked for{slow}",
     figures_session.profiles),
    ("oscillation", "Oscillation of the virtual master, and where it sets in", paper_figures.oscillation),
    ("tracking", "How fast a finger is followed: RFD and lag against speed", paper_figures.tracking),
    ("variants", "What the rise, the search radius and Method II's gain do", paper_figures.variants),
)  # fmt: skip


def produce(folder: Path, extent: Extent, announce: Announce) -> list[str]:
    """Simulate, draw and write into an existing folder; return the claims' verdicts as lines."""
    started = time.perf_counter()
    results = simulate(extent, announce)
    took = time.perf_counter() - started
    captions = {}
    for name, caption, draw in FIGURES:
        if name == OWN_TIMES and not results.slowness:
            continue
        announce(f"drawing {name}")
        picture = draw(results)
        if name == SURFACES:
            rows = table(figures_session.surface_rows(results.session), ("method", *"xy", "height (mm)"))
        else:
            letter(picture)
            rows = table(curves(picture))
        save(picture, folder / f"{name}.svg")
        write_whole(folder / f"{name}.csv", rows.encode())
        captions[name] = caption.format(slow=results.slowness)
    judged = claims(results)
    lines = list_lines(results, judged, captions, took, __version__)
    write_whole(folder / "paper.md", "".join(f"{line}\n" for line in lines).encode())
    write_whole(folder / "metrics.json", format_json(_numbers(results)))
    return [f"{claim.verdict:14} {claim.printed}" for claim in judged]


def _numbers(results: Results) -> dict[str, Any]:
    """Return what was measured, as it is written to ``metrics.json``; SI units."""
    methods = list_methods(results.session)
    numbers = {
        "criterion": {"lag": results.criterion.lag, "rfd": results.criterion.deviation},
        "slow": results.slow,
        "session": {method: results.session[method].metrics for method in methods},
        "session_at_its_own_times": {method: results.printed[method].metrics for method in methods},
        "lost_at_its_own_times": {method: results.printed[method].lost for method in methods},
        "windows_of_the_paper": {method: results.printed[method].windows for method in methods},
        "largest_drag_speed": results.fastest,
        "largest_lift_speed": results.lifting,
        "drags": {method: results.tracks.get(method, []) for method in methods},
        "simple_at_15_mm_a_second": results.simple,
        "oscillation": results.swings,
        "oscillation_of_a_quicker_device": results.quicker,
        "oscillation_of_method_two": results.cell_swings,
        "variants": results.dragged,
        "located": results.located,
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
    return {name: _plain(value) for name, value in numbers.items()}


def _plain(value: Any) -> Any:
    """Return a value for JSON: named fields as tables, None for the infinite lag without contact."""
    if isinstance(value, Follows):
        value = asdict(value)
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        return {key if isinstance(key, str) else ", ".join(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return None if value == math.inf else value
