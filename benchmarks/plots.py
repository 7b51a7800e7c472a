"""Style of the benchmark plots, and the work-precision plot.

Colors are Okabe and Ito's palette; markers and line styles say the same once more.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from digiclay.plots.figure import empty, save

from .work_precision import Work

#: Color, marker and line style of each method: ours are filled and drawn through, peers are open and dashed.
LOOKS: dict[str, tuple[str, str, str]] = {
    "bernoulli": ("#0072B2", "o", "-"), "richardson": ("#009E73", "s", "-"),
    "runge_kutta_4": ("#CC79A7", "D", "-"), "heun": ("#E69F00", "^", "-"), "euler": ("#56B4E9", "v", "-"),
    "LSODA": ("#D55E00", "o", "--"), "DOP853": ("#222222", "s", "--"), "Radau": ("#8A6D00", "D", "--"),
    "Python loop": ("#777777", "X", ":"),
    "LSODA, whole bed": ("#D55E00", "P", "-."), "DOP853, whole bed": ("#222222", "p", "-."),
    "Radau, whole bed": ("#8A6D00", "d", "-."), "Python loop, whole bed": ("#777777", "*", ":"),
}  # fmt: skip
STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans", "font.size": 10, "axes.titlelocation": "left", "axes.titlesize": 11,
    "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.color": "#E0DED8",
    "grid.linewidth": 0.7, "axes.axisbelow": True, "legend.frameon": False, "figure.dpi": 150,
}  # fmt: skip


def draw_precision(work: Sequence[Work], out: Path, lines: str = "full lines: ours; dashed: peers") -> Path:
    """Draw the work-precision plot, one panel a problem, and return its path; `lines` heads the legend.

    `out`: the PNG; `lines`: head of the legend.
    """
    names = list(dict.fromkeys(one.problem for one in work))
    columns = min(3, len(names))
    rows = -(-(len(names) + 1) // columns)
    with empty(4.4 * columns, 3.7 * rows, STYLE, layout="constrained") as figure:
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for panel, name in zip(panels, names, strict=False):
            _panel(panel, [one for one in work if one.problem == name])
            panel.set_title(name)
        for panel in panels[len(names) :]:
            panel.set_axis_off()
        handles = {
            label: handle
            for panel in panels[: len(names)]
            for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
        }
        panels[len(names)].legend(handles.values(), handles, loc="center", ncols=2, title=lines)
        return write(figure, out)


def _panel(panel: Any, work: Sequence[Work]) -> None:
    """Draw one problem: error of height over CPU time."""
    for method, (color, marker, line) in LOOKS.items():
        own = [one for one in work if one.method == method and 0.0 < one.height_error < 2e-3]
        if own:
            filled = color if line == "-" else "white"
            panel.loglog(
                [one.seconds * 1e3 for one in own], [one.height_error * 1e6 for one in own], line,
                color=color, marker=marker, markerfacecolor=filled, markersize=5.5, linewidth=1.5,
                label=method,
            )  # fmt: skip
    panel.set_xlabel("CPU time, ms")
    panel.set_ylabel("largest height error, µm")


def write(figure: Any, out: Path) -> Path:
    """Write a figure into a folder that may have to be made, and return its path.

    `figure` Figure; `out`: the PNG.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    return save(figure, out)
