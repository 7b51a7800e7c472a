"""``python -m benchmarks scale``: the same fingertip path on beds from 625 pins to a million."""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from pathlib import Path
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

from .plots import STYLE, write
from .report import add_kind, kept, made_with, progress

#: Pins along a side of the beds.
SIDES = (25, 101, 317, 1001)
#: The finger presses in the middle, rises and is dragged, over one and the same pins of every bed.
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
        CPU time of a control period, the mean, s: the finger's poses are worked out for 128 at once.
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
    return resolve(
        {
            "layout": {"rows": side, "columns": side},
            "recorder": "absent",
            "simulation": {"duration": DURATION},
            "trajectory": {
                "waypoints": [{"time": t, "position": [x * 1e-3, 0.0, z * 1e-3]} for t, x, z in PATH]
            },
        },
        f"{side * side} pins",
    )


def bytes_of(*values: Any) -> int:
    """Return the bytes of all different arrays in some dataclasses, and in what these hold."""
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
    known = scene(side)
    system = assemble(known)
    run = periods(system, known.trajectories(), begin(system), known.periods)
    return [state.active.cells.size for state in run]


def measured(side: int, repeats: int) -> Size:
    """Build a bed and run the session on it; the median of the repeats counts.

    `side`: pins along each side.
    """
    built, spent, cells, means = [], [], [], []
    known = scene(side)
    bytes_a_pin = 0.0
    for _ in range(repeats):
        started = time.perf_counter()
        system: System = assemble(known)
        start: State = begin(system)
        built.append(time.perf_counter() - started)
        used, moments = time.process_time(), [time.perf_counter()]
        for state in periods(system, known.trajectories(), start, known.periods):
            moments.append(time.perf_counter())
            cells.append(state.active.cells.size)
        means.append((time.process_time() - used) / known.periods)
        spent += [b - a for a, b in pairwise(moments)]
        bytes_a_pin = bytes_of(system, state) / (side * side)
    return Size(
        side * side,
        statistics.median(built),
        statistics.median(spent),
        statistics.median(means),
        statistics.fmean(cells),
        bytes_a_pin,
    )


def add(kinds: Any) -> None:
    """Add the benchmark."""
    examples = "  python -m benchmarks scale\n  python -m benchmarks scale --quick --out results\n"
    parser = add_kind(kinds, "scale", "a control period from 625 pins to a million", examples)
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Measure every size, and print the table."""
    sides, repeats = (SIDES[:3], 1) if arguments.quick else (SIDES, 5)
    with progress(arguments, "scale", len(sides)) as bar:
        sizes = []
        for side in sides:
            sizes.append(measured(side, repeats))
            bar(f"{side * side} pins")
    text = "\n".join(_text(sizes))
    print(text)
    head = [field.name for field in fields(Size)]
    kept(arguments.out, "scale", text, head, [[getattr(one, name) for name in head] for one in sizes])
    if arguments.out:
        _draw(sizes, arguments.out / "scale.png")
    return 0


def _draw(sizes: Sequence[Size], out: Path) -> Path:
    """Draw a control period's cost over the number of pins, and return the path."""
    with empty(6.0, 3.6, STYLE, layout="constrained") as figure:
        panel = figure.subplots()
        pins = [one.pins for one in sizes]
        for values, label, color, marker in (
            ([one.period * 1e6 for one in sizes], "median", "#0072B2", "o"),
            ([one.mean * 1e6 for one in sizes], "mean, with the finger's poses", "#D55E00", "s"),
        ):
            panel.semilogx(pins, values, "-", color=color, marker=marker, label=label)
        panel.set_ylim(0.0, 1.2e6 * max(one.mean for one in sizes))
        panel.set_xlabel("pins of the bed")
        panel.set_ylabel("a control period, µs")
        panel.set_title("The same finger on larger beds")
        panel.legend(loc="lower right")
        return write(figure, out)


def _text(sizes: list[Size]) -> Iterator[str]:
    """Give the lines of the report."""
    yield made_with()
    yield "\nThe same finger, pressing and dragging, 1.6 s; default parts; control period and step 5 ms\n"
    head = ("pins", "taking part", "period, µs", "to smallest", "CPU mean, µs", "built in, ms", "bytes a pin")
    rows = [
        [
            str(one.pins), f"{one.gathered:.1f}", f"{one.period * 1e6:.0f}",
            f"{one.period / sizes[0].period:.2f}",
            f"{one.mean * 1e6:.0f}", f"{one.built * 1e3:.3g}", f"{one.bytes_a_pin:.1f}",
        ]
        for one in sizes
    ]  # fmt: skip
    yield from table(head, rows, left=0)
