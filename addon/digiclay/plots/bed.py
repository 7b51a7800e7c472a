"""Plots of the bed: final heights from above with the fingertip path, and in relief with labels apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.base.arrays import Floats
from ..core.metrics.summary import find_contact_rows, split_fingers
from ..core.model.layout import find_grid_shape
from ..core.surface.formed import make_skin, make_solid
from .figure import INK, LINES, MM, legend_above

if TYPE_CHECKING:  # only named in annotations
    from matplotlib.axes import Axes


Room = tuple[float, float, float, float]

#: Where the relief and all that is written on it has room, as parts of the figure: left, bottom, right, top.
ROOM: Room = (0.01, 0.02, 0.525, 0.9)
#: Times the relief is fitted; a little less than the room, because letters do not grow with it.
ROUNDS, LARGER = 3, 1.6
#: Most numbers along an axis, and how far its name may stand off, points.
NUMBERS, OFF = 5, (4, 12, 20, 28, 36, 46, 56, 70)


def fit_relief(axes: Any, size: Any, limits: Sequence[tuple[float, float]], room: Room = ROOM) -> None:
    """Choose numbers on empty axes and places of their names so that they are apart, and fill the room.

    `size` (3,), of what is shown, in the same unit on all axes.
    """
    from matplotlib.ticker import FixedLocator

    zoom = 0.84
    for turn in range(ROUNDS):
        axes.set_box_aspect(size, zoom=zoom)
        for axis, (low, high) in zip(_sides(axes), limits, strict=True):
            _number(axes, axis, low, high)
            axis.labelpad = OFF[0]
        for axis in _sides(axes):
            counts = {}
            for axis.labelpad in OFF:
                counts[axis.labelpad] = sum(axis.label in pair for pair in hidden(axes))
                if not counts[axis.labelpad]:
                    break
            else:  # beside a narrow bed no distance takes the name off the numbers: those under it go
                axis.labelpad = min(counts, key=lambda pad: counts[pad])
                under = {text for pair in hidden(axes) if axis.label in pair for text in pair}
                kept = [tick.get_loc() for tick in _shown(axis) if tick.label1 not in under]
                axis.set_major_locator(FixedLocator(kept))
        if turn < ROUNDS - 1:
            zoom *= min(LARGER, _placed(axes, room))
    _placed(axes, room)


def _sides(axes: Any) -> tuple[Any, Any, Any]:
    return axes.xaxis, axes.yaxis, axes.zaxis


def _measure_texts(axes: Any) -> list[tuple[Any, Any]]:
    """Return all names and numbers on the axes of a relief, each with the box it is drawn in."""
    renderer = axes.figure.canvas.get_renderer()
    axes.draw(renderer)  # the figure's other axes would take their time again and again
    texts = [axis.label for axis in _sides(axes)]
    texts += [tick.label1 for axis in _sides(axes) for tick in _shown(axis)]
    return [(text, text.get_window_extent(renderer)) for text in texts if text.get_text()]


def hidden(axes: Any) -> list[tuple[Any, Any]]:
    """Return the pairs of texts on the axes of a relief that are drawn over each other."""
    pairs = combinations(_measure_texts(axes), 2)
    return [(one, two) for (one, a), (two, b) in pairs if a.overlaps(b)]


def _shown(axis: Any) -> list[Any]:
    """Return the ticks of an axis that are drawn."""
    low, high = sorted(axis.get_view_interval())
    slack = 1e-6 * (high - low)
    return [tick for tick in axis.get_major_ticks() if low - slack <= tick.get_loc() <= high + slack]


def _number(axes: Any, axis: Any, low: float, high: float) -> None:
    """Give an axis as many numbers as have room; one at its end if there is none for two."""
    from matplotlib.ticker import FixedLocator, MaxNLocator

    for count in range(NUMBERS, 0, -1):
        axis.set_major_locator(MaxNLocator(count, steps=[1, 2, 2.5, 5, 10]))
        own = {tick.label1 for tick in _shown(axis)}
        if len(own) > 1 and not any(own.issuperset(pair) for pair in hidden(axes)):
            return
    axis.set_major_locator(FixedLocator([float(np.round(high, 1 if high - low < 10.0 else 0))]))


def _placed(axes: Any, room: Room) -> float:
    """Move a relief into the middle of its room, and return how much larger it could be there."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    boxes = [box.get_points() for _, box in _measure_texts(axes)]
    corners = np.array(np.meshgrid(axes.get_xlim(), axes.get_ylim(), axes.get_zlim())).reshape(3, 8)
    flat = np.column_stack(proj_transform(*corners, axes.get_proj())[:2])
    places = np.concatenate([axes.transData.transform(flat), *boxes])
    inside = axes.figure.transFigure.inverted().transform(places)
    inside = inside[np.all(np.abs(inside) < 2.0, axis=1)]  # a number that is not drawn has no place
    low, high = inside.min(axis=0), inside.max(axis=0)
    ends = np.array(room).reshape(2, 2)
    now = axes.get_position()
    across, up = 0.5 * (ends.sum(axis=0) - low - high)
    axes.set_position((now.x0 + across, now.y0 + up, now.width, now.height))
    return float(np.min((ends[1] - ends[0]) / (high - low)))


History = Mapping[str, ArrayLike]
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
    half = 0.5 * np.maximum(size, max(0.75 * size.max(), 1.0))  # a narrow bed gets room for its labels
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
    dots: dict[str, Any] = {"color": "white", "linestyle": (0, (0.1, 2.2)), "dash_capstyle": "round"}
    dark, pale = withStroke(linewidth=3.6, foreground=INK), withStroke(linewidth=4.2, foreground="white")
    for number, own in enumerate(split_fingers(history)):
        touching = find_contact_rows(own["total_force"])[:, None]
        finger = np.asarray(own["fingertip"])[:, :2] * MM
        lifted, pressed = np.where(touching, np.nan, finger).T, np.where(touching, finger, np.nan).T
        axes.plot(*lifted, label="_" * (number > 0) + "lifted", path_effects=[dark], **dots)
        line: dict[str, Any] = {"path_effects": [pale], "color": LINES[1], "linewidth": 2.4}
        axes.plot(*pressed, label="_" * (number > 0) + "in contact", **line)
    axes.axis(frame)
    legend_above(axes)


def draw_relief(axes: Any, history: History, room: Room = ROOM) -> None:
    """Draw the final surface in three dimensions, lit from the left, equal scale on all axes."""
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
    axes.set(**dict(zip(("xlim", "ylim", "zlim"), limits, strict=True)), zlabel="height (mm)")
    axes.set(xlabel="x (mm)", ylabel="y (mm)")
    axes.view_init(elev=34, azim=-62)
    fit_relief(axes, np.ptp(vertices, axis=0), limits, room)
    for corners, paint in ((vertices[walls], CUT), (bright[:, :, :3], color)):
        axes.add_collection3d(Poly3DCollection(corners, facecolors=paint, edgecolors=paint, linewidths=0.3))


def _light(vertices: Floats, over: NDArray[np.integer[Any]]) -> Floats:
    """Return how brightly each vertex of the skin is lit, in (0, 1], by normals averaged over its faces."""
    a, b, c = (vertices[over[:, corner]] for corner in range(3))
    normal = np.zeros_like(vertices)
    np.add.at(normal, over, np.cross(b - a, c - a)[:, None])
    facing = normal @ SUN / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
    return np.asarray(0.45 + 0.55 * np.clip(facing, 0.0, 1.0))


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
