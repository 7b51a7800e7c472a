"""Aim of the mouse: the bed of a view, and the point on its pins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import bridge
from ..bridge import SCALE
from ..core.base.arrays import Floats
from ..core.base.errors import DigiclayError
from ..core.model.layout import Grid, make_grid
from ..core.surface.pointing import find_ray, intersect_surface
from ..roles import is_bed
from ..sessions import running
from ..settings import properties
from .occlusion import find_hider, shown_stretch


@dataclass(frozen=True, eq=False)
class Target:
    """Point on the pins of a bed."""

    #: Not to be kept: undo invalidates it.
    bed: Any
    grid: Grid
    #: (n,), heights of the pin tops, m.
    height: Floats
    #: (3,), where the ray met them, in the bed's space, m.
    point: Floats

    @property
    def pin(self) -> int:
        """The pin at that place."""
        return int(self.grid.at(self.point[:1], self.point[1:2])[0])


def find_target(context: Any, xy: tuple[float, float]) -> Target | None:
    """Return the nearest place on a bed that is seen under a pixel of the context's region."""
    target, hider = look_at(context, xy)
    return target if hider is None else None


def look_at(context: Any, xy: tuple[float, float]) -> tuple[Target | None, Any | None]:
    """Return the nearest place on a visible bed under a pixel, and the object that hides it there, if any."""
    target, nearest, eye = None, np.inf, np.zeros(3)
    for bed in context.visible_objects:
        if not is_bed(bed):
            continue
        try:
            cells, height = read_surface(bed)
            point = hit_point(context, bed, cells, height, xy)
        except DigiclayError:  # the bed is looked through; pressing on it reports why
            continue
        if point is None:
            continue
        origin, direction = _ray(context, bed, xy)
        distance = bridge.uniform(bed) * float((point - origin) @ direction)
        if distance < nearest:
            target, nearest, eye = Target(bed, cells, height, point), distance, origin
    if target is None:
        return None, None
    return target, find_hider(context, target.bed, _place(target.bed, eye), _place(target.bed, target.point))


def read_surface(bed: Any) -> tuple[Grid, Floats]:
    """Return where a bed's pins stand, and their heights (n,), m: of its session, or as they are drawn."""
    session = running.find(bed)
    if session is not None:
        return session.system.grid, session.state.row(0)
    return make_grid(properties.scene_of(bed).layout), bridge.read_cells(bed.data)["height"]


def hit_point(context: Any, bed: Any, cells: Grid, height: Floats, xy: tuple[float, float]) -> Floats | None:
    """Return where the ray through a pixel of the region meets pins of heights (n,), m; None if it misses."""
    origin, direction = _ray(context, bed, xy)
    first, last = shown_stretch(context, _place(bed, origin), _place(bed, origin + direction))
    if first > last:
        return None
    point = intersect_surface(cells, height, origin + first * direction, direction)
    return point if point is not None and (point - origin) @ direction <= last else None


def find_view(context: Any, bed: Any) -> Floats:
    """Return right, up and towards the eye of the context's view in a bed's space, (3, 3), a column each."""
    seen = np.array(context.region_data.view_matrix @ bed.matrix_world, np.float64)[:3, :3].T
    return np.asarray(seen / np.linalg.norm(seen, axis=0))


def _place(bed: Any, point: Floats) -> Floats:
    """Return where a point of a bed's space (3,), m, is in the world."""
    placed = np.array(bed.matrix_world, np.float64)
    return np.asarray(placed[:3, :3] @ (point * SCALE) + placed[:3, 3])


def _ray(context: Any, bed: Any, xy: tuple[float, float]) -> tuple[Floats, Floats]:
    """Return the ray through a pixel in the bed's space: origin, m, and direction of length 1."""
    bridge.uniform(bed)
    looking, region = context.region_data, context.region
    lens = np.array(looking.window_matrix, np.float64)
    seen = np.array(looking.view_matrix, np.float64) @ np.array(bed.matrix_world, np.float64)
    screen = 2.0 * np.array(xy) / [region.width, region.height] - 1.0
    origin, way = find_ray(lens, seen, screen)
    return origin / SCALE, way
