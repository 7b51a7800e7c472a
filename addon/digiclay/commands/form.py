"""``digiclay form``: display of a shape, forming, and export."""

import argparse
import json
import textwrap
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ..core.base.errors import OutputError
from ..core.base.quantity import show_digits
from ..core.files.run_folder import check_folder, claim_folder, find_name
from ..core.model.layout import make_grid
from ..core.scene.assembly import assemble
from ..core.scene.forming import GESTURES, make_forming_scene
from ..core.scene.scene_source import Setting
from ..core.scene.schema import Scene
from ..core.session.finished_run import require_surface
from ..core.session.run_scene import Result
from ..core.shapes.fitting import Fitted, find_shape, fit_shape, import_reader, list_shapes, pack
from .arguments import QUIET, add_scene, command, formats, say, scene_of
from .run import NO_ERRORS, plan_meshes, simulate, write_run
from .stop import Stop, allow_interrupt, defer_interrupt

EXAMPLES = f"""\
examples:
  digiclay form crater                                   displayed, a peak drawn out of it: surface.stl
  digiclay form "my relief.png" --set shape.rise="20 mm" --finger press --export obj,glb
  digiclay form part.stl --set shape.fit=actual --set shape.unit=inch --out part
  digiclay form letters --finger scene --scene my.toml   the fingertip path of the scene

{textwrap.fill("sample shapes: " + ", ".join(list_shapes()), 100)}

The result is a run folder: scene.toml (with the heights of the shape), history.npz, metrics.json. It has the
formed surface, and the displayed one in the folder 'displayed'.
"""
#: Bed, method and finger unless --scene names others.
SCENE = "dome_peaked"
OPTIONS = {
    "--finger": (
        (*GESTURES, "scene"),
        "press: into the highest part; pull: press, and draw a peak out of it (default); "
        "away: no touch; scene: as the scene says",
        "pull",
    ),
    "--out DIR": (Path, "folder; default: the shape's name in the working folder"),
    "--overwrite": "replace an older run at the end",
    "--export F,...": (formats, "mesh formats; default stl", ["stl"]),
    **NO_ERRORS,
    "--quiet": QUIET,
}


@command(
    "display a shape, form it with the fingertip, export it",
    EXAMPLES,
    {"shape SHAPE": "a sample shape's name, or a file"},
    partial(add_scene, default=SCENE),
    OPTIONS,
    description="Display a mesh, a picture or an array of heights, form it with the fingertip, export it.",
)
def carry_out(arguments: argparse.Namespace) -> int:
    """Fit, display, form, export, and print a summary."""
    file = find_shape(arguments.shape)
    out = arguments.out or Path(find_name(file))
    check_folder(out, overwrite=arguments.overwrite)
    word = json.dumps(arguments.shape, ensure_ascii=False)
    arguments.settings = [Setting("shape.file", word, "SHAPE"), *arguments.settings]
    with defer_interrupt():
        import_reader(file)
    with allow_interrupt():  # a mesh of millions of triangles takes a while
        scene, path = scene_of(arguments)
        scene, laid = _laid(scene)
        say(arguments, laid.describe())
        if arguments.finger != "scene":
            if len(scene.fingers) > 1:
                say(arguments, f"formed by the first of {len(scene.fingers)} fingers alone")
                scene = replace(scene, fingers=scene.fingers[:1])
            scene = make_forming_scene(scene, assemble(scene), arguments.finger)
    with claim_folder(out, overwrite=arguments.overwrite) as claim, Stop() as stop:
        result = simulate(arguments, scene, path, stop)
        # The shape is judged in the last row before the fingertip touches.
        touching = np.flatnonzero(result.history["total_force"] > 0.0)
        row = max(int(touching[0]) - 1, 0) if touching.size else len(result.history["time"]) - 1
        result, lines = _evaluate(result, row, laid)
        meshes = [
            plan_meshes(scene, result.history, arguments.export),
            plan_meshes(scene, result.history, arguments.export, row, "displayed"),
        ]
        return write_run(arguments, claim, result, meshes, stop, *lines)


def _laid(scene: Scene) -> tuple[Scene, Fitted]:
    """Return the scene with the shape's heights in it, and the messages on them."""
    require_surface(scene, "form")
    if scene.recorder is None:
        raise OutputError("form needs a recorder, and the scene has recorder = 'absent'.")
    if scene.shape is None:
        raise OutputError("form needs a shape, and the scene has shape = 'absent'.")
    laid = fit_shape(scene.shape, make_grid(scene.layout), scene.actuator)
    # The run's folder says all there is to say, whatever becomes of the shape's file.
    shape = replace(scene.shape, heights=pack(laid.heights))
    name = Path(scene.shape.file).stem
    return replace(
        scene, shape=shape, name=name, description=f"{name}, displayed and then formed."
    ), laid


def _evaluate(result: Result, row: int, laid: Fitted) -> tuple[Result, list[str]]:
    """Return the result with the data of its shape, displayed in a row, and their lines of text."""
    height, layout = result.history["height"], result.scene.layout
    error = float(np.abs(height[row] - laid.heights).max())
    stands = next(
        i for i in range(row + 1) if np.abs(height[i] - laid.heights).max() <= error + 1e-9
    )
    change = height[-1] - height[row]
    area = layout.pitch * layout.row_spacing
    raised, lowered = (float(np.maximum(rise, 0.0).sum() * area) for rise in (change, -change))
    figures = {"display_error": error, "raised_volume": raised, "lowered_volume": lowered}
    counts = {
        "shape_covered": laid.covered,
        "shape_clipped": laid.too_low + laid.too_high,
        "shape_overhanging": laid.overhanging,
    }
    units = dict(zip(figures, ("m", "m3", "m3"), strict=True))
    metrics = {**result.metrics, **figures, **counts, "units": {**result.metrics["units"], **units}}
    highest, lowest = (show_digits(1e3 * max(0.0, way.max())) for way in (change, -change))
    lines = [
        f"displayed to within {show_digits(error * 1e6)} µm in {result.history['time'][stands]:.1f} s",
        f"formed: {show_digits(raised * 1e6)} cm³ raised by up to {highest} mm, "
        f"{show_digits(lowered * 1e6)} cm³ lowered by up to {lowest} mm",
    ]
    return replace(result, metrics=metrics), lines
