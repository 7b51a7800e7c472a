"""Films from recorded states: a session with its force plot, or a rotating formed bed.

Nothing is simulated here. Every frame is drawn into a picture of its own, and Blender's
sequencer makes the film of them: so a stop between two frames loses nothing but the film. A frame
depends on its number alone, not on those drawn before it.
"""

import os
import shutil
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..bridge import SCALE
from ..compat import Object, Scene, bpy, quiet, strips, to_video
from ..core.base.arrays import Array, Cells, Floats
from ..core.base.errors import OutputError
from ..core.files.run_folder import name_unfinished
from ..core.files.tables import Table
from ..core.session.render_settings import Film, Moving, Turntable, name_frame
from ..device.instant import Instant
from ..roles import fingertips_of
from . import stage
from .legend import SHARE, draw_force_plot, list_entries
from .still import failure_reason, render_picture, stage_bed


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
    render.resolution_x, render.resolution_y, render.resolution_percentage = (
        looks.width,
        looks.height,
        100,
    )
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


#: How far beside and above the pins a fingertip may be that is to be in the frame, m: it stays
#: there when it lifts from a session; for more the bed would be small.
NEAR, LIFTED = 0.01, 0.03
Progress = Callable[[int, int], None]

#: Angles at which a turning bed's outline is looked at for the frame it needs.
LOOKS = 24


@dataclass(frozen=True, eq=False)
class Shots:
    """Frames of a film, which can be drawn in any order."""

    scene: Scene
    #: Number of frames.
    count: int
    #: Changes the scene to what a frame shows, by its number from 0.
    show: Callable[[int], None]


@contextmanager
def stage_film(
    history: Mapping[str, Array],
    looks: Film,
    plotted: tuple[str, Floats],
    *,
    set_point: float | None = None,
    **sizes: Any,
) -> Iterator[Shots]:
    """Set the stage for the frames of a film.

    `plotted`: what a force is called, and the force (t,), N, or the forces (t, f) of several
    fingertips.

    `sizes`: `pitch`, `actuator`, `finger` of `Instant.of`.
    """
    rows = looks.rows(history["time"])
    used = slice(int(rows[0]), int(rows[-1]) + 1)
    height = history["height"][used]
    waiting = history["waiting"][used] if "waiting" in history else None
    first = Instant.of(history, int(rows[0]), **sizes)
    with stage_bed("Digital Clay Film", first, looks, float(height.min())) as (scene, bed):
        left, right, below, above = stage.choose_margins(bed)
        front = stage.set_up(
            scene,
            bed,
            first,
            points=_visible_points(bed, history, rows, sizes),
            entries=list_entries(history["mode"][used], waiting),
            margins=(left, right, below + (SHARE if looks.strip else 0.0), above),
        )
        time, (called, force) = history["time"], plotted
        chart = (
            draw_force_plot(front, time[used], force[used], set_point, called)
            if looks.strip
            else None
        )

        def show(frame: int) -> None:
            row = int(rows[frame])
            stage.show(bed, Instant.of(history, row, **sizes))
            if chart is not None:
                chart.show(float(time[row]), force[row])

        yield Shots(scene, len(rows), show)


@contextmanager
def stage_turntable(instant: Instant, looks: Turntable) -> Iterator[Shots]:
    """Set the stage for the frames of a bed that turns once about itself."""
    with stage_bed("Digital Clay Turntable", instant, looks) as (scene, bed):
        for tip in () if looks.fingertip else fingertips_of(bed).values():
            for part in (*tip.children_recursive, tip):
                bpy.data.objects.remove(part)
        points = stage.outline(bed)
        turned = [_turn(points, angle) for angle in np.arange(LOOKS) * (2.0 * np.pi / LOOKS)]
        stage.set_up(scene, bed, instant, points=np.concatenate(turned))
        angles = looks.angles()

        def show(frame: int) -> None:
            bed.rotation_euler = (0.0, 0.0, float(angles[frame]))

        yield Shots(scene, looks.frames, show)


def _visible_points(bed: Object, history: Mapping[str, Array], rows: Cells, sizes: Table) -> Floats:
    """Return what must be in the frame, (k, 3), Blender units: all pins, the fingertips that are near."""
    used = slice(int(rows[0]), int(rows[-1]) + 1)
    position, height = np.asarray(history["position"]), history["height"][used]
    poses = history["fingertip"][rows]
    places = poses.reshape(-1, 7)[:, :3]  # of all fingertips, a row a pose
    middle = np.array([*position.mean(axis=0), height.max()])
    reach = np.array([*np.abs(position - middle[:2]).max(axis=0) + NEAR, LIFTED])
    places[(np.abs(places - middle) > reach).any(axis=1)] = middle
    directions = np.indices((3, 3, 3)).reshape(3, -1) - 1.0
    extremes = np.unique((places @ directions).argmax(axis=0) // (len(places) // len(poses)))
    clouds = [
        np.column_stack([position, level]) * SCALE
        for level in (height.min(axis=0), height.max(axis=0))
    ]
    for at in extremes:
        extreme = Instant.of(history, int(rows[at]), **sizes)
        stage.show(bed, replace(extreme, fingertip=poses[at]))
        clouds.append(stage.outline(bed))
    return np.concatenate(clouds)


def _turn(points: Floats, angle: float) -> Floats:
    """Turn points about the vertical axis."""
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def render_film(
    staged: AbstractContextManager[Shots],
    out: Path,
    looks: Moving,
    progress: Progress | None = None,
    stopped: Callable[[], bool] | None = None,
) -> Path | None:
    """Draw all frames into an MP4 file, which appears whole or not at all; None when it was stopped."""
    with frame_folder(out) as folder, staged as shots:
        frames = range(shots.count)
        if not draw_frames(shots, frames, folder, out, progress, stopped):
            return None
        return encode_film([name_frame(folder, frame) for frame in frames], out, looks)


def draw_frames(
    shots: Shots,
    frames: Sequence[int],
    folder: Path,
    out: Path,
    progress: Progress | None = None,
    stopped: Callable[[], bool] | None = None,
) -> bool:
    """Draw frames by number, each into a whole file of `folder`; return whether all were drawn."""
    for count, frame in enumerate(frames):
        if stopped and stopped():
            return False
        shots.show(frame)
        render_picture(shots.scene, name_frame(folder, frame), out)
        if progress:
            progress(count + 1, len(frames))
    return True
