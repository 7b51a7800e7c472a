"""What is refused before any work, because it is bound to fail after it."""

from __future__ import annotations

import importlib
import importlib.util

from ..core.errors import OutputError
from ..core.scene import Scene

__all__ = ["refuse_what_has_no_surface", "refuse_without", "refuse_without_blender"]


def refuse_what_has_no_surface(scene: Scene, option: str) -> None:
    """Refuse to make a surface of a bed that has none."""
    if min(scene.layout.rows, scene.layout.columns) < 2:
        raise OutputError(
            f"{option} needs at least 2 x 2 cells (got {scene.layout.rows} x {scene.layout.columns})."
        )


def refuse_without(module: str, option: str, remedy: str) -> None:
    """Refuse what needs a library that is not installed."""
    if importlib.util.find_spec(module) is None:
        raise OutputError(f"{option} needs {module}: run '{remedy}'.")


def refuse_without_blender() -> None:
    """Say what to install where Blender's module is missing."""
    importlib.import_module("..compat", __package__)
