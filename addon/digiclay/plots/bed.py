"""Plots of the bed: final heights from above with the fingertip path, and in relief."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..core.base.arrays import Array, Floats
from ..core.metrics.summary import find_contact_rows, split_fingers
from ..core.model.layout import find_grid_shape
from ..core.surface.formed import make_skin, make_solid
from .figure import INK, LINES, MM, legend_above

if TYPE_CHECKING:  # only named in annotations
    from matplotlib.axes import Axes


Room = tuple[float, float, float, float]

#: Where the relief has room, as parts of the figure: left, bottom, right, top.
ROOM: Room = (0.03, 0.05, 0.525, 0.88)


def fill_room(axes: Any, size: Floats, room: Room = ROOM) -> None:
    """Put what axes in three dimensions show, `size` (3,) in one unit, into the middle of a room."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    low, high = np.reshape(room, (2, 2))
    corners = np.array(np.meshgrid(axes.get_xlim(), axes.get_ylim(), axes.get_zlim())).reshape(3, 8)
    zoom = 1.0
    for _ in range(2):  # it is as large as the room once its size is known
        axes.set_box_aspect(size, zoom=zoom)
        axes.apply_aspect()
        flat = np.column_stack(proj_transform(*corners, axes.get_proj())[:2])
        seen = axes.figure.transFigure.inverted().transform(axes.transData.transform(flat))
        zoom *= float(np.min((high - low) / np.ptp(seen, axis=0)))
    across, up = 0.5 * (low + high - seen.min(axis=0) - seen.max(axis=0))
    now = axes.get_position()
    axes.set_position((now.x0 + across, now.y0 + up, now.width, now.height))


History = Mapping[str, Array]
#: The side walls of the relief.
CUT = "#CFCAC0"
#: Where the light of the relief comes from, a unit vector.
SUN = np.array([-0.48, -0.36, 0.80])
#: Pins along a side that a picture still resolves; larger beds are thinned before they are drawn.
RESOLVED = 100


def draw_map(axes: Any, history: History, title: str) -> None:
    """Draw the final heights, `height` over `position`, from above, with a color bar."""
    from mpl_toolkits.axes_grid1 import make_axes_locatable

    pins, top, rows, columns = _thinned(history)
    low, high = ends(top * MM, 1.0)
    scale: dict[str, Any] = {"cmap": "cividis", "vmin": low, "vmax": high}
    if min(rows, columns) < 2:
        picture: Any = axes.scatter(*pins.T * MM, c=top * MM, marker="s", **scale)
    else:
        faces = make_skin(pins, top, rows, columns)
        picture = axes.tripcolor(*pins.T * MM, faces, top * MM, shading="gouraud", **scale)
    size, middle = np.ptp(pins, axis=0) * MM, 0.5 * (pins.min(axis=0) + pins.max(axis=0)) * MM
    # A narrow bed gets room for its labels.
    half = 0.5 * np.maximum(size, max(0.75 * size.max(), 1.0))
    (left, bottom), (right, upper) = middle - half, middle + half
    axes.set(xlim=(left, right), ylim=(bottom, upper), aspect="equal")
    axes.set(xlabel="x (mm)", ylabel="y (mm)", title=title)
    axes.grid(False)
    divider = make_axes_locatable(axes)
    divider.set_anchor("NW")
    beside = divider.append_axes("right", size=0.16, pad=0.14, label="scale")
    axes.figure.colorbar(picture, cax=beside, label="height (mm)").outline.set_visible(False)
    beside.grid(False)


def draw_path(axes: Axes, history: History) -> None:
    """Draw the path of each fingertip on axes of `draw_map`: a line in contact, dots while lifted."""
    from matplotlib.patheffects import withStroke

    frame = axes.axis()
    dots: dict[str, Any] = {
        "color": "white",
        "linestyle": (0, (0.1, 2.2)),
        "dash_capstyle": "round",
    }
    dark = withStroke(linewidth=3.6, foreground=INK)
    pale = withStroke(linewidth=4.2, foreground="white")
    for number, one_finger in enumerate(split_fingers(history)):
        touching = find_contact_rows(one_finger["total_force"])[:, None]
        finger = np.asarray(one_finger["fingertip"])[:, :2] * MM
        lifted, pressed = np.where(touching, np.nan, finger).T, np.where(touching, finger, np.nan).T
        axes.plot(*lifted, label="_" * (number > 0) + "lifted", path_effects=[dark], **dots)
        line: dict[str, Any] = {"path_effects": [pale], "color": LINES[1], "linewidth": 2.4}
        axes.plot(*pressed, label="_" * (number > 0) + "in contact", **line)
    axes.axis(frame)
    legend_above(axes)


def draw_relief(axes: Any, history: History, room: Room = ROOM) -> None:
    """Draw the final surface in three dimensions, lit from the left, equal scale on all axes, none shown."""
    from matplotlib import colormaps
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    pins, top, rows, columns = _thinned(history)
    vertices, faces = make_solid(pins * MM, top * MM, rows, columns, base_thickness=3.0)
    count = 2 * (rows - 1) * (columns - 1)
    over, walls = faces[:count], faces[2 * count :]
    bright = np.column_stack([vertices, _light(vertices, over)])[over]
    while len(bright) < 8000:  # finer triangles of the same surface: they only smooth the light
        bright = _quartered(bright)
    low, high = ends(top * MM, 1.0)
    level, light = bright[:, :, 2].mean(axis=1), bright[:, :, 3].mean(axis=1)
    color = colormaps["cividis"]((level - low) / (high - low))[:, :3] * light[:, None]
    limits = [(side.min(), side.max()) for side in vertices.T]
    axes.set(**dict(zip(("xlim", "ylim", "zlim"), limits, strict=True)))
    axes.set_axis_off()
    axes.view_init(elev=34, azim=-62)
    fill_room(axes, np.ptp(vertices, axis=0), room)
    for corners, paint in ((vertices[walls], CUT), (bright[:, :, :3], color)):
        axes.add_collection3d(
            Poly3DCollection(corners, facecolors=paint, edgecolors=paint, linewidths=0.3)
        )


def _light(vertices: Floats, over: NDArray[np.integer[Any]]) -> Floats:
    """Return how brightly each vertex of the skin is lit, in (0, 1], by normals averaged over its faces."""
    a, b, c = (vertices[over[:, corner]] for corner in range(3))
    normal = np.zeros_like(vertices)
    np.add.at(normal, over, np.cross(b - a, c - a)[:, None])
    facing = normal @ SUN / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
    return 0.45 + 0.55 * np.clip(facing, 0.0, 1.0)


def _quartered(corners: Floats) -> Floats:
    """Cut each triangle in four at the middles of its sides; corners are (f, 3, k) and linear in between."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    parts = (a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)
    return np.concatenate([np.stack(part, axis=1) for part in parts])


def _thinned(history: History) -> tuple[Floats, Floats, int, int]:
    """Return positions, final heights, rows and columns, of at most `RESOLVED` pins a side."""
    pins, top = array(history, "position"), array(history, "height")[-1]
    rows, columns = find_grid_shape(pins)
    index = np.arange(rows * columns).reshape(rows, columns)
    index = index[:: -(-rows // RESOLVED), :: -(-columns // RESOLVED)]
    return pins[index.ravel()], top[index.ravel()], index.shape[0], index.shape[1]


def ends(values: Floats, least: float) -> tuple[float, float]:
    """Return the ends of a scale of `values`, `least` apart at least: what does not vary still gets one."""
    spare = max(0.0, 0.5 * (least - float(np.ptp(values))))
    return float(values.min()) - spare, float(values.max()) + spare


def array(history: History, name: str) -> Floats:
    """Return one array of the history as float64."""
    return np.asarray(history[name], dtype=np.float64)
