"""Hatch over locked pins in the 3D views: whole strokes over whole locks, shorter ones over those in part.

Light with a dark edge, it is told from a shadow and from any color of a pin. The views' own switch
of their overlays hides it.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import bridge
from ..compat import Context, Object, bpy
from ..core.base.arrays import Floats
from ..device import view
from ..sessions import running
from ..sessions.running import Running
from .brush import find_bed
from .tool import DARK, LIGHT

#: How far above the pins the hatch is, and half its length on a pin that is drawn alone, in pitches.
ABOVE, HALF = 0.15, 0.4
#: Widths of the dark and the light line, in those of a thin line.
LOOKS = (DARK, 6.0), (LIGHT, 1.8)
#: Least share that is drawn.
LEAST = 0.02


@dataclass
class Drawn:
    """Lines of the last bed drawn, what they were made of, and the handler that draws."""

    made_of: tuple[Any, ...] = ()
    batch: Any = None
    handle: Any = None


DRAWN = Drawn()


def find_hatch(session: Running, shares: Floats, skin: bool) -> Floats:
    """Return the ends of a line over each locked pin, (2 k, 3), m; over a skin they follow it."""
    grid, height, layout = session.system.grid, session.state.row(0), session.scene.layout
    beside = grid.find_beside(corners=True)
    half = beside.shape[1] // 2
    tops, pins = np.column_stack([grid.positions, height]), np.flatnonzero(shares > LEAST)
    ends = []
    for neighbor in (beside[pins, 1], beside[pins, 1 + half]):
        way = 0.5 * (tops[neighbor] - tops[pins])
        if not skin:
            way = HALF * layout.pitch * np.sign(way) * (0.7, 0.7, 0.0)
        ends.append(tops[pins] + shares[pins, None] * way + (0.0, 0.0, ABOVE * layout.pitch))
    return np.stack(ends, axis=1).reshape(-1, 3)


def _draw() -> None:
    """Draw the hatch of all sessions into a view."""
    context = bpy.context
    if not context.space_data.overlay.show_overlays:
        return
    for session in running.list_sessions():
        bed, shares = find_bed(context, session.uid), session.state.shares()
        if bed is not None and bed.visible_get() and (shares > LEAST).any():
            _draw_hatch(context, bed, session, shares)


def _draw_hatch(context: Context, bed: Object, session: Running, shares: Floats) -> None:
    """Draw the hatch of a bed."""
    import gpu
    from gpu_extras.batch import batch_for_shader

    shader, skin = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR"), view.is_skin_shown(bed)
    made_of = session.uid, session.tick, session.state.period, skin
    if DRAWN.made_of != made_of:
        ends = find_hatch(session, shares, skin) * bridge.SCALE
        DRAWN.made_of = made_of
        DRAWN.batch = batch_for_shader(shader, "LINES", {"pos": ends.astype(np.float32)})
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(False)
    try:
        with gpu.matrix.push_pop():
            gpu.matrix.multiply_matrix(bed.matrix_world)
            for color, width in LOOKS:
                shader.bind()
                shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
                shader.uniform_float("lineWidth", width * context.preferences.system.pixel_size)
                shader.uniform_float("color", (*color, 1.0))
                DRAWN.batch.draw(shader)
    finally:
        gpu.state.depth_test_set("NONE")


def register() -> None:
    """Draw the hatch in the 3D views from now on."""
    DRAWN.handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW")


def unregister() -> None:
    """Draw no more of it, and forget what was drawn."""
    bpy.types.SpaceView3D.draw_handler_remove(DRAWN.handle, "WINDOW")
    DRAWN.made_of, DRAWN.batch = (), None
