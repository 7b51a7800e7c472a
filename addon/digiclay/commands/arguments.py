"""Arguments several commands take."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import Any

from ..core.quantity import parse
from ..core.scene import Scene
from ..core.scene_file import Setting, find, load

__all__ = ["add_run", "add_scene", "length", "scene_of", "seconds", "size"]


def add_scene(parser: argparse.ArgumentParser, default: str = "") -> None:
    """Add SCENE, or --scene where there is a default, and the options that change it."""
    said = "a .toml file, a sample's name, or the folder of a run"
    if default:
        parser.add_argument("--scene", metavar="SCENE", default=default, help=f"{said}; default {default}")
    else:
        parser.add_argument("scene", metavar="SCENE", help=said)
    parser.add_argument("--method", metavar="M", help="control method: the same as --set control.method=M")
    parser.add_argument("--stepper", metavar="S", help="stepper: the same as --set simulation.stepper=S")
    parser.add_argument(
        "--tolerance",
        metavar="T",
        help='error of the heights to keep to, such as "1 um": chooses the adaptive stepper',
    )
    parser.add_argument(
        "--set",
        dest="settings",
        metavar="KEY=VALUE",
        type=_setting,
        action="append",
        default=[],
        help='override a parameter, such as layout.pitch="4 mm" or conduit=absent; may be repeated',
    )


def scene_of(arguments: argparse.Namespace) -> tuple[Scene, Path]:
    """Return the scene the arguments name, and its file."""
    path, settings = find(arguments.scene), list(arguments.settings)
    for option, key in (("method", "control.method"), ("stepper", "simulation.stepper")):
        if getattr(arguments, option) is not None:
            settings.append(Setting(key, getattr(arguments, option), f"--{option}"))
    if arguments.tolerance is not None:
        settings.append(Setting("simulation.tolerance", arguments.tolerance, "--tolerance"))
        if arguments.stepper is None:
            settings.append(Setting("simulation.stepper", "adaptive", "--tolerance"))
    return load(path, settings), path


def add_run(commands: Any, name: str, help: str, epilog: str) -> argparse.ArgumentParser:
    """Add a command that works on a finished run."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name, help=help, description=help, epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False,
    )  # fmt: skip
    parser.add_argument("run", metavar="RUN", type=Path, help="the folder 'digiclay run' wrote")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    return parser


def _setting(text: str) -> Setting:
    """Read KEY=VALUE."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise argparse.ArgumentTypeError(f"must be KEY=VALUE (got {text!r})")
    return Setting(key.strip(), value.strip())


def seconds(text: str) -> float:
    """Read a time: a number of seconds, or a quantity such as ``"300 ms"``."""
    return _measured(text, "s")


def length(text: str) -> float:
    """Read a length: a number of metres, or a quantity such as ``"20 um"``."""
    return _measured(text, "m")


def _measured(text: str, unit: str) -> float:
    """Read a quantity; a bare number is in SI."""
    try:
        return parse(text if text.strip()[-1:].isalpha() else f"{text} {unit}", unit)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{error} (got {text!r})") from None


def size(text: str) -> tuple[int, int]:
    """Read the size of a picture, ``1600x1000``."""
    read = re.fullmatch(r"([1-9]\d{0,4})x([1-9]\d{0,4})", text)
    if not read:
        raise argparse.ArgumentTypeError(f"must be WIDTHxHEIGHT in pixels, such as 1600x1000 (got {text!r})")
    return int(read[1]), int(read[2])
