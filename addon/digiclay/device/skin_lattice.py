"""Points of the live skin, and their weights: heights of the skin from heights of the pins; no Blender.

The skin is interpolated along the rows of pins, then across them. For each of the two passes the
points and their weights are prepared once. What remains for a new state is, at every point, a
weighted sum of heights, slopes and bends of two neighbors: cubic B-splines in Hermite's form.

*membrane* is that of `core.surface.skins`. *smooth* is a uniform cubic B-spline: a spline through the
pins, as that of the exports, shows steps of the rows in a rounded wall. What is level over three pins
each way is drawn at its height, a single pin at 4/9 of it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.base.arrays import Flags, Floats
from ..core.model.layout import find_grid_shape
from ..core.surface.formed import take_corners, take_outline
from ..core.surface.skins import flatten_share
from .instant import Instant

Indices = NDArray[np.int32]

#: Skins by name.
KINDS = ("smooth", "membrane")
#: Points of a skin at most, as long as the pins are fewer: what a tick has time for.
MOST_POINTS = 41_000
#: Points a pitch; more are not seen at the size of a pin.
PARTS = (4, 2, 1)
#: Rounding of a position, in pitches.
SLACK = 1e-6


class Weights(NamedTuple):
    """Weights of height, slope and bend of the two neighbors of every point, (m, 3) each.

    Slope is the sum of the rises to and from a neighbor, bend their difference.
    """

    low: Floats
    high: Floats


class Pass(NamedTuple):
    """Interpolation along one direction."""

    #: (k,), neighbors of each of the k values that are interpolated; itself at an end, which is level.
    previous: Indices
    following: Indices
    #: (m,), the two values each of the m points is between.
    low: Indices
    high: Indices
    #: By the names of `KINDS`.
    weights: dict[str, Weights]


class SkinLattice(NamedTuple):
    """Skin of a bed."""

    #: From pins to points on the rows of pins, and from these to the points of the skin.
    along: Pass
    across: Pass
    #: (m, 2), points of the skin in plan, m.
    place: Floats
    #: (m,), whether a point is on the lower edge of the skin's sides.
    sunk: Flags
    #: (f, 4), counter-clockwise from outside.
    faces: Indices
    #: (f,), the pin nearest to the middle of each face, of the nearest row.
    pin: Indices


def choose_parts(count: int) -> int:
    """Return the number of points per pitch for a number of pins."""
    return next((parts for parts in PARTS if parts**2 * count <= MOST_POINTS), PARTS[-1])


def make_lattice(instant: Instant, parts: int) -> SkinLattice:
    """Return the points and weights of a skin over a bed, with sides down to the floor."""
    x, y = instant.position.T
    rows, columns = find_grid_shape(instant.position)
    starts, spacing = x[::columns], float(y[columns] - y[0]) if rows > 1 else instant.pitch
    fine_x = _divide(x.min(), x.max(), instant.pitch, parts)
    fine_y = _divide(y.min(), y.max(), spacing, parts)
    cap = instant.actuator.bore / 2

    cell = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    low, share = _find_cells((fine_x - starts[:, None]) / instant.pitch, columns)
    first = cell[:, :1]
    along = Pass(
        *_neighbors(cell, 1),
        (first + low).ravel(),
        (first + np.minimum(low + 1, columns - 1)).ravel(),
        _weigh(share.ravel(), cap / instant.pitch),
    )
    point = np.arange(rows * fine_x.size, dtype=np.int32).reshape(rows, -1)
    low, share = _find_cells((fine_y - y[0]) / spacing, rows)
    surface = np.arange(fine_y.size * fine_x.size, dtype=np.int32).reshape(fine_y.size, -1)
    edge = take_outline(surface)
    of = np.concatenate([surface.ravel(), edge, edge])
    sunk = np.arange(of.size) >= surface.size + edge.size
    spread = np.repeat(share, fine_x.size)[of]
    across = Pass(
        *_neighbors(point, 0),
        point[low].ravel()[of],
        point[np.minimum(low + 1, rows - 1)].ravel()[of],
        {
            name: Weights(*(np.where(sunk[:, None], 0.0, part) for part in pair))
            for name, pair in _weigh(spread, cap / spacing).items()
        },
    )
    place = np.stack(np.meshgrid(fine_x, fine_y), axis=-1).reshape(-1, 2)[of]
    faces = _join(surface, edge.size)
    middle = place[faces].mean(axis=1)
    row = np.rint((middle[:, 1] - y[0]) / spacing).clip(0, rows - 1).astype(np.int32)
    column = (
        np.rint((middle[:, 0] - starts[row]) / instant.pitch).clip(0, columns - 1).astype(np.int32)
    )
    return SkinLattice(along, across, place, sunk, faces, row * columns + column)


def _divide(first: float, last: float, step: float, parts: int) -> Floats:
    """Return even points from half a step before the first pin to half a step after the last one."""
    margin = parts // 2
    count = int(np.rint((last - first) / step * parts)) + 2 * margin + 1
    return first + (np.arange(count) - margin) * (step / parts)


def _find_cells(place: Floats, count: int) -> tuple[Indices, Floats]:
    """Return the value before each place, and the share of the way to the next one; level beyond the ends."""
    low = np.clip(np.floor(place + SLACK), 0, max(count - 2, 0)).astype(np.int32)
    return low, np.clip(place - low, 0.0, 1.0)


def _neighbors(index: Indices, axis: int) -> tuple[Indices, Indices]:
    """Return the neighbors of every value along an axis; those of an end value are itself."""
    last = index.shape[axis] - 1
    step = np.arange(last + 1)
    inside = (step > 0) & (step < last)
    before, after = (np.take(index, step + side * inside, axis) for side in (-1, 1))
    return before.ravel(), after.ravel()


def _weigh(share: Floats, cap: float) -> dict[str, Weights]:
    """Return the weights at shares of the way between two pins, whose flat ends have a radius in pitches."""
    square, cube = share**2, share**3
    rise = 3.0 * square - 2.0 * cube
    low, high = 0.5 * (cube - 2.0 * square + share), 0.5 * (cube - square)
    line, none = flatten_share(share, cap), np.zeros_like(share)
    return {
        "smooth": Weights(
            np.column_stack([1.0 - rise, low, (1.0 - rise) / 6.0]),
            np.column_stack([rise, high, rise / 6.0]),
        ),
        "membrane": Weights(
            np.column_stack([1.0 - line, none, none]), np.column_stack([line, none, none])
        ),
    }


def _join(surface: Indices, edge: int) -> Indices:
    """Return the faces of a surface and of its sides, which have points of their own: a crease."""
    top = np.stack(take_corners(surface), axis=-1).reshape(-1, 4)
    upper = surface.size + np.arange(edge, dtype=np.int32)
    lower = upper + np.int32(edge)
    sides = np.column_stack([lower, np.roll(lower, -1), np.roll(upper, -1), upper])
    return np.concatenate([top, sides]).astype(np.int32)
