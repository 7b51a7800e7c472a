"""Options of the formed surface: skin and features."""

from __future__ import annotations

import argparse
from typing import Any

from ..core.base.errors import OutputError
from ..core.mesh_io.export_model import Model
from ..core.scene.schema import Scene
from ..core.session.finished_run import Run, find_row
from ..core.surface.features import Finding
from ..core.surface.skins import SKINS
from .arguments import millimeters, seconds, told_as_options


def add_surface(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    shown = "; ".join(f"{name}: {said}" for name, said in SKINS.items())
    parser.add_argument("--skin", choices=tuple(SKINS), default="bilinear", help=f"{shown}; default bilinear")
    parser.add_argument(
        "--resolution",
        metavar="N",
        type=_points,
        default=0,
        help="points a pitch; default: 1, or 4 for curved skins",
    )
    known = Finding()
    parser.add_argument(
        "--threshold", metavar="L", type=millimeters, default=known.threshold,
        help="least distance of a feature from the former surface, mm, or with a unit; "
        f"default {known.threshold * 1e3:g} mm",
    )  # fmt: skip
    parser.add_argument(
        "--smallest", metavar="N", type=int, default=known.smallest,
        help=f"least number of pins of a feature; default {known.smallest}",
    )  # fmt: skip
    parser.add_argument(
        "--former", metavar="T", default="0",
        help="instant of the former surface, s, or 'rest'; default: the start",
    )  # fmt: skip


def _points(text: str) -> int:
    """Read points a pitch: a whole number from 1 on; 0 stands for the default in files alone."""
    if not text.isdecimal() or int(text[:9]) < 1:
        raise argparse.ArgumentTypeError(f"must be a whole number from 1 to 64 (got {text!r})")
    return int(text[:9])


def finding_of(arguments: argparse.Namespace) -> Finding:
    """Return what counts as a feature."""
    with told_as_options("Finding"):
        return Finding(threshold=arguments.threshold, smallest=arguments.smallest)


def model_of(arguments: argparse.Namespace, scene: Scene, kind: str) -> Model:
    """Return what is to be made. `kind`: of the mesh."""
    told: dict[str, Any] = {"kind": kind, "skin": arguments.skin, "resolution": arguments.resolution}
    if getattr(arguments, "base_thickness", None) is not None:
        told["base_thickness"] = arguments.base_thickness
    with told_as_options("Model"):
        return Model(cap=scene.actuator.bore / 2.0, **told)


def row_of(run: Run, time: float | None) -> int:
    """Return the row of an instant, s; the last one where none is given. `time`, s."""
    return -1 if time is None else find_row(run.history, time, "--time")


def former_of(run: Run, text: str) -> int | float:
    """Return the row of what was before, or the rest height of all pins, m.

    `text`: value of --former: *rest*, or a time.
    """
    if text.strip() == "rest":
        return float(run.scene.actuator.rest_height)
    try:
        time = seconds(text)
    except argparse.ArgumentTypeError as error:
        raise OutputError(f"--former must be a time or 'rest': {error}.") from None
    return find_row(run.history, time, "--former")
