"""Arguments of several commands."""

import argparse
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from ..core.base.errors import MethodError, OutputError, ParameterError
from ..core.base.quantity import parse
from ..core.files.tables import Table
from ..core.scene.scene_source import Setting, find, load, read_parts
from ..core.scene.schema import Scene

#: The key of the control method in scene files.
METHOD = "control.method"
#: Options by ``"--name METAVAR"``: the help; type or choices, help, and perhaps the default; or a
#: dict of arguments of `argparse`.
Options = Table
#: Keys in scene files of options that change a scene.
SET_BY = {"method": METHOD, "stepper": "simulation.stepper", "tolerance": "simulation.tolerance"}
#: Arguments of a command on a finished run.
RUN = {"run RUN": (Path, "run folder of 'digiclay run'"), "--quiet": "print errors only"}
#: Help of --quiet where there is a progress line.
QUIET = "print errors only, without progress"


class Help(argparse.RawDescriptionHelpFormatter):
    """Help formatter that keeps paragraphs and fits the longest command name."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog)
        self._action_max_length = 14


def add_options(parser: Any, options: Options) -> None:
    """Add a table of options; one without metavar and type is a switch."""
    for words, row in options.items():
        name, _, metavar = words.partition(" ")
        named = {"metavar": metavar} if metavar else {}
        if isinstance(row, str):
            row = (None, row) if metavar else {"action": "store_true", "help": row}
        if isinstance(row, tuple):
            kind, text, default = (*row, None)[:3]
            limit = "type" if kind is None or callable(kind) else "choices"
            row = {limit: kind, "help": text, "default": default}
        parser.add_argument(name, **named, **row)


def _setting(text: str) -> Setting:
    """Read KEY=VALUE."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise argparse.ArgumentTypeError(f"must be KEY=VALUE (got {text!r})")
    return Setting(key.strip(), value.strip())


class _Once(argparse.Action):
    """Option that is refused the second time."""

    def __call__(
        self, parser: argparse.ArgumentParser, known: argparse.Namespace, value: Any, *_: Any
    ) -> None:
        if getattr(known, self.dest) is not None:
            raise argparse.ArgumentError(self, "may be given once (compare has --methods)")
        setattr(known, self.dest, value)


#: Options that change a scene.
SCENE_OPTIONS: Options = {
    "--method M": {
        "action": _Once,
        "help": "control method, also one of your own, mine.py:Mine: the same as --set control.method=M",
    },
    "--stepper S": "stepper: the same as --set simulation.stepper=S",
    "--tolerance T": 'largest error of the heights, such as "1 um": chooses the adaptive stepper',
    "--with FILE": {
        "dest": "parts",
        "type": Path,
        "action": "append",
        "default": [],
        "help": "take the parts of device and finger that a file gives, such as fitted.toml",
    },
    "--set KEY=VALUE": {
        "dest": "settings",
        "type": _setting,
        "action": "append",
        "default": [],
        "help": 'override a parameter, such as layout.pitch="4 mm" or conduit=absent; may be repeated',
    },
}


def add_scene(
    parser: argparse.ArgumentParser, default: str = "", *, optional: bool = False
) -> None:
    """Add SCENE, or --scene where there is a default, and the options that change it."""
    scene = "a .toml file, a sample's name, or the folder of a run"
    if default:
        add_options(parser, {"--scene SCENE": (None, f"{scene}; default {default}", default)})
    else:
        parser.add_argument("scene", metavar="SCENE", nargs="?" if optional else None, help=scene)
    add_options(parser, SCENE_OPTIONS)


def scene_of(arguments: argparse.Namespace) -> tuple[Scene, Path]:
    """Return the scene the arguments name, and its file."""
    path = find(arguments.scene)
    return load(path, settings_of(arguments)), path


def settings_of(arguments: argparse.Namespace) -> list[Setting]:
    """Return what the options of `add_scene` change of a scene file."""
    settings = [part for path in arguments.parts for part in read_parts(path)]
    settings += arguments.settings
    for option, key in SET_BY.items():
        if getattr(arguments, option) is not None:
            settings.append(Setting(key, getattr(arguments, option), f"--{option}"))
    if arguments.tolerance is not None and arguments.stepper is None:
        settings.append(Setting("simulation.stepper", "adaptive", "--tolerance"))
    return [_with_method(setting) if setting.key == METHOD else setting for setting in settings]


def _with_method(setting: Setting) -> Setting:
    """Return a setting of the method by its name, and load the method of one's own that it may name."""
    return setting._replace(value=load_by_option(setting.value.strip("\"'"), setting.option))


def name_methods(varied: str) -> str:
    """Return the text of --vary with the names of the methods that it varies; one's own ones are loaded."""
    key, _, words = varied.partition("=")
    if key.strip() != METHOD:
        return varied
    return (
        f"{METHOD}={','.join(load_by_option(word.strip(), '--vary') for word in words.split(','))}"
    )


def load_by_option(word: str, option: str) -> str:
    """Return the name of the method that a word of the command line names; load one of the user's own."""
    from ..plugins.method_loader import load_method

    try:
        return load_method(word)
    except MethodError as error:
        raise MethodError(f"{option}: {error}") from None


def add_command(
    commands: Any,
    name: str,
    help: str,
    epilog: str,
    description: str = "",
    *,
    carry_out: Callable[[argparse.Namespace], int] | None = None,
    listed: bool = True,
) -> argparse.ArgumentParser:
    """Add a command; its own help begins with `description`, by default `help` as a sentence."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        description=description or f"{help[0].upper()}{help[1:]}.",
        epilog=epilog,
        formatter_class=Help,
        allow_abbrev=False,
        **({"help": help} if listed else {}),
    )
    parser.set_defaults(carry_out=carry_out)
    return parser


#: What a command takes: options by table, or a function that adds them to a parser.
Taken = Options | Callable[[argparse.ArgumentParser], object]


class Command(NamedTuple):
    """A command that a function carries out; `texts` are help, epilog and description of `add_command`."""

    carry_out: Callable[[argparse.Namespace], int]
    texts: tuple[str, str, str]
    taken: tuple[Taken, ...]
    listed: bool

    def add(self, commands: Any, name: str) -> None:
        """Add the command to others."""
        parser = add_command(
            commands, name, *self.texts, carry_out=self.carry_out, listed=self.listed
        )
        for each in self.taken:
            each(parser) if callable(each) else add_options(parser, each)


def command(
    help: str, epilog: str, *taken: Taken, description: str = "", listed: bool = True
) -> Callable[[Callable[[argparse.Namespace], int]], Command]:
    """Return a decorator that makes a command of what carries it out."""
    return lambda carry_out: Command(carry_out, (help, epilog, description), taken, listed)


def one_of(options: Options) -> Callable[[argparse.ArgumentParser], None]:
    """Return what adds a table of options of which one may be given."""
    return lambda parser: add_options(parser.add_mutually_exclusive_group(), options)


def say(arguments: argparse.Namespace, *lines: object) -> None:
    """Print lines, unless only errors are asked for."""
    if not arguments.quiet:
        print(*lines, sep="\n", flush=True)


@contextmanager
def told_as_options(*owners: str, **names: str) -> Iterator[None]:
    """Rename parameters of some owners to their options in an error, by equal name or `names`."""
    try:
        yield
    except ParameterError as error:
        if error.owner not in owners:
            raise
        option = names.get(error.field, error.field).replace("_", "-")
        raise OutputError(f"--{option} {error.rule} (got {error.value}).") from None


def whole_number(least: int, most: int) -> Callable[[str], int]:
    """Return the reader of a whole number within bounds."""

    def read(text: str) -> int:
        digits = text.isascii() and text.isdecimal() and len(text) < 12
        if not digits or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(
                f"must be a whole number from {least} to {most} (got {text!r})"
            )
        return int(text)

    return read


def _measured(usual: str, unit: str) -> Callable[[str], float]:
    """Return the reader of a quantity in SI; a bare number is in the usual unit."""

    def read(text: str) -> float:
        try:
            return parse(text if text.strip()[-1:].isalpha() else f"{text} {usual}", unit)
        except ValueError as error:
            raise argparse.ArgumentTypeError(f"{error} (got {text!r})") from None

    return read


#: Readers of a time, ``0.3`` or ``"300 ms"``, of a length in m, and of one that is in mm without a
#: unit.
seconds, length, millimeters = _measured("s", "s"), _measured("m", "m"), _measured("mm", "m")


def formats(text: str) -> list[str]:
    """Read a list of mesh formats."""
    from ..core.mesh_io.mesh_writer import find_format

    try:
        return list(dict.fromkeys(find_format(name.strip()) for name in text.split(",")))
    except OutputError as error:
        raise argparse.ArgumentTypeError(str(error).rstrip(".")) from None


def size(text: str) -> tuple[int, int]:
    """Read the size of a picture, ``1600x1000``."""
    read = re.fullmatch(r"([1-9]\d{0,4})x([1-9]\d{0,4})", text)
    if not read:
        raise argparse.ArgumentTypeError(
            f"must be WIDTHxHEIGHT in pixels, such as 1600x1000 (got {text!r})"
        )
    return int(read[1]), int(read[2])
