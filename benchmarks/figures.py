"""Figures of the pages beside what the commands give now, or stored results: no page is stale unseen."""

import argparse
import csv
import math
import re
import subprocess
from functools import cache
from pathlib import Path

from digiclay.core.base.errors import OutputError
from digiclay.core.files.tables import Record, Table
from digiclay.core.metrics.metric_table import ERRORS, FACTORS
from digiclay.core.scene.scene_source import Setting, find, load, read_table
from digiclay.core.session.run_scene import run
from digiclay.core.studies.speed_limits import Criterion, find_largest_speed

from digiclay_study.method_trials import HIGH, LIMITS

from .kinds import PAPER
from .report import Report, Row, Steps, tabulate

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).with_name("results")
#: A number of a page, and what is between its thousands.
NUMBER, THOUSANDS = re.compile(r"\d+(?:\.\d+)?"), re.compile(r"(?<=\d)[ ,](?=\d{3}\b)")
#: A cell of a table that begins with a number, as a measured one does.
MEASURED = re.compile(r"[*~]*\d[\d.]*( \d{3})*( ?([µmnp]?[msNA]|mm/s|x|%|MB|million))?\b")
#: A row with a day says when and by which command others were measured.
DATE = re.compile(r"\d{4}-\d\d-\d\d")
#: Factors of units that only pages have, beside `FACTORS`.
UNITS = {**FACTORS, "ms": 1e3, "nm": 1e9, "pm": 1e12, "µN": 1e6, "nN": 1e9, "million": 1e-6}
#: A figure where its row of the table says nothing else: two digits may be off by 5 %.
USUAL: Row = {
    "number": 1,
    "scene": PAPER,
    "set": [],
    "off": 0.05,
    "slow": False,
    "stored": "",
    "where": {},
    "head": "",
    "rows": [],
}


@cache
def read_plan() -> Record:
    """Return figures.toml."""
    return read_table(Path(__file__).with_suffix(".toml"))


def read_figures(page: str | None = None) -> list[Row]:
    """Return the figures of a page, or of all, as the text has them; OutputError where one is missing."""
    figures: list[Row] = []
    for given in read_plan()["figure"]:
        if page not in (None, given["page"]):
            continue
        row = {**USUAL, **given}
        text = (ROOT / row["page"]).read_text(encoding="utf-8")
        rest = text[text.find(row["head"]) :]
        for label, where in row["rows"] or [[row["after"], {}]]:
            rest = rest.partition(label)[2]
            numbers = NUMBER.findall(THOUSANDS.sub("", rest))
            for place, (metric, unit, *conditions) in enumerate(row["metrics"], row["number"]):
                if len(numbers) < place:
                    raise OutputError(f"{row['page']} has no number {place} behind {label!r}.")
                if metric:
                    figure = {
                        "of": metric,
                        "unit": unit,
                        "behind": " ".join(label.split()),
                        "text": numbers[place - 1],
                        "where": row["where"] | where | dict(*conditions),
                    }
                    figures.append(row | figure)
    return figures


def list_measured_rows(text: str) -> list[str]:
    """Return the rows of a page's tables that have a measured number in a cell other than the first."""
    lines = (line for line in text.splitlines() if line.startswith("|") and not DATE.search(line))
    rows = (" ".join(line.split()) for line in lines)
    return [
        row
        for row in rows
        if any(MEASURED.match(cell.strip()) for cell in row[1:-1].split("|")[1:])
    ]


def describe_uncompared(page: str) -> str:
    """Return which rows of a page's tables no figure is of, in a line."""
    behind = [figure["behind"] for figure in read_figures(page)]
    rows = list_measured_rows((ROOT / page).read_text(encoding="utf-8"))
    left = [row.split("|")[1].strip() for row in rows if not any(text in row for text in behind)]
    return f"{page}: rows not compared: {'; '.join(left)}" if left else ""


@cache
def measure_scene(name: str, settings: tuple[str, ...], limit: str, *, errors: bool) -> Table:
    """Return a speed by its name in `LIMITS`, or all metrics of a scene with some settings."""
    scene = load(find(name), [Setting(*setting.split("=", 1)) for setting in settings])
    if limit in LIMITS:
        return {limit: find_largest_speed(scene, LIMITS[limit], Criterion(), high=HIGH)}
    done = run(scene)
    return (done.estimate_errors() or done).metrics if errors else done.metrics


@cache
def read_stored(name: str) -> tuple[list[Row], str]:
    """Return the rows of a stored result, and its name with the commit it was stored in, and the date."""
    lines = (RESULTS / name).read_text(encoding="utf-8").splitlines()
    words = ["git", "log", "-1", "--format=%h, %as", "--", name]
    stored = subprocess.run(words, cwd=RESULTS, capture_output=True, text=True, check=False).stdout
    return list(
        csv.DictReader(line for line in lines if line[0] != "#")
    ), f"{name}, {stored.strip()}"


def find_stored(figure: Row) -> float:
    """Return a figure of a stored result; OutputError unless of one row."""
    wanted = figure["where"].items()
    rows = [row for row in read_stored(figure["stored"])[0] if wanted <= row.items()]
    if len(rows) != 1:
        raise OutputError(
            f"{figure['stored']} must have one row of {figure['where']} (got {len(rows)})."
        )
    return float(rows[0][figure["of"]])


def find_run(figure: Row) -> float:
    """Return a figure of a run of now, NaN where it has none."""
    metric, settings = figure["of"], tuple(figure["set"])
    limit = metric if metric in LIMITS else ""
    return (
        measure_scene(figure["scene"], settings, limit, errors=metric in ERRORS)[metric] or math.nan
    )


def judge(figure: Row) -> Row:
    """Return a figure with the numbers of its page and of its source, and whether it is stale."""
    stored, text = figure["stored"], figure["text"]
    there, digits = float(text), len(text.partition(".")[2])
    now = UNITS.get(figure["unit"], 1.0) * (find_stored(figure) if stored else find_run(figure))
    near = abs(now - there) <= figure["off"] * there or round(now, digits) == there
    source = read_stored(stored)[1] if stored else "run"
    return {
        **figure,
        "there": there,
        "now": now,
        "source": source,
        "stale": "" if near else "STALE",
    }


COLUMNS = {
    "page": "page",
    "behind": "behind",
    "figure": "of",
    "unit": "unit",
    "of the page": "there .4g",
    "of the source": "now .4g",
    "source": "source",
    "": "stale",
}


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Compare the figures of one page, or of all."""
    pages = list(dict.fromkeys(row["page"] for row in read_plan()["figure"]))
    if arguments.page not in (None, *pages):
        raise OutputError(f"PAGE must be one of {', '.join(pages)} (got {arguments.page}).")
    figures = read_figures(arguments.page)
    chosen = [figure for figure in figures if not (arguments.quick and figure["slow"])]
    rows = [judge(figure) for figure in steps.through(chosen, lambda figure: figure["page"])]
    stale = sum(row["stale"] != "" for row in rows)
    left = filter(
        None, map(describe_uncompared, dict.fromkeys(figure["page"] for figure in figures))
    )
    lines = [*tabulate(rows, COLUMNS, 4), "", *left, f"{stale} of {len(rows)} figures are stale."]
    return Report(lines, rows, failed=stale > 0)
