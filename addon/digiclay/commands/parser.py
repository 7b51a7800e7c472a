"""The parser of all commands: what may be written behind ``digiclay``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any, NoReturn

from .. import __version__
from . import (
    batch,
    benchmark,
    compare,
    describe,
    export,
    features,
    form,
    job,
    paper,
    render,
    run,
    sweep,
)
from .arguments import Help
from .exit_codes import WRONG

__all__ = ["parser"]

EXAMPLES = """\
examples:
  digiclay run ridge_mound_valley                   the paper's session, into ./ridge_mound_valley
  digiclay run my.toml --out first --export stl     a scene of one's own, and its surface for a printer
  digiclay run tap --set valve.stroke="20 um"       the same scene with another valve
  digiclay describe ridge_mound_valley              what a scene consists of
  digiclay render first --time 5                    a picture of an instant (needs bpy)
"""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the arguments, and stop."""
        self.exit(WRONG, f"{self.prog}: {message}. See '{self.prog} --help'.\n")

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """Refuse what is not known here and now: later, nobody knows which command it was for."""
        known, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return known, unknown


def parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    top = Parser(
        prog="digiclay",
        description="Shape-design sessions on Digital Clay, a simulated bed of fluidic pins.",
        epilog=EXAMPLES,
        formatter_class=Help,
        allow_abbrev=False,
    )
    top.add_argument("--version", action="version", version=f"digiclay {__version__}")
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=Parser)
    every = (run, batch, job, form, describe, export, features, render, benchmark, sweep, compare, paper)
    for command in every:
        command.add(commands)
    return top
