"""Plots of a study's indices and of a tuning's front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.metrics.summary import find_weber_fractions
from digiclay.core.studies.evaluation import FIGURES
from digiclay.plots.figure import INK, LINES, SHADE, canvas, legend_above
from digiclay.plots.sweep import read_unit
from numpy.typing import NDArray

from .indices import CONFIDENCE, Indices
from .league import MEASURES, find_interval, list_values, show_digits

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .league import Row, Table


#: The largest value shown over the least one from which on an axis is logarithmic.
WIDE = 20.0
#: Share of the trials that the axes show at least.
SHOWN = 0.85


def draw_front(
    names: Sequence[str], values: Floats, sound: NDArray[np.bool_], front: NDArray[np.intp], chosen: int,
    title: str,
) -> Figure:  # fmt: skip
    """Draw the trials over two outputs; the first one upwards, the second one to the right."""
    units = [read_unit(FIGURES[name].unit, values[sound, number]) for number, name in enumerate(names)]
    shown = values * [factor for factor, _ in units]
    with canvas(9.0, 6.2, title) as (figure, place):
        axes = place("front", 1.0, 0.8, 7.7, 4.55)
        trials = np.arange(1, len(shown))
        kept, lost = trials[sound[1:]], trials[~sound[1:]]
        lost = lost[np.isfinite(shown[lost]).all(axis=1)]
        _mark(axes, shown[kept], "o", "#B9C7D3", 22, f"{len(kept)} trials")
        if lost.size:
            _mark(axes, shown[lost], "x", "#D9C3B5", 24, f"{len(lost)} without the fingertip")
        steps: Any = shown[front]
        axes.plot(steps[:, 1], steps[:, 0], "o-", color=LINES[0], markersize=6, zorder=3, label="front")
        _mark(axes, shown[[0]], "D", LINES[1], 75, "unchanged scene")
        _mark(axes, shown[[chosen]], "*", LINES[2], 260, "chosen")
        axes.set_ylabel(_label(names[0], units[0][1]))
        axes.set_xlabel(_label(names[1], units[1][1]))
        outside = _frame(axes, shown, np.concatenate([front, [0]]), trials)
        if outside:
            note = f"{outside} trials are outside the axes"
            axes.text(1.0, -0.155, note, transform=axes.transAxes, ha="right")
        close = {"borderaxespad": 0.2, "handletextpad": 0.3, "columnspacing": 1.2}
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=5, **close)
    return figure


def _mark(axes: Any, points: Floats, marker: str, color: str, size: float, label: str) -> None:
    """Draw markers, large ones over small ones."""
    large = size > 30
    look: dict[str, Any] = {"marker": marker, "label": label, "zorder": 4 if large else 2}
    if marker != "x":
        look |= {"edgecolors": INK if large else "none", "linewidths": 0.8}
    axes.scatter(points[:, 1], points[:, 0], size, color, **look)


def _label(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit else name


def _frame(axes: Any, shown: Floats, inside: NDArray[np.intp], trials: NDArray[np.intp]) -> int:
    """Set the ends of the axes around front, unchanged scene and most trials; return how many are outside."""
    out = np.zeros(len(shown), dtype=bool)
    for column, name in ((0, "y"), (1, "x")):
        values = shown[trials, column]
        most = np.quantile(values[np.isfinite(values)], SHOWN, method="higher")
        low, high = shown[inside, column].min(), max(shown[inside, column].max(), most)
        if low > 0.0 and high / low > WIDE:
            axes.set(**{f"{name}scale": "log"})
            ends = low / 1.3, high * 1.3
        else:
            pad = 0.06 * max(high - low, 0.05 * abs(high), 1e-12)
            ends = low - pad, high + pad
        axes.set(**{f"{name}lim": ends})
        out |= (shown[:, column] < ends[0]) | (shown[:, column] > ends[1])
    return int(np.count_nonzero(out[trials]))


#: Inches: a panel, and what stands around it.
ACROSS, A_PARAMETER, BESIDE, GAP, ABOVE, BELOW = 3.1, 0.52, 0.35, 0.35, 0.95, 0.65
#: Inches a letter of a parameter's name takes at most.
LETTER = 0.105
#: Height of a bar; parameters are 1 apart.
BAR = 0.36
#: The axes reach from 0 to 1 at least, and no farther than this for wide intervals.
FARTHEST = (-0.4, 1.4)


def draw_indices(keys: Sequence[str], found: Mapping[str, Indices | None], title: str) -> Figure:
    """Draw first-order and total indices of each output, those with the largest totals at the top."""
    varying = [indices for indices in found.values() if indices is not None]
    low, high = _find_ends(varying)
    totals = [indices["total"][0] for indices in varying]
    order = np.argsort(np.max(totals, axis=0)) if totals else np.arange(len(keys))
    beside = BESIDE + LETTER * max(len(key) for key in keys)
    width = beside + len(found) * (ACROSS + GAP)
    up = A_PARAMETER * len(keys) + 0.2
    height = ABOVE + up + BELOW
    with canvas(width, height, title) as (figure, place):
        for number, (name, indices) in enumerate(found.items()):
            axes = place(name, beside + number * (ACROSS + GAP), BELOW, ACROSS, up)
            axes.set(xlim=(low, high), ylim=(-0.6, len(keys) - 0.4), title=name)
            axes.set_xlabel("share of the variance")
            axes.set_yticks(range(len(keys)), [keys[i] for i in order] if number == 0 else [])
            axes.tick_params(axis="y", length=0)
            axes.grid(visible=False, axis="y")
            axes.axvline(0.0, color=INK, linewidth=0.8)
            if indices is None:
                axes.text(0.5, 0.5, "does not vary", transform=axes.transAxes, ha="center", va="center")
            else:
                _draw_bars(axes, indices, order)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        if handles:
            figure.legend(handles, labels, loc="upper right", ncols=2, bbox_to_anchor=(1.0, 1.0))
    return figure


def _find_ends(found: Sequence[Indices]) -> tuple[float, float]:
    """Return the ends of the axes that show the bars with their intervals."""
    bars = [indices[order] for indices in found for order in ("first", "total")]
    low = min([0.0, *(float(np.min(values - interval)) for values, interval in bars)])
    high = max([1.0, *(float(np.max(values + interval)) for values, interval in bars)])
    return max(low - 0.05, FARTHEST[0]), min(high + 0.05, FARTHEST[1])


def _draw_bars(axes: Any, indices: Indices, order: Any) -> None:
    """Draw the bars of an output."""
    rows, whisker = np.arange(len(order)), {"ecolor": INK, "elinewidth": 1.1, "capsize": 2.5}
    total = f"with interactions (total), {CONFIDENCE:.0%} intervals"
    for name, label, side, color, hatch in (
        ("first", "alone (first order)", 0.5, LINES[0], ""), ("total", total, -0.5, LINES[1], "////"),
    ):  # fmt: skip
        values, interval = (part[order] for part in indices[name])
        look = {"color": color, "hatch": hatch, "edgecolor": "white", "linewidth": 0.0, "label": label}
        axes.barh(rows + side * BAR, values, BAR, xerr=interval, error_kw=whisker, **look)


#: Marks of the methods, which differ without their colors.
MARKS = "osD^vP*X<>"
#: Panels of the league.
PANELS = ("lag_mean", "ridge_unevenness", "ridge-limit", "lift-limit", "max_total_force", "period_cost")


def draw_rfd(table: Table, methods: Sequence[str]) -> Figure:
    """Draw the RFD of every trajectory: a small mark a seed, a large one the mean, with its interval.

    The shaded band holds the just noticeable differences of the first method's set point.
    """
    names = list(dict.fromkeys(name for (_, name, _), found in table.items() if found.get("rfd") is not None))
    from matplotlib.ticker import LogFormatter

    high = 0.27 * max(len(names), 1)
    with canvas(11.0, high + 1.7, "Reference force deviation by trajectory") as (figure, place):
        axes = place("rfd", 1.7, 0.75, 8.9, high)
        for number, method in enumerate(methods):
            _mark_method(axes, table, method, number, names)
        points = [found.get("set_point") for (own, _, _), found in table.items() if own == methods[0]]
        set_point = next((value for value in points if value is not None), None)
        if set_point is not None:
            edges = [share * set_point / 1e-3 for share in find_weber_fractions(set_point)]
            axes.axvspan(*edges, color=SHADE, zorder=0, label="one JND of the set point")
        axes.set_yticks(-np.arange(len(names)), names)
        axes.set(ylim=(-len(names) + 0.4, 0.6), xlabel="RFD (mN)", xscale="log")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(LogFormatter(minor_thresholds=(1.0, 0.4)))  # 20, not 2 × 10¹
        legend_above(axes)
    return figure


def _mark_method(axes: Any, table: Table, method: str, number: int, names: Sequence[str]) -> None:
    """Draw the marks of a method."""
    style: dict[str, Any] = {"color": LINES[number % len(LINES)], "marker": MARKS[number % len(MARKS)]}
    shift = 0.18 * (number % 3 - 1)
    label: str | None = method
    for line, name in enumerate(names):
        values = [1e3 * rfd for rfd in list_values(table, method, name, "rfd") if rfd]
        if mean := find_interval(values):
            row = -line - shift
            axes.plot(np.array(values), np.full(len(values), row), ls="", markersize=3, alpha=0.6, **style)
            whole = {"linestyle": "", "markersize": 7, "capsize": 3, "label": label}
            axes.errorbar(mean.mean, row, xerr=mean.half, **whole, **style)
            label = None


def draw_measures(league: Sequence[Row], methods: Sequence[str]) -> Figure:
    """Draw a panel a measure of the league: a mark a method, with its interval."""
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
    interval = row.measures.get(measure)
    if interval is None:
        axes.text(0.0, line, " –", va="center", fontsize=11, color=INK)
        return
    mean, half = interval.mean * factor, (interval.half or 0.0) * factor
    style = {"color": LINES[number % len(LINES)], "marker": MARKS[number % len(MARKS)]}
    axes.errorbar(mean, line, xerr=half, markersize=8, capsize=4, **style)
    beside = {"xytext": (8, 0), "textcoords": "offset points", "va": "center", "fontsize": 11}
    axes.annotate(show_digits(mean), (mean + half, line), **beside)
