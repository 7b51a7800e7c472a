"""Command line in Blender: ``blender --command digiclay`` with the installed extension."""

from __future__ import annotations

from .compat import bpy

NAME = "digiclay"

#: What Blender gave for the registered command, and wants back.
HANDLES: list[object] = []


def run(arguments: list[str]) -> int:
    """Carry out a command; what the commands need is imported only now, not in every Blender session."""
    from .cli import main

    return main(arguments)


def register() -> None:
    """Register the command in Blender."""
    HANDLES.append(bpy.utils.register_cli_command(NAME, run))


def unregister() -> None:
    """Undo `register`."""
    while HANDLES:
        bpy.utils.unregister_cli_command(HANDLES.pop())
