"""Common parts of all plots: style, colors, legend, writing.

matplotlib is imported where it is used, and drawn with its Agg canvas only: no window, no
global state. Colors are Okabe and Ito's palette and cividis, told apart by people with
any color vision; letters and markers say the same once more.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.base.errors import OutputError
from ..core.files.run_folder import write_whole

if TYPE_CHECKING:  # only named in annotations
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MM = 1e3
LINES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
INK, SHADE = "#222222", "#F1EEE6"
#: Line of what was asked for.
DASHES = (0, (5, 3))
STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 12,
    "axes.titlesize": 12,
    "axes.titlelocation": "left",
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#E0DED8",
    "grid.linewidth": 0.8,
    "lines.linewidth": 1.9,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "figure.facecolor": "white",
    "figure.dpi": 160,
}


@contextmanager
def empty(
    width: float, height: float, style: Mapping[str, Any] = STYLE, **options: Any
) -> Iterator[Figure]:
    """Give an empty figure, inches, in a style that also holds for what is drawn on it."""
    try:
        from matplotlib import rc_context
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise OutputError("Plots need matplotlib: run 'pip install digiclay[plots]'.") from None
    with rc_context(dict[Any, Any](style)):
        figure = Figure(figsize=(width, height), **options)
        FigureCanvasAgg(figure)
        yield figure


@contextmanager
def canvas(width: float, height: float, title: str = "") -> Iterator[tuple[Figure, Any]]:
    """Give an empty figure, inches, and what places axes on it: label, then a box in inches."""
    with empty(width, height) as figure:
        if title:
            figure.text(0.3 / width, 1.0 - 0.33 / height, title, fontsize=14, fontweight="bold")

        def place(
            label: str, left: float, bottom: float, across: float, up: float, **looks: Any
        ) -> Any:
            box = (left / width, bottom / height, across / width, up / height)
            return figure.add_axes(box, label=label, **looks)

        yield figure, place


def legend_above(axes: Axes, columns: int = 6) -> None:
    """Put the legend on the line of the title, where it hides nothing."""
    close = {"handlelength": 1.4, "columnspacing": 1.2, "handletextpad": 0.5, "borderaxespad": 0.0}
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.99), ncols=columns, **close)


def save(figure: Figure, out: str | Path) -> Path:
    """Write a figure, whole or not at all, and return its path; OutputError when it cannot.

    As an SVG if its name ends so, with its letters as outlines and the same bytes every time; else
    as a PNG. What an artist marks as rasterized is pixels in an SVG.
    """
    content, path = io.BytesIO(), Path(out)
    if path.suffix == ".svg":
        from matplotlib import rc_context

        with rc_context({"svg.fonttype": "path", "svg.hashsalt": "digiclay"}):
            figure.savefig(content, format="svg", metadata={"Creator": "digiclay", "Date": None})
    else:
        figure.savefig(content, format="png", metadata={"Software": "digiclay"})
    write_whole(path, content.getvalue())
    return path
