"""Aim of the mouse: a view's bed, the point on its pins, what hides it; a free place for a new bed."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from .. import bridge
from ..bridge import SCALE
from ..compat import Context, Matrix, Object, View3DShading
from ..core.base.arrays import Floats
from ..core.base.errors import DigiclayError
from ..core.model.layout import Grid, make_grid
from ..core.surface.pointing import find_ray, intersect_surface
from ..device import view
from ..roles import ROLE, find_whole, is_bed
from ..sessions import running
from ..settings import properties
from ..strokes.stroke import Place
from ..ui_text import localize


@dataclass(frozen=True, eq=False)
class Target:
    """Point on the pins of a bed."""

    #: Not to be kept: undo invalidates it.
    bed: Object
    grid: Grid
    #: (n,), heights of the pin tops, m.
    height: Floats
    #: (n,), heights of what the mouse moves over, m: of those, or of the rest plane.
    canvas: Floats
    #: (3,), where the ray met that, in the bed's space, m.
    point: Floats

    @property
    def pin(self) -> int:
        """The pin at that place."""
        return int(self.grid.at(self.point[:1], self.point[1:2])[0])


#: Where a stroke goes: on the surface that is seen, or on the plane of the pins at rest.
SURFACE, PLANE = "SURFACE", "PLANE"


def find_target(context: Context, xy: Place, project: str = SURFACE) -> Target | None:
    """Return the nearest place on a bed that is seen under a pixel of the context's region."""
    target, hider = look_at(context, xy, project)
    return target if hider is None else None


def look_at(
    context: Context, xy: Place, project: str = SURFACE
) -> tuple[Target | None, Object | None]:
    """Return the nearest place on a visible bed under a pixel, and the object that hides it there, if any."""
    target, nearest, sight = None, np.inf, np.zeros((2, 3))
    for bed in context.visible_objects:
        if not is_bed(bed):
            continue
        try:
            cells, height = read_surface(bed)
            seen = hit_point(context, bed, cells, height, xy)
            canvas = _find_canvas(bed, height, project)
            point = seen if canvas is height else hit_point(context, bed, cells, canvas, xy)
        except DigiclayError:  # the bed is looked through; pressing on it reports why
            continue
        if point is None:
            continue
        # What hides the bed is in front of its pins, also where these are in front of the plane.
        end = point if seen is None else seen
        origin, direction = _ray(context, bed, xy)
        distance = bridge.uniform(bed) * float((end - origin) @ direction)
        if distance < nearest:
            target, nearest = Target(bed, cells, height, canvas, point), distance
            sight = np.array([_place(bed, origin), _place(bed, end)])
    if target is None:
        return None, None
    return target, find_hider(context, target.bed, *sight)


def _find_canvas(bed: Object, height: Floats, project: str) -> Floats:
    """Return the heights (n,), m, of what the mouse moves over on pins at heights (n,), m."""
    if project == SURFACE:
        return height
    session = running.find(bed)
    scene = properties.scene_of(bed) if session is None else session.scene
    return np.full_like(height, scene.actuator.rest_height)


def read_surface(bed: Object) -> tuple[Grid, Floats]:
    """Return where a bed's pins stand, and their heights (n,), m: of its session, or as they are drawn."""
    session = running.find(bed)
    if session is not None:
        return session.system.grid, session.state.row(0)
    return make_grid(properties.scene_of(bed).layout), bridge.read_cells(bed.data)["height"]


def hit_point(
    context: Context, bed: Object, cells: Grid, height: Floats, xy: Place
) -> Floats | None:
    """Return where the ray through a pixel of the region meets pins of heights (n,), m; None if it misses."""
    origin, direction = _ray(context, bed, xy)
    first, last = shown_stretch(context, _place(bed, origin), _place(bed, origin + direction))
    if first > last:
        return None
    point = intersect_surface(cells, height, origin + first * direction, direction)
    return point if point is not None and (point - origin) @ direction <= last else None


def find_view(context: Context, bed: Object) -> Floats:
    """Return right, up and towards the eye of the context's view in a bed's space, (3, 3), a column each."""
    seen = np.array(context.region_data.view_matrix @ bed.matrix_world, np.float64)[:3, :3].T
    return seen / np.linalg.norm(seen, axis=0)


def _place(bed: Object, point: Floats) -> Floats:
    """Return where a point of a bed's space (3,), m, is in the world."""
    placed = np.array(bed.matrix_world, np.float64)
    return placed[:3, :3] @ (point * SCALE) + placed[:3, 3]


def _ray(context: Context, bed: Object, xy: Place) -> tuple[Floats, Floats]:
    """Return the ray through a pixel in the bed's space: origin, m, and direction of length 1."""
    bridge.uniform(bed)
    looking, region = context.region_data, context.region
    lens = np.array(looking.window_matrix, np.float64)
    seen = np.array(looking.view_matrix, np.float64) @ np.array(bed.matrix_world, np.float64)
    screen = 2.0 * np.array(xy) / [region.width, region.height] - 1.0
    origin, direction = find_ray(lens, seen, screen)
    return origin / SCALE, direction


#: Objects that may have a surface.
SOLID = frozenset({"MESH", "CURVE", "SURFACE", "META", "FONT"})
#: How an object is displayed that hides nothing.
OPEN = frozenset({"WIRE", "BOUNDS"})
#: A surface that ends a ray hides nothing of what it ends at: share of the ray's length.
NEAR = 1e-6


def shown_stretch(context: Context, start: Floats, end: Floats) -> Place:
    """Return the stretch of a ray that a view shows, 0 its start, 1 its end; first > last: nothing of it."""
    looking = context.region_data
    clip = np.array(looking.perspective_matrix, np.float64)
    planes = [clip[3] + clip[2], clip[3] - clip[2]]
    if looking.use_clip_planes:
        planes += [np.array(plane, np.float64) for plane in looking.clip_planes]
    first, last = 0.0, np.inf
    for plane in planes:
        before, after = (float(plane[:3] @ point + plane[3]) for point in (start, end))
        rising = after - before
        if rising:
            crossed = -before / rising
            first, last = (
                (max(first, crossed), last) if rising > 0.0 else (first, min(last, crossed))
            )
        elif before < 0.0:
            return 1.0, 0.0
    return first, last


def find_hider(
    context: Context,
    bed: Object,
    start: Floats,
    end: Floats,
    surfaces: Iterable[tuple[Object, Matrix]] | None = None,
) -> Object | None:
    """Return the object that the 3D view shows in front of the end of a ray, (3,) in the world; or None."""
    if _shows_through(context.space_data.shading):
        return None
    first, _ = shown_stretch(context, start, end)
    start = start + first * (end - start)
    ray = end - start
    for thing, matrix in list_surfaces(context, bed) if surfaces is None else surfaces:
        # An object in front of others hides what is nearer too; one behind such a bed hides
        # nothing.
        if bed.show_in_front and not thing.show_in_front:
            continue
        reach = np.inf if thing.show_in_front and not bed.show_in_front else 1.0 - NEAR
        if _meets(thing, matrix, start, ray, reach):
            return thing
    return None


def _shows_through(shading: View3DShading) -> bool:
    """Return whether a view shows what lies behind surfaces, and so selects it too."""
    if shading.type == "WIREFRAME":
        return bool(shading.show_xray_wireframe)
    return bool(shading.type == "SOLID" and shading.show_xray)


def list_surfaces(context: Context, bed: Object) -> Iterator[tuple[Object, Matrix]]:
    """Yield the objects that may hide a bed, and their places in the world."""
    graph, instancers = context.evaluated_depsgraph_get(), set()
    for thing in context.visible_objects:
        if _belongs(thing, bed):
            continue
        if _instances(thing) and not is_bed(thing):
            instancers.add(thing)
        if _hides(thing):
            yield thing, thing.matrix_world
    if not instancers:  # a bed of 10 000 pins has as many instances to go through
        return
    for instance in graph.object_instances:
        if (
            instance.is_instance
            and instance.parent.original in instancers
            and _hides(instance.object)
        ):
            # A mesh that nodes instance has no original; Blender crashes on an evaluated curve.
            mesh = instance.object.type == "MESH"
            yield instance.object if mesh else instance.object.original, instance.matrix_world


def _hides(thing: Object) -> bool:
    """Return whether an object may have a surface, and is displayed with it."""
    if thing.type not in SOLID or thing.display_type in OPEN:
        return False
    if thing.type != "CURVE":
        return True
    curve = thing.data
    filled = curve.dimensions == "2D" and curve.fill_mode != "NONE"
    return bool(
        filled or curve.extrude or curve.bevel_depth or curve.bevel_object or thing.modifiers
    )


def _belongs(thing: Object, bed: Object) -> bool:
    """Return whether an object is a bed or a part of it; what a user has parented to it is none."""
    while thing is not None and thing != bed:
        thing = find_whole(thing) if ROLE in thing else None
    return thing is not None


def _instances(thing: Object) -> bool:
    """Return whether an object may draw others as its instances."""
    makers = ("NODES", "PARTICLE_SYSTEM")
    return thing.instance_type != "NONE" or any(
        modifier.type in makers for modifier in thing.modifiers
    )


def _meets(thing: Object, matrix: Matrix, start: Floats, ray: Floats, reach: float) -> bool:
    """Return whether a ray in the world meets an object within a reach, in lengths of its way."""
    placed = np.array(matrix, np.float64)
    if (
        not np.isfinite(placed).all()
        or abs(np.linalg.det(placed[:3, :3])) < np.finfo(np.float32).tiny
    ):
        return False
    inverse = np.linalg.inv(placed)
    origin, along = inverse[:3, :3] @ start + inverse[:3, 3], inverse[:3, :3] @ ray
    length = float(np.linalg.norm(along))
    try:
        met = thing.ray_cast(origin.tolist(), along.tolist(), distance=min(reach * length, 1e30))
    except RuntimeError:  # a curve without a surface
        return False
    return bool(met[0])


#: Share of the pins that may be hidden: what stands among the pins or leans over their edge is left
#: alone.
HIDDEN = 0.25
#: Places looked at along each side of the pins, and the gap to what a bed stands beside, of its
#: width.
SIDE, SPACE = 5, 0.1
#: Where the eye of a parallel view is taken to be, Blender units: before all that it shows.
FAR_EYE = 1e5
ON_TOP = "{} is at the 3D cursor and would hide the bed: it stands on top of it"
BESIDE = "{} is at the 3D cursor and would hide the bed: it stands beside it"
NOWHERE = "{} hides the bed, which stands at the 3D cursor: move or hide one of them"


def find_free_place(context: Context, bed: Object) -> tuple[Floats, str]:
    """Return where the middle of a new bed's underside goes (3,), world, and words if not the 3D cursor."""
    cursor, (low, high) = np.array(context.scene.cursor.location), _box(bed)
    # Only what reaches into the bed's own box moves it: what stands before it leaves as the view is
    # turned.
    surfaces = [
        (thing, matrix, *_bounds(thing, matrix)) for thing, matrix in list_surfaces(context, bed)
    ]

    def overlapping(place: Floats) -> list[tuple[Object, Matrix, Floats, Floats]]:
        return [
            row
            for row in surfaces
            if (row[2] < place + high).all() and (row[3] > place + low).all()
        ]

    def hider(place: Floats, among: list[tuple[Object, Matrix, Floats, Floats]]) -> Object | None:
        beds = [row[0] for row in overlapping(place) if is_bed(row[0])]
        return (
            beds[0]
            if beds
            else _find_hider(context, bed, place, (low, high), [row[:2] for row in among])
        )

    there = overlapping(cursor)
    hides = hider(cursor, there)
    if hides is None:
        return cursor, ""
    first = np.min([row[2] for row in there], axis=0)
    last = np.max([row[3] for row in there], axis=0)
    middle, gap = (first + last) / 2.0, SPACE * (high - low)
    places = [] if is_bed(hides) else [(np.array([*middle[:2], last[2]]), ON_TOP)]
    for axis in (0, 1):
        for edge in (last[axis] - low[axis] + gap[axis], first[axis] - high[axis] - gap[axis]):
            place = cursor.copy()
            place[axis] = edge
            places.append((place, BESIDE))
    for place, words in sorted(places, key=lambda row: float(np.linalg.norm(row[0] - cursor))):
        if hider(place, surfaces) is None:
            return place, localize(words, hides.name)
    return cursor, localize(NOWHERE, hides.name)


def _box(bed: Object) -> Floats:
    """Return the corners (2, 3) of a bed's housing and pins, from the middle of its underside."""
    housing: Object = view.housing_of(bed)
    points = np.array([thing.co for mesh in (housing.data, bed.data) for thing in mesh.vertices])
    corners = np.array([points.min(axis=0), points.max(axis=0)]) * np.array(bed.scale)
    return corners - [0.0, 0.0, corners[0, 2]]


def _bounds(thing: Object, matrix: Matrix) -> Floats:
    """Return the corners (2, 3) of the box about an object in the world."""
    placed = np.array(matrix, np.float64)
    corners = np.array(thing.bound_box) @ placed[:3, :3].T + placed[:3, 3]
    return np.array([corners.min(axis=0), corners.max(axis=0)])


def _find_hider(
    context: Context,
    bed: Object,
    place: Floats,
    box: tuple[Floats, Floats],
    surfaces: list[tuple[Object, Matrix]],
) -> Object | None:
    """Return the object that hides more of the pins of a bed at a place than may be; None without."""
    (left, front, _), (right, back, top) = box
    eye, hiders = context.region_data.view_matrix.inverted(), []
    for x in np.linspace(left, right, SIDE + 2)[1:-1]:
        for y in np.linspace(front, back, SIDE + 2)[1:-1]:
            end = place + np.array([x, y, top])
            parallel = context.region_data.window_matrix[3][3] == 1.0
            start = (
                end + FAR_EYE * np.array(eye.col[2][:3]) if parallel else np.array(eye.translation)
            )
            hiders.append(find_hider(context, bed, start, end, surfaces))
    things = [thing for thing in hiders if thing is not None]
    return things[len(things) // 2] if len(things) > HIDDEN * len(hiders) else None
