"""3D view in use: found, turned so that all of a bed is seen in it, and lit so that its relief is."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import preferences
from ..compat import bpy
from ..core.base.arrays import Floats
from ..device import detail, view
from ..overlay.sections import list_rooms
from ..overlay.views import find_free_room
from ..roles import BALL, fingertip_of

#: Width of a sidebar that is yet to be opened, at a UI scale of 1, pixels.
SIDEBAR = 280.0
#: Space about a bed, of the room it has.
SPACE = 0.04
#: Shading of a 3D view nobody has changed; and what differs where a relief is to be seen: a matcap, as in
#: Blender's Sculpting workspace, but lit from one side; edges are brightened, and valleys darkened.
FACTORY = {"type": "SOLID", "light": "STUDIO", "color_type": "MATERIAL", "show_cavity": False}
RELIEF = {"light": "MATCAP", "studio_light": "basic_side.exr", "show_cavity": True, "cavity_type": "SCREEN"}
#: Marks screens whose views were lit once: what the user does then remains.
LIT = "digiclay_lit"


def find_view(context: Any) -> tuple[Any, Any] | None:
    """Return area and region of the 3D view in use: the context's, or the first of its window."""
    window = None if bpy.app.background else context.window
    areas = [context.area, *(window.screen.areas if window is not None else ())]
    area = next((area for area in areas if area is not None and area.type == "VIEW_3D"), None)
    return area and (area, next(region for region in area.regions if region.type == "WINDOW"))


def light(context: Any) -> None:
    """Light the 3D view in use for reliefs, once a screen, unless its shading was changed."""
    shown, screen = find_view(context), context.screen
    if shown is None or screen is None or not preferences.get(context).light_relief or screen.get(LIT):
        return
    shading = shown[0].spaces.active.shading
    known = any(each.name == RELIEF["studio_light"] for each in context.preferences.studio_lights)
    if known and all(getattr(shading, name) == value for name, value in FACTORY.items()):
        for name, value in RELIEF.items():
            setattr(shading, name, value)
        screen[LIT] = True


def frame(context: Any, bed: Any) -> None:
    """Move the 3D view in use so that it shows a bed and its fingertip whole, beside sidebar and overlay."""
    shown = find_view(context)
    if shown is None:
        return
    area, region = shown
    scale, corner = context.preferences.system.ui_scale, preferences.get(context).overlay_corner
    room = find_free_room(area, region, {"UI": SIDEBAR * scale})
    looking, size = region.data, np.array([region.width, region.height])
    if looking.view_perspective == "CAMERA":
        looking.view_perspective = "PERSP"
        looking.update()
    context.view_layer.update()
    axes, parallel = np.array(looking.view_rotation.to_matrix()), looking.view_perspective == "ORTHO"
    lens, points = np.diag(np.array(looking.window_matrix))[:2], _list_corners(bed) @ axes
    if parallel:
        lens = lens * looking.view_distance
    rooms = (2.0 * np.reshape(each, (2, 2)) / size - 1.0 for each in list_rooms(room, scale, corner))
    eyes = [place_eye(points, lens, each, parallel) for each in rooms if (each[1] > each[0]).all()]
    if not eyes:
        return
    x, y, distance = min(eyes, key=lambda eye: float(eye[2]))
    middle = float(points[:, 2].mean())
    looking.view_location = axes @ [x, y, middle]
    looking.view_distance = distance if parallel else distance - middle
    looking.update()
    detail.follow()


def place_eye(points: Floats, lens: Floats, room: Floats, parallel: bool) -> Floats:
    """Return the nearest eye (3,) that sees points (k, 3) in a room: lower and upper corner (2, 2), -1 to 1.

    Axes are those of the view: right, up, to the eye. `lens` (2,): size in the view of a length of 1 at a
    distance of 1. Seen in parallel, the third number is the distance that scales the view.
    """
    low, high = room + SPACE * (room[1] - room[0]) * [[1.0], [-1.0]]
    depth = 0.0 * points[:, 2:] if parallel else points[:, 2:]
    # The eye at z sees a point at x right of `low`: lens (x - eye) >= low (z - depth); and so left of `high`.
    most = (points[:, :2] + low * depth / lens).min(axis=0)
    least = (points[:, :2] + high * depth / lens).max(axis=0)
    z = float(((least - most) * lens / (high - low)).max())
    return np.array([*((least + most - (low + high) * z / lens) / 2.0), z])


def _list_corners(bed: Any) -> Floats:
    """Return the corners (k, 3) of the boxes about housing, pins and fingertip, world."""
    tip = fingertip_of(bed)
    things = [(view.housing_of(bed), bed), (bed, bed)]
    things += [(tip[BALL], tip[BALL])] if tip is not None and tip.get(BALL) else []
    boxes = []
    for shape, placed in things:
        matrix = np.array(placed.matrix_world)
        points = np.array([vertex.co for vertex in shape.data.vertices])
        corners = np.stack(np.meshgrid(*zip(points.min(axis=0), points.max(axis=0), strict=True)), axis=-1)
        boxes.append(corners.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3])
    return np.concatenate(boxes)
