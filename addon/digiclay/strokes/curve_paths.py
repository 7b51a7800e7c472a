"""Paths of strokes along lines: in steps of a millimeter, as far as they are on a bed. No Blender."""

import math
from collections.abc import Sequence

import numpy as np

from ..core.base.arrays import TIE, Flags, Floats, Indices
from ..core.base.errors import ParameterError
from ..core.model.layout import Grid
from .stroke import SIDE

#: Most steps of all strokes together, 10 m, and most strokes.
STEPS, STROKES = 10_000, 500
#: Where a line turns by more, rad, the path has a place.
CORNER = math.radians(20.0)


def join_edges(places: Floats, edges: Indices) -> list[Floats]:
    """Return lines (k, 2) through places (n, 2) by edges (m, 2), each of which begins where one has ended.

    Closed lines end where they begin.
    """
    lines = np.split(edges, np.flatnonzero(edges[1:, 0] != edges[:-1, 1]) + 1)
    return [places[np.append(line[:, 0], line[-1, 1])] for line in lines if len(line)]


def lay_lines(name: str, lines: Sequence[Floats], grid: Grid) -> tuple[list[Floats], bool]:
    """Return paths (k, 2), m, along what of an object's lines is on a bed, and whether that is all of them.

    Raises ParameterError for lines that are not finite, or longer than a kilometer.
    """
    pin = np.array([grid.layout.pitch, grid.layout.row_spacing])
    half = grid.positions.max(axis=0) + pin / 2.0 + TIE
    paths, whole = list[Floats](), True
    for line in lines:
        length = float(np.hypot(*np.diff(line, axis=0).T).sum())
        if not length < 1e3:
            rule = "must be finite, and below 1000 m of the device"
            raise ParameterError(name, "length", rule, f"{length:g} m")
        if length > TIE:
            path = divide_line(line)
            inside = (np.abs(path) <= half).all(axis=1)
            paths += _split_path(path, inside)
            whole = whole and bool(inside.all())
    return paths, whole and bool(paths)


def divide_line(line: Floats) -> Floats:
    """Return places (k, 2) along a line (n, 2), m, at steps of a millimeter, and at its corners.

    The place that is nearest to a corner is moved there.
    """
    line = line[np.append(True, np.diff(line, axis=0).any(axis=1))]
    way = np.diff(line, axis=0)
    length = np.hypot(*way.T)
    gone = np.append(0.0, np.cumsum(length))
    # Blender rounds places to a few nanometers.
    count = math.ceil(gone[-1] / SIDE - 1e-3)
    at = np.linspace(0.0, gone[-1], count + 1)
    way /= length[:, None]
    corners = 1 + np.flatnonzero((way[1:] * way[:-1]).sum(axis=1) < math.cos(CORNER))
    nearest = np.rint(gone[corners] / gone[-1] * count).astype(np.intp)
    inner = (nearest > 0) & (nearest < count)
    at[nearest[inner]] = gone[corners[inner]]
    return np.column_stack([np.interp(at, gone, places) for places in line.T])


def _split_path(path: Floats, inside: Flags) -> list[Floats]:
    """Return the parts of a path (k, 2) that are inside; of a closed one, none ends where it begins."""
    if not inside.all() and (path[0] == path[-1]).all():
        outside = int(inside.argmin())
        path, inside = (
            np.concatenate([row[outside:-1], row[: outside + 1]]) for row in (path, inside)
        )
    runs = np.split(np.arange(len(path)), np.flatnonzero(np.diff(inside)) + 1)
    return [path[run] for run in runs if inside[run[0]]]


def refuse_paths(paths: Sequence[Floats]) -> None:
    """Raise ParameterError if there are no paths, or they are too long together, or too many."""
    steps = sum(len(path) - 1 for path in paths)
    limits = (
        ("", not paths, "must have a line over the bed", "none"),
        ("length", steps > STEPS, "must be at most 10 m on the bed", f"{SIDE * steps:.5g} m"),
        ("lines", len(paths) > STROKES, "must be at most 500 on the bed", f"{len(paths)}"),
    )
    for field, broken, rule, value in limits:
        if broken:
            raise ParameterError("Curves", field, rule, value)
