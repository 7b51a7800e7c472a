"""Commands outside the extension: ``digiclay paper``, ``study``, ``tune``, ``serve`` and ``benchmark``.

The paper's reproduction, the studies and the server are packages of their own beside this one, which add
their commands themselves where they are installed. Here stands what is said where they are not, and where
the benchmarks are.
"""

from __future__ import annotations

import argparse
from importlib import import_module
from importlib.util import find_spec
from typing import Any, NoReturn

from ..core.base.errors import DigiclayError

#: Where packages stand beside this one: above both.
BESIDE = __name__.removesuffix("digiclay.commands.outside")
#: Commands of packages beside this one: package, module, extra, and what the list of commands says.
COMMANDS = {
    "paper": ("digiclay_paper", "reproduce", "plots", "reproduce the paper's results"),
    "study": ("digiclay_study", "study_command", "study", "find which parameters matter for which metric"),
    "tune": ("digiclay_study", "tune_command", "study", "find the best trade-off of two metrics"),
    "serve": ("digiclay_serve", "serve_command", "serve", "run a session for other programs"),
}
NO_BENCHMARK = "The benchmarks are run from a checkout: 'python -m benchmarks --help' lists them."


def add(commands: Any) -> None:
    """Add the commands of other packages, or their install messages, and the place of the benchmarks."""
    for name, (package, module, extra, help) in COMMANDS.items():
        if find_spec(f"{BESIDE}{package}"):
            import_module(f"{BESIDE}{package}.{module}").add(commands)
        else:
            said = f"digiclay {name} is not part of the extension: run 'pip install digiclay[{extra}]' first."
            _add_absent(commands, name, f"{help} (not part of the extension)", said)
    _add_absent(commands, "benchmark", "where the benchmarks are", NO_BENCHMARK)


def _add_absent(commands: Any, name: str, help: str, said: str) -> None:
    """Add a command that takes any arguments and refuses in one line."""

    def refuse(arguments: argparse.Namespace) -> NoReturn:
        raise DigiclayError(said)

    # No argument begins with this, so all are taken alike, --help too.
    parser = commands.add_parser(name, help=help, prefix_chars="\0", add_help=False)
    parser.add_argument("rest", nargs=argparse.REMAINDER)
    parser.set_defaults(carry_out=refuse)
