"""``digiclay render``: a picture of one instant of a finished run, drawn by Blender."""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ..core.fingertip import Fingertip
from ..core.scene import Scene
from .arguments import add_run, seconds, size
from .finished import last_touch, read, row_at

__all__ = ["add", "picture", "refuse_without_blender"]

EXAMPLES = """\
examples:
  digiclay render ridge_mound_valley
  digiclay render ridge_mound_valley --time 10 --size 800x500 --out ridge.png
"""


def add(commands: Any) -> None:
    """Add the command."""
    parser = add_run(
        commands, "render", "draw an instant of a run as a PNG; needs Blender's module, bpy", EXAMPLES
    )
    parser.add_argument("--time", metavar="T", type=seconds, help="the instant, s; default the last touch")
    parser.add_argument("--out", metavar="PNG", type=Path, help="default pins.png in the run's folder")
    parser.add_argument("--size", metavar="WxH", type=size, default=(1600, 1000), help="default 1600x1000")
    parser.add_argument("--engine", choices=("cycles", "workbench"), default="cycles", help="default cycles")
    parser.set_defaults(carry_out=carry_out)


def refuse_without_blender() -> None:
    """Say what to install, before any work is done."""
    importlib.import_module("..compat", __package__)


def picture(
    scene: Scene,
    history: Mapping[str, NDArray[Any]],
    row: int,
    out: Path,
    *,
    width: int = 1600,
    height: int = 1000,
    engine: str = "cycles",
) -> Path:
    """Draw one row of a history; Blender is imported only now."""
    from ..instant import Instant
    from ..render import still

    finger = scene.fingertip or Fingertip()
    instant = Instant.of(history, row, pitch=scene.layout.pitch, actuator=scene.actuator, finger=finger)
    return still(instant, out, width=width, height=height, engine=engine)


def carry_out(arguments: argparse.Namespace) -> int:
    """Render."""
    refuse_without_blender()
    run = read(arguments.run, "height", "force", "mode", "fingertip", "position", "total_force")
    row = last_touch(run.history) if arguments.time is None else row_at(run.history, arguments.time)
    out = arguments.out or arguments.run / "pins.png"
    width, height = arguments.size
    path = picture(run.scene, run.history, row, out, width=width, height=height, engine=arguments.engine)
    if not arguments.quiet:
        print(path)
    return 0
