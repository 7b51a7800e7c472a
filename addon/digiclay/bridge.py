"""Conversion between numpy and Blender: arrays, lengths, attributes and poses."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .compat import Context, Mesh, Object, Region, bpy
from .core.base.arrays import Array, Cells, Floats
from .core.base.errors import DigiclayError
from .core.model.fingertip import LEVEL, Fingertip, make_matrices
from .roles import BED, ELLIPSOID, PALM, ROLE, fingertips_of, owner_of
from .ui_text import localize

#: Blender units per meter of the device: a millimeter is drawn as a hundredth of a unit,
#: which suits Blender's default clipping, snapping and lights.
SCALE = 10.0

#: Scales that differ by less, of 1, count as equal: matrices are float32, and parents multiply.
UNEVEN = 1e-3
#: A bed scaled to less than this can be neither seen nor inverted.
SMALLEST_SCALE = 1e-6

#: Matrices of fingertips that differ by less, in units of their bed, stand alike on a palm: they
#: are float32.
STRAY = 1e-4
#: Where an empty keeps the semi-axes of its finger, m.
AXES = "digiclay_axes"

#: Attributes of a bed's mesh, one value per pin: type in Blender, name of its value, type of the
#: array.
ATTRIBUTES = {"mode": ("INT", "value", np.int32), "force": ("FLOAT", "value", np.float32)}
#: The same, with what a mesh has from the first pin on that waits for its drive.
WRITTEN = ATTRIBUTES | {"waiting": ("BOOLEAN", "value", np.bool_)}


def mesh(
    name: str, shape: tuple[Floats, Sequence[Sequence[int]]], smooth_below: float = 0.6
) -> Mesh:
    """Make a mesh of a shape in Blender units, smooth where faces meet at less than an angle, rad."""
    vertices, faces = shape
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces)
    mesh.shade_smooth()
    mesh.set_sharp_from_angle(angle=smooth_below)
    return mesh


def points(name: str, count: int) -> Mesh:
    """Make a mesh of `count` loose vertices with the attributes of a bed."""
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(count)
    for attribute, (kind, _, _) in ATTRIBUTES.items():
        mesh.attributes.new(attribute, kind, "POINT")
    return mesh


def find_fault(bed: Mesh, pins: int | None = None) -> str:
    """Return why a bed's mesh can be neither read nor written as that of its pins now, or an empty text."""
    # Blender draws shape keys in place of what is written.
    pins_alone = isinstance(bed, bpy.types.Mesh) and not (bed.polygons or bed.shape_keys)
    if not pins_alone or not ATTRIBUTES.keys() <= set(bed.attributes.keys()):
        return localize("the bed's mesh is no longer that of its pins: undo that to go on")
    if bed.is_editmode:  # its attributes have length 0
        return localize("the bed is being edited: go back to Object Mode to go on")
    if pins not in (None, len(bed.vertices)):
        return localize(
            "the bed has {} pins now instead of {}: undo that to go on", len(bed.vertices), pins
        )
    return ""


def _require_cells(bed: Mesh, pins: int | None = None) -> None:
    """Refuse a mesh that has a fault, by a DigiclayError."""
    fault = find_fault(bed, pins)
    if fault:
        raise DigiclayError(f"{bed.name}: {fault}.")


def write_cells(bed: Mesh, position: Floats, height: Floats, **values: Array) -> None:
    """Write pins into a mesh: axes (n, 2), m, tops (n,), m, and of `WRITTEN` (n,) what changed."""
    _require_cells(bed, len(height))
    placed = np.column_stack([position, height]) * SCALE
    bed.vertices.foreach_set("co", np.ascontiguousarray(placed, np.float32).ravel())
    for name, array in values.items():
        stored, value, kind = WRITTEN[name]
        if name not in bed.attributes:
            if not array.any():
                continue
            bed.attributes.new(name, stored, "POINT")
        # Looked up afresh each time: undo and new attributes invalidate what was kept.
        bed.attributes[name].data.foreach_set(value, np.ascontiguousarray(array, kind))
    bed.update()  # 4.2 shows stale data without


def read_points(mesh: Mesh) -> Floats:
    """Return the vertices (k, 3) of a mesh in its own space, Blender units."""
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    return points.reshape(-1, 3).astype(np.float64)


def read_cells(bed: Mesh) -> dict[str, Array]:
    """Return `position` (n, 2) and `height` (n,), m, `mode` and `force` of a bed's mesh."""
    _require_cells(bed)
    points = read_points(bed) / SCALE
    cells: dict[str, Array] = {"position": points[:, :2], "height": points[:, 2]}
    for name, (_, value, kind) in ATTRIBUTES.items():
        array = np.empty(len(points), kind)
        bed.attributes[name].data.foreach_get(value, array)
        cells[name] = array
    return cells


def place_fingertips(
    bed: Object, poses: Floats, fingers: Sequence[Fingertip], numbers: Sequence[int] = ()
) -> None:
    """Put fingertips of a bed to poses (f, 7), and give their ellipsoids their sizes: `move_fingertips`."""
    tips = fingertips_of(bed)
    for number, finger in zip(numbers or tips, fingers, strict=False):
        if number in tips:
            resize_fingertip(tips[number], finger)
    move_fingertips(bed, poses, fingers, numbers)


def move_fingertips(
    bed: Object, poses: Floats, fingers: Sequence[Fingertip], numbers: Sequence[int] = ()
) -> None:
    """Put the first fingertips, or those of some numbers, to poses (f, 7); a palm goes along if all do."""
    parts: dict[Any, list[tuple[Any, Floats]]] = {}
    numbered, to_world = fingertips_of(bed), np.array(bed.matrix_world)
    for number, at, finger in zip(numbers or numbered, poses, fingers, strict=False):
        if number in numbered:
            center = finger.outline(np.asarray(at, np.float64)[None])[0, :3]
            place = make_place(center, at[3:])
            parts.setdefault(numbered[number].parent, []).append((numbered[number], place))
    for above, tips in parts.items():
        role = above and above.get(ROLE)
        above_to_world = np.array(above.matrix_world if above else np.eye(4))
        if role == PALM and len(tips) == sum(tip.parent == above for tip in numbered.values()):
            moves = [to_world @ pose @ np.linalg.pinv(tip.matrix_world) for tip, pose in tips]
            if np.ptp(moves, axis=0).max() < STRAY * np.linalg.norm(to_world[:3, 0]):
                above_to_world = moves[0] @ above_to_world
                above.matrix_world = above_to_world.T.tolist()
        for tip, place in tips:
            if role in (BED, PALM):
                tip.matrix_parent_inverse.identity()
                tip.matrix_basis = (np.linalg.pinv(above_to_world) @ to_world @ place).T.tolist()
            else:
                tip.matrix_world = (to_world @ place).T.tolist()


def make_place(origin: Floats, turn: Floats) -> Floats:
    """Return the matrix (4, 4), in a bed's space, of what is turned (4,) about its origin (3,), m."""
    matrix = np.eye(4)
    matrix[:3, :3] = make_matrices(turn[None])[0]
    matrix[:3, 3] = origin * SCALE
    return matrix


def resize_fingertip(tip: Object, finger: Fingertip) -> None:
    """Give the ellipsoid in a fingertip its semi-axes, and the empty a size to be seen about it."""
    axes = np.array([finger.length, finger.width, finger.height])
    tip[AXES] = axes.tolist()
    tip.empty_display_size = 1.3 * float(axes.max()) * SCALE
    for ball in tip.children:
        if ball.get(ROLE) == ELLIPSOID:
            # Other things may hang on the fingertip, and keep their size.
            ball.scale = axes * SCALE


def keep_sizes(bed: Object) -> None:
    """Take back what the scale of a palm, or other parent, adds to the size of fingertips."""
    for tip in fingertips_of(bed).values():
        scale = np.linalg.norm(np.array(tip.matrix_world)[:3, :3], axis=0) / uniform(bed)
        if np.abs(scale - 1.0).max() > UNEVEN:
            tip.scale = np.array(tip.scale) / scale


def finger_of(tip: Object) -> Fingertip:
    """Return the size of a fingertip, as `resize_fingertip` has given it."""
    return Fingertip(*tip[AXES])


def pose(tip: Object) -> Floats:
    """Return the pose (7,) of a fingertip in its bed's space: lowest point, m, and quaternion."""
    (pose,) = _read_poses(owner_of(tip), [tip])
    return pose


def poses(bed: Object) -> Floats:
    """Return the poses (f, 7) of the fingertips of a bed in order; without any, that of one at its origin."""
    tips = list(fingertips_of(bed).values())
    return _read_poses(bed, tips) if tips else np.array([[0.0, 0.0, 0.0, *LEVEL]])


def _read_poses(bed: Object, tips: Sequence[Object]) -> Floats:
    """Return the poses (f, 7) of fingertips in the space of their bed."""
    uniform(bed)
    inverse, poses = bed.matrix_world.inverted(), np.empty((len(tips), 7))
    for row, tip in zip(poses, tips, strict=True):
        # The world's matrix is live while the user drags the fingertip by whatever means.
        center, turn, _ = (inverse @ tip.matrix_world).decompose()
        row[:3], row[3:] = center, turn.normalized()
    turns, squares = make_matrices(poses[:, 3:]), np.array([tip[AXES] for tip in tips]) ** 2
    # How the center is above the lowest point: as in `Fingertip.outline`.
    above = np.einsum("fij,fj,fj->fi", turns, squares, turns[:, 2])
    poses[:, :3] = poses[:, :3] / SCALE - above / np.sqrt(above[:, 2:])
    return poses


def uniform(bed: Object) -> float:
    """Return the scale of a bed in the world; raise DigiclayError where lengths in it mean nothing."""
    fault = find_scale_fault(bed)
    if fault:
        raise DigiclayError(f"{fault}.")
    return _judge_scale(tuple(map(tuple, bed.matrix_world)))[0]


def find_scale_fault(bed: Object) -> str:
    """Return why lengths in a bed mean nothing, or an empty text; see `uniform`."""
    fault = _judge_scale(tuple(map(tuple, bed.matrix_world)))[1]
    remedy = "Set it with Object > Apply or in the sidebar's Item tab"
    return fault and f"The scale of {bed.name}, that of its parents included, {fault}. {remedy}"


@lru_cache(maxsize=32)  # A session asks in every tick, and a bed seldom moves.
def _judge_scale(rows: tuple[tuple[float, ...], ...]) -> tuple[float, str]:
    """Return the largest scale of a matrix (4, 4), and why it is not uniform; empty: it is."""
    matrix = np.array(rows)[:3, :3]
    scales = np.linalg.norm(matrix, axis=0)
    largest = float(scales.max())
    shown = " x ".join(f"{scale:.4g}" for scale in scales)
    if not np.isfinite(matrix).all() or scales.min() <= SMALLEST_SCALE:
        return largest, f"must be above 0 along x, y and z (got {shown})"
    angles = matrix.T @ matrix / np.outer(scales, scales) - np.eye(3)
    if np.abs(angles).max() > UNEVEN:
        return largest, f"must not shear it (got {shown}, sheared)"
    if np.ptp(scales) > UNEVEN * largest:
        return largest, f"must be the same along x, y and z (got {shown})"
    if np.linalg.det(matrix) < 0.0:
        return largest, f"must not mirror it (got {shown}, mirrored)"
    return largest, ""


def read_place(bed: Object, thing: Object) -> NDArray[np.float32]:
    """Return the matrix (3, 4) from an object's own space to a bed's, m."""
    uniform(bed)
    matrix = np.array(bed.matrix_world.inverted() @ thing.matrix_world)
    return (matrix[:3] / SCALE).astype(np.float32)


def read_triangles(mesh: Mesh) -> tuple[Floats, Cells]:
    """Return vertices (v, 3), in the mesh's own space, and triangles (t, 3) of a mesh."""
    mesh.calc_loop_triangles()
    faces = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", faces)
    return read_points(mesh), faces.reshape(-1, 3).astype(np.intp)


def project(context: Context, bed: Object, points: Floats) -> Floats:
    """Return where points (k, 3) of a bed's space, m, appear in the region (k, 2), pixels; or NaN."""
    to_clip = np.array(context.region_data.perspective_matrix @ bed.matrix_world)
    return find_pixels(to_clip, points * SCALE, context.region)


def find_pixels(to_clip: Floats, points: Floats, region: Region) -> Floats:
    """Return where a matrix (4, 4) shows points (k, 3) in a region (k, 2), pixels; NaN behind the eye."""
    clip = np.column_stack([points, np.ones(len(points))]) @ to_clip.T
    depth = np.where(clip[:, 3] > 0.0, clip[:, 3], np.nan)[:, None]
    return (clip[:, :2] / depth + 1.0) / 2.0 * [region.width, region.height]


def linear(
    color: tuple[float, float, float], alpha: float = 1.0
) -> tuple[float, float, float, float]:
    """Return an sRGB color in the linear light of Blender's materials."""
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color)
    return r, g, b, alpha


def srgb(light: Sequence[float]) -> tuple[float, float, float]:
    """Return a color of linear light as sRGB; the inverse of `linear`."""
    r, g, b = (c * 12.92 if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055 for c in light[:3])
    return r, g, b
