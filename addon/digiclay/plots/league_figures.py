"""Plots of a benchmark of methods: force deviation by trajectory, and the measures of the league."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.metrics.force import find_weber_fractions
from ..core.studies.league import MEASURES, find_interval
from .figure import INK, LINES, SHADE, canvas, legend_above

if TYPE_CHECKING:  # only named in annotations
    from matplotlib.figure import Figure

    from ..core.studies.league import Row, Table

#: Marks of the methods, which differ without their colors.
MARKS = "osD^vP*X<>"
#: Panels of the league.
PANELS = ("lag_mean", "ridge_unevenness", "ridge-limit", "lift-limit", "max_total_force", "period_cost")


def draw_rfd(table: Table, methods: Sequence[str]) -> Figure:
    """Draw the RFD of every trajectory: a small mark a seed, a large one the mean, with its interval.

    The shaded band holds the just noticeable differences of the first method's set point.

    `table`: measured values by method, trajectory and seed.
    """
    names = list(dict.fromkeys(name for (_, name, _), found in table.items() if found.get("rfd") is not None))
    high = 0.27 * max(len(names), 1)
    with canvas(11.0, high + 1.7, "Reference force deviation by trajectory") as (figure, place):
        axes = place("rfd", 1.7, 0.75, 8.9, high)
        for number, method in enumerate(methods):
            _mark_method(axes, table, method, number, names)
        points = [found.get("set_point") for (own, _, _), found in table.items() if own == methods[0]]
        known = [value for value in points if value is not None]
        if known:
            edges = [share * known[0] / 1e-3 for share in find_weber_fractions(known[0])]
            axes.axvspan(*edges, color=SHADE, zorder=0, label="one JND of the set point")
        axes.set_yticks(-np.arange(len(names)), names)
        axes.set(ylim=(-len(names) + 0.4, 0.6), xlabel="RFD (mN)", xscale="log")
        axes.xaxis.set_major_formatter("{x:g}")
        legend_above(axes)
    return figure


def _mark_method(axes: Any, table: Table, method: str, number: int, names: Sequence[str]) -> None:
    """Draw the marks of a method."""
    style: dict[str, Any] = {"color": LINES[number % len(LINES)], "marker": MARKS[number % len(MARKS)]}
    shift = 0.18 * (number % 3 - 1)
    label: str | None = method
    for line, name in enumerate(names):
        values = [
            1e3 * float(found["rfd"] or 0.0)
            for (own, trajectory, _), found in table.items()
            if (own, trajectory) == (method, name) and found.get("rfd")
        ]
        if values:
            rows = np.full(len(values), -line - shift)
            axes.plot(values, rows, linestyle="", markersize=3, alpha=0.6, **style)
            found = find_interval(values)
            assert found is not None
            axes.errorbar(
                found.mean,
                rows[0],
                xerr=found.half,
                linestyle="",
                markersize=7,
                capsize=3,
                label=label,
                **style,
            )
            label = None


def draw_measures(league: Sequence[Row], methods: Sequence[str]) -> Figure:
    """Draw a panel a measure of the league: a mark a method, with its interval.

    `methods`: in the order of their colors.
    """
    panels = [name for name in PANELS if any(row.measures.get(name) for row in league)]
    lines = -(-len(panels) // 2)
    bar = 0.42 * len(league) + 0.2
    height = lines * (bar + 1.0) + 0.5
    with canvas(13.0, height, "League of methods: means and intervals") as (figure, place):
        for number, measure in enumerate(panels):
            metric = MEASURES[measure]
            row, column = divmod(number, 2)
            axes = place(measure, 1.75 + 6.4 * column, 0.5 + (lines - 1 - row) * (bar + 1.0), 4.3, bar)
            for line, one in enumerate(league):
                _mark_interval(axes, one, measure, -line, methods.index(one.method), metric.factor)
            axes.set_yticks(-np.arange(len(league)), [one.method for one in league])
            axes.set(ylim=(-len(league) + 0.4, 0.6), title=metric.title)
            low, far = axes.get_xlim()
            axes.set_xlim(0.0, 1.3 * max(far, low, 1e-9))
    return figure


def _mark_interval(axes: Any, row: Row, measure: str, line: int, number: int, factor: float) -> None:
    """Draw the mark of a method with its interval, and the mean beside it."""
    found = row.measures.get(measure)
    if found is None:
        axes.text(0.0, line, " –", va="center", fontsize=11, color=INK)
        return
    mean, half = found.mean * factor, (found.half or 0.0) * factor
    axes.errorbar(
        mean, line, xerr=half, color=LINES[number % len(LINES)], marker=MARKS[number % len(MARKS)],
        markersize=8, capsize=4,
    )  # fmt: skip
    axes.annotate(
        f"{mean:.3g}", (mean + half, line), xytext=(8, 0), textcoords="offset points", va="center",
        fontsize=11,
    )  # fmt: skip
