"""Method III beside the methods of the paper: a table of the page."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from .relief_sections import sections
from .results import PAPER_SPEED, WAYS, Results, Session
from .scenes import COMPARED, NAMES

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
    """Give the lines of the table, a method a column, in Markdown.

    `results`: with all methods, see `Results.compared`.
    """
    methods = [method for method in COMPARED if method in results.session]
    yield f"| | {' | '.join(NAMES[method] for method in methods)} |"
    yield f"| --- |{' ---: |' * len(methods)}"
    for key, name, factor, unit in METRICS:
        values = [results.session[method].metrics.get(key) for method in methods]
        yield _row(f"{name} ({unit})", [None if value is None else value * factor for value in values])
    for way in WAYS:
        found = [results.simple.get((method, way)) for method in methods]
        speed = f"drag at {PAPER_SPEED * 1e3:g} mm/s, {way}"
        yield _row(f"{speed}: RFD (N)", [one.rfd if one else None for one in found])
        yield _row(f"{speed}: largest lag (mm)", [one.lag * 1e3 if one else None for one in found])
    drags = {f"drag, {way}": [results.fastest.get((method, way)) for method in methods] for way in WAYS}
    for name, known in {**drags, "lift": [results.lifting.get(method) for method in methods]}.items():
        yield _row(f"largest speed, {name} (mm/s)", [None if one is None else one * 1e3 for one in known])
    for title, measure in SECTIONS:
        values = [measure(results.session[method]) * 1e3 for method in methods]
        yield _row(f"{title} (mm)", list(values))


def _row(name: str, values: list[float | None]) -> str:
    """Return a row of the table."""
    return f"| {name} | {' | '.join('–' if value is None else f'{value:.3g}' for value in values)} |"


#: Deviations of the sections through ridge, mound and valley: name and measure, m.
SECTIONS: tuple[tuple[str, Callable[[Session], float]], ...] = (
    ("sections, largest rms deviation", lambda session: max(one.rms for one in sections(session))),
    ("sections, largest deviation", lambda session: max(one.largest for one in sections(session))),
)
