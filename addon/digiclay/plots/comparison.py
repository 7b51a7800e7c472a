"""Plot of the metrics of several methods."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..core.session.run_scene import RUN_METRICS
from .figure import INK, LINES, canvas, legend_above

#: Metrics that are drawn.
PANELS = (
    "rfd_shaping", "force_deviation", "height_deviation", "ridge_error", "lag_max", "contact_loss_share",
    "losses", "run_time",
)  # fmt: skip


def comparison(
    found: Mapping[str, Mapping[str, float | None]],
    forces: Mapping[str, tuple[Any, Any, Any]],
    name: str,
) -> Any:
    """Draw the total force over time, and a bar a method for each metric.

    `forces`: time, s, total force, N, and the total force asked for, NaN where none is, by method.
    """
    colors = {method: LINES[i % len(LINES)] for i, method in enumerate(found)}
    bar = 0.3
    high = bar * len(found) + 0.1
    height = 4.2 + 2 * (high + 0.85)
    with canvas(12.5, height, name) as (figure, place):
        force = place("force", 0.85, height - 3.6, 11.3, 2.5)
        for method, (time, total, _) in forces.items():
            force.plot(time, total, color=colors[method], linewidth=1.4, label=method)
        for method, (time, _, wanted) in forces.items():
            if not np.all(np.isnan(wanted)):
                force.plot(time, wanted, color=colors[method], linewidth=1.0, linestyle=(0, (5, 3)))
        force.plot([], [], color=INK, linewidth=1.0, linestyle=(0, (5, 3)), label="set points")
        force.set(xlabel="time (s)", ylabel="total force (N)", ylim=(0.0, None), title="Total force")
        force.set_xlim(0.0, max(float(time[-1]) for time, _, _ in forces.values()))
        legend_above(force)
        for number, key in enumerate(PANELS):
            metric = RUN_METRICS[key]
            row, column = divmod(number, 4)
            bottom = 0.3 + (1 - row) * (high + 0.85)
            axes = place(key, 0.4 + 3.02 * column, bottom, 2.35, high)
            _bars(axes, [found[method][key] for method in found], list(colors.values()), metric.factor)
            axes.set_title(metric.title, fontsize=11)
    return figure


def _bars(axes: Any, values: list[float | None], colors: list[str], factor: float) -> None:
    """Draw a bar a method, its value beside it; a dash where there is none."""
    longest = max((value * factor for value in values if value is not None), default=0.0) or 1.0
    for line, (value, color) in enumerate(zip(values, colors, strict=True)):
        size = 0.0 if value is None else value * factor
        axes.barh(-line, size, height=0.7, color=color)
        said = "–" if value is None else f"{size:.3g}"
        axes.text(max(size, 0.0) + 0.03 * longest, -line, said, va="center", fontsize=11)
    axes.set(xlim=(0.0, 1.3 * longest), ylim=(-len(values) + 0.4, 0.6))
    axes.set_yticks(-np.arange(len(values)), [""] * len(values))
    axes.tick_params(left=False, bottom=False, labelbottom=False)
    axes.grid(False)
    axes.spines["bottom"].set_visible(False)
