"""Level of detail: whether the pins of a bed are too small in the 3D views to be drawn one by one.

Below some pixels a pitch pins hide the form, and their rows make moire. A bed shown as "automatic"
is then drawn as a skin, until its pins are clearly larger again in any view.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..compat import Object, Region, RegionView3D, Window, bpy
from ..core.base.arrays import Floats
from ..roles import is_bed, is_local
from . import view
from .node_tree import FAR

#: Pitch below which the skin is drawn, and above which pins are drawn again, pixels at a UI scale
#: of 1.
SMALL, LARGE = 8.0, 10.0
#: The draw handler that looks for changed views; without a window there is none.
_handle: Any = None


def choose_far(pitch: float, far: bool) -> bool:
    """Return whether pins are too small to be drawn."""
    return 0.0 < pitch < (LARGE if far else SMALL)


def measure_pitch(to_clip: Floats, to_view: Floats, pitch: float, height: float) -> float:
    """Return the size of a pitch at the middle of a bed, seen from the front, pixels; 0 behind the eye."""
    depth = float(to_clip[3, 3])
    return pitch * float(to_view[1, 1]) * height / 2.0 / depth if depth > 0.0 else 0.0


def follow() -> None:
    """Have every bed of the scenes in view drawn as its size in the views asks for."""
    for bed in _list_changed():
        view.write_setting(bed, FAR, not view.is_far(bed))


def _list_changed() -> list[Object]:
    """Return the beds shown as "automatic" that are to be drawn otherwise from now on."""
    sizes: dict[Object, float] = {}  # the pitch in the view that shows a bed largest, pixels
    scale = bpy.context.preferences.system.ui_scale or 1.0  # 0 without a window
    for window in bpy.context.window_manager.windows:
        beds = [thing for thing in window.scene.objects if is_bed(thing) and _is_automatic(thing)]
        for region, looking in _regions(window) if beds else ():
            lens = np.array(looking.window_matrix)
            for bed in beds:
                to_clip = np.array(looking.perspective_matrix @ bed.matrix_world)
                pitch = _pitch(bed) * bed.matrix_world.median_scale
                size = measure_pitch(to_clip, lens, pitch, region.height) / scale
                sizes[bed] = max(size, sizes.get(bed, 0.0))
    return [bed for bed in sizes if choose_far(sizes[bed], view.is_far(bed)) != view.is_far(bed)]


def _regions(window: Window) -> Iterator[tuple[Region, RegionView3D]]:
    """Give the regions of a window's 3D views, with where each looks from."""
    for area in window.screen.areas:
        if area.type == "VIEW_3D":
            region = next(part for part in area.regions if part.type == "WINDOW")
            yield region, area.spaces.active.region_3d


def _is_automatic(bed: Object) -> bool:
    """Return whether a bed's size in the views decides what is drawn of it."""
    return is_local(bed) and view.can_show_skin(bed) and view.read_form(bed) == "automatic"


def _pitch(bed: Object) -> float:
    """Return the distance of the first two pins of a bed, Blender units."""
    vertices = bed.data.vertices
    if len(vertices) < 2:
        return 0.0
    apart = vertices[1].co.xy - vertices[0].co.xy
    return float(apart.length)


def _look() -> None:
    """Have the beds follow once the drawing under way is done: while Blender draws, data must not change."""
    if _list_changed() and not bpy.app.timers.is_registered(follow):
        bpy.app.timers.register(follow, first_interval=0.0)


def register() -> None:
    """Look at every view that is drawn from now on."""
    global _handle
    if not bpy.app.background:
        _handle = bpy.types.SpaceView3D.draw_handler_add(_look, (), "WINDOW", "POST_PIXEL")


def unregister() -> None:
    """Stop looking."""
    global _handle
    if _handle is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_handle, "WINDOW")
        _handle = None
    if bpy.app.timers.is_registered(follow):
        bpy.app.timers.unregister(follow)
