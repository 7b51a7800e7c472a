"""Film file: its frames, and the MP4 from Blender's sequencer."""

from __future__ import annotations

import os
import shutil
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..compat import bpy, quiet, strips, to_video
from ..core.base.errors import OutputError
from ..core.base.unfinished import name_unfinished
from ..core.session.render_settings import Moving
from .still import failure_reason


@contextmanager
def frame_folder(out: Path) -> Iterator[Path]:
    """Give a folder for the frames beside the film, and take it away again."""
    folder = name_unfinished(out, "frames")
    try:
        folder.mkdir(parents=True)
        yield folder
    except OSError as error:
        raise OutputError(f"{out} cannot be written: {error.strerror or error}.") from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def encode_film(frames: list[Path], out: Path, looks: Moving) -> Path:
    """Make a film of pictures that lie in one folder. `frames`: pictures, in their order."""
    scene = bpy.data.scenes.new("Digital Clay Frames")
    scene.view_settings.view_transform = "Standard"
    scene.frame_start, scene.frame_end = 1, len(frames)
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = looks.width, looks.height, 100
    render.fps, render.fps_base = looks.rate, 1.0
    to_video(render)
    partial = frames[0].with_name("film.mp4")
    render.filepath = str(partial)
    pictures = strips(scene).new_image("frames", str(frames[0]), channel=1, frame_start=1)
    for path in frames[1:]:
        pictures.elements.append(path.name)
    try:
        with quiet():
            bpy.ops.render.render(animation=True, scene=scene.name)
        if not partial.is_file() or not is_whole_film(partial.read_bytes()):
            raise OutputError(f"{out} cannot be written: {failure_reason(partial)}.")
        os.replace(partial, out)
    except RuntimeError as error:
        raise OutputError(f"{out} cannot be written: {' '.join(str(error).split())}") from None
    return out


def is_whole_film(data: bytes) -> bool:
    """Return whether an MP4 file has all its parts, the last of which says where the frames are."""
    at, kinds = 0, []
    while at + 8 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        if size == 1 and at + 16 <= len(data):  # larger than 4 GB: the length follows
            (size,) = struct.unpack_from(">Q", data, at + 8)
        if size < 8:
            return False
        kinds.append(kind)
        at += size
    return at == len(data) and b"moov" in kinds
