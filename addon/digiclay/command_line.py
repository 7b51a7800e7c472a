"""Command line in Blender: ``blender --command digiclay`` with the installed extension."""

from dataclasses import dataclass

from .compat import bpy

NAME = "digiclay"


@dataclass
class Registered:
    """Blender's handle of the command; None while it is not registered."""

    handle: object = None


COMMAND = Registered()


def run(arguments: list[str]) -> int:
    """Carry out a command; what the commands need is imported only now, not in every Blender session."""
    from .cli import main

    return main(arguments)


def register() -> None:
    """Register the command in Blender."""
    COMMAND.handle = bpy.utils.register_cli_command(NAME, run)


def unregister() -> None:
    """Undo `register`."""
    if COMMAND.handle is not None:
        bpy.utils.unregister_cli_command(COMMAND.handle)
        COMMAND.handle = None
