"""``digiclay paper``: counterparts of the paper's figures, and its claims beside measurements."""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

from digiclay.commands.arguments import Options, add_command, add_options
from digiclay.commands.progress import Line
from digiclay.commands.refusals import refuse_without
from digiclay.commands.stop import Stop
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
    description = "Reproduce the paper's figures, and set its claims beside what is measured."
    options: Options = {
        "--out DIR": (Path, "default ./paper", Path("paper")),
        "--overwrite": "replace an older one at the end",
        "--quick": "few speeds and gains, for a first look",
        "--quiet": "print errors only, without progress",
    }
    purpose = "reproduce the paper's results"
    add_options(
        add_command(commands, "paper", purpose, EXAMPLES, description, carry_out=carry_out), options
    )


def carry_out(arguments: argparse.Namespace) -> int:
    """Simulate, draw, write, and print how the claims came out."""
    check_folder(arguments.out, overwrite=arguments.overwrite)
    refuse_without("digiclay paper", "plots", "matplotlib")
    from .page import produce
    from .results import FULL, QUICK

    started = time.monotonic()

    def begin_stage(stage: str) -> None:
        if stop():
            raise KeyboardInterrupt
        line.draw(f"{time.monotonic() - started:4.0f} s  {stage}")

    with (
        Stop() as stop,
        Line(sys.stderr, quiet=arguments.quiet) as line,
        write_folder(arguments.out, overwrite=arguments.overwrite) as folder,
    ):
        verdicts = produce(folder, QUICK if arguments.quick else FULL, begin_stage)
    if not arguments.quiet:
        print("\n".join(verdicts))
        print(f"written to {arguments.out}: start with {arguments.out / 'paper.md'}")
    return 0
