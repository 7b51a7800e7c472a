"""Benchmark ``zoo``: published figures of pin displays beside those of the sample scenes."""

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from digiclay.core.scene.scene_source import read_table
from digiclay.core.session.run_scene import Result, run
from digiclay.front_door import change_scene

from .report import Report, Row, Steps, tabulate

#: Distance from its last height at which a pin has arrived, m; share by which a figure may be off.
ARRIVED, OFF = 1e-4, 0.2
COLUMNS = {
    "scene": "scene",
    "figure": "figure",
    "unit": "unit",
    "published": "published",
    "simulated": "simulated .3g",
    "kind": "kind",
    "within 20 %": "verdict",
    "source": "source",
}


def find_speed(result: Result) -> float:
    """Return the largest speed of a pin, mm/s."""
    height, time = result.history["height"], result.history["time"]
    return float(1e3 * np.abs(np.diff(height, axis=0)).max() / (time[1] - time[0]))


def find_refresh(result: Result) -> float:
    """Return the time until all pins have arrived, s."""
    height = result.history["height"]
    moving = np.abs(height - height[-1]).max(axis=1) > ARRIVED
    # The row after the last from which a pin still moves.
    (rows,) = np.append(True, moving).nonzero()
    return float(result.history["time"][rows[-1]])


MEASURES: dict[str, Callable[[Result], float]] = {
    "force": lambda result: float(result.history["force"].max()),
    "speed": find_speed,
    "refresh": find_refresh,
    "row": lambda result: find_refresh(result) / result.scene.layout.rows,
}


def judge(figure: Row) -> Row:
    """Return the row of the table for a figure of zoo.toml."""
    result = run(change_scene(figure["scene"], figure.get("set", {})))
    simulated, published = MEASURES[figure["measure"]](result), figure["published"]
    exact = isinstance(published, float)
    low, high = (published * (1 - OFF), published * (1 + OFF)) if exact else published
    return {
        **{key: figure[key] for key in ("scene", "figure", "unit")},
        "published": f"{published:g}" if exact else f"{low:g} to {high:g}",
        "simulated": simulated,
        "kind": "input" if figure.get("input") else "prediction",
        "verdict": "yes" if low <= simulated <= high else "no",
        "source": figure["source"],
    }


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Simulate all displays; what the model lacks follows the table."""
    figures = read_table(Path(__file__).with_suffix(".toml"))["figure"]
    chosen = [row for row in figures if not (arguments.quick and row.get("slow"))]
    rows = [judge(row) for row in steps.through(chosen, lambda row: row["scene"])]
    lacks = [f"  {row['scene']} lacks {row['lacks']}" for row in chosen if "lacks" in row]
    return Report([*tabulate(rows, COLUMNS, left=2), *lacks], rows)
