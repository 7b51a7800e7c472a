"""Stage of a picture: camera, lights, floor, legend."""

import math
from collections.abc import Sequence

import numpy as np

from .. import bridge
from ..compat import Object, Scene, bpy, shader_nodes
from ..core.base.arrays import Floats
from ..device import parts, view
from ..device.instant import Instant
from .legend import Entry, Front, list_entries, write_force_legend, write_mode_legend

#: Where the camera stands, seen from the bed: angle from x and above the floor, rad.
AZIMUTH, ELEVATION = math.radians(-62.0), math.radians(43.0)
LENS, SENSOR = 62.0, 36.0
Margins = tuple[float, float, float, float]
#: Parts of the picture's width or height kept free: left, right, below, above; beside a legend,
#: and without one.
MARGINS, BARE = (0.25, 0.03, 0.05, 0.05), (0.05, 0.05, 0.05, 0.05)
#: Property with the number of a body.
BODY = "digiclay_body"
#: sRGB of the floor.
FLOOR = (0.80, 0.81, 0.82)


def set_up(
    scene: Scene,
    bed: Object,
    instant: Instant,
    *,
    points: Floats | None = None,
    entries: Sequence[Entry] | None = None,
    margins: Margins | None = None,
) -> Front:
    """Put camera, lights, floor and legend about a bed at the origin; return the plane before the camera.

    Margins are those of `choose_margins` unless given, entries of the legend those of the instant.
    """
    points = outline(bed) if points is None else points
    floor = float(points[:, 2].min())
    span = float(np.ptp(points, axis=0).max())
    camera = _camera(scene, points, margins or choose_margins(bed))
    if scene.render.engine == "CYCLES":
        _floor(scene, floor, 60.0 * span)
    _lights(scene)
    front = Front.before(scene, camera, half_frame(scene))
    if view.shows_force(bed):
        write_force_legend(front)
    elif view.read_coloring(bed) == "mode":
        shown = list_entries(instant.mode, instant.waiting) if entries is None else entries
        write_mode_legend(front, shown)
    return front


def add_bodies(scene: Scene, bed: Object, instant: Instant) -> None:
    """Add the bodies of an instant, at their poses over a bed."""
    for number, body in enumerate(instant.bodies):
        mesh = parts.make_body("Digital Clay Body", body)
        part = bpy.data.objects.new(mesh.name, mesh)
        part.parent, part[BODY] = bed, number
        scene.collection.objects.link(part)
    _place_bodies(bed, instant)


def show(bed: Object, instant: Instant) -> None:
    """Show another instant of the same bed, with its bodies."""
    view.show(bed, instant)
    _place_bodies(bed, instant)


def _place_bodies(bed: Object, instant: Instant) -> None:
    """Put the bodies over a bed to the poses of an instant."""
    for part in bed.children:
        if instant.body is not None and BODY in part:
            pose = instant.body[part[BODY]]
            part.matrix_basis = bridge.make_place(pose[:3], pose[3:]).T.tolist()


def choose_margins(bed: Object) -> Margins:
    """Return what is kept free about a bed: room for a legend where its colors need one."""
    return BARE if view.read_coloring(bed) == "neutral" else MARGINS


def camera_place(points: Floats, axes: Floats, low: Floats, high: Floats) -> Floats:
    """Return the nearest place that sees points (k, 3) between the slopes `low` and `high` (2,)."""
    seen = points @ axes.T
    across, back = seen[:, :2], seen[:, 2:]
    top = (across + high * back).max(axis=0)
    bottom = (across + low * back).min(axis=0)
    depth = float(((top - bottom) / (high - low)).max())
    offset = ((top - high * depth) + (bottom - low * depth)) / 2
    return np.array([*offset, depth]) @ axes


def outline(bed: Object) -> Floats:
    """Return points of housing, fingertip and pin tops, (k, 3), Blender units; the bed is at the origin."""
    clouds = []
    # The housing's shape is that of an object which stands in no scene: what it is drawn by is the
    # bed.
    meshes = [(part, part.data) for part in (bed, *bed.children_recursive) if part.type == "MESH"]
    case = view.housing_of(bed)
    if case is not None and case.parent != bed:
        meshes.append((bed, case.data))
    for part, mesh in meshes:
        cloud = bridge.read_points(mesh)
        while part is not None:
            matrix = np.array(part.matrix_basis)
            cloud, part = cloud @ matrix[:3, :3].T + matrix[:3, 3], part.parent
        clouds.append(cloud)
    return np.concatenate(clouds)


def _camera(scene: Scene, points: Floats, margins: Margins) -> Object:
    """Add the camera that frames the points."""
    data = bpy.data.cameras.new("Digital Clay Camera")
    data.lens, data.sensor_width, data.sensor_fit = LENS, SENSOR, "HORIZONTAL"
    camera = bpy.data.objects.new(data.name, data)
    scene.collection.objects.link(camera)
    level = math.cos(ELEVATION)
    backward = np.array([math.cos(AZIMUTH) * level, math.sin(AZIMUTH) * level, math.sin(ELEVATION)])
    right = np.cross([0.0, 0.0, 1.0], backward)
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(backward, right), backward])
    width, height = half_frame(scene)
    left, right_, below, above = margins
    low = np.array([-width * (1 - 2 * left), -height * (1 - 2 * below)])
    high = np.array([width * (1 - 2 * right_), height * (1 - 2 * above)])
    place = camera_place(points, axes, low, high)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = axes.T, place
    camera.matrix_world = matrix.T.tolist()
    distance = float(np.linalg.norm(points - place, axis=1).max())
    data.clip_start, data.clip_end = distance * 1e-3, distance * 200.0
    scene.camera = camera
    return camera


def half_frame(scene: Scene) -> tuple[float, float]:
    """Return half the frame's width and height at depth 1."""
    width = SENSOR / 2 / LENS
    return width, width * scene.render.resolution_y / scene.render.resolution_x


def _floor(scene: Scene, height: float, size: float) -> None:
    """Add the plane the housing stands on."""
    square = np.array([[-size, -size], [size, -size], [size, size], [-size, size]])
    square = np.column_stack([square, np.full(4, height)])
    mesh = bridge.mesh("Digital Clay Floor", (square, [(0, 1, 2, 3)]))
    mesh.materials.append(parts.material("floor", FLOOR, roughness=0.9))
    scene.collection.objects.link(bpy.data.objects.new(mesh.name, mesh))


def _lights(scene: Scene) -> None:
    """Light from the left and behind, low enough that slopes show; the sky fills the shadows."""
    data = bpy.data.lights.new("Digital Clay Sun", "SUN")
    data.energy, data.angle = 2.6, math.radians(5.0)
    sun = bpy.data.objects.new(data.name, data)
    sun.rotation_euler = (math.radians(48.0), 0.0, AZIMUTH + math.radians(90.0 - 118.0))
    scene.collection.objects.link(sun)
    world = bpy.data.worlds.new("Digital Clay Sky")
    tree = shader_nodes(world)
    sky = next(node for node in tree.nodes if node.type == "BACKGROUND")
    sky.inputs["Color"].default_value = bridge.linear((0.90, 0.94, 1.0))
    sky.inputs["Strength"].default_value = 0.5
    world.color = bridge.linear(FLOOR)[:3]  # what Workbench shows behind everything
    scene.world = world
    scene.view_settings.view_transform = "Standard"
