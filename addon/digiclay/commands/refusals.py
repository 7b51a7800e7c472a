"""Refusals of a command before any work, in one line: missing libraries, folders and files that cannot be."""

import importlib
import importlib.util
import os
from pathlib import Path

from ..core.base.errors import OutputError
from .stop import defer_interrupt

#: The package, as an extension in Blender or installed with pip.
PACKAGE = __name__.removesuffix(".commands.refusals")


def in_blender() -> bool:
    """Return whether this is an extension inside Blender, which cannot start others like itself."""
    return PACKAGE != "digiclay"


def refuse_without(option: str, extra: str, *modules: str) -> None:
    """Refuse what needs libraries of an extra of this package that are not installed."""
    for module in modules:
        if importlib.util.find_spec(module) is None:
            raise OutputError(f"{option} needs {module}: run 'pip install digiclay[{extra}]'.")


def refuse_without_blender() -> None:
    """Refuse without Blender's module, with the command that installs it."""
    with defer_interrupt():
        importlib.import_module("..compat", __package__)


def refuse_unwritable(folder: Path) -> None:
    """Refuse a folder that is none, or that cannot be made or written to."""
    above = next(path for path in (folder, *folder.resolve().parents) if os.path.lexists(path))
    if not os.path.isdir(above):
        raise OutputError(f"{folder} cannot be a folder: {above.name} is a file.")
    if not os.access(above, os.W_OK | os.X_OK):
        raise OutputError(f"{folder} cannot be written to.")


def refuse_file(out: Path, ending: str) -> None:
    """Refuse a file that cannot be written, or whose name promises another format."""
    if out.suffix.lower() != ending:
        raise OutputError(f"--out must end with {ending} (got {out}).")
    if os.path.isdir(out):
        raise OutputError(f"--out must be a file ({out} is a folder).")
    refuse_unwritable(out.parent)
