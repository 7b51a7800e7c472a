"""Commands outside the extension: ``digiclay paper``, ``study``, ``tune``, ``serve``, ``hands``; its suite.

They are in packages beside this one, where those are installed. ``digiclay benchmark`` says where
the benchmarks are.
"""

from argparse import REMAINDER, ArgumentParser
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any, NoReturn

from ..core.base.errors import DigiclayError

#: Where packages stand beside this one: above both.
BESIDE = __name__.removesuffix("digiclay.commands.outside")
#: Commands of packages beside this one: package, module, extra, and what the list of commands says.
COMMANDS = {
    "paper": ("digiclay_paper", "reproduce", "plots", "reproduce the paper's results"),
    "fit": ("digiclay_fit", "fit_command", "fit", "fit device or finger to measured data"),
    "study": (
        "digiclay_study",
        "study_command",
        "study",
        "find which parameters matter for which metric",
    ),
    "tune": ("digiclay_study", "tune_command", "study", "find the best trade-off of two metrics"),
    "serve": ("digiclay_serve", "serve_command", "serve", "run a session for other programs"),
    "hands": (
        "digiclay_serve",
        "hands_command",
        "serve",
        "move the fingertips of a server by tracked hands",
    ),
}
#: The package and the module of ``digiclay compare --suite``.
SUITE = ("digiclay_study", "suite_command")
NO_BENCHMARK = "The benchmarks are run from a checkout: 'python -m benchmarks --help' lists them."


def find_beside(package: str, module: str) -> ModuleType | None:
    """Return a module of a package beside this one, None where the package is not installed."""
    return import_module(f"{BESIDE}{package}.{module}") if find_spec(f"{BESIDE}{package}") else None


def refuse_absent(name: str, extra: str) -> NoReturn:
    """Refuse a command of a package that is not installed."""
    _refuse(
        f"digiclay {name} is not part of the extension: run 'pip install digiclay[{extra}]' first."
    )


def _refuse(rule: str) -> NoReturn:
    raise DigiclayError(rule)


def add(commands: Any) -> None:
    """Add the commands of other packages, or their install messages, and the place of the benchmarks."""
    for name, (package, module, extra, help) in COMMANDS.items():
        if entry := find_beside(package, module):
            entry.add(commands)
        else:
            parser = _add_any(commands, name, help=f"{help} (not part of the extension)")
            parser.set_defaults(
                carry_out=lambda _, name=name, extra=extra: refuse_absent(name, extra)
            )
    command = _add_any(commands, "benchmark", description="Where the benchmarks are.")
    command.set_defaults(carry_out=lambda _: _refuse(NO_BENCHMARK))


def _add_any(commands: Any, name: str, **listed: str) -> ArgumentParser:
    """Add a command that takes any arguments."""
    # No argument begins with this, so all are taken alike, --help too.
    parser: ArgumentParser = commands.add_parser(name, prefix_chars="\0", add_help=False, **listed)
    parser.add_argument("rest", nargs=REMAINDER)
    return parser
