"""Common parts of the benchmarks: options, progress, and results in a folder."""

from __future__ import annotations

import argparse
import csv
import io
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

from digiclay.commands.arguments import add_command
from digiclay.commands.machine import describe_machine as made_with
from digiclay.commands.progress import Line, draw_share, table
from digiclay.commands.stop import refuse_unwritable
from digiclay.core.base.errors import OutputError

__all__ = ["add_kind", "kept", "made_with", "progress", "table"]


def add_kind(kinds: Any, name: str, help: str, examples: str, *, out: bool = True) -> argparse.ArgumentParser:
    """Add a benchmark with the options all of them take.

    `kinds` argparse's subparsers; `examples`: lines below *examples* in its help; `out`: whether it can keep
    its results in a folder.
    """
    parser = add_command(kinds, name, help, f"examples:\n{examples}")
    parser.add_argument("--quick", action="store_true", help="fewer and shorter runs")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    if out:
        parser.add_argument(
            "--out", metavar="DIR", type=_folder, help="also write the results into this folder"
        )
    return parser


def _folder(text: str) -> Path:
    """Read the name of a folder to write into; it is refused now what is bound to fail after the work."""
    try:
        refuse_unwritable(Path(text))
    except OutputError as error:
        raise argparse.ArgumentTypeError(str(error).rstrip(".")) from None
    return Path(text)


class Steps(Line):
    """Progress of a sequence of pieces; updated after each with its name.

    Parameters
    ----------
    total : int
        Pieces of work.
    """

    def __init__(self, stream: TextIO, label: str, total: int) -> None:
        super().__init__(stream)
        self._label, self._total, self._done = label, total, 0

    def __call__(self, doing: str = "") -> None:
        """Count one more piece as done, and draw the bar if it is time to."""
        self._done += 1
        if self.is_due():
            share = self._done / self._total
            said = f"{self._done} of {self._total}{self.format_left(share)}  {doing}"
            self.draw(f"{self._label} {draw_share(share)} {said}")


def progress(arguments: argparse.Namespace, label: str, total: int) -> Steps:
    """Return the bar of a benchmark, on stderr; one that draws nothing with --quiet.

    `arguments`: `quiet` is asked for; `label`: in front of the bar; `total`: steps of the bar.
    """
    return Steps(io.StringIO() if arguments.quiet else sys.stderr, label, total)


def kept(out: Path | None, name: str, text: str, head: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Write a benchmark's text as ``name.md`` and its figures as ``name.csv``, if there is a folder for them.

    `out`: the folder; `name`: of both files, without suffix; `head`: names of the columns of the CSV; `rows`:
    their values. Raises OutputError when the folder cannot be written.
    """
    if out is None:
        return
    figures = io.StringIO(newline="")
    writer = csv.writer(figures, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / f"{name}.md").write_text(
            f"# python -m benchmarks {name}\n\n```\n{text}\n```\n", encoding="utf-8"
        )
        (out / f"{name}.csv").write_text(figures.getvalue(), encoding="utf-8")
    except OSError as error:
        raise OutputError(f"Cannot write into {out}: {error.strerror or error}.") from None
