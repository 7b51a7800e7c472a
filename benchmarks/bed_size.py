"""Benchmark ``scale``: the same fingertip path on beds from 625 pins to a million."""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

import numpy as np
from digiclay.commands.progress import table
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.engine.state import State
from digiclay.core.engine.system import System
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene
from digiclay.core.scene.toml_table import resolve
from digiclay.plots.figure import empty

from .report import BLUE, RED, STYLE, Report, Steps, cells, list_records

#: Pins along a side of the beds.
SIDES = (25, 101, 317, 1001)
#: The fingertip presses in the middle, rises and is dragged, over the same pins of every bed: s; x, z in mm.
PATH = ((0.0, 0.0, 42.0), (0.3, 0.0, 36.5), (0.8, 6.0, 40.0), (1.3, 12.0, 44.0), (1.6, 12.0, 60.0))
DURATION = 1.6


@dataclass(frozen=True)
class Size:
    """Cost of a bed of one size.

    Attributes
    ----------
    built : float
        Time to put it together, s.
    period : float
        A control period, the median, s.
    mean : float
        CPU time of a control period, the mean, s: the fingertip's poses are computed for 128 at once.
    gathered : float
        Cells that take part, on average.
    """

    pins: int
    built: float
    period: float
    mean: float
    gathered: float
    bytes_a_pin: float


def scene(side: int) -> Scene:
    """Return a bed of side x side pins; an odd side has a pin in the middle."""
    waypoints = [{"time": t, "position": [x * 1e-3, 0.0, z * 1e-3]} for t, x, z in PATH]
    parts = {"simulation": {"duration": DURATION}, "trajectory": {"waypoints": waypoints}}
    layout = {"rows": side, "columns": side}
    return resolve({"layout": layout, "recorder": "absent", **parts}, f"{side * side} pins")


def bytes_of(*values: Any) -> int:
    """Return the bytes of all different arrays in dataclasses and sequences, and within their members."""
    arrays: dict[int, int] = {}
    waiting, seen = list(values), set()
    while waiting:
        value = waiting.pop()
        if isinstance(value, np.ndarray):
            owner = value if value.base is None or not isinstance(value.base, np.ndarray) else value.base
            arrays[id(owner)] = owner.nbytes
        elif hasattr(value, "__dataclass_fields__") and id(value) not in seen:
            seen.add(id(value))
            waiting += [getattr(value, field.name) for field in fields(value)]
            waiting += list(getattr(value, "__dict__", {}).values())  # cached properties
        elif isinstance(value, (tuple, list)):
            waiting += value
    return sum(arrays.values())


def gathered_cells(side: int) -> list[int]:
    """Return how many cells take part in each control period."""
    bed = scene(side)
    system = assemble(bed)
    run = periods(system, bed.trajectories(), begin(system), bed.periods)
    return [state.active.cells.size for state in run]


def _time_bed(side: int, repeats: int) -> Size:
    """Build a bed of `side` x `side` pins and run the session on it; the median of the repeats counts."""
    built, spent, gathered, means = [], [], [], []
    bed = scene(side)
    bytes_a_pin = 0.0
    for _ in range(repeats):
        started = time.perf_counter()
        system: System = assemble(bed)
        start: State = begin(system)
        built.append(time.perf_counter() - started)
        used, moments = time.process_time(), [time.perf_counter()]
        for state in periods(system, bed.trajectories(), start, bed.periods):
            moments.append(time.perf_counter())
            gathered.append(state.active.cells.size)
        means.append((time.process_time() - used) / bed.periods)
        spent += [b - a for a, b in pairwise(moments)]
        bytes_a_pin = bytes_of(system, state) / (side * side)
    build, period, mean = (statistics.median(times) for times in (built, spent, means))
    return Size(side * side, build, period, mean, statistics.fmean(gathered), bytes_a_pin)


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Measure every size."""
    sides, repeats = (SIDES[:3], 1) if arguments.quick else (SIDES, 5)
    sizes = [_time_bed(side, repeats) for side in steps.through(sides, lambda side: f"{side * side} pins")]
    return Report(_list_lines(sizes), *list_records(sizes), lambda: _draw(sizes))


def _draw(sizes: Sequence[Size]) -> Any:
    """Draw a control period's cost over the number of pins."""
    with empty(6.0, 3.6, STYLE, layout="constrained") as figure:
        panel = figure.subplots()
        pins = [size.pins for size in sizes]
        for values, label, color, marker in (
            ([size.period * 1e6 for size in sizes], "median", BLUE, "o"),
            ([size.mean * 1e6 for size in sizes], "mean, with the fingertip's poses", RED, "s"),
        ):
            panel.semilogx(pins, values, "-", color=color, marker=marker, label=label)
        panel.set(
            ylim=(0.0, 1.2e6 * max(size.mean for size in sizes)), title="The same fingertip, larger beds"
        )
        panel.set(xlabel="pins of the bed", ylabel="a control period, µs")
        panel.legend(loc="lower right")
        return figure


def _list_lines(sizes: list[Size]) -> Iterator[str]:
    """Give the lines of the report."""
    yield "\nThe same fingertip, pressing and dragging, 1.6 s; default parts; control period and step 5 ms\n"
    head = ("pins", "taking part", "period, µs", "to smallest", "CPU mean, µs", "built in, ms", "bytes a pin")
    rows = [
        cells(
            "d .1f .0f .2f .0f .3g .1f", one.pins, one.gathered, one.period * 1e6,
            one.period / sizes[0].period, one.mean * 1e6, one.built * 1e3, one.bytes_a_pin,
        )
        for one in sizes
    ]  # fmt: skip
    yield from table(head, rows, left=0)
