"""Plots of a study's indices, of a tuning's front, and of a league."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from digiclay.core.base.arrays import Cells, Flags, Floats
from digiclay.core.base.quantity import show_digits
from digiclay.core.metrics.metric_table import Metric
from digiclay.core.metrics.summary import find_weber_fractions
from digiclay.core.studies.evaluation import FIGURES
from digiclay.plots.figure import DASHES, INK, LINES, SHADE, STYLE, empty
from digiclay.plots.sweep import read_unit

from .indices import CONFIDENCE, Indices
from .league import MEASURES, find_interval, find_trajectories, list_values

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .league import Interval, Row, Table


#: What is left free around panels, inches.
PADS = dict.fromkeys(("figure.constrained_layout.w_pad", "figure.constrained_layout.h_pad"), 0.12)


@contextmanager
def panels(
    title: str, width: float, height: float, rows: int, columns: int
) -> Iterator[tuple[Figure, Any]]:
    """Give a figure, inches, and its panels, row by row."""
    with empty(width, height, STYLE | PADS, layout="constrained") as figure:
        figure.suptitle(title, x=0.01, ha="left", fontsize=14, fontweight="bold")
        yield figure, figure.subplots(rows, columns, squeeze=False).ravel()


def name_rows(axes: Any, names: Sequence[str]) -> None:
    """Give the panel a row for each name, the first one at the top: row k is at -k."""
    axes.set_yticks(-np.arange(len(names)), names)
    axes.set_ylim(-len(names) + 0.4, 0.6)


def put_legend_above(axes: Any) -> None:
    """Put the legend above the panel."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=6, columnspacing=1.2)


#: The largest value shown over the least one from which on an axis is logarithmic.
WIDE = 20.0
#: Share of the trials that the axes show at least.
SHOWN = 0.85


def draw_front(
    names: Sequence[str],
    values: Floats,
    sound: Flags,
    front: Cells,
    chosen: int,
    title: str,
) -> Figure:
    """Draw the trials over two outputs; the first one upwards, the second one to the right."""
    units = [
        read_unit(FIGURES[name].unit, values[sound, number]) for number, name in enumerate(names)
    ]
    shown = values * [factor for factor, _ in units]
    y_label, x_label = (
        f"{name} ({unit})" if unit else name for name, (_, unit) in zip(names, units, strict=True)
    )
    trials = np.arange(1, len(shown))
    followed, lost = trials[sound[1:]], trials[~sound[1:]]
    lost = lost[np.isfinite(shown[lost]).all(axis=1)]
    edge = {"edgecolors": INK, "linewidths": 0.8, "zorder": 4}
    marks: tuple[tuple[Any, str, str, int, str, dict[str, Any]], ...] = (
        (followed, "o", "#B9C7D3", 22, f"{len(followed)} trials", {}),
        (lost, "x", "#D9C3B5", 24, f"{len(lost)} without the fingertip", {}),
        ([0], "D", LINES[1], 75, "unchanged scene", edge),
        ([chosen], "*", LINES[2], 260, "chosen", edge),
    )
    with panels(title, 9.0, 6.2, 1, 1) as (figure, (axes,)):
        for rows, marker, color, size, label, look in marks:
            if len(rows):
                places = shown[rows, 1], shown[rows, 0]
                axes.scatter(*places, size, color, marker=marker, label=label, **look)
        axes.plot(shown[front, 1], shown[front, 0], "o-", color=LINES[0], zorder=3, label="front")
        outside = _frame(axes, shown, np.append(front, 0), trials)
        note = f"\n{outside} trials are outside the axes" if outside else ""
        axes.set(xlabel=x_label + note, ylabel=y_label)
        put_legend_above(axes)
    return figure


def _frame(axes: Any, shown: Floats, inside: Cells, trials: Cells) -> int:
    """Set the ends of the axes around front, unchanged scene and most trials; return how many are outside."""
    out = np.zeros(len(shown), dtype=bool)
    for column, name in ((0, "y"), (1, "x")):
        low, high = shown[inside, column].min(), shown[inside, column].max()
        values = shown[trials, column]
        if np.isfinite(values).any():
            most = np.quantile(values[np.isfinite(values)], SHOWN, method="higher")
            high = max(high, most)
        if low > 0.0 and high / low > WIDE:
            axes.set(**{f"{name}scale": "log"})
            ends = low / 1.3, high * 1.3
        else:
            pad = 0.06 * max(high - low, 0.05 * abs(high), 1e-12)
            ends = low - pad, high + pad
        axes.set(**{f"{name}lim": ends})
        out |= (shown[:, column] < ends[0]) | (shown[:, column] > ends[1])
    return int(np.count_nonzero(out[trials]))


#: Height of a bar; parameters are 1 apart.
BAR = 0.36
#: The axes reach from 0 to 1 at least, and no farther than this for wide intervals.
FARTHEST = (-0.4, 1.4)
#: Bars of a parameter: their order, side, color, hatch and label.
BARS = (
    ("first", 0.5, LINES[0], "", "alone (first order)"),
    ("total", -0.5, LINES[1], "////", f"with interactions (total), {CONFIDENCE:.0%} intervals"),
)


def draw_indices(keys: Sequence[str], outputs: Mapping[str, Indices | None], title: str) -> Figure:
    """Draw first-order and total indices of each output, those with the largest totals at the top."""
    totals = [indices["total"][0] for indices in outputs.values() if indices is not None]
    order = np.argsort(-np.max(totals, axis=0)) if totals else np.arange(len(keys))
    rows, whisker = -np.arange(len(keys)), {"ecolor": INK, "elinewidth": 1.1, "capsize": 2.5}
    size = 1.5 + 3.4 * len(outputs), 1.8 + 0.52 * len(keys)
    with panels(title, *size, 1, len(outputs)) as (figure, axes):
        for panel, (name, indices) in zip(axes, outputs.items(), strict=True):
            for each, side, color, hatch, label in BARS:
                values, interval = (
                    (part[order] for part in indices[each]) if indices else (rows * 0.0, None)
                )
                look = {"hatch": hatch, "edgecolor": "white", "linewidth": 0.0, "label": label}
                places = {"y": rows + side * BAR, "height": BAR, "color": color}
                panel.barh(width=values, xerr=interval, error_kw=whisker, **places, **look)
            if indices is None:
                panel.text(
                    0.5, 0.5, "does not vary", transform=panel.transAxes, ha="center", va="center"
                )
            name_rows(panel, [keys[i] for i in order] if panel is axes[0] else [""] * len(keys))
            panel.set(title=name, xlabel="share of the variance")
            panel.tick_params(axis="y", length=0)
            panel.grid(visible=False, axis="y")
            panel.axvline(0.0, color=INK, linewidth=0.8)
        ends = np.array([panel.get_xlim() for panel in axes])
        low = max(min(ends.min(), -0.05), FARTHEST[0])
        high = min(max(ends.max(), 1.05), FARTHEST[1])
        for panel in axes:
            panel.set_xlim(low, high)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return figure


#: Marks of the methods, which differ without their colors.
MARKS = "osD^vP*X<>"
#: Panels of the league.
PANELS = (
    "lag_mean",
    "ridge_unevenness",
    "ridge-limit",
    "lift-limit",
    "max_total_force",
    "period_cost",
)


def look_of(number: int) -> dict[str, Any]:
    """Return color and marker of a method or a variant."""
    return {"color": LINES[number % len(LINES)], "marker": MARKS[number % len(MARKS)]}


def mark(
    axes: Any, row: float, mean: Interval, number: int, factor: float, **more: Any
) -> dict[str, Any]:
    """Mark the mean of a method in a row, with its interval; return the look of the method's marks."""
    look = look_of(number)
    half = (mean.half or 0.0) * factor
    axes.errorbar(
        mean.mean * factor, row, xerr=half, linestyle="", markersize=8, capsize=4, **look, **more
    )
    return look


def draw_rfd(table: Table, methods: Sequence[str]) -> Figure:
    """Draw the RFD of every trajectory: a small mark per seed, a large one for the mean, with its interval.

    The shaded band holds the just noticeable differences of the first method's set point.
    """
    from matplotlib.ticker import LogFormatter

    names = [
        name
        for name in find_trajectories(table)
        if any(list_values(table, method, name, "rfd") for method in methods)
    ]
    size = 11.0, 0.27 * max(len(names), 1) + 1.7
    with panels("Reference force deviation by trajectory", *size, 1, 1) as (figure, (axes,)):
        for number, method in enumerate(methods):
            label: str | None = method
            for line, name in enumerate(names):
                values = [rfd for rfd in list_values(table, method, name, "rfd") if rfd]
                if mean := find_interval(values):
                    row = -line - 0.18 * (number % 3 - 1)
                    look = mark(axes, row, mean, number, 1e3, label=label)
                    small = {"linestyle": "", "markersize": 3, "alpha": 0.6, **look}
                    axes.plot(1e3 * np.array(values), np.full(len(values), row), **small)
                    label = None
        points = [
            figures.get("set_point")
            for (method, _, _), figures in table.items()
            if method == methods[0]
        ]
        set_point = next((value for value in points if value is not None), None)
        if set_point is not None:
            edges = [share * set_point / 1e-3 for share in find_weber_fractions(set_point)]
            axes.axvspan(*edges, color=SHADE, zorder=0, label="one JND of the set point")
        name_rows(axes, names)
        axes.set(xlabel="RFD (mN)", xscale="log")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(LogFormatter(minor_thresholds=(1.0, 0.4)))  # 20, not 2 × 10¹
        put_legend_above(axes)
    return figure


def draw_measures(league: Sequence[Row], methods: Sequence[str]) -> Figure:
    """Draw one panel per measure of the league: one mark per method, its interval, the mean beside it."""
    names = [name for name in PANELS if any(row.measures.get(name) for row in league)]
    lines = -(-len(names) // 2)
    size = 13.0, lines * (0.42 * len(league) + 1.2) + 0.5
    with panels("League of methods: means and intervals", *size, lines, 2) as (figure, axes):
        for panel in axes[len(names) :]:
            panel.set_axis_off()
        for panel, name in zip(axes, names, strict=False):
            factor = MEASURES[name].factor
            for line, row in enumerate(league):
                mean = row.measures.get(name)
                if mean is None:
                    panel.text(0.0, -line, " –", va="center", color=INK)
                    continue
                mark(panel, -line, mean, methods.index(row.method), factor)
                right = (mean.mean + (mean.half or 0.0)) * factor, -line
                beside = {
                    "xytext": (8, 0),
                    "textcoords": "offset points",
                    "va": "center",
                    "fontsize": 11,
                }
                panel.annotate(show_digits(mean.mean * factor, 3), right, **beside)
            name_rows(panel, [row.method for row in league])
            panel.set(title=MEASURES[name].title, xlim=(0.0, 1.3 * max(panel.get_xlim()[1], 1e-9)))
    return figure


#: Share of a limit below which an axis shows nothing.
NEGLIGIBLE = 0.02


def draw_limits(
    minimized: str, limits: Mapping[Metric, float], curves: Mapping[str, Floats]
) -> Figure:
    """Draw the worst figures of candidates, a panel for each limit.

    `curves`: (candidates, 1 + limits), what is minimized and the figures, SI, by variant.
    """
    from matplotlib.ticker import LogLocator, NullLocator

    size = 1.0 + 5.4 * len(limits), 5.2
    with panels("Worst cases", *size, 1, len(limits)) as (figure, axes):
        for column, (panel, (metric, most)) in enumerate(zip(axes, limits.items(), strict=True), 1):
            for number, (name, curve) in enumerate(curves.items()):
                rows = curve[np.isfinite(curve[:, column])]
                values = metric.factor * rows[:, column]
                panel.plot(rows[:, 0], values, label=name, **look_of(number))
            limit = metric.factor * most
            panel.axhline(limit, color=INK, linestyle=DASHES, linewidth=1.2, label="limit")
            panel.set(xlabel=minimized, ylabel=metric.title, yscale="log")
            panel.set_ylim(bottom=max(panel.get_ylim()[0], NEGLIGIBLE * limit))
            panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            panel.yaxis.set_minor_locator(NullLocator())
            panel.yaxis.set_major_formatter("{x:g}")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower right", ncols=4)
    return figure
