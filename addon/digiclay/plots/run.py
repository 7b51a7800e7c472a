"""Plots of a run: heights and force over time, and the final surface."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.metrics.metric_table import METRICS
from ..core.metrics.summary import compute_metrics, find_contact_rows, split_fingers, sum_cells
from ..core.model.control_interface import SetPoint
from .bed import History, array, draw_map, draw_path, draw_relief, ends
from .figure import DASHES, INK, LINES, MM, SHADE, canvas, legend_above

if TYPE_CHECKING:  # only named in annotations
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Letter of each chosen cell, in the order in which the fingertip passes them.
LETTERS = "ABCDEF"
#: Lines of fingers beyond the sixth have the same colors again.
STYLES = ("-", ":", (0, (1, 1, 4, 1)), (0, (8, 1)), (0, (3, 1)), (0, (6, 2, 1, 2)))
#: Metrics in the picture of a session.
FIGURES = (
    "rfd",
    "rfd_shaping",
    "max_total_force",
    "contact_loss_share",
    "lag_mean",
    "height_range",
)


def session_cells(history: History) -> list[int]:
    """Choose up to six cells along the fingertip path in contact, evenly spaced.

    They are different, in the order in which the fingertip passes them, the first and the last
    contact among them. Without any contact they are of those that moved, from most to least, evenly
    spaced: those that moved most may be neighbors, and alike. Of several fingertips
    each of the first six has the cell under it in the middle of its contact.
    """
    count = len(LETTERS)
    if "finger_force" in history:
        return _find_middle_cells(history)[:count]
    position, height = array(history, "position"), array(history, "height")
    touching = np.flatnonzero(find_contact_rows(array(history, "total_force")))
    if not len(touching):
        travel = np.ptp(height, axis=0)
        rank = np.linspace(0.0, max(1, np.count_nonzero(travel)) - 1, count).round().astype(int)
        return list(dict.fromkeys(np.argsort(-travel, kind="stable")[rank].tolist()))
    finger = array(history, "fingertip")[touching, :2]
    stretch, pressed = np.hypot(*np.diff(finger, axis=0).T), np.diff(touching) == 1
    # The way through the air to the next place is one step at most: its ends are worth a cell, no
    # more.
    stretch[~pressed] = np.minimum(stretch[~pressed], stretch[pressed].sum() / (count - 2))
    traveled = np.concatenate([[0.0], np.cumsum(stretch)])
    steps = np.linspace(0.0, traveled[-1], count)
    evenly = finger[np.argmin(np.abs(traveled - steps[:, None]), axis=1)]
    nearest = np.argmin(np.sum((evenly[:, None] - position[None]) ** 2, axis=2), axis=1)
    return list(dict.fromkeys(nearest.tolist()))


def _find_middle_cells(history: History) -> list[int]:
    """Return the cell under each fingertip in the middle of its contact, or where it begins without any."""
    position, cells = array(history, "position"), []
    for finger in split_fingers(history):
        touching = np.flatnonzero(find_contact_rows(finger["total_force"]))
        place = finger["fingertip"][touching[len(touching) // 2] if len(touching) else 0, :2]
        cells.append(int(np.argmin(np.sum((position - place) ** 2, axis=1))))
    return cells


def session_figure(history: History, set_point: SetPoint | None) -> Figure:
    """Draw heights of chosen cells and the total force over time, as the paper's Fig. 8 does.

    Of several fingertips it is the force of each. Without a `set_point` neither it nor a deviation
    from it is shown. The axes are, by label: ``heights``, ``force``, ``map`` with its ``scale``,
    and ``figures``.
    """
    several, marked = "finger_force" in history, ", bars: served" if "served" in history else ""
    letters = [str(number) for number in range(1, len(LINES) + 1)] if several else LETTERS
    time, height = array(history, "time"), array(history, "height")
    with canvas(12.5, 6.3) as (figure, place):
        heights, plan = place("heights", 0.8, 2.95, 6.95, 3.0), place("map", 8.62, 3.1, 3.12, 2.85)
        force = place("force", 0.8, 0.65, 6.95, 1.7)
        figures = place("figures", 8.62, 0.65, 3.78, 1.7)
        draw_map(plan, history, "Where the cells are")
        for name, color, cell in zip(letters, LINES, session_cells(history), strict=False):
            if "served" in history:
                _mark_served(heights, time, array(history, "served")[:, cell], color)
            heights.plot(time, height[:, cell] * MM, color=color, label=name)
            spot = array(history, "position")[cell] * MM
            disc = {
                "markersize": 16,
                "markeredgecolor": color,
                "markeredgewidth": 2.6,
                "clip_on": False,
            }
            plan.plot(*spot, "o", color="white", **disc)
            plan.annotate(
                name, spot, fontsize=10, fontweight="bold", ha="center", va="center_baseline"
            )
        heights.set_ylim(ends(np.array(heights.get_ylim()), 2.0))
        heights.set(ylabel="height (mm)", xlim=ends(time, 0.1))
        heights.set_title("Heights of cells" + (" under the fingers" if several else marked))
        heights.tick_params(labelbottom=False)
        shade_contact(heights, history)
        wanted, label = None, ""
        if set_point is not None:
            fingers = [
                set_point.total(sum_cells(finger).following) for finger in split_fingers(history)
            ]
            # All fingers have the same set point where it does not depend on cells.
            wanted = np.fmax.reduce(fingers)
            label = f"set point {set_point.force:g} N{' per cell' if set_point.per_cell else ''}"
        draw_force(force, history, wanted, label)
        force.set(xlabel="time (s)", ylabel="force (N)", ylim=(0.0, None), xlim=ends(time, 0.1))
        presser = "bodies" if "body_force" in history else "fingertip"
        force.set_title("Forces" if several else f"Total force on the {presser}")
        legend_above(heights)
        for axes in (heights, force):
            axes.yaxis.set_label_coords(-0.085, 0.5)
        _write_figures(figures, compute_metrics(history, set_point))
    return figure


def draw_force(axes: Axes, history: History, wanted: ArrayLike | None, label: str) -> None:
    """Draw the total force over time, the one asked for (t,), N, dashed, and when the fingertip touches.

    Of several fingertips the force of each, the first six in the colors of their cells; the legend
    has the first one of each further style.
    """
    time, asked = array(history, "time"), LINES[1]
    if "finger_force" in history:
        asked = INK
        for number, force in enumerate(array(history, "finger_force").reshape(len(time), -1).T):
            again, color = divmod(number, len(LINES))
            name = str(number + 1) if again and not color else None
            style, shown = STYLES[again], LINES[color]
            axes.plot(time, force, color=shown, linestyle=style, linewidth=1.1, label=name)
    else:
        axes.plot(
            time, array(history, "total_force"), color=INK, linewidth=1.3, label="total force"
        )
    bodies = array(history, "body_force").sum(axis=2).T if "body_force" in history else ()
    alone = len(bodies) == 1 and "finger_force" not in history
    for number, force in enumerate(() if alone else bodies):
        style, name = STYLES[number % len(STYLES)], f"body {number + 1}"
        axes.plot(time, force, color=INK, linestyle=style, linewidth=1.1, label=name)
    if wanted is not None:
        axes.plot(time, wanted, color=asked, linewidth=1.3, linestyle=DASHES, label=label)
    full = len(axes.get_lines()) > 4 * len(LINES)  # of the legend's line
    shade_contact(axes, history, None if full else "in contact")
    legend_above(axes, columns=40)


def shade_contact(axes: Axes, history: History, label: str | None = None) -> None:
    """Shade the time in contact over the whole height of the axes."""
    touching, across = find_contact_rows(array(history, "total_force")), axes.get_xaxis_transform()
    shade: dict[str, Any] = {"color": SHADE, "linewidth": 0, "label": label}
    axes.fill_between(array(history, "time"), 0, 1, where=touching, transform=across, **shade)


def _mark_served(axes: Axes, time: ArrayLike, served: Any, color: str) -> None:
    """Draw a strip below the former ones at the top of the axes: when a cell's line is addressed."""
    top = 1.0 - 0.02 * len(axes.collections)
    upper, across = np.where(served, top, top - 0.015), axes.get_xaxis_transform()
    strip: dict[str, Any] = {"color": color, "linewidth": 0, "step": "post", "zorder": 1.5}
    axes.fill_between(time, top - 0.015, upper, transform=across, **strip)


def surface_figure(history: History) -> Figure:
    """Draw the final surface in relief and from above, as the paper's Fig. 10 does.

    The axes are, by label: ``relief`` (3-D, to scale) and ``map``, with the fingertip's path,
    with its ``scale``. Raises ParameterError when the bed is a single row or column.
    """
    with canvas(12.5, 5.5) as (figure, place):
        # The relief is cut off at the edge of its axes, so they reach under the title and the
        # margins.
        draw_relief(
            place("relief", -0.6, -0.75, 8.1, 6.7, projection="3d", computed_zorder=False), history
        )
        figure.text(0.3 / 12.5, 5.14 / 5.5, "Final surface, to scale")
        plan = place("map", 7.5, 0.65, 4.3, 4.4)
        draw_map(plan, history, "From above")
        draw_path(plan, history)
    return figure


def _write_figures(axes: Axes, metrics: dict[str, float | None]) -> None:
    """Write the metrics of a session as text."""
    axes.set_axis_off()
    axes.set_title("Metrics")
    names = [
        name for name in FIGURES if metrics["set_point"] is not None or not name.startswith("rfd")
    ]
    for line, name in enumerate(names):
        value, metric, y = metrics[name], METRICS[name], 0.92 - 0.158 * line
        text = "–" if value is None else f"{value * metric.factor:.3g} {metric.shown}"
        axes.text(0.0, y, metric.label, va="top")
        axes.text(1.0, y, text, va="top", ha="right")
