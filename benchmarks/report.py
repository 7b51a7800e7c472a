"""Common parts of the benchmarks: progress, report with files, cells of tables, style of the plots."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TextIO, TypeVar

from digiclay.commands.progress import Line, draw_share
from digiclay.core.base.errors import OutputError
from digiclay.plots.figure import save

from digiclay_study.suite_page import describe_machine

Item = TypeVar("Item")

#: Okabe and Ito's palette: of the first and second line, and of what is marked.
BLUE, RED, INK = "#0072B2", "#D55E00", "#222222"
STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans", "font.size": 10, "axes.titlelocation": "left", "axes.titlesize": 11,
    "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.color": "#E0DED8",
    "grid.linewidth": 0.7, "axes.axisbelow": True, "legend.frameon": False, "figure.dpi": 150,
}  # fmt: skip


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
    """Result of a benchmark.

    Attributes
    ----------
    lines : iterable of str
        The text below the line of versions and machine.
    head, rows : sequences
        Columns of the CSV, and their values.
    draw : callable, optional
        Returns the matplotlib figure.
    name : str
        Of the files; by default that of the benchmark.
    packages : tuple of str
        Packages whose versions are given.
    program : str
        Version of another program.
    """

    lines: Iterable[str]
    head: Sequence[str] = ()
    rows: Sequence[Sequence[Any]] = ()
    draw: Callable[[], Any] | None = None
    name: str = ""
    packages: tuple[str, ...] = ()
    program: str = ""

    def text(self) -> str:
        """Return versions, machine and lines."""
        machine = ", ".join(filter(None, [describe_machine(*self.packages), self.program]))
        return "\n".join([machine, *self.lines])


def list_records(records: Sequence[Any]) -> tuple[list[str], list[list[Any]]]:
    """Return head and rows of a CSV of dataclass instances."""
    head = [field.name for field in fields(records[0])]
    return head, [[getattr(record, name) for name in head] for record in records]


def cells(forms: str, *values: Any) -> list[str]:
    """Return the cells of a row of a table; `forms`: format specifications separated by blanks."""
    return [format(value, form) for form, value in zip(forms.split(), values, strict=True)]


def write_report(report: Report, out: Path, name: str) -> None:
    """Write a report's ``name.md``, ``name.csv`` and ``name.png``; OutputError if they cannot be."""
    figures = io.StringIO(newline="")
    writer = csv.writer(figures, lineterminator="\n")
    writer.writerow(report.head)
    writer.writerows(report.rows)
    text = f"# python -m benchmarks {name}\n\n```\n{report.text()}\n```\n"
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / f"{name}.md").write_text(text, encoding="utf-8")
        (out / f"{name}.csv").write_text(figures.getvalue(), encoding="utf-8")
    except OSError as error:
        raise OutputError(f"Cannot write into {out}: {error.strerror or error}.") from None
    if report.draw:
        save(report.draw(), out / f"{name}.png")
