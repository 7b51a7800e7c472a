"""``digiclay paper``: counterparts of the paper's figures, and its claims beside measurements."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any, TextIO

from digiclay.commands.arguments import add_command
from digiclay.commands.progress import Line
from digiclay.commands.stop import Stop, refuse_without
from digiclay.core.files.run_folder import check_folder, write_folder

EXAMPLES = """\
examples:
  digiclay paper                           into ./paper, in one to three minutes
  digiclay paper --out results --overwrite

The folder holds paper.md (start there), the figures as SVG with their data as CSV beside them, and
metrics.json with every number.
"""


def add(commands: Any) -> None:
    """Add the command."""
    said = "Reproduce the paper's figures, and set its claims beside what is measured."
    parser = add_command(commands, "paper", "reproduce the paper's results", EXAMPLES, said)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("paper"), help="default ./paper")
    parser.add_argument("--overwrite", action="store_true", help="replace an older one when all is done")
    parser.add_argument("--quick", action="store_true", help="coarse: few speeds and gains, for a first look")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors, and no progress")
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Simulate, draw, write, and tell how the claims came out."""
    check_folder(arguments.out, overwrite=arguments.overwrite)
    refuse_without("digiclay paper", "plots", "matplotlib")
    from .page import produce
    from .results import FULL, QUICK

    with (
        Stop() as stop,
        Stages(sys.stderr, stop, quiet=arguments.quiet) as told,
        write_folder(arguments.out, overwrite=arguments.overwrite) as folder,
    ):
        verdicts = produce(folder, QUICK if arguments.quick else FULL, told)
    if not arguments.quiet:
        print("\n".join(verdicts))
        print(f"written to {arguments.out}: start with {arguments.out / 'paper.md'}")
    return 0


class Stages(Line):
    """Progress line on a terminal, with stop by a signal.

    Parameters
    ----------
    stop : Stop
        Asked before each stage.
    """

    def __init__(self, stream: TextIO, stop: Stop, *, quiet: bool) -> None:
        super().__init__(stream)
        self._stop, self._quiet = stop, quiet

    def __call__(self, stage: str) -> None:
        """Tell the next stage."""
        if self._stop():
            raise KeyboardInterrupt
        if not self._quiet:
            self.draw(f"{time.monotonic() - self._started:4.0f} s  {stage}")
