"""Ghost of press strokes: the skin that the queue, and a path being laid, will leave, in the 3D views.

It is there at once, translucent over all else, and goes where the pins have come to it. The views'
own switch of their overlays hides it.
"""

import time
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import bridge
from ..compat import Object, bpy
from ..core.base.arrays import Floats
from ..core.model.layout import Grid, Layout
from ..core.surface.formed import take_corners
from ..sessions import running
from ..sessions.running import Running, find_device
from ..strokes.queue_ghosts import Ghost, find_ghosts
from ..strokes.stroke import Stroke
from .brush import find_bed

#: Colors of what is to be raised and lowered: blue and orange of Okabe and Ito, which all eyes tell
#: apart.
RAISED, LOWERED = (0.0, 0.45, 0.70), (0.90, 0.62, 0.0)
#: Where the light comes from, in the bed's space, and how dark a slope is that gets none.
LIGHT, SHADE = (-0.48, 0.36, 0.80), 0.4
#: Opacity, the way of a pin from which on it has that, m, and the least way that is drawn, m.
OPACITY, OPAQUE, LEAST = 0.7, 1e-3, 0.1e-3
#: A path that is being laid has another ghost after so many times as long as that took.
REST = 3.0


@dataclass
class Drawn:
    """What is drawn: ghosts of the strokes by the uid of their bed, and triangles."""

    ghosts: dict[int, tuple[Ghost, ...]] = field(default_factory=dict)
    #: Stroke along a path that is being laid, and the uid of its bed.
    plan: tuple[int, Stroke] | None = None
    #: Heights that the triangles are of, the light on them, and the tick of the pins below, whose
    #: way to them their opacity tells.
    heights: Floats | None = None
    light: Floats | None = None
    tick: int = 0
    batch: Any = None
    #: When the ghost of a path that is being laid may be found again, s.
    ready: float = 0.0
    handle: Any = None


DRAWN = Drawn()


def plan(uid: int, stroke: Stroke | None) -> None:
    """Show what a stroke along a path that is being laid will leave on a bed; None: no longer."""
    if stroke is None:
        DRAWN.plan = None
    elif time.perf_counter() >= DRAWN.ready:
        DRAWN.plan = uid, stroke


def find_surface(session: Running) -> Floats | None:
    """Return the heights (n,), m, that the strokes of a session are to leave; None without any."""
    planned = [DRAWN.plan[1]] if DRAWN.plan and DRAWN.plan[0] == session.uid else []
    strokes, drawn = (*session.strokes, *planned), DRAWN.ghosts.get(session.uid, ())
    if not strokes:
        DRAWN.ghosts.pop(session.uid, None)
        return None
    began = time.perf_counter()
    ghosts = find_ghosts(strokes, find_device(session), session.state.row(0), drawn)
    DRAWN.ghosts[session.uid], took = ghosts, time.perf_counter() - began
    DRAWN.ready = began + REST * took
    return ghosts[-1].nominal.height if ghosts else None


def find_light(layout: Layout, surface: Floats) -> Floats:
    """Return how light each place of a surface (n,), m, is, (n,), from 0 to 1."""
    table = surface.reshape(layout.rows, layout.columns)
    across, along = (
        slope.ravel() for slope in np.gradient(table, layout.row_spacing, layout.pitch)
    )
    toward = LIGHT[2] - LIGHT[0] * along - LIGHT[1] * across
    lit: Floats = (toward / np.sqrt(1.0 + along * along + across * across)).clip(0.0, 1.0)
    return SHADE + (1.0 - SHADE) * lit


def find_colors(light: Floats, rise: Floats) -> NDArray[np.float32]:
    """Return colors (n, 4), times opacity, of a lit surface (n,) to which pins have a way (n,), m."""
    # Times the opacity: from a pin that has no way its color does not reach those beside it.
    opacity = (OPACITY / OPAQUE) * np.minimum(np.abs(rise), OPAQUE)
    hue = np.where(rise[:, None] > 0.0, RAISED, LOWERED)
    colors = np.column_stack([hue * light[:, None], np.ones(rise.size)])
    return (colors * opacity[:, None]).astype(np.float32)


@lru_cache(maxsize=4)
def _list_triangles(layout: Layout) -> NDArray[np.int32]:
    """Return the triangles (k, 3) between the pins of a bed, counter-clockwise from above."""
    cells = np.arange(layout.rows * layout.columns, dtype=np.int32).reshape(
        layout.rows, layout.columns
    )
    first, second, third, fourth = (corner.ravel() for corner in take_corners(cells))
    return np.concatenate(
        [np.column_stack([first, second, third]), np.column_stack([first, third, fourth])]
    )


def _make_batch(grid: Grid, surface: Floats, light: Floats, height: Floats) -> Any:
    """Return the triangles of a lit surface (n,), m, where pins (n,), m, have a way to it; or None."""
    import gpu

    triangles, rise = _list_triangles(grid.layout), surface - height
    moves = np.abs(rise) > LEAST
    chosen = triangles[moves[triangles].any(axis=1)]
    if not len(chosen):
        return None
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    points = gpu.types.GPUVertBuf(shader.format_calc(), len(surface))
    corners = np.column_stack([grid.positions, surface]) * bridge.SCALE
    points.attr_fill("pos", np.ascontiguousarray(corners, np.float32))
    points.attr_fill("color", find_colors(light, rise))
    return gpu.types.GPUBatch(
        type="TRIS", buf=points, elem=gpu.types.GPUIndexBuf(type="TRIS", seq=chosen)
    )


def _draw() -> None:
    """Draw the ghosts of all sessions into a view."""
    context = bpy.context
    if not context.space_data.overlay.show_overlays:
        return
    for session in running.list_sessions():
        bed, ghost = find_bed(context, session.uid), find_surface(session)
        if bed is not None and ghost is not None and bed.visible_get():
            _draw_surface(bed, session, ghost)


def _draw_surface(bed: Object, session: Running, ghost: Floats) -> None:
    """Draw a surface (n,), m, over a bed."""
    import gpu

    grid = session.system.grid
    if DRAWN.light is None or DRAWN.heights is not ghost:
        DRAWN.heights, DRAWN.light, DRAWN.tick = ghost, find_light(grid.layout, ghost), -1
    if DRAWN.tick != session.tick:
        DRAWN.tick = session.tick
        DRAWN.batch = _make_batch(grid, ghost, DRAWN.light, session.state.row(0))
    if DRAWN.batch is None:
        return
    gpu.state.blend_set("ALPHA_PREMULT")
    gpu.state.face_culling_set("BACK")
    try:
        with gpu.matrix.push_pop():
            gpu.matrix.multiply_matrix(bed.matrix_world)
            DRAWN.batch.draw(gpu.shader.from_builtin("SMOOTH_COLOR"))
    finally:
        gpu.state.blend_set("NONE")
        gpu.state.face_culling_set("NONE")


def register() -> None:
    """Draw ghosts in the 3D views from now on."""
    DRAWN.handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW")


def unregister() -> None:
    """Draw no more of them, and forget what was drawn."""
    bpy.types.SpaceView3D.draw_handler_remove(DRAWN.handle, "WINDOW")
    DRAWN.ghosts.clear()
    DRAWN.plan, DRAWN.heights, DRAWN.light, DRAWN.batch = None, None, None, None
