"""Still of one instant, drawn in the background beside the user's Blender scene."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

from ..compat import bpy, has_denoiser, quiet, scratch
from ..core.base.errors import OutputError
from ..core.files.formats import is_whole_picture
from ..core.session.render_settings import Picture, Still
from ..device import view
from ..device.instant import Instant
from . import stage

#: Our names of the engines, and Blender's.
ENGINES = {"cycles": "CYCLES", "workbench": "BLENDER_WORKBENCH"}
#: With less than this on a disk, bytes, a picture does not fit.
SPACE = 2**20


def render_still(instant: Instant, out: Path, looks: Still) -> Path:
    """Draw an instant into a PNG file, which appears whole or not at all."""
    partial = out.with_name(f".{out.name}.{os.getpid()}.partial.png")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with scratch():
            scene = add_picture_scene("Digital Clay Still", looks)
            bed = view.build(instant, scene.collection)
            apply_style(bed, looks)
            stage.set_up(scene, bed, instant)
            render_picture(scene, partial, out)
        os.replace(partial, out)
    except OSError as error:
        raise OutputError(f"{out} cannot be written: {error.strerror or error}.") from None
    finally:
        partial.unlink(missing_ok=True)
    return out


def apply_style(bed: Any, looks: Picture) -> None:
    """Color the pins as asked, and show arrows or not. `bed` bpy.types.Object."""
    view.color_by(bed, looks.color)
    view.show_arrows(bed, looks.arrows)


def render_picture(scene: Any, path: Path, out: Path) -> None:
    """Draw a scene into a PNG file; messages name `out`, which the user knows."""
    scene.render.filepath = str(path)
    try:
        path.touch()
        with quiet():
            bpy.ops.render.render(write_still=True, scene=scene.name)
        if not is_whole_picture(path.read_bytes()):
            raise OutputError(f"{out} cannot be written: {failure_reason(path)}.")
    except OSError as error:
        raise OutputError(f"{out} cannot be written: {error.strerror or error}.") from None
    except RuntimeError as error:
        raise OutputError(f"{out} cannot be drawn: {' '.join(str(error).split())}") from None


def failure_reason(path: Path) -> str:
    """Return why Blender may not have written a file."""
    full = shutil.disk_usage(path.parent).free < SPACE
    return "no space is left on the disk" if full else "Blender wrote no whole file"


def add_picture_scene(name: str, looks: Picture) -> Any:
    """Add a scene with all that decides a picture besides the scene's contents."""
    scene = bpy.data.scenes.new(name)
    render, engine = scene.render, looks.engine
    render.engine = ENGINES[engine]
    render.resolution_x, render.resolution_y = looks.width, looks.height
    render.resolution_percentage = 100
    render.use_file_extension = False
    render.image_settings.file_format = "PNG"
    render.image_settings.color_mode = "RGB"
    if engine == "cycles":
        _cycles(scene.cycles, looks.samples)
    else:
        _workbench(scene.display)
    return scene


def use_fast_settings(scene: Any) -> None:
    """Leave out shadows, two thirds of a frame in Workbench, and the samples hardly seen."""
    scene.display.shading.show_shadows = False
    scene.display.render_aa = "8"


def _cycles(cycles: Any, samples: int) -> None:
    """Few samples, no surprises: the same picture each time, on any machine."""
    cycles.device = "CPU"
    cycles.samples = samples
    cycles.seed = 0
    cycles.use_adaptive_sampling = False
    cycles.max_bounces = 2
    cycles.use_denoising = has_denoiser()
    if cycles.use_denoising:
        cycles.denoiser = "OPENIMAGEDENOISE"
        if hasattr(cycles, "denoising_quality"):
            cycles.denoising_quality = "FAST"
        cycles.denoising_prefilter = "NONE"
    cycles.caustics_reflective = cycles.caustics_refractive = False


def _workbench(display: Any) -> None:
    """Plain colors, with shadows and edges that show slopes."""
    shading = display.shading
    display.render_aa = "16"
    display.light_direction = (0.45, 0.35, 0.82)
    shading.light = "STUDIO"
    shading.color_type = "MATERIAL"
    shading.show_shadows = True
    shading.shadow_intensity = 0.45
    shading.background_type = "WORLD"
    shading.show_cavity = True
    shading.cavity_type = "BOTH"
