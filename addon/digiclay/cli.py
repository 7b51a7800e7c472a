"""The command line: ``digiclay``, ``python -m digiclay``, and ``blender --command digiclay``."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from . import __version__
from .commands import (
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
from .core.errors import DigiclayError

__all__ = ["WRONG", "console", "main", "parser"]

#: Exit codes: what the user asked for cannot be done; stopped by Ctrl-C or SIGTERM.
WRONG, STOPPED = 2, 130

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


def parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    top = Parser(
        prog="digiclay",
        description="Shape-design sessions on Digital Clay, a simulated bed of fluidic pins.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    top.add_argument("--version", action="version", version=f"digiclay {__version__}")
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=Parser)
    every = (run, batch, job, form, describe, export, features, render, benchmark, sweep, compare, paper)
    for command in every:
        command.add(commands)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; return its exit code: 0, 2 for what a user can mend, 130 when stopped.

    Parameters
    ----------
    argv : sequence of str, optional
        The arguments; by default those of the process.
    """
    try:
        arguments = parser().parse_args(argv)
    except SystemExit as done:  # --help, --version, or arguments that make no sense
        return done.code if isinstance(done.code, int) else 0
    try:
        code: int = arguments.carry_out(arguments)
    except DigiclayError as error:
        print(" ".join(str(error).split()), file=sys.stderr)
        return WRONG
    except MemoryError:
        print("There is not enough memory: use fewer cells, or a higher recorder.every.", file=sys.stderr)
        return WRONG
    except KeyboardInterrupt:
        print("Stopped; nothing was written.", file=sys.stderr)
        return STOPPED
    return code


def console() -> NoReturn:
    """Run as a program."""
    try:
        code = main()
        sys.stdout.flush()
    except BrokenPipeError:  # whoever read our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    sys.exit(code)
