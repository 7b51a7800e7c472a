"""Films from recorded states: a session with its force plot, or a rotating formed bed.

Nothing is simulated here. Every frame is drawn into a picture of its own, and Blender's
sequencer makes the film of them: so a stop between two frames loses nothing but the film.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..bridge import SCALE
from ..compat import bpy, scratch
from ..core.base.modes import Mode
from ..core.session.render_settings import Film, Turntable
from ..device import view
from ..device.instant import Instant
from . import stage
from .film_file import encode_film, frame_folder
from .force_plot import SHARE, draw_force_plot
from .still import add_picture_scene, apply_style, render_picture, use_fast_settings

__all__ = ["render_film", "render_turntable"]

Floats = NDArray[np.float64]
Progress = Callable[[int, int], None]

#: Angles at which a turning bed's outline is looked at for the frame it needs.
LOOKS = 24


def render_film(
    history: Mapping[str, NDArray[Any]],
    out: Path,
    looks: Film,
    *,
    set_point: float | None = None,
    progress: Progress | None = None,
    stopped: Callable[[], bool] | None = None,
    **sizes: Any,
) -> Path | None:
    """Draw a session, or a part of it, into an MP4 file.

    Parameters
    ----------
    history : mapping of arrays
        As in ``history.npz``.
    out : Path
        The file; it appears whole or not at all.
    looks : Film
    set_point : float, optional
        Total force that is asked for, N; drawn into the strip.
    progress : callable, optional
        Told after each frame how many are drawn, and of how many.
    stopped : callable, optional
        Asked before each frame; when it says True, no film is made.
    **sizes
        `pitch`, `actuator` and `finger`, as for `Instant.of`.

    Returns
    -------
    Path or None
        `out`; None when it was stopped.

    Raises
    ------
    ParameterError
        When the part asked for is not in the session.
    OutputError
        When the file cannot be written.
    """
    rows = looks.rows(history["time"])
    used = slice(int(rows[0]), int(rows[-1]) + 1)
    height = history["height"][used]
    with scratch(), frame_folder(out) as folder:
        scene = add_picture_scene("Digital Clay Film", looks)
        use_fast_settings(scene)
        first = Instant.of(history, int(rows[0]), **sizes)
        bed = view.build(first, scene.collection, lowest=float(height.min()))
        apply_style(bed, looks)
        left, right, below, above = stage.MARGINS
        front = stage.set_up(
            scene, bed, first,
            points=_visible_points(bed, history, rows, sizes),
            modes=[Mode(int(code)) for code in np.unique(history["mode"][used])],
            margins=(left, right, below + (SHARE if looks.strip else 0.0), above),
        )  # fmt: skip
        time, force = history["time"], history["total_force"]
        chart = draw_force_plot(front, time[used], force[used], set_point) if looks.strip else None

        def show(frame: int) -> None:
            row = int(rows[frame])
            view.show(bed, Instant.of(history, row, **sizes))
            if chart is not None:
                chart.show(float(time[row]), float(force[row]))

        drawn = _render_frames(scene, folder, out, len(rows), show, progress, stopped)
        return encode_film(drawn, out, looks) if drawn else None


def render_turntable(
    instant: Instant,
    out: Path,
    looks: Turntable,
    *,
    progress: Progress | None = None,
    stopped: Callable[[], bool] | None = None,
) -> Path | None:
    """Draw a bed that turns once about itself into an MP4 file.

    Parameters
    ----------
    instant : Instant
        What the bed shows.
    out, looks, progress, stopped
        As for `render_film`.

    Returns
    -------
    Path or None
        `out`; None when it was stopped.
    """
    with scratch(), frame_folder(out) as folder:
        scene = add_picture_scene("Digital Clay Turntable", looks)
        use_fast_settings(scene)
        bed = view.build(instant, scene.collection)
        apply_style(bed, looks)
        tip = view.fingertip_of(bed)
        if tip is not None and not looks.fingertip:
            for part in (*tip.children_recursive, tip):
                bpy.data.objects.remove(part)
        points = stage.outline(bed)
        turned = [_turn(points, angle) for angle in np.arange(LOOKS) * (2.0 * np.pi / LOOKS)]
        stage.set_up(scene, bed, instant, points=np.concatenate(turned))
        angles = looks.angles()

        def show(frame: int) -> None:
            bed.rotation_euler = (0.0, 0.0, float(angles[frame]))

        drawn = _render_frames(scene, folder, out, looks.frames, show, progress, stopped)
        return encode_film(drawn, out, looks) if drawn else None


def _visible_points(
    bed: Any, history: Mapping[str, NDArray[Any]], rows: NDArray[np.intp], sizes: Mapping[str, Any]
) -> Floats:
    """Return what a film must have in its frame, (k, 3) in Blender units.

    The pins wherever they go, and the fingertip where it touches: in the air it may leave.
    """
    used = slice(int(rows[0]), int(rows[-1]) + 1)
    touching = rows[history["total_force"][rows] > 0.0]
    poses = history["fingertip"][touching if touching.size else rows]
    extremes = np.unique([poses[:, :3].argmin(axis=0), poses[:, :3].argmax(axis=0)])
    instant = Instant.of(history, int(rows[0]), **sizes)
    position, height = np.asarray(history["position"]), history["height"][used]
    clouds = [
        np.column_stack([position, level]) * SCALE for level in (height.min(axis=0), height.max(axis=0))
    ]
    for at in extremes:
        view.show(bed, Instant(**{**vars(instant), "fingertip": poses[at]}))
        clouds.append(stage.outline(bed))
    view.show(bed, instant)
    return np.concatenate(clouds)


def _turn(points: Floats, angle: float) -> Floats:
    """Turn points about the vertical axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))


def _render_frames(
    scene: Any,
    folder: Path,
    out: Path,
    count: int,
    show: Callable[[int], None],
    progress: Progress | None,
    stopped: Callable[[], bool] | None,
) -> list[Path]:
    """Draw every frame into a file of its own; none are returned when somebody asked to stop."""
    files = []
    for frame in range(count):
        if stopped and stopped():
            return []
        show(frame)
        files.append(folder / f"{frame:06d}.png")
        render_picture(scene, files[-1], out)
        if progress:
            progress(frame + 1, count)
    return files
