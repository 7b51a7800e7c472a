"""Triangles of flat polygons, also of concave ones, as modelers and CAD programs write them."""

import numpy as np

from ..base.arrays import Floats, Indices
from .mesh_limits import CORNERS, SMALLER, make_refusal, refuse_many_triangles

#: A dent of a smaller share of a polygon's area is rounding: files have six digits.
FLAT = 1e-6
#: Polygons that are cut at a time.
CHUNK = 1_000_000
#: Most corners of a concave polygon: cutting it takes time with their square.
MOST_CORNERS = 10_000


def cut(points: Floats, corners: Indices, sizes: Indices, name: str) -> Indices:
    """Return triangles (f, 3) of polygons on points (v, 3); corners (c,), of each polygon `sizes` (p,)."""
    if corners.size and (corners.min() < 0 or corners.max() >= len(points)):
        content = f"vertex {corners.max() + 1} of {len(points)}"
        raise make_refusal(CORNERS, name, content, "Is the file cut off?")
    refuse_many_triangles(name, int(np.maximum(sizes - 2, 0).sum()))
    starts, order = np.cumsum(sizes) - sizes, np.argsort(sizes, kind="stable")
    triangles = [np.empty((0, 3), np.int64)]
    for alike in np.split(order, np.flatnonzero(np.diff(sizes[order])) + 1):
        size = int(sizes[alike].max(initial=0))
        for part in np.split(alike, range(CHUNK, len(alike), CHUNK)) if size > 2 else []:
            polygons = corners[starts[part][:, None] + np.arange(size)]
            triangles.append(polygons if size == 3 else _cut_alike(points, polygons, name))
    return np.concatenate(triangles)


def _cut_alike(points: Floats, polygons: Indices, name: str) -> Indices:
    """Return the triangles (f, 3) of polygons (p, k): fans, or of one that has a dent its ears."""
    spokes = points[polygons[:, 1:]] - points[polygons[:, :1]]
    with np.errstate(over="ignore", invalid="ignore"):
        areas = np.cross(spokes[:, :-1], spokes[:, 1:])
        normal = areas.sum(axis=1)
        # Each triangle has to have the polygon's sense: of a fan that overlaps, one has not.
        along = np.einsum("pki,pi->pk", areas, normal)
        dented = np.any(along < -FLAT * np.einsum("pi,pi->p", normal, normal)[:, None], axis=1)
    size = polygons.shape[1]
    fan = np.stack([np.zeros(size - 2, np.int64), np.arange(1, size - 1), np.arange(2, size)], 1)
    fans = polygons[~dented][:, fan].reshape(-1, 3)
    if dented.any() and size > MOST_CORNERS:
        rule = f"must have no concave face of more than {MOST_CORNERS:,} corners"
        raise make_refusal(rule, name, f"{size:,} corners", SMALLER)
    ears = [
        polygon[_cut_ears(_flatten(points[polygon], up))]
        for polygon, up in zip(polygons[dented], normal[dented], strict=True)
    ]
    return np.concatenate([fans, *ears])


def _flatten(places: Floats, normal: Floats) -> Floats:
    """Return places (k, 3) in the plane of two axes (k, 2), seen so that the normal points upwards."""
    axis = int(np.abs(normal).argmax())
    first, second = (axis + 1) % 3, (axis + 2) % 3
    return places[:, [first, second] if normal[axis] > 0.0 else [second, first]]


def _cut_ears(plan: Floats) -> Indices:
    """Return the triangles (k - 2, 3) of a counterclockwise polygon (k, 2), from which ears are cut."""
    left, triangles, at = list(range(len(plan))), [], 0
    while len(left) > 3:
        place = plan[left]
        before, after = np.roll(place, 1, axis=0), np.roll(place, -1, axis=0)
        corner = _find_area(place - before, after - before)
        turns = (np.arange(len(left)) + at) % len(left)
        # A polygon that crosses itself may have no ear: its sharpest corner is cut.
        ear = next((i for i in turns if _is_ear(place, i, corner[i])), int(corner.argmax()))
        triangles.append([left[ear - 1], left[ear], left[(ear + 1) % len(left)]])
        del left[ear]
        at = ear
    return np.array([*triangles, left])


def _find_area(first: Floats, second: Floats) -> Floats:
    """Return twice the areas between vectors (..., 2)."""
    area: Floats = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return area


def _is_ear(place: Floats, at: int, area: float) -> bool:
    """Return whether the triangle at a corner of a polygon (k, 2) is inside, without another corner."""
    if area <= 0.0:
        return area == 0.0
    ends = place[[at - 1, at, (at + 1) % len(place)]]
    sides = np.roll(ends, -1, axis=0) - ends
    inside = np.all(_find_area(sides, place[:, None] - ends) >= 0.0, axis=1)
    return not np.any(inside & ~np.any(np.all(place[:, None] == ends, axis=2), axis=1))
