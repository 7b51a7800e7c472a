"""Folder of `digiclay paper`: figures with data, the page, and measured numbers."""

import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Any

from digiclay import __version__
from digiclay.core.files.run_folder import format_json, write_whole
from digiclay.core.files.tables import Record
from digiclay.core.studies.speed_limits import Follows
from digiclay.plots.figure import MM, save

from . import figures_session
from .claims import TEXTS, Claim, claims
from .paper_figures import curves, letter, list_methods, table
from .relief_sections import LIMITS, sections
from .results import PAPER_SPEED, WAYS, Extent, Results
from .scenes import NAMES
from .simulations import Announce, simulate


def compare_methods(results: Results) -> Iterator[str]:
    """Give the lines of the table, a method a column, in Markdown."""
    methods = list_methods(results.session)
    yield f"| | {' | '.join(NAMES[method] for method in methods)} |"
    yield f"| --- |{' ---: |' * len(methods)}"
    for name, values in _list_rows(results, methods):
        yield f"| {name} | {' | '.join('–' if value is None else f'{value:.3g}' for value in values)} |"


def _list_rows(results: Results, methods: list[str]) -> Iterator[tuple[str, list[float | None]]]:
    """Give the name and the values of each row of the table."""
    for key, name, factor, unit in TEXTS["metrics"]:
        yield (
            f"{name} ({unit})",
            _scale([results.session[each].metrics.get(key) for each in methods], factor),
        )
    for way in WAYS:
        follows = [results.simple.get((method, way)) for method in methods]
        name = f"drag at {PAPER_SPEED * MM:g} mm/s, {way}"
        yield f"{name}: RFD (N)", [one.rfd if one else None for one in follows]
        yield f"{name}: largest lag (mm)", _scale([one.lag if one else None for one in follows], MM)
    for way in WAYS:
        speeds = [results.fastest.get((method, way)) for method in methods]
        yield f"largest speed, drag, {way} (mm/s)", _scale(speeds, MM)
    yield (
        "largest speed, lift (mm/s)",
        _scale([results.lifting.get(method) for method in methods], MM),
    )
    formed = [list(sections(results.session[method])) for method in methods]
    yield (
        "sections, largest rms deviation (mm)",
        [MM * max(one.rms for one in row) for row in formed],
    )
    yield (
        "sections, largest deviation (mm)",
        [MM * max(one.largest for one in row) for row in formed],
    )


def _scale(values: list[float | None], factor: float) -> list[float | None]:
    return [None if value is None else value * factor for value in values]


def format_page(
    results: Results, judged: list[Claim], pictures: Mapping[str, str], took: float
) -> str:
    """Return the page; `pictures`: files' names to captions; `took`: time of simulations, s."""
    rows = [
        f"| {claim.printed} | {claim.measured.replace('; ', ';<br>')} | **{claim.verdict}** | {claim.why} |"
        for claim in judged
    ]
    figures = [
        f"![{caption}]({name}.svg)\n\n*{caption}.* [Data]({name}.csv)"
        for name, caption in pictures.items()
    ]
    return (
        Path(__file__)
        .with_name("paper.md")
        .read_text(encoding="utf-8")
        .format(
            version=__version__,
            took=took,
            criterion=results.criterion,
            claims="\n".join(rows),
            figures="\n\n".join(figures),
            methods="\n".join(compare_methods(results)),
        )
    )


#: The figure whose data are heights of pins, and no curves; and the one of a session that was
#: slowed.
SURFACES, OWN_TIMES = "fig10_surfaces", "fig08_own_times"


def produce(folder: Path, extent: Extent, announce: Announce) -> list[str]:
    """Simulate, draw and write into an existing folder; return the claims' verdicts as lines."""
    started = time.perf_counter()
    results = simulate(extent, announce)
    took = time.perf_counter() - started
    captions = {}
    for figure in TEXTS["figure"]:
        name = figure["name"]
        if name == OWN_TIMES and not results.slowness:
            continue
        announce(f"drawing {name}")
        module, _, function = figure["draw"].partition(".")
        picture = getattr(import_module(f".{module}", __package__), function)(results)
        if name == SURFACES:
            rows = table(
                figures_session.surface_rows(results.session), ("method", *"xy", "height (mm)")
            )
        else:
            letter(picture)
            rows = table(curves(picture))
        save(picture, folder / f"{name}.svg")
        write_whole(folder / f"{name}.csv", rows.encode())
        captions[name] = figure["caption"].format(slow=results.slowness)
    judged = claims(results)
    write_whole(folder / "paper.md", format_page(results, judged, captions, took).encode())
    write_whole(folder / "metrics.json", format_json(_numbers(results)))
    return [f"{claim.verdict:14} {claim.printed}" for claim in judged]


def _numbers(results: Results) -> Record:
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
    return {name: _plain(value) for name, value in numbers.items()}


def _plain(value: Any) -> Any:
    """Return a value for JSON: named fields as tables, None for the infinite lag without contact."""
    if isinstance(value, Follows):
        value = asdict(value)
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        return {
            key if isinstance(key, str) else ", ".join(key): _plain(one)
            for key, one in value.items()
        }
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return None if value == math.inf else value
