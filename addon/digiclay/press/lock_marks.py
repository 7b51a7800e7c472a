"""Hatch over locked pins in the 3D views: whole strokes over whole locks, shorter ones over those in part.

Light with a dark edge, it is told from a shadow and from any color of a pin. The views' own switch
of their overlays hides it.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .. import bridge
from ..compat import Context, Object, bpy
from ..core.base.arrays import Floats
from ..core.base.errors import DigiclayError
from ..core.base.modes import LOCKED
from ..core.model.layout import Grid
from ..core.session.snapshot import read_shares
from ..device import view
from ..live import beds
from ..roles import is_bed
from ..sessions import running
from .aim import read_surface
from .tool import DARK, LIGHT

#: How far above the pins the hatch is, and half its length on a pin that is drawn alone, in pitches.
ABOVE, HALF = 0.15, 0.4
#: Widths of the dark and the light line, in those of a thin line.
LOOKS = (DARK, 6.0), (LIGHT, 1.8)
#: Least share that is drawn.
LEAST = 0.02
#: Beds whose lines are stored.
MOST = 32


@dataclass
class Drawn:
    """Lines of the last beds drawn, and what they were made of, by `session_uid`; the handler that draws."""

    hatches: dict[int, tuple[object, Any]] = field(default_factory=dict)
    handle: Any = None


DRAWN = Drawn()


def find_hatch(grid: Grid, height: Floats, shares: Floats, skin: bool) -> Floats:
    """Return the ends of a line over each locked pin, (2 k, 3), m; over a skin they follow it."""
    pitch, beside = grid.layout.pitch, grid.find_beside(corners=True)
    half = beside.shape[1] // 2
    tops, pins = np.column_stack([grid.positions, height]), np.flatnonzero(shares > LEAST)
    ends = []
    for neighbor in (beside[pins, 1], beside[pins, 1 + half]):
        arm = 0.5 * (tops[neighbor] - tops[pins])
        if not skin:
            arm = HALF * pitch * np.sign(arm) * (0.7, 0.7, 0.0)
        ends.append(tops[pins] + shares[pins, None] * arm + (0.0, 0.0, ABOVE * pitch))
    return np.stack(ends, axis=1).reshape(-1, 3)


def find_shares(bed: Object) -> Floats:
    """Return the shares (n,) by which a bed's pins are locked, in its session or as it is stored."""
    session = running.find(bed)
    if session is not None:
        return session.state.shares()
    whole = bridge.read_cells(bed.data)["mode"] == LOCKED
    stored = beds.read_snapshot(bed)
    shares = np.zeros(whole.size) if stored is None else read_shares(stored)
    # A take that is played shows locks of its own.
    return shares if np.array_equal(shares == 1.0, whole) else whole.astype(np.float64)


def identify(bed: Object) -> object:
    """Return what tells apart the hatches of a bed."""
    session, skin = running.find(bed), view.is_skin_shown(bed)
    if session is not None:
        return session.tick, session.state.period, skin
    cells = bridge.read_cells(bed.data)
    shown = cells["height"].tobytes(), cells["mode"].tobytes()
    return hash((beds.read_snapshot(bed), *shown)), skin


def _draw() -> None:
    """Draw the hatch of all beds into a view."""
    context = bpy.context
    if not context.space_data.overlay.show_overlays:
        return
    for bed in filter(is_bed, context.visible_objects):
        try:
            batch = _find_batch(bed)
        except DigiclayError:  # its panel tells what is wrong with it
            continue
        if batch is not None:
            _draw_hatch(context, bed, batch)


def _find_batch(bed: Object) -> Any:
    """Return the lines over a bed, made again where anything of them has changed; None: no pin is locked."""
    if running.find(bed) is None and beds.STATE not in bed:
        return None
    uid, made_of = bed.session_uid, identify(bed)
    former, batch = DRAWN.hatches.pop(uid, (None, None))
    if former != made_of:
        batch = _make_batch(bed)
    DRAWN.hatches[uid] = made_of, batch
    if len(DRAWN.hatches) > MOST:
        del DRAWN.hatches[next(iter(DRAWN.hatches))]
    return batch


def _make_batch(bed: Object) -> Any:
    """Return new lines over a bed; None: no pin is locked."""
    import gpu
    from gpu_extras.batch import batch_for_shader

    shares = find_shares(bed)
    if not (shares > LEAST).any():
        return None
    ends = find_hatch(*read_surface(bed), shares, view.is_skin_shown(bed)) * bridge.SCALE
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    return batch_for_shader(shader, "LINES", {"pos": ends.astype(np.float32)})


def _draw_hatch(context: Context, bed: Object, batch: Any) -> None:
    """Draw the hatch of a bed."""
    import gpu

    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
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
                batch.draw(shader)
    finally:
        gpu.state.depth_test_set("NONE")


def register() -> None:
    """Draw the hatch in the 3D views from now on."""
    DRAWN.handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW")


def unregister() -> None:
    """Draw no more of it, and forget what was drawn."""
    bpy.types.SpaceView3D.draw_handler_remove(DRAWN.handle, "WINDOW")
    DRAWN.hatches.clear()
