"""Plot of Sobol indices: two bars a parameter with error bars, a panel an output."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from digiclay.plots.figure import INK, LINES, canvas

from .indices import CONFIDENCE, Indices

if TYPE_CHECKING:  # only named in annotations
    from matplotlib.figure import Figure

#: Inches: a panel, and what stands around it.
ACROSS, A_PARAMETER, BESIDE, GAP, ABOVE, BELOW = 3.1, 0.52, 0.35, 0.35, 0.95, 0.65
#: Inches a letter of a parameter's name takes at most.
LETTER = 0.105
#: Height of a bar; parameters are 1 apart.
BAR = 0.36
#: The axes reach from 0 to 1 at least, and no farther than this for wide intervals.
FARTHEST = (-0.4, 1.4)


def draw_indices(keys: Sequence[str], found: Mapping[str, Indices | None], title: str) -> Figure:
    """Draw first-order and total indices of each output; parameters with the largest totals are at the top.

    `keys`: the varied parameters; `found`: indices by output; None for one that does not vary, which has an
    empty panel. Returns its axes, by label: the outputs.
    """
    totals = [one.total for one in found.values() if one is not None]
    low, high = _find_ends([one for one in found.values() if one is not None])
    order = np.argsort(np.max(totals, axis=0)) if totals else np.arange(len(keys))
    beside = BESIDE + LETTER * max(len(key) for key in keys)
    width = beside + len(found) * (ACROSS + GAP)
    up = A_PARAMETER * len(keys) + 0.2
    height = ABOVE + up + BELOW
    with canvas(width, height, title) as (figure, place):
        for number, (name, one) in enumerate(found.items()):
            axes = place(name, beside + number * (ACROSS + GAP), BELOW, ACROSS, up)
            axes.set(xlim=(low, high), ylim=(-0.6, len(keys) - 0.4), title=name)
            axes.set_xlabel("share of the variance")
            axes.set_yticks(range(len(keys)), [keys[i] for i in order] if number == 0 else [])
            axes.tick_params(axis="y", length=0)
            axes.grid(visible=False, axis="y")
            axes.axvline(0.0, color=INK, linewidth=0.8)
            if one is None:
                axes.text(0.5, 0.5, "does not vary", transform=axes.transAxes, ha="center", va="center")
            else:
                _draw_bars(axes, one, order)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        if handles:
            figure.legend(handles, labels, loc="upper right", ncols=2, bbox_to_anchor=(1.0, 1.0))
    return figure


def _find_ends(found: Sequence[Indices]) -> tuple[float, float]:
    """Return the ends of the axes that show the bars with their intervals."""
    low, high = [0.0], [1.0]
    for one in found:
        for values, interval in ((one.first, one.first_interval), (one.total, one.total_interval)):
            low.append(float(np.min(values - interval)))
            high.append(float(np.max(values + interval)))
    return max(min(low) - 0.05, FARTHEST[0]), min(max(high) + 0.05, FARTHEST[1])


def _draw_bars(axes: Any, one: Indices, order: Any) -> None:
    """Draw the bars of an output."""
    level = f"{CONFIDENCE:.0%}"
    rows = np.arange(len(order))
    pairs = (
        ("alone (first order)", one.first, one.first_interval, 0.5, LINES[0], ""),
        (
            f"with interactions (total), {level} intervals",
            one.total,
            one.total_interval,
            -0.5,
            LINES[1],
            "////",
        ),
    )
    for label, values, interval, side, color, hatch in pairs:
        look = {"color": color, "hatch": hatch, "edgecolor": "white", "linewidth": 0.0, "label": label}
        whisker = {"ecolor": INK, "elinewidth": 1.1, "capsize": 2.5}
        axes.barh(rows + side * BAR, values[order], BAR, xerr=interval[order], error_kw=whisker, **look)
