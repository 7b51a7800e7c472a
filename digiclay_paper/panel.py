"""Common parts of the figures: lettered panels, and curves as a table."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

#: Columns of the tables: which panel and curve, and a point of it, with what the axes are called.
COLUMNS = ("panel", "curve", "x", "x_axis", "y", "y_axis")
#: Label of axes that only hold a scale of colors.
SCALE = "scale"
#: Identifier of axes whose vertical axis has names for its ticks, and no numbers.
NAMED = "named"


def letter(figure: Any) -> None:
    """Put a letter before the title of every panel, in the order in which they were placed."""
    panels = [axes for axes in figure.axes if axes.get_label() != SCALE]
    for number, axes in enumerate(panels):
        title = axes.get_title(loc="left")
        axes.set_title(f"({chr(ord('a') + number)}) {title}".rstrip(), loc="left")


def curves(figure: Any) -> Iterator[tuple[str, str, float, str, float | str, str]]:
    """Give every point of the named curves of a lettered figure, as rows of `COLUMNS`."""
    for axes in figure.axes:
        title = axes.get_title(loc="left")
        if not title.startswith("("):
            continue
        names = tuple(_name(figure, axes, way) for way in "xy")
        called = _called(axes)
        for line in axes.get_lines():
            label = line.get_label()
            if label.startswith("_") or line.get_transform() != axes.transData:
                continue
            x, y = (np.asarray(values, dtype=float) for values in line.get_data())
            for one, other in zip(x, y, strict=True):
                if not (np.isnan(one) or np.isnan(other)):
                    y_value = called(float(other)) if called else float(other)
                    yield title[1], _plain(label), float(one), names[0], y_value, names[1]


def _name(figure: Any, axes: Any, way: str) -> str:
    """Return what an axis is called, in this panel or in one that has the same ends."""

    def known(panel: Any) -> tuple[str, tuple[float, float]]:
        return getattr(panel, f"get_{way}label")(), getattr(panel, f"get_{way}lim")()

    own, ends = known(axes)
    others = (label for label, other in map(known, figure.axes) if label and other == ends)
    return _plain(own or next(others, ""))


def _called(axes: Any) -> Callable[[float], str] | None:
    """Return what gives the name of the nearest tick of a vertical axis of names; None for numbers."""
    if axes.get_gid() != NAMED:
        return None
    ticks = axes.get_yticks()
    names = [text.get_text() for text in axes.get_yticklabels()]
    return lambda value: names[int(np.argmin(np.abs(np.asarray(ticks) - value)))]


def _plain(text: str) -> str:
    """Return a label without the marks of mathematics."""
    return text.replace("$", "").replace("\n", " ")


def table(rows: Iterable[Iterable[Any]], columns: Iterable[str] = COLUMNS) -> str:
    """Return rows as CSV, numbers with six digits.

    `rows`: values of each row; `columns`: names of the columns.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        # A 0 is added so that none is written as -0.
        writer.writerow([f"{one + 0.0:.6g}" if isinstance(one, float) else one for one in row])
    return out.getvalue()
