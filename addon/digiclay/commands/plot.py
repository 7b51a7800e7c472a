"""``digiclay plot``: heights and force of a run over time, and its surface, as pictures."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ..core.files.run_folder import claim_files
from ..core.scene.schema import Scene
from ..core.session.finished_run import SHAPES, read_run
from .arguments import add_run
from .stop import refuse_unwritable, refuse_without, require_surface

EXAMPLES = """\
examples:
  digiclay plot ridge_mound_valley
  digiclay plot ridge_mound_valley --out pictures
"""
#: The files.
PLOTS = ("session.png", "surface.png")


def add(commands: Any) -> None:
    """Add the command."""
    said = "draw heights and force of a run over time, and its final surface"
    parser = add_run(commands, "plot", said, EXAMPLES)
    parser.add_argument("--out", metavar="DIR", type=Path, help="output folder; default: the run folder")
    parser.set_defaults(carry_out=carry_out)


def plotted(scene: Scene, history: Mapping[str, NDArray[Any]], folder: Path) -> list[Path]:
    """Draw a history into a folder; return the files."""
    from ..plots.run import session, surface

    paths = [folder / name for name in PLOTS]
    return [session(history, paths[0], scene.set_point), surface(history, paths[1])]


def carry_out(arguments: argparse.Namespace) -> int:
    """Plot."""
    folder: Path = arguments.out or arguments.run
    refuse_without("matplotlib", "digiclay plot", "pip install digiclay[plots]")
    run = read_run(arguments.run, *(name for name in SHAPES if name != "time"))
    require_surface(run.scene, "plot")
    refuse_unwritable(folder)
    with claim_files([folder / name for name in PLOTS]):
        for path in plotted(run.scene, run.history, folder):
            if not arguments.quiet:
                print(path)
    return 0
