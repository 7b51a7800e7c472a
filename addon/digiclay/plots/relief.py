"""Axis labels of a relief plot, placed without overlap."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import combinations
from typing import Any

import numpy as np

Room = tuple[float, float, float, float]

#: Where the relief and all that is written on it has room, as parts of the figure: left, bottom, right, top.
ROOM: Room = (0.01, 0.02, 0.525, 0.9)
#: Times the relief is fitted; a little less than the room, because letters do not grow with it.
ROUNDS, LARGER = 3, 1.6
#: Most numbers along an axis, and how far its name may stand off, points.
NUMBERS, OFF = 5, (4, 12, 20, 28, 36, 46, 56, 70)


def fit_relief(axes: Any, size: Any, limits: Sequence[tuple[float, float]], room: Room = ROOM) -> None:
    """Choose numbers on the axes and places of their names so that they are apart, and fill the room.

    `axes` Axes3D, still empty, with its limits and names; `size` (3,), of what is shown, in the same unit on
    all axes; `room`: left, bottom, right and top of the part of the figure that it fills, as shares of the
    figure.
    """
    with _alone(axes):
        _fit(axes, size, limits, room)


@contextmanager
def _alone(axes: Any) -> Iterator[None]:
    """Leave out all other axes of the figure within the block: what is drawn again and again takes time."""
    others = [other for other in axes.figure.axes if other is not axes and other.get_visible()]
    for other in others:
        other.set_visible(False)
    try:
        yield
    finally:
        for other in others:
            other.set_visible(True)


def _fit(axes: Any, size: Any, limits: Sequence[tuple[float, float]], room: Room) -> None:
    """Fit a relief, see `fit_relief`."""
    zoom = 0.84
    sides = (axes.xaxis, axes.yaxis, axes.zaxis)
    for turn in range(ROUNDS):
        axes.set_box_aspect(size, zoom=zoom)
        for axis, (low, high) in zip(sides, limits, strict=True):
            _number(axes, axis, low, high)
        for axis in sides:
            axis.labelpad = OFF[0]
        for axis in sides:
            counts = {}
            for axis.labelpad in OFF:
                counts[axis.labelpad] = sum(axis.label in pair for pair in hidden(axes))
                if not counts[axis.labelpad]:
                    break
            axis.labelpad = min(counts, key=lambda pad: counts[pad])
            if all(counts.values()):  # beside a narrow bed no distance takes the name off the numbers
                _give_way(axes, axis)
        if turn < ROUNDS - 1:
            zoom *= min(LARGER, _placed(axes, room))
    _placed(axes, room)


def hidden(axes: Any) -> list[tuple[Any, Any]]:
    """Return the pairs of texts on the axes of a relief that are drawn over each other."""
    renderer = axes.figure.canvas.get_renderer()
    axes.figure.draw_without_rendering()
    texts = [axis.label for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]
    texts += [tick.label1 for axis in (axes.xaxis, axes.yaxis, axes.zaxis) for tick in _shown(axis)]
    boxes = [(text, text.get_window_extent(renderer)) for text in texts if text.get_text()]
    return [(one, two) for (one, a), (two, b) in combinations(boxes, 2) if a.overlaps(b)]


def _shown(axis: Any) -> list[Any]:
    """Return the ticks of an axis that are drawn."""
    low, high = sorted(axis.get_view_interval())
    slack = 1e-6 * (high - low)
    return [tick for tick in axis.get_major_ticks() if low - slack <= tick.get_loc() <= high + slack]


def _number(axes: Any, axis: Any, low: float, high: float) -> None:
    """Give an axis as many numbers as have room; one at its end if there is none for two."""
    from matplotlib.ticker import FixedLocator, MaxNLocator

    for count in range(NUMBERS, 0, -1):
        axis.set_major_locator(MaxNLocator(count, steps=[1, 2, 2.5, 5, 10]))
        own = [tick.label1 for tick in _shown(axis)]
        if len(own) > 1 and not any(one in own and two in own for one, two in hidden(axes)):
            return
    axis.set_major_locator(FixedLocator([float(np.round(high, 1 if high - low < 10.0 else 0))]))


def _give_way(axes: Any, axis: Any) -> None:
    """Leave out the numbers of an axis that its name hides."""
    from matplotlib.ticker import FixedLocator

    under = [text for pair in hidden(axes) if axis.label in pair for text in pair]
    kept = [tick.get_loc() for tick in _shown(axis) if tick.label1 not in under]
    axis.set_major_locator(FixedLocator(kept))


def _placed(axes: Any, room: Room) -> float:
    """Move a relief into the middle of its room, and return how much larger it could be there."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    figure = axes.figure
    renderer = figure.canvas.get_renderer()
    figure.draw_without_rendering()
    corners = np.array(np.meshgrid(axes.get_xlim(), axes.get_ylim(), axes.get_zlim())).reshape(3, 8)
    flat = np.column_stack(proj_transform(*corners, axes.get_proj())[:2])
    places = [axes.transData.transform(flat)]
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        texts = [axis.label, *(tick.label1 for tick in _shown(axis))]
        places += [text.get_window_extent(renderer).get_points() for text in texts if text.get_text()]
    inside = figure.transFigure.inverted().transform(np.concatenate(places))
    inside = inside[np.all(np.abs(inside) < 2.0, axis=1)]  # a number that is not drawn has no place
    low, high = inside.min(axis=0), inside.max(axis=0)
    ends = np.array(room).reshape(2, 2)
    now = axes.get_position()
    across, up = 0.5 * (ends.sum(axis=0) - low - high)
    axes.set_position((now.x0 + across, now.y0 + up, now.width, now.height))
    return float(np.min((ends[1] - ends[0]) / (high - low)))
