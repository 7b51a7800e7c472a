"""Stepped bed as one printable body: a prism for every pin.

The part of a pin is the area nearest to it: a square in an aligned bed, a hexagon in a shifted one.
A wall stands between neighbors of different heights. Two squares that meet only at a corner, and
are both higher than the other two there, would touch along a line without thickness, which no
printer can make: a bridge of half the width `BRIDGE` joins them.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Faces, Floats, Indices
from ..model.layout import list_steps
from .formed import BASE_THICKNESS, Formed, find_base_level, take_corners

#: Half the width of a bridge, in pitches along x and rows along y.
BRIDGE = 0.05
#: Heights above the base are rounded to multiples of this, m: a wall lower than float32 resolves
#: would have no area in a file.
STEP = 1e-7


@dataclass(frozen=True, eq=False)
class Parts:
    """Division of the bed into parts, one per pin, with the sides of each part in sequence."""

    corner: Floats
    """(k, 2): Where the parts meet, m."""
    start: Indices
    end: Indices
    """(e,): Corners of each side of each part; the part is to the left."""
    pin: Indices
    """(e,): The pin of each side."""
    twin: Indices
    """(e,): The same side seen from the part beyond; -1 at the edge of the bed."""


def make_parts(formed: Formed) -> Parts:
    """Divide a bed."""
    sides = list_steps(formed.shift / formed.pitch).shape[1]
    corner, loops = _hexagons(formed) if sides == 6 else _squares(formed)
    # Corners of one loop that coincide are one corner: the loop of a square has two at each.
    start, end = loops.ravel(), np.roll(loops, -1, axis=1).ravel()
    pin = np.repeat(np.arange(len(loops)), loops.shape[1])
    real = start != end
    start, end, pin = start[real], end[real], pin[real]
    size = len(corner)
    sides = start * size + end
    order = np.argsort(sides)
    rank = np.minimum(np.searchsorted(sides, end * size + start, sorter=order), len(sides) - 1)
    twin = order[rank]
    opposite = (start[twin] == end) & (end[twin] == start)
    return Parts(corner, start, end, pin, np.where(opposite, twin, -1))


def make_pins_solid(
    formed: Formed, base_thickness: float = BASE_THICKNESS
) -> tuple[Floats, Faces, Indices]:
    """Return vertices (v, 3), m, first the middles of tops, faces (f, 3) and their pins."""
    level = find_base_level(formed.height, base_thickness)
    steps = np.maximum(np.rint((formed.height - level) / STEP), 1.0).astype(np.int64)
    height = level + steps * STEP
    parts, n = make_parts(replace(formed, height=height)), len(steps)
    # Each corner has a vertex at the height of every part about it, and one of the base.
    k, above = len(parts.corner), int(steps.max()) + 1
    keys = np.concatenate([parts.start * above + steps[parts.pin], np.arange(k) * above])
    names, number = np.unique(keys, return_inverse=True)
    number = number.ravel() + 2 * n
    starts, ground = number[: len(parts.start)], number[len(parts.start) :]
    at, up = np.divmod(names, above)
    middle = np.column_stack([formed.position, height])
    below = np.column_stack([formed.position, np.full(n, level)])
    vertices = np.concatenate(
        [middle, below, np.column_stack([parts.corner[at], level + up * STEP])]
    )
    ends = starts[_following(parts.pin)]
    top = np.column_stack([parts.pin, starts, ends]).astype(np.int32)
    bottom = np.column_stack([parts.pin + n, ground[parts.end], ground[parts.start]]).astype(
        np.int32
    )
    walls, whose = _walls(parts, steps, starts, ends, ground)
    return (
        vertices,
        np.concatenate([top, bottom, walls]),
        np.concatenate([parts.pin, parts.pin, whose]),
    )


def _following(pin: Indices) -> Indices:
    """Return for each side the next one of its part."""
    following = np.arange(1, len(pin) + 1)
    last = np.flatnonzero(np.diff(pin, append=-1) != 0)
    following[last] = np.concatenate([[0], last[:-1] + 1])
    return following


def _walls(
    parts: Parts, steps: Indices, starts: Indices, ends: Indices, ground: Indices
) -> tuple[Faces, Indices]:
    """Return the triangles of the walls of parts above their neighbors, and their pins."""
    # The vertices of a corner are numbered in the order of their heights: a wall uses consecutive
    # ones.
    other = np.where(parts.twin >= 0, steps[parts.pin[parts.twin]], 0)
    side = np.flatnonzero(steps[parts.pin] > other)
    twin = parts.twin[side]
    # The feet of the wall: the neighbor's vertices, or beyond the bed those of the base.
    left = np.where(twin >= 0, ends[twin], ground[parts.start[side]])
    right = np.where(twin >= 0, starts[twin], ground[parts.end[side]])
    i, step = _counted(starts[side] - left)
    lower = np.column_stack([left[i] + step, right[i], left[i] + step + 1]).astype(np.int32)
    j, step = _counted(ends[side] - right)
    upper = np.column_stack([right[j] + step, right[j] + step + 1, starts[side][j]]).astype(
        np.int32
    )
    return np.concatenate([lower, upper]), parts.pin[side][np.concatenate([i, j])]


def _counted(counts: Indices) -> tuple[Indices, Indices]:
    """Return each index repeated by its count, and the number of the repetition."""
    index = np.repeat(np.arange(len(counts)), counts)
    first = np.cumsum(counts) - counts
    return index, np.arange(len(index)) - first[index]


def _squares(formed: Formed) -> tuple[Floats, Indices]:
    """Return corners and loops of an aligned bed: where four parts meet are two corners, mostly the same."""
    rows, columns = formed.rows, formed.columns
    (first_x, first_y), step_x, step_y = formed.position[0], formed.along, formed.across
    x = first_x + step_x * (np.arange(columns + 1) - 0.5)
    y = first_y + step_y * (np.arange(rows + 1) - 0.5)
    corner = np.stack(np.meshgrid(x, y), axis=-1)
    top = formed.height.reshape(rows, columns)
    a, b, c, d = take_corners(top)
    ac = np.minimum(a, c) > np.maximum(b, d)
    bd = np.minimum(b, d) > np.maximum(a, c)
    # The lower corner is moved towards -y, and towards +x where a and c are joined, -x where b and
    # d are.
    lean = np.pad(ac.astype(np.float64) - bd, 1)
    apart, joined_ac, joined_bd = lean != 0.0, lean > 0.0, lean < 0.0
    away = BRIDGE * np.stack([lean * step_x, -np.abs(lean) * step_y], axis=-1)
    lower = np.arange(apart.size).reshape(apart.shape)
    upper = np.where(apart, apart.size + np.cumsum(apart.ravel()).reshape(apart.shape) - 1, lower)
    corners = np.concatenate([(corner + away).reshape(-1, 2), (corner - away)[apart]])
    # The two corners of a part where four meet, by its position among them, in the order of its
    # loop.
    corners_at = (
        (upper, np.where(joined_ac, lower, upper)),
        (np.where(joined_bd, lower, upper), upper),
        (lower, np.where(joined_ac, upper, lower)),
        (np.where(joined_bd, upper, lower), lower),
    )
    loop = [take_corners(table)[number] for number, pair in enumerate(corners_at) for table in pair]
    loops = np.stack(loop, axis=-1).reshape(rows * columns, 8)
    return corners, loops if step_x * step_y > 0.0 else loops[:, ::-1]


def _hexagons(formed: Formed) -> tuple[Floats, Indices]:
    """Return corners and loops of a bed whose rows are shifted by half a pitch."""
    rows, columns = formed.rows, formed.columns
    pitch, spacing = formed.along, formed.across
    near = (spacing**2 - pitch**2 / 4.0) / (2.0 * spacing)
    side = 1 if formed.shift > 0.0 else -1
    row, column = np.divmod(np.arange(rows * columns), columns)
    # Corners between two rows stand half a pitch apart; those of a pin are numbers q - 1, q and q +
    # 1.
    width = 2 * columns + 4
    q = 2 * column + (row % 2) * side + 2
    below, above = row * width + q, (row + 1) * width + q
    loops = np.stack([below - 1, below, below + 1, above + 1, above, above - 1], axis=1)
    x = np.array([-0.5, 0.0, 0.5, 0.5, 0.0, -0.5]) * pitch
    y = np.array([-near, near - spacing, -near, near, spacing - near, near])
    corner = np.empty(((rows + 1) * width, 2))
    corner[loops] = formed.position[:, None] + np.column_stack([x, y])
    used, loops = np.unique(loops, return_inverse=True)
    loops = loops.reshape(-1, 6)
    return corner[used], loops if pitch * spacing > 0.0 else loops[:, ::-1]
