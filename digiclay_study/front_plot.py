"""Plot of a tuning: all trials, the front, the unchanged scene and the chosen point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.studies.evaluation import FIGURES
from digiclay.plots.figure import INK, LINES, canvas
from digiclay.plots.sweep import read_unit
from numpy.typing import NDArray

if TYPE_CHECKING:  # only named in annotations
    from matplotlib.figure import Figure

#: The largest value shown over the least one from which on an axis is logarithmic.
WIDE = 20.0
#: Share of the trials that the axes show at least.
SHOWN = 0.85


def draw_front(
    names: Sequence[str],
    values: Floats,
    sound: NDArray[np.bool_],
    front: NDArray[np.intp],
    chosen: int,
    title: str,
) -> Figure:
    """Draw the trials over two outputs; the first one upwards, the second one to the right.

    `names`: two keys of `evaluation.FIGURES`; `values` (points, 2), of the unchanged scene, and of all
    trials; SI; infinite where there are none; `sound` bool (points,), which keep the fingertip; `front`:
    points of the front; `chosen`: the chosen one of them. Returns its axes, by label: ``front``.
    """
    units = [read_unit(FIGURES[name][0], values[sound, number]) for number, name in enumerate(names)]
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
            axes.text(
                1.0, -0.155, f"{outside} trials are outside the axes", transform=axes.transAxes, ha="right"
            )
        close = {"borderaxespad": 0.2, "handletextpad": 0.3, "columnspacing": 1.2}
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=5, **close)
    return figure


def _mark(axes: Any, points: Floats, marker: str, color: str, size: float, label: str) -> None:
    """Draw markers."""
    edge: dict[str, Any] = (
        {} if marker == "x" else {"edgecolors": INK if size > 30 else "none", "linewidths": 0.8}
    )
    axes.scatter(
        points[:, 1],
        points[:, 0],
        size,
        color,
        marker=marker,
        label=label,
        zorder=4 if size > 30 else 2,
        **edge,
    )


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
