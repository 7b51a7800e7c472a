"""Place of a new bed: the 3D cursor, or on top of or beside what would hide the pins there."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.base.arrays import Floats
from ..device import view
from ..ui_text import localize
from .occlusion import find_hider, list_surfaces

#: Share of the pins that may be hidden: what stands among the pins or leans over their edge is left alone.
HIDDEN = 0.25
#: Places looked at along each side of the pins, and the gap to what a bed stands beside, of its width.
SIDE, GAP = 5, 0.1
#: Where the eye of a parallel view is taken to be, Blender units: before all that it shows.
FAR = 1e5
ON_TOP = "{} is at the 3D cursor and would hide the bed: it stands on top of it"
BESIDE = "{} is at the 3D cursor and would hide the bed: it stands beside it"
NOWHERE = "{} hides the bed, which stands at the 3D cursor: move or hide one of them"


def find_free_place(context: Any, bed: Any) -> tuple[Floats, str]:
    """Return where the middle of a new bed's underside goes (3,), in the world, and words if not the cursor.

    The context is that of a 3D view's region. Only what reaches into the bed's own box moves it: an object
    somewhere in front of it leaves as soon as the view is turned.
    """
    cursor, (low, high) = np.array(context.scene.cursor.location), _box(bed)
    surfaces = [(thing, matrix, *_bounds(thing, matrix)) for thing, matrix in list_surfaces(context, bed)]

    def overlapping(place: Floats) -> list[Any]:
        return [one for one in surfaces if (one[2] < place + high).all() and (one[3] > place + low).all()]

    def hider(place: Floats, among: list[Any]) -> Any:
        beds = [one[0] for one in overlapping(place) if view.is_bed(one[0])]
        return beds[0] if beds else _find_hider(context, bed, place, (low, high), [one[:2] for one in among])

    there = overlapping(cursor)
    hides = hider(cursor, there)
    if hides is None:
        return cursor, ""
    first, last = np.min([one[2] for one in there], axis=0), np.max([one[3] for one in there], axis=0)
    middle, gap = (first + last) / 2.0, GAP * (high - low)
    places = [] if view.is_bed(hides) else [(np.array([*middle[:2], last[2]]), ON_TOP)]
    for axis in (0, 1):
        for edge in (last[axis] - low[axis] + gap[axis], first[axis] - high[axis] - gap[axis]):
            place = cursor.copy()
            place[axis] = edge
            places.append((place, BESIDE))
    for place, words in sorted(places, key=lambda one: float(np.linalg.norm(one[0] - cursor))):
        if hider(place, surfaces) is None:
            return place, localize(words, hides.name)
    return cursor, localize(NOWHERE, hides.name)


def _box(bed: Any) -> Floats:
    """Return the corners (2, 3) of a bed's housing and pins, from the middle of its underside."""
    housing: Any = view.housing_of(bed)
    points = np.array([thing.co for mesh in (housing.data, bed.data) for thing in mesh.vertices])
    corners = np.array([points.min(axis=0), points.max(axis=0)]) * np.array(bed.scale)
    return np.asarray(corners - [0.0, 0.0, corners[0, 2]])


def _bounds(thing: Any, matrix: Any) -> Floats:
    """Return the corners (2, 3) of the box about an object in the world."""
    placed = np.array(matrix, np.float64)
    corners = np.array(thing.bound_box) @ placed[:3, :3].T + placed[:3, 3]
    return np.array([corners.min(axis=0), corners.max(axis=0)])


def _find_hider(context: Any, bed: Any, place: Floats, box: Any, surfaces: list[Any]) -> Any | None:
    """Return the object that hides more of the pins of a bed at a place than may be; None without."""
    (left, front, _), (right, back, top) = box
    eye, found = context.region_data.view_matrix.inverted(), []
    for x in np.linspace(left, right, SIDE + 2)[1:-1]:
        for y in np.linspace(front, back, SIDE + 2)[1:-1]:
            end = place + np.array([x, y, top])
            parallel = context.region_data.window_matrix[3][3] == 1.0
            start = end + FAR * np.array(eye.col[2][:3]) if parallel else np.array(eye.translation)
            found.append(find_hider(context, bed, start, end, surfaces))
    things = [thing for thing in found if thing is not None]
    return things[len(things) // 2] if len(things) > HIDDEN * len(found) else None
