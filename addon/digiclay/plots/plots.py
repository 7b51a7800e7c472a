"""Pictures of a run: heights and force over time, and the final surface.

matplotlib is imported where it is used, and drawn with its Agg canvas only: no window, no
global state. Colours are Okabe and Ito's palette and cividis, told apart by people with
any colour vision; letters say the same once more.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import OutputError
from ..core.export import write_whole
from ..core.metrics import in_contact, summary
from ..core.surface import grid_shape, skin, solid

if TYPE_CHECKING:  # only named in annotations
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["session", "session_cells", "session_figure", "surface", "surface_figure"]

History = Mapping[str, ArrayLike]
Floats = NDArray[np.float64]
MM = 1e3

#: Letter and colour of each chosen cell, in the order in which the finger passes them.
LETTERS = "ABCDEF"
LINES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
INK, SHADE, CUT = "#222222", "#F1EEE6", "#CFCAC0"
#: Where the light of the relief comes from, a unit vector.
SUN = np.array([-0.48, -0.36, 0.80])
#: Pins along a side that a picture still resolves; larger beds are thinned before they are drawn.
RESOLVED = 100
#: What the session's picture says in words: label, metric, factor, format.
FIGURES = (
    ("RFD in contact", "rfd", 1.0, "{:.3f} N"),
    ("RFD while shaping", "rfd_shaping", 1.0, "{:.3f} N"),
    ("largest force", "max_total_force", 1.0, "{:.3f} N"),
    ("no contact in between", "contact_loss_share", 1e2, "{:.1f} %"),
    ("mean lag of the force", "lag_mean", MM, "{:.2f} mm"),
    ("relief formed", "height_range", MM, "{:.1f} mm"),
)
STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans", "font.size": 12, "axes.titlesize": 12, "axes.titlelocation": "left",
    "text.color": INK, "axes.edgecolor": INK, "axes.labelcolor": INK, "xtick.color": INK, "ytick.color": INK,
    "axes.spines.top": False, "axes.spines.right": False, "axes.axisbelow": True,
    "axes.grid": True, "grid.color": "#E0DED8", "grid.linewidth": 0.8,
    "lines.linewidth": 1.9, "lines.solid_capstyle": "round", "legend.frameon": False,
    "figure.facecolor": "white", "figure.dpi": 160,
}  # fmt: skip


def session(history: History, out: str | Path, set_point: float) -> Path:
    """Write `session_figure` as a PNG and return its path; OutputError when it cannot be written."""
    return _save(session_figure(history, set_point), out)


def surface(history: History, out: str | Path) -> Path:
    """Write `surface_figure` as a PNG and return its path; OutputError when it cannot be written."""
    return _save(surface_figure(history), out)


def session_cells(history: History) -> list[int]:
    """Choose up to six cells that tell the session: along the finger's path in contact, evenly spaced.

    They are different, in the order in which the finger passes them, the first and the last
    contact among them. Without any contact they are those that moved most.
    """
    count = len(LETTERS)
    position, height = _array(history, "position"), _array(history, "height")
    touching = np.flatnonzero(in_contact(_array(history, "total_force")))
    if not len(touching):
        return sorted(np.argsort(-np.ptp(height, axis=0), kind="stable")[:count].tolist())
    finger = _array(history, "fingertip")[touching, :2]
    stretch, pressed = np.hypot(*np.diff(finger, axis=0).T), np.diff(touching) == 1
    # The way through the air to the next place is one step at most: its ends are worth a cell, no more.
    stretch[~pressed] = np.minimum(stretch[~pressed], stretch[pressed].sum() / (count - 2))
    travelled = np.concatenate([[0.0], np.cumsum(stretch)])
    steps = np.linspace(0.0, travelled[-1], count)
    evenly = finger[np.argmin(np.abs(travelled - steps[:, None]), axis=1)]
    nearest = np.argmin(np.sum((evenly[:, None] - position[None]) ** 2, axis=2), axis=1)
    return list(dict.fromkeys(nearest.tolist()))


def session_figure(history: History, set_point: float) -> Figure:
    """Draw heights of chosen cells and the total force over time, as the paper's Fig. 8 does.

    Parameters
    ----------
    history : mapping
        The arrays of ``history.npz``.
    set_point : float
        Force the finger should feel, N.

    Returns
    -------
    matplotlib.figure.Figure
        Its axes, by label: ``heights``, ``force``, ``map`` with its ``scale``, and ``figures``.
    """
    time, total, height = (_array(history, name) for name in ("time", "total_force", "height"))
    with _figure(12.5, 6.3) as (figure, place):
        heights, plan = place("heights", 0.8, 2.95, 6.95, 3.0), place("map", 8.62, 3.1, 3.12, 2.85)
        force, figures = place("force", 0.8, 0.65, 6.95, 1.7), place("figures", 8.62, 0.65, 3.78, 1.7)
        for axes in (heights, force):
            across = axes.get_xaxis_transform()
            axes.fill_between(time, 0, 1, where=in_contact(total), transform=across, color=SHADE, linewidth=0)
        _draw_map(plan, history, "Where the cells are")
        for name, colour, cell in zip(LETTERS, LINES, session_cells(history), strict=False):
            heights.plot(time, height[:, cell] * MM, color=colour, label=name)
            spot = _array(history, "position")[cell] * MM
            disc = {"markersize": 16, "markeredgecolor": colour, "markeredgewidth": 2.6, "clip_on": False}
            plan.plot(*spot, "o", color="white", **disc)
            plan.annotate(name, spot, fontsize=10, fontweight="bold", ha="center", va="center_baseline")
        heights.set_ylim(_range(np.array(heights.get_ylim()), 2.0))
        heights.set(ylabel="height (mm)", title="Heights of cells", xlim=_range(time, 0.1))
        heights.tick_params(labelbottom=False)
        force.plot(time, total, color=INK, linewidth=1.3, label="total force")
        force.axhline(set_point, color=LINES[1], linestyle=(0, (5, 3)), label=f"set point {set_point:g} N")
        force.fill_between([], [], color=SHADE, label="in contact")
        force.set(xlabel="time (s)", ylabel="force (N)", ylim=(0.0, None), xlim=_range(time, 0.1))
        force.set_title("Total force on the finger")
        for axes in (heights, force):
            _legend_above(axes)
            axes.yaxis.set_label_coords(-0.075, 0.5)
        _write_figures(figures, summary(history, set_point))
    return figure


def surface_figure(history: History) -> Figure:
    """Draw the final surface in relief and from above, as the paper's Fig. 10 does.

    The axes are, by label: ``relief`` (3-D, to scale) and ``map``, with the finger's path,
    with its ``scale``. Raises ParameterError when the bed is a single row or column.
    """
    with _figure(12.5, 5.5) as (figure, place):
        # The relief is cut off at the edge of its axes, so they reach under the title and the margins.
        _draw_relief(place("relief", -0.6, -0.75, 8.1, 6.7, projection="3d", computed_zorder=False), history)
        figure.text(0.3 / 12.5, 5.14 / 5.5, "Final surface, to scale")
        plan = place("map", 7.5, 0.65, 4.3, 4.4)
        _draw_map(plan, history, "From above")
        _draw_path(plan, history)
    return figure


def _write_figures(axes: Axes, found: dict[str, float | None]) -> None:
    """Write the figures a session is judged by."""
    axes.set_axis_off()
    axes.set_title("In figures")
    for line, (label, name, factor, form) in enumerate(FIGURES):
        value, y = found[name], 0.92 - 0.158 * line
        axes.text(0.0, y, label, va="top")
        axes.text(1.0, y, "–" if value is None else form.format(value * factor), va="top", ha="right")


def _legend_above(axes: Axes) -> None:
    """Put the legend on the line of the title, where it hides nothing."""
    close = {"handlelength": 1.4, "columnspacing": 1.2, "handletextpad": 0.5, "borderaxespad": 0.0}
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.99), ncols=len(LETTERS), **close)


def _draw_map(axes: Any, history: History, title: str) -> None:
    """Draw the final heights from above, with a colour bar."""
    from mpl_toolkits.axes_grid1 import make_axes_locatable

    pins, top, rows, columns = _thinned(history)
    low, high = _range(top * MM, 1.0)
    scale: dict[str, Any] = {"cmap": "cividis", "vmin": low, "vmax": high}
    if min(rows, columns) < 2:
        picture: Any = axes.scatter(*pins.T * MM, c=top * MM, marker="s", **scale)
    else:
        faces = skin(pins, top, rows, columns)
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


def _draw_path(axes: Axes, history: History) -> None:
    """Draw where the fingertip went: a line in contact, dots while lifted."""
    from matplotlib.patheffects import withStroke

    touching = in_contact(_array(history, "total_force"))[:, None]
    finger, frame = _array(history, "fingertip")[:, :2] * MM, axes.axis()
    lifted, pressed = np.where(touching, np.nan, finger).T, np.where(touching, finger, np.nan).T
    dots: dict[str, Any] = {"color": "white", "linestyle": (0, (0.1, 2.2)), "dash_capstyle": "round"}
    dark, pale = withStroke(linewidth=3.6, foreground=INK), withStroke(linewidth=4.2, foreground="white")
    axes.plot(*lifted, label="lifted", path_effects=[dark], **dots)
    axes.plot(*pressed, label="in contact", path_effects=[pale], color=LINES[1], linewidth=2.4)
    axes.axis(frame)
    _legend_above(axes)


def _draw_relief(axes: Any, history: History) -> None:
    """Draw the final surface in three dimensions, lit from the left, equal scale on all axes."""
    from matplotlib import colormaps
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    pins, top, rows, columns = _thinned(history)
    vertices, faces = solid(pins * MM, top * MM, rows, columns, base_thickness=3.0)
    count = 2 * (rows - 1) * (columns - 1)
    over, walls = faces[:count], faces[2 * count :]
    bright = np.column_stack([vertices, _light(vertices, over)])[over]
    while len(bright) < 8000:  # finer triangles of the same surface: they only smooth the light
        bright = _quartered(bright)
    low, high = _range(top * MM, 1.0)
    level, light = bright[:, :, 2].mean(axis=1), bright[:, :, 3].mean(axis=1)
    colour = colormaps["cividis"]((level - low) / (high - low))[:, :3] * light[:, None]
    for corners, paint in ((vertices[walls], CUT), (bright[:, :, :3], colour)):
        axes.add_collection3d(Poly3DCollection(corners, facecolors=paint, edgecolors=paint, linewidths=0.3))
    limits = [(side.min(), side.max()) for side in vertices.T]
    axes.set(**dict(zip(("xlim", "ylim", "zlim"), limits, strict=True)), zlabel="height (mm)")
    axes.set_xlabel("x (mm)", labelpad=12)
    axes.set_ylabel("y (mm)", labelpad=12)
    axes.locator_params(nbins=5)
    axes.set_box_aspect(np.ptp(vertices, axis=0), zoom=0.84)
    axes.view_init(elev=34, azim=-62)


def _light(vertices: Floats, over: NDArray[np.int64]) -> Floats:
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
    pins, top = _array(history, "position"), _array(history, "height")[-1]
    rows, columns = grid_shape(pins)
    index = np.arange(rows * columns).reshape(rows, columns)
    index = index[:: -(-rows // RESOLVED), :: -(-columns // RESOLVED)]
    return pins[index.ravel()], top[index.ravel()], index.shape[0], index.shape[1]


def _range(values: Floats, least: float) -> tuple[float, float]:
    """Return the ends of a scale, `least` apart at least: what does not vary still gets one."""
    spare = max(0.0, 0.5 * (least - float(np.ptp(values))))
    return float(values.min()) - spare, float(values.max()) + spare


def _array(history: History, name: str) -> Floats:
    """Return one array of the history as float64."""
    return np.asarray(history[name], dtype=np.float64)


@contextmanager
def _figure(width: float, height: float) -> Iterator[tuple[Figure, Any]]:
    """Give an empty figure in `STYLE`, and what places axes on it (label, then a box in inches)."""
    try:
        from matplotlib import rc_context
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise OutputError("Plots need matplotlib: run 'pip install digiclay[plots]'.") from None
    with rc_context(STYLE):
        figure = Figure(figsize=(width, height))
        FigureCanvasAgg(figure)

        def place(label: str, left: float, bottom: float, across: float, up: float, **known: Any) -> Any:
            box = (left / width, bottom / height, across / width, up / height)
            return figure.add_axes(box, label=label, **known)

        yield figure, place


def _save(figure: Figure, out: str | Path) -> Path:
    """Write a figure as a PNG, whole or not at all."""
    content, path = io.BytesIO(), Path(out)
    figure.savefig(content, format="png", metadata={"Software": "digiclay"})
    write_whole(path, content.getvalue())
    return path
