"""Parser of all commands."""

import re
import sys
from argparse import Action, ArgumentError, ArgumentParser
from collections.abc import Sequence
from importlib import import_module
from typing import Any, NoReturn

from ..core.base.errors import one_line
from ..core.base.quantity import find_nearest_name
from ..core.version import __version__
from .arguments import Help
from .stop import WRONG

#: The commands by name, without those of other packages: only the one asked for is imported.
COMMANDS = {
    "run": "run.carry_out",
    "batch": "batch.carry_out",
    "job": "job.carry_out",
    "page": "job.write_page",
    "form": "form.carry_out",
    "describe": "describe.carry_out",
    "export": "export.carry_out",
    "features": "export.list_features",
    "plot": "render.plot",
    "render": "render.carry_out",
    "sweep": "sweep.carry_out",
    "compare": "compare.carry_out",
    "new-method": "new_method.carry_out",
}

EXAMPLES = """\
examples:
  digiclay run ridge_mound_valley                   the paper's session, into ./ridge_mound_valley
  digiclay run my.toml --out first --export stl     a custom scene, and its surface for a printer
  digiclay run tap --set valve.stroke="20 um"       the same scene with another valve
  digiclay describe ridge_mound_valley              the parts of a scene
  digiclay render first --time 5                    a picture of an instant (needs bpy)
"""


class Parser(ArgumentParser):
    """Parser with errors of one line, which suggest the probable word."""

    _given: Sequence[str] = ()
    _hint = ""

    def error(self, message: str) -> NoReturn:
        """Print the error in the arguments, and exit."""
        hint = self._hint or self._misspelt()
        self.exit(
            WRONG, one_line(f"{self.prog}: {message}.{hint} See '{self.prog} --help'.") + "\n"
        )

    def _misspelt(self) -> str:
        """Return a suggestion for an unknown option."""
        words = list(self._given)
        for word in words[: words.index("--")] if "--" in words else words:
            name = word.partition("=")[0]
            if (
                re.fullmatch("--?[A-Za-z][A-Za-z-]+", name)
                and name not in self._option_string_actions
            ):
                asked = _asked(name, list(self._option_string_actions))
                return asked.replace("?", f" (not {name})?")
        return ""

    def _check_value(self, action: Action, value: Any) -> None:
        """Refuse a value that is not among the choices, and suggest the nearest."""
        if action.choices is not None and value not in action.choices:
            choices = [str(choice) for choice in action.choices]
            self._hint = _asked(str(value), choices)
            raise ArgumentError(
                action, f"invalid choice: {value!r} (choose from {', '.join(choices)})"
            )

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """Refuse unknown arguments here, where their command is known."""
        self._given = given = list(sys.argv[1:] if args is None else args)
        if "--token" in given[:-1]:  # which may begin with a dash
            at = given.index("--token")
            given[at : at + 2] = ["=".join(given[at : at + 2])]
        arguments, unknown = super().parse_known_args(given, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return arguments, unknown


def _asked(word: str, names: Sequence[str]) -> str:
    """Return a suggestion: the only name with this beginning, or the nearest."""
    bare = {name.lstrip("-").lower(): name for name in names}  # dashes do not count for likeness
    meant = word.lstrip("-").lower()
    longer = [name for name in bare if len(meant) > 1 and name.startswith(meant)]
    close = longer[0] if len(longer) == 1 else find_nearest_name(meant, list(bare), alike=0.6)
    return f" Did you mean {bare[close]}?" if close else ""


def parser(first: str = "") -> ArgumentParser:
    """Return the parser of all commands, or of the one that a command line begins with."""
    top = Parser(
        prog="digiclay",
        description="Shape-design sessions on Digital Clay, a simulated bed of fluidic pins.",
        epilog=EXAMPLES,
        formatter_class=Help,
        allow_abbrev=False,
    )
    top.add_argument("--version", action="version", version=f"digiclay {__version__}")
    commands = top.add_subparsers(
        title="commands", metavar="COMMAND", required=True, parser_class=Parser
    )
    if first == "--version":
        return top
    for name in [first] if first in COMMANDS else COMMANDS:
        module, _, command = COMMANDS[name].partition(".")
        getattr(import_module(f".{module}", __package__), command).add(commands, name)
    if first not in COMMANDS:
        import_module(".outside", __package__).add(commands)
    return top
