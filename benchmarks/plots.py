"""Pictures of the benchmarks: error against run time, and cost against size.

Colours are Okabe and Ito's palette; markers and line styles say the same once more.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

from digiclay.plots.figure import empty, save

__all__ = ["precision", "scale", "stack"]

#: Colour, marker and line style of each method: ours are filled and drawn through, peers are open and dashed.
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


class Work(Protocol):
    """A run of `precision`: its largest error of height, m, and its CPU time, s."""

    problem: str
    method: str
    height_error: float
    seconds: float


class Cost(Protocol):
    """A bed of `scale`: the median and the mean of a control period, s."""

    pins: int
    period: float
    mean: float


class Gain(Protocol):
    """A study of `stack`: CPU times of a run, s, each alone and of many in one call."""

    study: str
    runs: int
    alone: float
    stacked: float
    judged_alone: float
    judged_stacked: float
    errors_alone: float
    errors_stacked: float


def precision(work: Sequence[Work], out: Path, lines: str = "full lines: ours; dashed: peers") -> Path:
    """Draw the work-precision plot, one panel a problem, and return its path; `lines` heads the legend."""
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
        return _written(figure, out)


def _panel(panel: Any, work: Sequence[Work]) -> None:
    """Draw one problem: error of height over CPU time."""
    for method, (colour, marker, line) in LOOKS.items():
        own = [one for one in work if one.method == method and 0.0 < one.height_error < 2e-3]
        if own:
            filled = colour if line == "-" else "white"
            panel.loglog(
                [one.seconds * 1e3 for one in own], [one.height_error * 1e6 for one in own], line,
                color=colour, marker=marker, markerfacecolor=filled, markersize=5.5, linewidth=1.5,
                label=method,
            )  # fmt: skip
    panel.set_xlabel("CPU time, ms")
    panel.set_ylabel("largest height error, µm")


def scale(sizes: Sequence[Cost], out: Path) -> Path:
    """Draw a control period's cost over the number of pins, and return the path."""
    with empty(6.0, 3.6, STYLE, layout="constrained") as figure:
        panel = figure.subplots()
        pins = [one.pins for one in sizes]
        for values, label, colour, marker in (
            ([one.period * 1e6 for one in sizes], "median", "#0072B2", "o"),
            ([one.mean * 1e6 for one in sizes], "mean, with the finger's poses", "#D55E00", "s"),
        ):
            panel.semilogx(pins, values, "-", color=colour, marker=marker, label=label)
        panel.set_ylim(0.0, 1.2e6 * max(one.mean for one in sizes))
        panel.set_xlabel("pins of the bed")
        panel.set_ylabel("a control period, µs")
        panel.set_title("The same finger on larger beds")
        panel.legend(loc="lower right")
        return _written(figure, out)


def stack(sizes: Sequence[Gain], out: Path) -> Path:
    """Draw how many times the runs a second a stack comes to, over its runs, and return the path."""
    with empty(6.0, 3.6, STYLE, layout="constrained") as figure:
        panel = figure.subplots()
        for study, colour, marker in (("control", "#0072B2", "o"), ("device", "#D55E00", "s")):
            own = [one for one in sizes if one.study == study]
            runs = [one.runs for one in own]
            for gains, line, label in (
                ([one.alone / one.stacked for one in own], "-", "simulated"),
                ([one.judged_alone / one.judged_stacked for one in own], "--", "recorded and judged"),
                ([one.errors_alone / one.errors_stacked for one in own], ":", "errors estimated too"),
            ):
                panel.loglog(
                    runs, gains, line, color=colour, marker=marker,
                    markerfacecolor=colour if line == "-" else "white", label=f"{study} varies, {label}",
                )  # fmt: skip
        panel.axhline(6.0, color="#777777", linewidth=1.0, label="the goal")
        panel.set_xticks(runs, [str(count) for count in runs])
        panel.set_yticks([1, 2, 4, 6, 10, 20], ["1", "2", "4", "6", "10", "20"])
        panel.minorticks_off()
        panel.set_xlabel("runs in one call")
        panel.set_ylabel("runs a second, to one at a time")
        panel.set_title("Many sessions in one call")
        panel.legend(loc="lower right", fontsize=8.5)
        return _written(figure, out)


def _written(figure: Any, out: Path) -> Path:
    """Write a figure into a folder that may have to be made, and return its path."""
    out.parent.mkdir(parents=True, exist_ok=True)
    return save(figure, out)
