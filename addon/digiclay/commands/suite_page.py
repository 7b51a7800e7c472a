"""Page and tables of a benchmark of methods, with all that a citation needs."""

from __future__ import annotations

import csv
import html
import io
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..core.metrics.metric_table import Metric
from ..core.studies.axes import Point
from ..core.studies.evaluation import Record
from ..core.studies.league import KIND, MEASURES, Interval, Row, Table, find_interval
from ..core.studies.method_trials import LIMITS, LOW, OUTCOMES
from .gallery import wrap
from .progress import table as aligned

#: Columns of the table in a terminal.
PRINTED = (
    "rfd", "lag_mean", "ridge_unevenness", "relief_rms", "max_total_force", "losses", *LIMITS, "cost_ratio",
)  # fmt: skip
#: Measures of the table of trajectories on the page.
SHOWN = ("rfd", "lag_mean", "ridge_unevenness", "relief_rms", "max_total_force", "losses")


@dataclass(frozen=True)
class Provenance:
    """Origin of the results of a suite.

    Attributes
    ----------
    identity : str
        Hash of all scenes, with all parameters.
    noise : float
        N.
    """

    scene: str
    version: str
    identity: str
    methods: tuple[str, ...]
    seeds: tuple[int, ...]
    noise: float
    machine: str
    date: str
    command: str

    def cite(self) -> str:
        """Return the line by which a paper cites the results."""
        ends = f"{self.seeds[0]} to {self.seeds[-1]}" if len(self.seeds) > 1 else f"{self.seeds[0]}"
        return (
            f"digiclay {self.version}, benchmark of control methods {', '.join(self.methods)} "
            f"({self.scene}, scenes {self.identity[:16]}, noise {self.noise * 1e3:g} mN, seeds {ends}), "
            f"{self.date}."
        )

    def facts(self) -> list[tuple[str, str]]:
        """Return names and values of the page and of the comments of the tables."""
        return [
            ("cite", self.cite()),
            ("command", self.command),
            ("scenes (SHA-256)", self.identity),
            ("seeds", " ".join(map(str, self.seeds))),
            ("force noise (N)", f"{self.noise:g}"),
            ("machine", self.machine),
            ("date", self.date),
            ("intervals", KIND),
        ]


def format_results(source: Provenance, points: Sequence[Point], records: Mapping[int, Record]) -> str:
    """Return all trials as CSV in SI units. `records`: by the index of their point."""
    head = ["method", "trajectory", "seed", *_name_units(OUTCOMES), "error"]
    rows = []
    for point in points:
        record = records[point.index]
        figures = record.get("figures", {})
        rows.append(
            [*point.words, *(_plain(figures.get(name)) for name in OUTCOMES), record.get("error", "")]
        )
    return _format_csv(source, head, rows)


def format_trajectories(source: Provenance, table: Table, methods: Sequence[str]) -> str:
    """Return means and intervals of every trajectory as CSV in SI units."""
    head = ["trajectory", "method", "measure", "unit", "mean", "half width", "seeds"]
    rows = []
    for name in _list_trajectories(table):
        for method in methods:
            for measure, metric in OUTCOMES.items():
                found = find_interval(_select(table, method, name, measure))
                if found is not None:
                    rows.append([name, method, measure, metric.unit, *_numbers(found)])
    return _format_csv(source, head, rows)


def format_league(source: Provenance, league: Sequence[Row]) -> str:
    """Return the league as CSV in SI units."""
    head = ["rank", "method"]
    for name, metric in MEASURES.items():
        head += [f"{name} ({metric.unit})", f"{name}, half width ({metric.unit})"]
    head += ["trajectories with a greater RFD than the first method", "trajectories"]
    rows = []
    for rank, row in enumerate(league, 1):
        cells: list[Any] = [rank, row.method]
        for name in MEASURES:
            found = row.measures[name]
            cells += ["", ""] if found is None else _numbers(found)[:2]
        rows.append([*cells, _plain(row.worse), row.trajectories])
    return _format_csv(source, head, rows)


def print_league(league: Sequence[Row]) -> Iterator[str]:
    """Give the lines of the league for a terminal."""
    columns = {name: metric for name, metric in MEASURES.items() if name in PRINTED}
    shown = (f"{metric.label} {metric.shown}".strip() for metric in columns.values())
    head = ("method", *shown, "RFD greater on")
    rows = [
        (
            row.method,
            *(_say_measure(row, name, metric.factor) for name, metric in columns.items()),
            _worse(row),
        )
        for row in league
    ]
    yield from aligned(head, rows)


def format_page(
    source: Provenance, league: Sequence[Row], table: Table, failed: Sequence[str], pictures: Sequence[str]
) -> str:
    """Return the page. `failed`: a line a failed trial; `pictures`: files beside it."""
    heads = ["method", *(metric.title for metric in MEASURES.values())]
    rows = [
        [
            row.method,
            *(_say_measure(row, name, metric.factor) for name, metric in MEASURES.items()),
            _worse(row),
        ]
        for row in league
    ]
    lines = [f"<p>{len(table)} trials of {len(source.methods)} methods, {len(source.seeds)} seeds.</p>"]
    lines += ["<h2>League</h2>", *_table([*heads, "RFD greater on"], rows)]
    lines.append(
        f"<p>Means over the trajectories, the random drags together as one; ± {html.escape(KIND)}. Largest "
        "force: of all trajectories. Losses: sum. Cost: processor time, median; ratio to "
        f"{html.escape(source.methods[0])}. Last column: trajectories with a greater mean RFD than "
        f"{html.escape(source.methods[0])}. JND: just noticeable differences of the set point.</p>"
    )
    lines += [f'<p><img alt="{name}" src="{name}"></p>' for name in pictures]
    for name in SHOWN:
        lines.append(f"<h2>{html.escape(MEASURES[name].title)} by trajectory</h2>")
        body = []
        for trajectory in _list_trajectories(table):
            found = [find_interval(_select(table, method, trajectory, name)) for method in source.methods]
            if any(found):
                body.append([trajectory, *(_say(one, MEASURES[name].factor) for one in found)])
        lines += _table(["trajectory", *source.methods], body)
    if failed:
        lines += ["<h2>Failed trials</h2>", *(f"<p>{html.escape(line)}</p>" for line in failed)]
    lines.append("<h2>Origin</h2>")
    lines += _table(["", ""], [list(fact) for fact in source.facts()])
    links = ("league.csv", "trajectories.csv", "results.csv")
    lines.append("<p>" + " ".join(f'<a href="{name}">{name}</a>' for name in links) + "</p>")
    return wrap(f"Benchmark of control methods: {source.scene}", lines)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Give the lines of a table."""
    yield "<table><tr>" + "".join(f"<th>{html.escape(cell)}</th>" for cell in head) + "</tr>"
    for row in rows:
        yield "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>"
    yield "</table>"


def _say_measure(row: Row, name: str, factor: float) -> str:
    """Write a measure of the league; a largest speed that was not found is below the slowest tried."""
    if row.measures[name] is None and name in row.searched:
        return f"below {LOW * factor:g}"
    return _say(row.measures[name], factor)


def _say(found: Interval | None, factor: float) -> str:
    """Write a mean and its interval in the unit shown."""
    if found is None:
        return "–"
    half = "" if found.half is None else f" ± {found.half * factor:.2g}"
    return f"{found.mean * factor:.3g}{half}"


def _worse(row: Row) -> str:
    return "–" if row.worse is None else f"{row.worse} of {row.trajectories}"


def _list_trajectories(table: Table) -> list[str]:
    return list(dict.fromkeys(name for _, name, _ in table))


def _select(table: Table, method: str, trajectory: str, measure: str) -> list[float | None]:
    """Return a measure of a method on a trajectory, a value a seed."""
    return [
        found.get(measure) for (own, name, _), found in table.items() if (own, name) == (method, trajectory)
    ]


def _numbers(found: Interval) -> list[Any]:
    return [repr(found.mean), "" if found.half is None else repr(found.half), found.count]


def _plain(value: Any) -> Any:
    return "" if value is None else value


def _name_units(metrics: Mapping[str, Metric]) -> list[str]:
    return [name if metric.unit == "1" else f"{name} ({metric.unit})" for name, metric in metrics.items()]


def _format_csv(source: Provenance, head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Return rows as CSV below comments with their origin."""
    lines = io.StringIO()
    for name, value in source.facts():
        lines.write(f"# {name}: {textwrap.shorten(value, 2000)}\n")
    writer = csv.writer(lines, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return lines.getvalue()
