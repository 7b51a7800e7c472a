"""Still of one instant, drawn in the background beside the user's Blender scene."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..compat import Object, PropertyGroup, Scene, View3DShading, bpy, has_denoiser, quiet, scratch
from ..core.base.errors import OutputError
from ..core.files.formats import is_whole_picture
from ..core.files.run_folder import name_unfinished
from ..core.session.render_settings import Moving, Picture, Still
from ..device import view
from ..device.instant import Instant
from . import stage

#: Our names of the engines, and Blender's.
ENGINES = {"cycles": "CYCLES", "workbench": "BLENDER_WORKBENCH"}
#: With less than this on a disk, bytes, a picture does not fit.
SPACE = 2**20


def render_still(instant: Instant, out: Path, looks: Still) -> Path:
    """Draw an instant into a PNG file, which appears whole or not at all."""
    with stage_bed("Digital Clay Still", instant, looks) as (scene, bed):
        stage.set_up(scene, bed, instant)
        render_picture(scene, out, out)
    return out


@contextmanager
def stage_bed(
    name: str, instant: Instant, looks: Picture, lowest: float | None = None
) -> Iterator[tuple[Scene, Object]]:
    """Give a scene that draws pictures and a bed in it, for the block; `lowest` of the pins ever, m."""
    with scratch():
        scene = add_picture_scene(name, looks)
        bed = view.build(instant, scene.collection, lowest)
        view.color_by(bed, looks.color)
        view.show_arrows(bed, looks.arrows)
        stage.add_bodies(scene, bed, instant)
        yield scene, bed


def render_picture(scene: Scene, file: Path, out: Path) -> None:
    """Draw a scene into a PNG file, whole or not at all; messages name `out`, which the user knows."""
    part = name_unfinished(file)
    scene.render.filepath = str(part)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        part.touch()
        with quiet():
            bpy.ops.render.render(write_still=True, scene=scene.name)
        if not is_whole_picture(part.read_bytes()):
            raise OutputError(f"{out} cannot be written: {failure_reason(part)}.")
        os.replace(part, file)
    except OSError as error:
        raise OutputError(f"{out} cannot be written: {error.strerror or error}.") from None
    except RuntimeError as error:
        raise OutputError(f"{out} cannot be drawn: {' '.join(str(error).split())}") from None
    finally:
        with suppress(OSError):  # it has its name, or was never made
            part.unlink()


def failure_reason(path: Path) -> str:
    """Return why Blender may not have written a file."""
    full = shutil.disk_usage(path.parent).free < SPACE
    return "no space is left on the disk" if full else "Blender wrote no whole file"


def add_picture_scene(name: str, looks: Picture) -> Scene:
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
    if isinstance(looks, Moving):
        # Shadows are two thirds of a frame, and the samples are hardly seen.
        scene.display.shading.show_shadows = False
        scene.display.render_aa = "8"
    return scene


def _cycles(cycles: PropertyGroup, samples: int) -> None:
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


def _workbench(display: View3DShading) -> None:
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
