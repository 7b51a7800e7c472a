"""Commands outside the extension: ``digiclay paper`` and ``digiclay benchmark``.

The paper's reproduction is a package of its own beside this one, which adds the command itself where it
is installed. Here stands what is said where it is not, and where the benchmarks are.
"""

from __future__ import annotations

import argparse
from importlib import import_module
from importlib.util import find_spec
from typing import Any, NoReturn

from ..core.base.errors import DigiclayError

__all__ = ["add"]

#: The package that adds ``digiclay paper``; it stands beside this one, under the same name above both.
PAPER = f"{__name__.removesuffix('digiclay.commands.outside')}digiclay_paper"
NO_PAPER = "digiclay paper is not part of the extension: run 'pip install digiclay[plots]' first."
NO_BENCHMARK = "The benchmarks are run from a checkout: 'python -m benchmarks --help' lists them."


def add(commands: Any) -> None:
    """Add ``paper``, or its install message, and ``benchmark``, which names the place of the benchmarks."""
    if find_spec(PAPER):
        import_module(f"{PAPER}.reproduce").add(commands)
    else:
        _add_absent(commands, "paper", "reproduce the paper's results (not part of the extension)", NO_PAPER)
    _add_absent(commands, "benchmark", "where the benchmarks are", NO_BENCHMARK)


def _add_absent(commands: Any, name: str, help: str, said: str) -> None:
    """Add a command that takes any arguments and refuses in one line."""

    def refuse(arguments: argparse.Namespace) -> NoReturn:
        raise DigiclayError(said)

    # No argument begins with this, so all are taken alike, --help too.
    parser = commands.add_parser(name, help=help, prefix_chars="\0", add_help=False)
    parser.add_argument("rest", nargs=argparse.REMAINDER)
    parser.set_defaults(carry_out=refuse)
