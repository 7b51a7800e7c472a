"""Page and tables of a benchmark of methods, with all that a citation needs."""

import importlib.metadata
import os
import platform
import textwrap
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from digiclay import __version__
from digiclay.commands.gallery import make_links, make_table, wrap
from digiclay.commands.progress import table as aligned
from digiclay.core.base.quantity import show_digits
from digiclay.core.files.tables import Record
from digiclay.core.studies.axes import Point
from digiclay.core.studies.speed_limits import describe_end
from digiclay.core.studies.sweep_plan import format_csv

from .league import (
    KIND,
    MEASURES,
    Interval,
    Row,
    Table,
    find_interval,
    find_trajectories,
    list_values,
)
from .method_trials import HIGH, LIMITS, LOW, OUTCOMES


def describe_machine(*packages: str) -> str:
    """Return one line: versions, those of more packages too, and the kind of machine."""
    versions = [
        f"digiclay {__version__}",
        f"Python {platform.python_version()}",
        f"numpy {np.__version__}",
    ]
    versions += [f"{name} {importlib.metadata.version(name)}" for name in packages]
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return (
        ", ".join(versions)
        + f"; {platform.system()}, {platform.machine()}, {_processor()}, {cores} cores"
    )


def _processor() -> str:
    """Return the processor's name where the system tells it."""
    path = Path("/proc/cpuinfo")
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown processor"


#: Columns of the table in a terminal.
PRINTED = (
    "rfd",
    "lag_mean",
    "ridge_unevenness",
    "relief_rms",
    "max_total_force",
    "losses",
    *LIMITS,
    "cost_ratio",
    "height_error",
    "force_error",
)
#: Where errors are estimated.
JUDGED = "Errors: the largest of the trials with the first seed, estimated, but for speed limits."
#: Heading of the last column of the league.
WORSE = "RFD greater on"
#: Measures of the table of trajectories on the page.
SHOWN = ("rfd", "lag_mean", "ridge_unevenness", "relief_rms", "max_total_force", "losses")


class Plan(NamedTuple):
    """Plan of a suite."""

    methods: tuple[str, ...]
    groups: tuple[str, ...]
    #: Of the noise.
    seeds: tuple[int, ...]
    #: A trial each; words are method, trajectory and seed.
    points: tuple[Point, ...]
    #: Standard deviation of the force sensors, N.
    noise: float
    #: Name of the scene.
    title: str
    #: Hash of all scenes with all parameters, and of the code of methods of one's own.
    identity: str


class Provenance(NamedTuple):
    """Origin of the results of a suite."""

    plan: Plan
    machine: str
    date: str
    command: str

    def cite(self) -> str:
        """Return the line by which a paper cites the results."""
        plan = self.plan
        ends = " to ".join(dict.fromkeys((str(plan.seeds[0]), str(plan.seeds[-1]))))
        return (
            f"digiclay {__version__}, benchmark of control methods {', '.join(plan.methods)} "
            f"({plan.title}, scenes {plan.identity[:16]}, noise {plan.noise * 1e3:g} mN, seeds {ends}), "
            f"{self.date}."
        )

    def facts(self) -> list[tuple[str, str]]:
        """Return names and values of the page and of the comments of the tables."""
        return [
            ("cite", self.cite()),
            ("command", self.command),
            ("scenes (SHA-256)", self.plan.identity),
            ("seeds", " ".join(map(str, self.plan.seeds))),
            ("force noise (N)", f"{self.plan.noise:g}"),
            ("machine", self.machine),
            ("date", self.date),
            ("intervals", KIND),
        ]


def format_results(source: Provenance, records: Mapping[int, Record]) -> str:
    """Return all trials as CSV in SI units. `records`: by the index of their point."""
    units = [
        name if metric.unit == "1" else f"{name} ({metric.unit})"
        for name, metric in OUTCOMES.items()
    ]
    rows = []
    for point in source.plan.points:
        record = records[point.index]
        figures = record.get("figures", {})
        rows.append([*point.words, *map(figures.get, OUTCOMES), record.get("error", "")])
    return _format_csv(source, ["method", "trajectory", "seed", *units, "error"], rows)


def format_trajectories(source: Provenance, table: Table) -> str:
    """Return means and intervals of every trajectory as CSV in SI units."""
    head = ["trajectory", "method", "measure", "unit", "mean", "half width", "seeds"]
    rows = []
    for name in find_trajectories(table):
        for method in source.plan.methods:
            for measure, metric in OUTCOMES.items():
                interval = find_interval(list_values(table, method, name, measure))
                if interval is not None:
                    rows.append([name, method, measure, metric.unit, *interval])
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
            interval = row.measures[name]
            cells += [None, None] if interval is None else [interval.mean, interval.half]
        rows.append([*cells, row.worse, row.trajectories])
    return _format_csv(source, head, rows)


def print_league(league: Sequence[Row]) -> list[str]:
    """Return the lines of the league for a terminal."""
    names = [name for name in MEASURES if name in PRINTED]
    titles = [f"{MEASURES[name].label} {MEASURES[name].shown}".strip() for name in names]
    return [
        *aligned(("method", *titles, WORSE), [_list_cells(row, names) for row in league]),
        JUDGED,
    ]


def format_page(
    source: Provenance,
    league: Sequence[Row],
    table: Table,
    failed: Sequence[str],
    pictures: Sequence[str],
) -> str:
    """Return the page. `failed`: one line per failed trial; `pictures`: files beside it."""
    titles = {name: metric.title for name, metric in MEASURES.items()}
    methods = source.plan.methods
    first = escape(methods[0])
    lines = [
        f"<p>{len(table)} trials of {len(methods)} methods, {len(source.plan.seeds)} seeds.</p>",
        "<h2>League</h2>",
        *make_table(
            ["method", *titles.values(), WORSE],
            [_list_cells(row, list(MEASURES)) for row in league],
        ),
        f"<p>Means over the trajectories, the random drags together as one; ± {escape(KIND)}. Of several "
        "fingers the worst counts. Largest force: over all trajectories. Losses: sum. Cost: median time; "
        f"ratio to {first}. {JUDGED} Last column: trajectories with a greater mean RFD than {first}. "
        "JND: just noticeable differences of the set point.</p>",
        *(f'<p><img alt="{name}" src="{name}"></p>' for name in pictures),
    ]
    for name in SHOWN:
        body, factor = [], MEASURES[name].factor
        for trajectory in find_trajectories(table):
            intervals = [
                find_interval(list_values(table, method, trajectory, name)) for method in methods
            ]
            if any(intervals):
                body.append([trajectory, *(_format(interval, factor) for interval in intervals)])
        lines.append(f"<h2>{escape(titles[name])} by trajectory</h2>")
        lines += make_table(["trajectory", *methods], body)
    if failed:
        lines += ["<h2>Failed trials</h2>", *(f"<p>{escape(line)}</p>" for line in failed)]
    files = ("league.csv", "trajectories.csv", "results.csv")
    lines += ["<h2>Origin</h2>", *make_table(["", ""], source.facts())]
    lines.append(f"<p>{make_links([(name, name) for name in files])}</p>")
    return wrap(f"Benchmark of control methods: {source.plan.title}", lines)


def _list_cells(row: Row, names: Sequence[str]) -> list[str]:
    """Return a row of the league; a largest speed may be an end of its search."""
    cells = [row.method]
    for name in names:
        factor = MEASURES[name].factor
        interval = row.measures[name]
        end = describe_end(interval and interval.mean, LOW, HIGH) if name in row.searched else ""
        cells.append(end or _format(interval, factor))
    return [*cells, "–" if row.worse is None else f"{row.worse} of {row.trajectories}"]


def _format(interval: Interval | None, factor: float) -> str:
    """Write a mean and its interval in the unit shown."""
    if interval is None:
        return "–"
    half = "" if interval.half is None else f" ± {show_digits(interval.half * factor)}"
    return f"{show_digits(interval.mean * factor, 3)}{half}"


def _format_csv(source: Provenance, head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Return rows as CSV below comments with their origin."""
    facts = [f"# {name}: {textwrap.shorten(value, 2000)}\n" for name, value in source.facts()]
    return "".join(facts) + format_csv([head, *rows])
