"""Figures of the pages beside what the commands give now: no page is stale unseen."""

import argparse
import math
import re
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from digiclay.core.base.errors import OutputError
from digiclay.core.metrics.metric_table import ERRORS, FACTORS, SPEEDS
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.session.run_scene import run
from digiclay.core.studies.speed_limits import Criterion, Drag, Lift, find_largest_speed

from .kinds import PAPER
from .report import Report, Row, Steps, tabulate

ROOT = Path(__file__).parents[1]
#: A number of a page.
NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e-?\d+)?")
#: A figure where its row of the table says nothing else: two digits may be off by 5 %.
USUAL: Row = {"number": 1, "scene": PAPER, "set": [], "off": 0.05, "slow": False}
#: Motion of each speed, and the fastest that is tried, m/s.
WAYS: dict[str, Drag | Lift] = dict(zip(SPEEDS, (Drag(), Lift()), strict=True))
FASTEST = 80e-3


def read_figures() -> list[Row]:
    """Return the figures of figures.toml; a row with several metrics has numbers that follow one another."""
    table = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    figures: list[Row] = []
    for row in table["figure"]:
        figure = {**USUAL, **row}
        for place, (metric, unit) in enumerate(row["metrics"]):
            figures.append({**figure, "metric": metric, "unit": unit, "number": figure["number"] + place})
    return figures


def read_page(figure: Row, text: str) -> float:
    """Return the number that a page has for a figure; OutputError when it has no such text or number."""
    _, _, rest = text.partition(figure["after"])
    numbers = NUMBER.findall(rest)
    if len(numbers) < figure["number"]:
        raise OutputError(f"{figure['page']} has no number {figure['number']} behind {figure['after']!r}.")
    return float(numbers[figure["number"] - 1])


@cache
def measure_scene(name: str, settings: tuple[str, ...], metric: str, *, errors: bool) -> Mapping[str, Any]:
    """Return a speed by its name in `SPEEDS`, or all metrics of a scene with some settings."""
    scene = load(find(name), [Setting(*setting.split("=", 1)) for setting in settings])
    if metric in WAYS:
        return {metric: find_largest_speed(scene, WAYS[metric], Criterion(), high=FASTEST)}
    done = run(scene)
    return (done.estimate_errors() or done).metrics if errors else done.metrics


def judge(figure: Row) -> Row:
    """Return a figure with the number of its page, the one of now, their ratio, and whether it is stale."""
    metric, settings = figure["metric"], tuple(figure["set"])
    of_speed = metric if metric in WAYS else ""
    found = measure_scene(figure["scene"], settings, of_speed, errors=metric in ERRORS)[metric]
    now = math.nan if found is None else found * FACTORS.get(figure["unit"], 1.0)
    there = read_page(figure, (ROOT / figure["page"]).read_text(encoding="utf-8"))
    ratio = now / there if there else math.nan
    stale = "" if abs(ratio - 1.0) <= figure["off"] else "STALE"
    behind = " ".join(figure["after"].strip("\n |").split())
    return {**figure, "behind": behind[-40:], "there": there, "now": now, "ratio": ratio, "stale": stale}


COLUMNS = {
    "page": "page", "behind": "behind", "metric": "metric", "unit": "unit", "of the page": "there .4g",
    "now": "now .4g", "ratio": "ratio .3f", "off by more than": "off g", "": "stale",
}  # fmt: skip


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Compare the figures of one page, or of all."""
    figures = read_figures()
    pages = list(dict.fromkeys(figure["page"] for figure in figures))
    if arguments.page not in (None, *pages):
        raise OutputError(f"PAGE must be one of {', '.join(pages)} (got {arguments.page}).")
    chosen = [
        figure
        for figure in figures
        if arguments.page in (None, figure["page"]) and not (arguments.quick and figure["slow"])
    ]
    rows = [judge(figure) for figure in steps.through(chosen, lambda figure: figure["page"])]
    stale = sum(row["stale"] != "" for row in rows)
    lines = [*tabulate(rows, COLUMNS, 4), f"{stale} of {len(rows)} figures are stale."]
    return Report(lines, rows, failed=stale > 0)
