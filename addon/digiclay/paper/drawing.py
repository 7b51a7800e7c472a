"""What the figures of the paper's results share: style, colours, labels."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ..plots.plots import INK, LINES, MM, SHADE, _draw_map, _draw_path, _draw_relief, _figure, _save

__all__ = [
    "INK", "LINES", "METHOD_COLOURS", "MM", "SHADE", "above", "canvas", "draw_map", "draw_path",
    "draw_relief", "save",
]  # fmt: skip

#: Told apart with any colour vision; markers say the same once more.
METHOD_COLOURS = {"virtual_master": LINES[0], "cell_states": LINES[1]}

draw_map, draw_path, draw_relief, save = _draw_map, _draw_path, _draw_relief, _save


@contextmanager
def canvas(width: float, height: float, title: str = "") -> Iterator[tuple[Any, Any]]:
    """Give an empty figure, its size in inches, and what places axes on it; see `plots`."""
    with _figure(width, height) as (figure, place):
        if title:
            figure.text(0.3 / width, 1.0 - 0.33 / height, title, fontsize=14, fontweight="bold")
        yield figure, place


def above(axes: Any, columns: int = 6) -> None:
    """Put the legend on the line of the title, where it hides nothing."""
    close = {"handlelength": 1.4, "columnspacing": 1.2, "handletextpad": 0.5, "borderaxespad": 0.0}
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.99), ncols=columns, **close)
