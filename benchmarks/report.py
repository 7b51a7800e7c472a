"""Common parts of the benchmarks: progress, report with files, tables, style of the plots."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO, TypeVar

from digiclay.commands.progress import Line, draw_share, table
from digiclay.core.base.errors import OutputError
from digiclay.plots.figure import INK, LINES, empty, save

from digiclay_study.suite_page import describe_machine

Item = TypeVar("Item")
#: Row of a CSV by column.
Row = Mapping[str, Any]

#: Okabe and Ito's palette: of the first and second line.
BLUE, RED = LINES[:2]
STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans", "font.size": 10, "axes.titlelocation": "left", "axes.titlesize": 11,
    "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.color": "#E0DED8",
    "grid.linewidth": 0.7, "axes.axisbelow": True, "legend.frameon": False, "figure.dpi": 150,
}  # fmt: skip
__all__ = ["BLUE", "INK", "RED", "Report", "Row", "Steps", "tabulate"]


class Steps(Line):
    """Progress of a sequence of steps; updated after each with its name.

    Parameters
    ----------
    total : int
        Number of steps.
    """

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
    packages: tuple[str, ...] = ()
    """Packages whose versions are given."""
    program: str = ""
    """Version of another program."""

    def text(self) -> str:
        """Return versions, machine and lines."""
        machine = ", ".join(filter(None, [describe_machine(*self.packages), self.program]))
        return "\n".join([machine, *self.lines])

    def write(self, out: Path, name: str, text: str) -> None:
        """Write ``name.md``, ``name.csv`` and ``name.png``; OutputError if they cannot be."""
        figures = io.StringIO(newline="")
        writer = csv.DictWriter(figures, list(self.rows[0]) if self.rows else [], lineterminator="\n")
        writer.writeheader()
        writer.writerows(self.rows)
        try:
            out.mkdir(parents=True, exist_ok=True)
            (out / f"{name}.md").write_text(
                f"# python -m benchmarks {name}\n\n```\n{text}\n```\n", encoding="utf-8"
            )
            (out / f"{name}.csv").write_text(figures.getvalue(), encoding="utf-8")
        except OSError as error:
            raise OutputError(f"Cannot write into {out}: {error.strerror or error}.") from None
        if self.draw:
            with empty(*self.size, STYLE, layout="constrained") as figure:
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
