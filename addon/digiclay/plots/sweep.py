"""Plots of several runs: a line over one axis of a sweep, a heat map over two; metrics of several methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.base.arrays import Floats
from ..core.session.run_scene import RUN_METRICS
from ..core.studies.axes import Column
from ..core.studies.evaluation import FIGURES
from .figure import DASHES, INK, LINES, canvas, legend_above

if TYPE_CHECKING:  # only named in annotations
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Units people read: factor and name.
READ: dict[str, tuple[float, str]] = {
    "m": (1e3, "mm"),
    "m3": (1e9, "mm³"),
    "Pa": (1e-5, "bar"),
    "m2/s": (1e6, "mm²/s"),
    "kg/m3": (1.0, "kg/m³"),
    "m/s": (1e3, "mm/s"),
    "1": (1.0, ""),
}
#: Cells of a heat map along a side whose values are still written into it.
WRITTEN = 10
#: Most labels on an axis.
LABELS = 12


def sweep_figure(columns: Sequence[Column], name: str, values: Floats) -> Figure:
    """Draw a figure over the one or two axes of a sweep."""
    meaning = FIGURES[name].doc
    factor, read = read_unit(FIGURES[name].unit, values)
    label = f"{name} ({read})" if read else name
    with canvas(9.0, 5.2 if len(columns) == 1 else 6.0) as (figure, place):
        # The meaning is a sentence: it goes above the axes, and the key beside them.
        figure.text(0.75 / 9.0, 0.955, meaning[0].upper() + meaning[1:], va="top", fontsize=11)
        if len(columns) == 1:
            _draw_line(place("sweep", 0.95, 0.8, 7.6, 3.75), columns[0], values * factor, label)
        else:
            axes, scale = place("sweep", 1.45, 0.85, 5.9, 4.5), place("scale", 7.55, 0.85, 0.2, 4.5)
            _draw_map(axes, scale, columns, values * factor, label)
    return figure


def read_unit(unit: str, values: Any) -> tuple[float, str]:
    """Return factor and name of the unit people read; times below half a second are read in ms."""
    if unit == "s":
        finite = [abs(value) for value in np.ravel(values) if np.isfinite(value)]
        return (1e3, "ms") if finite and max(finite) < 0.5 else (1.0, "s")
    return READ.get(unit, (1.0, unit))


def _draw_line(axes: Axes, column: Column, values: Floats, label: str) -> None:
    """Draw a line with a marker for each point."""
    shown, along = _shown(column)
    if column.numeric:
        positions, look = shown, "o-"
        axes.set_xscale("log" if column.logarithmic else "linear")
    else:
        positions, look = np.arange(len(values)), "o"
        axes.set_xticks(positions, [str(value) for value in column.values])
        axes.set_xlim(-0.5, len(values) - 0.5)
    order, missing = np.argsort(positions), positions[np.isnan(values)]
    axes.plot(
        positions[order], values[order], look, color=LINES[0], markersize=6 if column.numeric else 8
    )
    if missing.size:
        across = axes.get_xaxis_transform()
        axes.plot(
            missing,
            np.full(missing.size, 0.03),
            "x",
            color=LINES[1],
            transform=across,
            label="no result",
        )
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)
    axes.set(xlabel=along, ylabel=label)


def _draw_map(
    axes: Axes, scale: Axes, columns: Sequence[Column], values: Floats, label: str
) -> None:
    """Draw a heat map: every point one cell of equal size, the first axis to the right."""
    shown: Any = np.ma.masked_invalid(values.T)  # type: ignore[no-untyped-call]
    names: tuple[Any, ...] = axes.set_xlabel, axes.set_ylabel
    axes.set_facecolor("#DDDDDD")
    field = axes.pcolormesh(shown, cmap="cividis", edgecolors="white", linewidth=0.6)
    axes.grid(False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    for column, ticks, name in zip(columns, (axes.set_xticks, axes.set_yticks), names, strict=True):
        read, along = _shown(column)
        words = [f"{value:.4g}" if column.numeric else str(value) for value in read]
        every = -(-len(words) // LABELS)
        ticks(np.arange(len(words))[::every] + 0.5, words[::every])
        name(along)
    axes.tick_params(length=0)
    if max(values.shape) <= WRITTEN:
        _write_values(axes, shown)
    elif np.isnan(values).any():
        axes.text(1.0, 1.015, "gray: no result", transform=axes.transAxes, ha="right")
    figure: Any = axes.figure
    figure.colorbar(field, cax=scale, label=label).outline.set_visible(False)
    scale.grid(False)


def _write_values(axes: Axes, shown: Any) -> None:
    """Write each value into its cell, light on dark and dark on light."""
    low, high = shown.min(), shown.max()
    for (row, column), value in np.ndenumerate(shown.filled(np.nan)):
        finite = np.isfinite(value)
        bright = not finite or high == low or (value - low) / (high - low) > 0.5
        axes.text(
            column + 0.5,
            row + 0.5,
            f"{value:.3g}" if finite else "×",
            ha="center",
            va="center",
            fontsize=9.5,
            color=INK if bright else "white",
        )


def _shown(column: Column) -> tuple[Any, str]:
    """Return an axis's values in the unit people read, and its label."""
    if not column.numeric:
        return list(column.values), column.key
    values = np.array(column.values, dtype=np.float64)
    factor, unit = read_unit(column.unit, values)
    return values * factor, f"{column.key} ({unit})" if unit else column.key


#: Metrics that are drawn.
PANELS = (
    "rfd_shaping",
    "force_deviation",
    "height_deviation",
    "ridge_error",
    "lag_max",
    "contact_loss_share",
    "losses",
    "run_time",
)


def comparison(
    metrics: Mapping[str, Mapping[str, float | None]],
    forces: Mapping[str, tuple[Any, Any, Any]],
    name: str,
    called: str = "total force",
) -> Any:
    """Draw a force over time, by default the total one, and one bar per method and metric.

    `forces`: time, s, force, N, and the one asked for, NaN where none is, by method.
    """
    colors = {method: LINES[i % len(LINES)] for i, method in enumerate(metrics)}
    bar = 0.3
    high = bar * len(metrics) + 0.1
    height = 4.2 + 2 * (high + 0.85)
    with canvas(12.5, height, name) as (figure, place):
        force = place("force", 0.85, height - 3.6, 11.3, 2.5)
        dashed: dict[str, Any] = {"linewidth": 1.0, "linestyle": DASHES}
        for method, (time, total, wanted) in forces.items():
            force.plot(time, total, color=colors[method], linewidth=1.4, label=method)
            force.plot(time, wanted, color=colors[method], zorder=2.5, **dashed)
        force.plot([], [], color=INK, label="set points", **dashed)
        force.set(
            xlabel="time (s)", ylabel="force (N)", ylim=(0.0, None), title=called.capitalize()
        )
        force.set_xlim(0.0, max(float(time[-1]) for time, _, _ in forces.values()))
        legend_above(force)
        for number, key in enumerate(PANELS):
            metric = RUN_METRICS[key]
            row, column = divmod(number, 4)
            bottom = 0.3 + (1 - row) * (high + 0.85)
            axes = place(key, 0.4 + 3.02 * column, bottom, 2.35, high)
            _bars(
                axes,
                [metrics[method][key] for method in metrics],
                list(colors.values()),
                metric.factor,
            )
            axes.set_title(metric.title, fontsize=11)
    return figure


def _bars(axes: Any, values: list[float | None], colors: list[str], factor: float) -> None:
    """Draw one bar per method with its value beside it; a dash where there is none."""
    longest = max((value * factor for value in values if value is not None), default=0.0) or 1.0
    for line, (value, color) in enumerate(zip(values, colors, strict=True)):
        size = 0.0 if value is None else value * factor
        axes.barh(-line, size, height=0.7, color=color)
        label = "–" if value is None else f"{size:.3g}"
        axes.text(max(size, 0.0) + 0.03 * longest, -line, label, va="center", fontsize=11)
    axes.set(xlim=(0.0, 1.3 * longest), ylim=(-len(values) + 0.4, 0.6))
    axes.set_yticks(-np.arange(len(values)), [""] * len(values))
    axes.tick_params(left=False, bottom=False, labelbottom=False)
    axes.grid(False)
    axes.spines["bottom"].set_visible(False)
