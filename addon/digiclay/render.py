"""A still of one instant, drawn in the background without touching the user's scene."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from . import stage, view
from .compat import bpy, has_denoiser, quiet, scratch
from .core.errors import DigiclayError, OutputError
from .instant import Instant

__all__ = ["ENGINES", "still"]

#: Our names of the engines, and Blender's.
ENGINES = {"cycles": "CYCLES", "workbench": "BLENDER_WORKBENCH"}


def still(
    instant: Instant,
    out: Path,
    *,
    width: int = 1600,
    height: int = 1000,
    engine: str = "cycles",
    samples: int = 6,
    denoise: bool = True,
) -> Path:
    """Draw an instant into a PNG file.

    Parameters
    ----------
    instant : Instant
        What to draw.
    out : Path
        The file; it is written under a temporary name and renamed.
    width, height : int, optional
        Size of the picture, pixels.
    engine : {"cycles", "workbench"}, optional
        Cycles gives soft shadows and runs anywhere; Workbench is quicker and plainer, and
        wants OpenGL.
    samples : int, optional
        Samples per pixel of Cycles; more is smoother and slower in proportion.
    denoise : bool, optional
        Smooth what few samples leave, where Blender was built with Cycles' denoiser.

    Returns
    -------
    Path
        `out`.

    Raises
    ------
    OutputError
        When the file cannot be written.
    """
    if engine not in ENGINES:
        raise DigiclayError(f"render.engine must be one of {', '.join(ENGINES)} (got {engine!r}).")
    if min(width, height, samples) < 1:
        size = f"{width} x {height} at {samples}"
        raise DigiclayError(f"render.size must be at least 1 x 1 pixels at 1 sample (got {size}).")
    partial = out.with_name(f".{out.name}.partial.png")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        partial.touch()
        with scratch():
            scene = bpy.data.scenes.new("Digital Clay Still")
            _settings(scene, partial, (width, height), engine, samples, denoise)
            bed = view.build(instant, scene.collection)
            stage.set_up(scene, bed, instant)
            with quiet():
                bpy.ops.render.render(write_still=True, scene=scene.name)
        if not partial.stat().st_size:
            raise OutputError(f"{out} cannot be written: Blender gave no picture.")
        os.replace(partial, out)
    except OSError as error:
        raise OutputError(f"{out} cannot be written: {error.strerror or error}.") from None
    finally:
        partial.unlink(missing_ok=True)
    return out


def _settings(
    scene: Any, path: Path, size: tuple[int, int], engine: str, samples: int, denoise: bool
) -> None:
    """Set what decides the picture besides the scene's contents."""
    render = scene.render
    render.engine = ENGINES[engine]
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    render.filepath = str(path)
    render.use_file_extension = False
    render.image_settings.file_format = "PNG"
    render.image_settings.color_mode = "RGB"
    if engine == "cycles":
        cycles = scene.cycles
        cycles.device = "CPU"
        cycles.samples = samples
        cycles.seed = 0
        cycles.use_adaptive_sampling = False
        cycles.max_bounces = 2
        cycles.use_denoising = denoise and has_denoiser()
        if cycles.use_denoising:
            cycles.denoiser = "OPENIMAGEDENOISE"
            if hasattr(cycles, "denoising_quality"):
                cycles.denoising_quality = "FAST"
            cycles.denoising_prefilter = "NONE"
        cycles.caustics_reflective = cycles.caustics_refractive = False
        return
    shading = scene.display.shading
    scene.display.render_aa = "16"
    scene.display.light_direction = (0.45, 0.35, 0.82)
    shading.light = "STUDIO"
    shading.color_type = "MATERIAL"
    shading.show_shadows = True
    shading.shadow_intensity = 0.45
    shading.background_type = "WORLD"
    shading.show_cavity = True
    shading.cavity_type = "BOTH"
