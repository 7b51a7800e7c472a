"""Common parts of the benchmarks: progress, report with files, tables, style of the plots."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from time import process_time
from typing import Any, TextIO, TypeVar

import numpy as np
from digiclay.commands.progress import Line, draw_share, table
from digiclay.core.base.errors import explain_os_error
from digiclay.core.files.tables import Table
from digiclay.core.studies.sweep_plan import format_csv
from digiclay.plots.figure import LINES, STYLE, empty, save

from digiclay_study.suite_page import describe_machine

Item = TypeVar("Item")
#: Row of a CSV by column.
Row = Table

#: Okabe and Ito's palette: of the first and second line.
BLUE, RED = LINES[:2]
LOOK = STYLE | {
    "font.size": 10,
    "axes.titlesize": 11,
    "figure.dpi": 150,
    "axes.prop_cycle": f"cycler(linestyle=['-', '--', ':']) * cycler(color={[*LINES]}, marker={[*'os^DvX']})",
}
#: Size of a panel of `Curves`, and height of the legend below, inches; most columns of both.
PANEL, LEGEND, COLUMNS = (4.4, 3.6), 1.2, 3


@dataclass(frozen=True, eq=False)
class Curves:
    """Lines over logarithmic axes, in panels side by side, with one legend for all."""

    panels: Mapping[str, Mapping[str, Sequence[tuple[float, float]]]]
    """By title the lines, by label their points."""
    x: str
    y: str
    """Labels of the axes."""
    scale: str = "log"
    """Of the y axis; a linear one begins at 0."""

    @property
    def grid(self) -> tuple[int, int]:
        """Rows and columns of panels."""
        columns = min(COLUMNS, len(self.panels))
        return math.ceil(len(self.panels) / columns), columns

    @property
    def size(self) -> tuple[float, float]:
        """Of the figure, inches."""
        rows, columns = self.grid
        return PANEL[0] * columns, PANEL[1] * rows + LEGEND

    def __call__(self, figure: Any) -> None:
        """Draw the panels."""
        rows, columns = self.grid
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        for panel in axes[len(self.panels) :]:
            panel.set_axis_off()
        labels = dict.fromkeys(label for lines in self.panels.values() for label in lines)
        for panel, (title, lines) in zip(axes, self.panels.items(), strict=False):
            for label in labels:
                # Also those without points here: a label has one look in all panels.
                panel.plot(*np.reshape(lines.get(label, ()), (-1, 2)).T, label=label)
            panel.set(title=title, xlabel=self.x, ylabel=self.y, xscale="log", yscale=self.scale)
            if self.scale == "linear":
                panel.set_ylim(bottom=0.0)
        figure.legend(
            *axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=columns
        )


class Steps(Line):
    """Progress of a sequence of `total` steps; updated after each with its name."""

    def __init__(self, stream: TextIO, label: str, total: int = 1) -> None:
        super().__init__(stream)
        self.total = total
        self._label, self._done = label, 0

    def __call__(self, step: str = "") -> None:
        """Count one more step as done, and draw the bar if it is time to."""
        self._done += 1
        if self.is_due():
            share = self._done / self.total
            count = f"{self._done} of {self.total}{self.format_left(share)}"
            self.draw(f"{self._label} {draw_share(share)} {count}  {step}")

    def through(self, items: Sequence[Item], name: Callable[[Item], str] = str) -> Iterator[Item]:
        """Give items, each a step; `name` returns the name of an item."""
        self.total = len(items)
        for item in items:
            yield item
            self(name(item))


@dataclass(frozen=True, eq=False)
class Report:
    """Result of a benchmark."""

    lines: Iterable[str]
    """The text below the line of versions and machine."""
    rows: Sequence[Row] = ()
    """Of the CSV; all have the same keys."""
    draw: Callable[[Any], None] | None = None
    """Draws on a matplotlib figure."""
    size: tuple[float, float] = (6.0, 3.6)
    """Of the figure, inches."""
    name: str = ""
    """Of the files; by default that of the benchmark."""
    failed: bool = False
    """Whether the exit code is 1."""

    def text(self, package: str = "") -> str:
        """Return versions, that of a package included, machine and lines."""
        return "\n".join([describe_machine(*filter(None, [package])), *self.lines])

    def write(self, out: Path, name: str, text: str) -> None:
        """Write ``name.md``, ``name.csv`` and ``name.png``; OutputError if they cannot be."""
        head = list(self.rows[0]) if self.rows else []
        figures = format_csv([head, *([*row.values()] for row in self.rows)])
        with explain_os_error(f"Cannot write into {out}"):
            out.mkdir(parents=True, exist_ok=True)
            (out / f"{name}.md").write_text(
                f"# python -m benchmarks {name}\n\n```\n{text}\n```\n", encoding="utf-8"
            )
            (out / f"{name}.csv").write_text(figures, encoding="utf-8")
        if self.draw:
            size = self.draw.size if isinstance(self.draw, Curves) else self.size
            with empty(*size, LOOK, layout="constrained") as figure:
                self.draw(figure)
                save(figure, out / f"{name}.png")


def tabulate(rows: Iterable[Row], columns: Mapping[str, str], left: int = 1) -> Iterator[str]:
    """Give the lines of a table; `columns`: by heading the key of a row, its format and factor, if any."""
    cells = [[_write_cell(row, *column.split()) for column in columns.values()] for row in rows]
    yield from table(list(columns), cells, left=left)


def _write_cell(row: Row, key: str, form: str = "", factor: str = "1") -> str:
    value = row[key]
    if value is None:
        return ""
    return format(value if factor == "1" else value * float(factor), form)


#: Something whose time is measured.
Work = Callable[[], object]


def time_by_turns(works: Sequence[Work], repeats: int) -> list[float]:
    """Return the median processor time of each work, s; what else the machine does befalls all alike."""
    times = np.zeros((repeats, len(works)))
    for turn, number in product(range(repeats), range(len(works))):
        began = process_time()
        works[number]()
        times[turn, number] = process_time() - began
    return np.median(times, axis=0).tolist()
