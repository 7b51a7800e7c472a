"""Between numpy and Blender: the one file that knows arrays, metres, attributes and poses alike."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .compat import bpy
from .core.fingertip import Fingertip
from .device_shapes import Shape

__all__ = ["SCALE", "linear", "mesh", "place_fingertip", "points", "pose", "read_cells", "write_cells"]

Floats = NDArray[np.float64]

#: Blender units per metre of the device: a millimetre is drawn as a hundredth of a unit,
#: which suits Blender's default clipping, snapping and lights.
SCALE = 10.0

#: Attributes of a bed's mesh, one value a pin: type in Blender, name of its value, type of the array.
ATTRIBUTES = {"mode": ("INT", "value", np.int32), "force": ("FLOAT", "value", np.float32)}


def mesh(name: str, shape: Shape, smooth_below: float = 0.6) -> Any:
    """Make a mesh of a shape in Blender units, smooth where faces meet at less than an angle, rad."""
    vertices, faces = shape
    made = bpy.data.meshes.new(name)
    made.from_pydata(vertices.tolist(), [], faces)
    made.shade_smooth()
    made.set_sharp_from_angle(angle=smooth_below)
    return made


def points(name: str, count: int) -> Any:
    """Make a mesh of `count` loose vertices with the attributes of a bed."""
    made = bpy.data.meshes.new(name)
    made.vertices.add(count)
    for attribute, (kind, _, _) in ATTRIBUTES.items():
        made.attributes.new(attribute, kind, "POINT")
    return made


def write_cells(bed: Any, position: Floats, height: Floats, **values: NDArray[Any]) -> None:
    """Write pins into a bed's mesh.

    Parameters
    ----------
    bed : bpy.types.Mesh
        From `points`, with n vertices.
    position : ndarray (n, 2)
        Axes of the pins, m.
    height : ndarray (n,)
        Pin tops, m.
    **values : ndarray (n,)
        `mode` and `force`, as many as have changed.
    """
    placed = np.column_stack([position, height]) * SCALE
    bed.vertices.foreach_set("co", np.ascontiguousarray(placed, np.float32).ravel())
    for name, array in values.items():
        _, value, kind = ATTRIBUTES[name]
        # Looked up afresh each time: undo and new attributes invalidate what was kept.
        bed.attributes[name].data.foreach_set(value, np.ascontiguousarray(array, kind))
    bed.update()  # 4.2 shows stale data without


def read_cells(bed: Any) -> dict[str, NDArray[Any]]:
    """Return `position` (n, 2) and `height` (n,), m, `mode` and `force` of a bed's mesh."""
    count = len(bed.vertices)
    placed = np.empty(3 * count, np.float32)
    bed.vertices.foreach_get("co", placed)
    table = placed.reshape(count, 3).astype(np.float64) / SCALE
    cells: dict[str, NDArray[Any]] = {"position": table[:, :2], "height": table[:, 2]}
    for name, (_, value, kind) in ATTRIBUTES.items():
        array = np.empty(count, kind)
        bed.attributes[name].data.foreach_get(value, array)
        cells[name] = array
    return cells


def place_fingertip(ball: Any, at: Floats, finger: Fingertip) -> None:
    """Put a unit sphere where the fingertip is; location, rotation and scale are its pose and semi-axes.

    Parameters
    ----------
    ball : bpy.types.Object
        In the space of its bed.
    at : ndarray (7,)
        Lowest point, m, and quaternion w, x, y, z.
    finger : Fingertip
    """
    ball.rotation_mode = "QUATERNION"
    ball.rotation_quaternion = at[3:]
    ball.location = finger.outline(np.asarray(at, np.float64)[None])[0, :3] * SCALE
    ball.scale = np.array([finger.length, finger.width, finger.height]) * SCALE


def pose(ball: Any) -> Floats:
    """Return the pose (7,) of a fingertip in the space of its bed: lowest point, m, and quaternion.

    Reads `matrix_world`, which is live while the user drags the fingertip.
    """
    bed = ball.parent
    local = ball.matrix_world if bed is None else bed.matrix_world.inverted() @ ball.matrix_world
    centre, turn, scale = local.decompose()
    rotation = np.array(turn.to_matrix())
    # N = R diag(a²) Rᵀ; the lowest point is centre - N z / sqrt(z N z).
    down = rotation @ (np.array(scale) ** 2 * rotation[2])
    lowest = np.array(centre) - down / np.sqrt(down[2])
    return np.array([*(lowest / SCALE), *turn.normalized()])


def linear(colour: tuple[float, float, float], alpha: float = 1.0) -> tuple[float, float, float, float]:
    """Return an sRGB colour in the linear light Blender's materials want."""
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour)
    return r, g, b, alpha
