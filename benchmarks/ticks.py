"""``python -m benchmarks ticks``: distribution of the time of a live session's tick under the Press tool."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from digiclay.commands.progress import table
from digiclay.commands.stop import refuse_without_blender
from digiclay.plots.figure import empty

from .plots import STYLE, write
from .report import add_kind, kept, made_with, progress

if TYPE_CHECKING:  # Blender is imported when it is needed
    from .tick_times import Ticks

#: Rows and columns of the beds, their pitch and the bore of their pins, m, and the time that 99 of 100 ticks
#: are to keep to, s.
BEDS = ((25, 25, 3e-3, 2e-3, 8e-3), (100, 100, 3e-3, 2e-3, 16e-3), (100, 100, 1.5e-3, 1e-3, 16e-3))
#: Ticks that are timed, with --quick and without.
QUICK, FULL = 120, 3000
#: Shares of the ticks whose times are given; the last one is the largest time.
SHARES = (0.5, 0.9, 0.99, 0.999, 1.0)
NAMES = ("median", "90 %", "99 %", "99.9 %", "largest")


def add(kinds: Any) -> None:
    """Add the benchmark."""
    examples = "  python -m benchmarks ticks\n  python -m benchmarks ticks --quick --out results\n"
    parser = add_kind(
        kinds, "ticks", "how the time of a tick of a live session is distributed (needs bpy)", examples
    )
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Measure every bed on one core, and print the tables."""
    refuse_without_blender()
    from digiclay.compat import bpy

    from .tick_times import measure

    keep_to_one_core()
    count, found = QUICK if arguments.quick else FULL, []
    with progress(arguments, "ticks", len(BEDS)) as bar:
        for rows, columns, pitch, bore, _ in BEDS:
            found.append(measure(rows, columns, pitch, bore, count))
            bar(found[-1].name)
    text = "\n".join(_text(found, bpy.app.version_string))
    print(text)
    head = ("rows", "columns", "pitch_m", "ticks", "part", *(f"share_{share:g}_s" for share in SHARES))
    figures = [
        [bed.rows, bed.columns, bed.pitch, count, name, *np.quantile(times, SHARES)]
        for bed in found
        for name, times in _lines(bed).items()
    ]
    kept(arguments.out, "ticks", text, head, figures)
    if arguments.out is not None:
        draw_histogram(found, [bed[-1] for bed in BEDS], arguments.out / "ticks.png")
    return 0


def keep_to_one_core() -> None:
    """Have all threads of the process use one core, where the system lets it; Blender has begun some."""
    if hasattr(os, "sched_setaffinity"):
        core = {min(os.sched_getaffinity(0))}
        for thread in os.listdir("/proc/self/task"):
            os.sched_setaffinity(int(thread), core)


def _text(found: Sequence[Ticks], version: str) -> Iterator[str]:
    """Give the lines of the report."""
    from .tick_times import RATE

    yield f"{made_with()}, Blender {version}"
    yield f"\nTicks of a live session at {RATE} a second while a hand draws with the Press tool; one core,"
    yield "without drawing. Processor time, ms. evaluate: Blender's geometry nodes; pack and store: the state"
    yield "for undo and files; monitor: estimate of the error; other: what is in no part."
    for bed, (_, _, _, _, goal) in zip(found, BEDS, strict=True):
        kept_to = 100.0 * np.mean(bed.spent < goal)
        yield f"\n{bed.name}, {len(bed.spent)} ticks; {kept_to:.2f} % under {1e3 * goal:g} ms\n"
        rows = [
            [name, *(f"{1e3 * time:.2f}" for time in np.quantile(times, SHARES))]
            for name, times in _lines(bed).items()
        ]
        yield from table(("", *NAMES), rows)


def _lines(bed: Ticks) -> dict[str, Any]:
    """Return the times of a bed's ticks, s, by the lines of the report."""
    rest = bed.spent - sum(times for name, times in bed.parts.items() if name != "garbage")
    return {"whole tick": bed.spent, **bed.parts, "other": rest, "whole, elapsed time": bed.elapsed}


def draw_histogram(found: Sequence[Ticks], goals: Sequence[float], out: Path) -> Path:
    """Draw how the times of the ticks are distributed, one panel a bed, and return the picture's path.

    `goals`: time that 99 of 100 ticks of each bed are to keep to, s; `out`: the PNG.
    """
    with empty(7.2, 2.1 * len(found), STYLE, layout="constrained") as figure:
        panels = figure.subplots(len(found), 1, sharex=True, squeeze=False).ravel()
        highest = 1e3 * max(*(float(bed.spent.max()) for bed in found), *goals)
        bins = np.arange(0.0, highest + 0.5, 0.25)
        for panel, bed, goal in zip(panels, found, goals, strict=True):
            panel.hist(1e3 * bed.spent, bins, color="#0072B2", log=True)
            panel.axvline(1e3 * goal, color="#D55E00", linestyle="--", label=f"goal: {1e3 * goal:g} ms")
            share = 1e3 * float(np.quantile(bed.spent, 0.99))
            panel.axvline(share, color="#222222", linestyle=":", label=f"99 %: {share:.1f} ms")
            panel.set_title(f"{bed.name}, {len(bed.spent)} ticks")
            panel.set_ylabel("ticks in 0.25 ms")
            panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.0)
        panels[-1].set_xlabel("processor time of a tick, ms")
        return write(figure, out)
