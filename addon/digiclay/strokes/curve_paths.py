"""Paths of strokes along lines that lie on a bed: clipped to it, in steps of a millimeter. No Blender."""

import math
from collections.abc import Sequence

import numpy as np

from ..core.base.arrays import TIE, Floats, Indices
from ..core.base.errors import ParameterError
from ..core.model.layout import Grid
from .stroke import SIDE

#: Longest path of all strokes together, m, and most strokes.
LONGEST, MOST = 10.0, 500
#: Where a line turns by more, rad, the path has a place.
CORNER = math.radians(20.0)


def join_edges(places: Floats, edges: Indices) -> list[Floats]:
    """Return lines (k, 2) through places (n, 2) by edges (m, 2), each of which begins where one has ended.

    Closed lines end where they begin.
    """
    if not len(edges):
        return []
    lines = np.split(edges, np.flatnonzero(edges[1:, 0] != edges[:-1, 1]) + 1)
    return [places[np.append(line[:, 0], line[-1, 1])] for line in lines]


def measure_length(lines: Sequence[Floats]) -> float:
    """Return the length of lines (k, 2) together."""
    return sum(float(np.hypot(*np.diff(line, axis=0).T).sum()) for line in lines)


def clip_line(line: Floats, low: Floats, high: Floats) -> list[Floats]:
    """Return the parts of a line (k, 2) in a rectangle; of a closed one, no part ends where it begins."""
    start, way = line[:-1], np.diff(line, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        times = (np.stack([low, high])[:, None] - start) / way
    # A line along a side is in the rectangle.
    times = np.where(np.isnan(times), np.array([-np.inf, np.inf])[:, None, None], times)
    first = times.min(axis=0).max(axis=1).clip(0.0)
    last = times.max(axis=0).min(axis=1).clip(max=1.0)
    inside = np.flatnonzero(first < last)
    if not inside.size:
        return []
    first, last, start, way = first[inside], last[inside], start[inside], way[inside]
    entries = start + first[:, None] * way
    exits = np.where(last[:, None] < 1.0, start + last[:, None] * way, line[1:][inside])
    gaps = (np.diff(inside) > 1) | (last[:-1] < 1.0) | (first[1:] > 0.0)
    ends = np.append(np.flatnonzero(gaps) + 1, inside.size)
    starts = np.append(0, ends[:-1])
    parts = [np.vstack([entries[i:k], exits[k - 1]]) for i, k in zip(starts, ends, strict=True)]
    begin, end = parts[0][0], parts[-1][-1]
    if len(parts) > 1 and (begin == end).all() and (begin == line[0]).all():
        parts = [np.concatenate([parts[-1], parts[0][1:]]), *parts[1:-1]]
    return parts


def divide_line(line: Floats) -> Floats:
    """Return places (k, 2) along a line (n, 2), m, at steps of a millimeter, and at its corners.

    The place that is nearest to a corner is moved there.
    """
    line = line[np.append(True, np.diff(line, axis=0).any(axis=1))]
    way = np.diff(line, axis=0)
    length = np.hypot(*way.T)
    gone = np.append(0.0, np.cumsum(length))
    count = max(1, math.ceil((gone[-1] - TIE) / SIDE))
    at = np.linspace(0.0, gone[-1], count + 1)
    way /= length[:, None]
    corners = 1 + np.flatnonzero((way[1:] * way[:-1]).sum(axis=1) < math.cos(CORNER))
    nearest = np.rint(gone[corners] / gone[-1] * count).astype(np.intp)
    inner = (nearest > 0) & (nearest < count)
    at[nearest[inner]] = gone[corners[inner]]
    return np.column_stack([np.interp(at, gone, places) for places in line.T])


def clip_to_bed(lines: Sequence[Floats], grid: Grid) -> list[Floats]:
    """Return the parts of lines (k, 2), m, on a bed, up to the rims of its pins."""
    half = np.array([grid.layout.pitch, grid.layout.row_spacing]) / 2.0
    low, high = grid.positions.min(axis=0) - half, grid.positions.max(axis=0) + half
    parts = [part for line in lines for part in clip_line(line, low, high)]
    return [part for part in parts if measure_length([part]) > TIE]


def divide_lines(lines: Sequence[Floats]) -> list[Floats]:
    """Return the paths (k, 2), m, of strokes along lines; ParameterError if they are too long or too many."""
    length = measure_length(lines)
    if not lines:
        raise ParameterError("Curves", "", "must have a line over the bed", "none")
    if length > LONGEST:
        rule = f"must be at most {LONGEST:g} m on the bed"
        raise ParameterError("Curves", "length", rule, f"{length:.4g} m", "Select fewer.")
    if len(lines) > MOST:
        rule = f"must be at most {MOST} on the bed"
        raise ParameterError("Curves", "lines", rule, f"{len(lines)}", "Select fewer.")
    return [divide_line(line) for line in lines]
