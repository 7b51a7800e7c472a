"""``digiclay export``: the surface of a finished run as mesh files."""

from __future__ import annotations

import argparse
import importlib.util
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ..core.errors import OutputError
from ..core.export import FORMATS, UNITS, known_format, mesh, write
from ..core.scene import Scene
from .arguments import add_run, seconds
from .finished import read, row_at

__all__ = ["add", "exported", "formats", "refuse_what_has_no_surface", "refuse_without"]

EXAMPLES = """\
examples:
  digiclay export ridge_mound_valley --format stl,glb
  digiclay export ridge_mound_valley --format ply --unit m --time 10 --out meshes
"""


def add(commands: Any) -> None:
    """Add the command."""
    parser = add_run(commands, "export", "write the formed surface of a run as a watertight solid", EXAMPLES)
    shown = ", ".join(f"{name} ({said})" for name, said in FORMATS.items())
    parser.add_argument(
        "--format", metavar="F,...", type=formats, default=["stl"], help=f"{shown}; default stl"
    )
    parser.add_argument("--unit", choices=tuple(UNITS), default="mm", help="of stl, obj and ply; default mm")
    parser.add_argument("--time", metavar="T", type=seconds, help="the instant, s; default the end")
    parser.add_argument("--out", metavar="DIR", type=Path, help="where to; default the run's folder")
    parser.set_defaults(carry_out=carry_out)


def formats(text: str) -> list[str]:
    """Read a list of mesh formats."""
    try:
        return list(dict.fromkeys(known_format(name.strip()) for name in text.split(",")))
    except OutputError as error:
        raise argparse.ArgumentTypeError(str(error).rstrip(".")) from None


def refuse_what_has_no_surface(scene: Scene, option: str) -> None:
    """Refuse, before any work, to make a surface of a bed that has none."""
    if min(scene.layout.rows, scene.layout.columns) < 2:
        raise OutputError(
            f"{option} needs at least 2 x 2 cells (got {scene.layout.rows} x {scene.layout.columns})."
        )


def refuse_without(module: str, option: str, remedy: str) -> None:
    """Refuse, before any work, what needs a library that is not installed."""
    if importlib.util.find_spec(module) is None:
        raise OutputError(f"{option} needs {module}: run '{remedy}'.")


def exported(
    scene: Scene,
    history: Mapping[str, NDArray[Any]],
    row: int,
    kinds: Iterable[str],
    folder: Path,
    unit: str = "mm",
) -> list[Path]:
    """Write the surface of one row of a history in several formats; return the files."""
    solid = mesh(history["position"], history["height"][row], scene.layout.rows, scene.layout.columns)
    return [write(solid, folder / f"surface.{kind}", unit) for kind in kinds]


def carry_out(arguments: argparse.Namespace) -> int:
    """Export."""
    run = read(arguments.run, "height", "position")
    refuse_what_has_no_surface(run.scene, "export")
    row = -1 if arguments.time is None else row_at(run.history, arguments.time)
    folder = arguments.out or arguments.run
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder} cannot be made: {error.strerror or error}.") from None
    for path in exported(run.scene, run.history, row, arguments.format, folder, arguments.unit):
        if not arguments.quiet:
            print(path)
    return 0
