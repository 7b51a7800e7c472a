"""3D view in use: found, turned so that all of a bed is seen in it, and lit so that its relief is."""

from collections.abc import Iterable

import numpy as np

from .. import bridge, preferences
from ..compat import Area, Context, Matrix, Object, Region, bpy
from ..core.base.arrays import Floats
from ..device import detail, view
from ..roles import BALL, fingertips_of
from .views import find_free_room, find_taken

#: Width of a sidebar that is yet to be opened, at a UI scale of 1, pixels.
SIDEBAR = 280.0
#: Space about a bed, of the room it has.
SPACE = 0.04
#: Distances tried, in nearest ones, until a bed is whole from above too: within as much of the
#: view.
FARTHER, ABOVE = (1.0, 1.05, 1.1, 1.15, 1.2, 1.25), 0.95
#: Distances from the eye at which a view begins, at least and at most, and ends, at least, as shares
#: of that of what it turns about: enough to orbit and zoom, not so much that surfaces flicker.
CLIP = 1e-4, 0.05, 10.0
#: Least square of the level part of a view's direction that is divided by: from above there is
#: none.
LEVEL = 0.01
#: Shading of a 3D view nobody has changed; and what differs where a relief is to be seen: a matcap,
#: as in Blender's Sculpting workspace, but lit from one side; edges are brightened, and valleys
#: darkened.
FACTORY = {"type": "SOLID", "light": "STUDIO", "color_type": "MATERIAL", "show_cavity": False}
RELIEF = {
    "light": "MATCAP",
    "studio_light": "basic_side.exr",
    "show_cavity": True,
    "cavity_type": "SCREEN",
}
#: Marks screens whose views were lit once: what the user does then remains.
LIT = "digiclay_lit"


def find_view(context: Context) -> tuple[Area, Region] | None:
    """Return area and region of the 3D view in use: the context's, or the first of its window."""
    window = None if bpy.app.background else context.window
    areas = [context.area, *(window.screen.areas if window is not None else ())]
    area = next((area for area in areas if area is not None and area.type == "VIEW_3D"), None)
    return area and (area, next(region for region in area.regions if region.type == "WINDOW"))


def light(context: Context) -> None:
    """Light the 3D view in use for reliefs, once a screen, unless its shading was changed."""
    shown, screen = find_view(context), context.screen
    if (
        shown is None
        or screen is None
        or not preferences.get(context).light_relief
        or screen.get(LIT)
    ):
        return
    shading = shown[0].spaces.active.shading
    lit = any(each.name == RELIEF["studio_light"] for each in context.preferences.studio_lights)
    if lit and all(getattr(shading, name) == value for name, value in FACTORY.items()):
        for name, value in RELIEF.items():
            setattr(shading, name, value)
        screen[LIT] = True


def frame(context: Context, bed: Object) -> None:
    """Move the 3D view in use so that it shows a bed and its fingertip whole, beside sidebar and overlay."""
    shown = find_view(context)
    if shown is None or not shown[1].data:  # in background mode
        return
    area, region = shown
    looking, size = region.data, np.array([region.width, region.height])
    if looking.view_perspective == "CAMERA":
        looking.view_perspective = "PERSP"
        looking.update()
    context.view_layer.update()
    axes = np.array(looking.view_rotation.to_matrix())
    parallel = looking.view_perspective == "ORTHO"
    lens = np.diag(np.array(looking.window_matrix))[:2]
    balls = [(tip[BALL], tip[BALL]) for tip in fingertips_of(bed).values() if tip.get(BALL)]
    corners = _list_corners([(view.housing_of(bed), bed), (bed, bed), *balls])
    if parallel:
        lens = lens * looking.view_distance
    free, taken = 2.0 * _find_room(context, bed, area, region, SIDEBAR) / size - 1.0
    middle, back = corners.mean(axis=0), axes[:, 2]
    half = np.abs(corners - middle)[:, :2].max(axis=0)
    for farther in FARTHER:
        eye = find_eye((corners - middle) @ axes, lens, free, taken, parallel, farther)
        if eye is None:
            return
        # The view turns about a place over or under the middle, so that it shows the bed from above
        # as well.
        aside = axes[:, :2] @ eye[:2]
        depth = -float(aside[:2] @ back[:2]) / max(float(back[:2] @ back[:2]), LEVEL)
        looking.view_location = middle + aside + depth * back
        looking.view_distance = eye[2] - (0.0 if parallel else depth)
        if (lens * (half + np.abs(aside + depth * back)[:2]) < ABOVE * looking.view_distance).all():
            break
    # A bed can be larger or smaller than the factory file's view shows, as in millimeters.
    space = area.spaces.active
    nearest, near, far = (share * looking.view_distance for share in CLIP)
    space.clip_start = min(max(space.clip_start, nearest), near)
    space.clip_end = max(space.clip_end, far)
    looking.update()
    detail.follow()


def reveal(context: Context, bed: Object, things: Iterable[Object]) -> None:
    """Show a bed whole, as `frame` does, if some of what has meshes there is not in the view in use."""
    shown = find_view(context)
    if shown is None or not shown[1].data or shown[1].data.view_perspective == "CAMERA":
        return
    context.view_layer.update()
    (free, taken), region = _find_room(context, bed, *shown), shown[1]
    points = np.concatenate([_place(bridge.read_points(thing.data), thing) for thing in things])
    places = bridge.find_pixels(np.array(region.data.perspective_matrix), points, region)
    seen = ((places >= free[0]) & (places <= free[1])).all(axis=1)
    if not (seen & ~((places > taken[0]) & (places < taken[1])).all(axis=1)).all():
        frame(context, bed)


def _find_room(
    context: Context, bed: Object, area: Area, region: Region, sidebar: float = 0.0
) -> Floats:
    """Return the free part of a view and the overlay's box in it, (2, 2, 2), pixels, beside a `sidebar`."""
    room = find_free_room(area, region, {"UI": sidebar * context.preferences.system.ui_scale})
    return np.reshape([room, find_taken(context, bed, room)], (2, 2, 2))


def find_eye(
    points: Floats, lens: Floats, room: Floats, box: Floats, parallel: bool, farther: float = 1.0
) -> Floats | None:
    """Return the nearest eye (3,) that sees all between points (k, 3) in a room, nothing in a box; or None.

    Axes are those of the view: right, up, to the eye; the origin is amidst the points. `lens` (2,):
    size in the view of a length of 1 at a distance of 1. `room`, and `box` in a corner of it: lower
    and upper corners (2, 2), -1 to 1. Seen in parallel the third number is the distance that scales
    the view. `farther`: times the nearest.
    """
    cuts, along = np.linspace(0.0, 1.0, 6), np.linspace(0.0, 1.0, 12)[:, None, None, None]
    lines = (points + along * (points[:, None] - points)).reshape(-1, 3)
    eyes: list[Floats] = []
    for cut in cuts:
        for axis in (0, 1):
            part, end = room.copy(), int(box[1, axis] == room[1, axis])
            part[end, axis] += cut * (box[1 - end, axis] - room[end, axis])
            if (part[0] < part[1]).all():
                eye = place_eye(points, lens, part, parallel, farther)
                seen = (
                    lens * (lines[:, :2] - eye[:2]) / (eye[2] - (0.0 if parallel else lines[:, 2:]))
                )
                if not ((box[0] < seen) & (seen < box[1])).all(axis=1).any():
                    eyes.append(eye)
    return min(eyes, key=lambda eye: round(float(eye[2]), 6)) if eyes else None


def place_eye(
    points: Floats, lens: Floats, room: Floats, parallel: bool, farther: float = 1.0
) -> Floats:
    """Return the nearest eye (3,) that sees points (k, 3) in a room, in the middle if it can: `find_eye`."""
    low, high = room + SPACE * (room[1] - room[0]) * [[1.0], [-1.0]]
    depth = 0.0 * points[:, 2:] if parallel else points[:, 2:]
    # The eye at z sees a point at x right of `low`: lens (x - eye) >= low (z - depth); and so left
    # of `high`.
    most = (points[:, :2] + low * depth / lens).min(axis=0)
    least = (points[:, :2] + high * depth / lens).max(axis=0)
    z = farther * float(((least - most) * lens / (high - low)).max())
    middle = (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2.0
    return np.array([*np.clip(middle, least - high * z / lens, most - low * z / lens), z])


def _list_corners(things: list[tuple[Object, Matrix]]) -> Floats:
    """Return the corners (k, 3) of the boxes about shapes of placed objects, world."""
    boxes = []
    for shape, placed in things:
        points = bridge.read_points(shape.data)
        corners = np.stack(
            np.meshgrid(*zip(points.min(axis=0), points.max(axis=0), strict=True)), axis=-1
        )
        boxes.append(_place(corners.reshape(-1, 3), placed))
    return np.concatenate(boxes)


def _place(points: Floats, placed: Matrix) -> Floats:
    """Return points (k, 3) of an object, world."""
    matrix = np.array(placed.matrix_world)
    return points @ matrix[:3, :3].T + matrix[:3, 3]
