"""Skins over the pin tops: interpolation between them.

A skin divides every pitch into the same number of parts, along the rows and across them; between
two rows that are shifted against each other its points shift gradually. Every pin top is one of its
points.

*bilinear* is straight between pins: the bilinear patch over four pins of an aligned bed, the
triangle over three of a staggered or hexagonal one. *smooth* is a monotone cubic spline along each
row, then across the rows: through every pin, and nowhere above or below the pins around it.
*membrane* is stretched over the flat ends of the pins: level over the ends and straight between
them, along each row, then across the rows.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ..base.arrays import Array, Faces, Floats
from ..base.spline import interpolate_monotone
from .formed import NO_PIN, Formed, make_skin

#: Largest radius of a pin's flat end, in pitches: a skin needs room to descend between two pins.
WIDEST = 0.45
#: Skins by name, with their lines in the help.
SKINS: dict[str, str] = {
    "bilinear": "straight between the pins",
    "smooth": "monotone cubic splines through the pin tops",
    "membrane": "level over the flat ends of the pins, straight between them",
}


def place_points(formed: Formed, parts: int) -> Floats:
    """Return the points of a skin, m, shape (rows, columns, 2), with `parts` points per pitch."""
    across = _linear(formed.points, parts)
    return np.swapaxes(_linear(np.swapaxes(across, 0, 1), parts), 0, 1)


def interpolate_skin(formed: Formed, height: Floats, skin: str, parts: int, cap: float) -> Floats:
    """Return the heights, m, of the points of a skin of `SKINS` over pins of heights (n,), row by row."""
    if parts == 1:
        return height
    pins = height.reshape(formed.rows, formed.columns)
    if skin == "bilinear":
        return _straight(formed, pins, parts).ravel()
    if skin == "smooth":
        return _join_rows(formed, pins, parts, interpolate_monotone).ravel()
    return _join_rows(formed, pins, parts, partial(interpolate_level, cap=cap)).ravel()


def interpolate_level(knot: Floats, value: Floats, at: Floats, cap: float) -> Floats:
    """Return values (m, s) at places (m,): level within `cap` of knots (k,) of values (k, s)."""
    if knot[0] > knot[-1]:
        knot, value = knot[::-1], value[::-1]
    low = np.clip(knot.searchsorted(at, side="right") - 1, 0, len(knot) - 2)
    step = knot[low + 1] - knot[low]
    share = flatten_share((at - knot[low]) / step, cap / step)[:, None]
    return np.asarray(value[low] + share * (value[low + 1] - value[low]))


def flatten_share(share: Floats, cap: Floats | float) -> Floats:
    """Return shares of the rise between pins with flat ends of radius `cap`, at shares of the distance."""
    cap = np.minimum(cap, WIDEST)
    return np.asarray(np.clip((share - cap) / (1.0 - 2.0 * cap), 0.0, 1.0))


def _linear(values: Floats, parts: int) -> Floats:
    """Divide each step along the first axis into straight parts."""
    share = (np.arange(parts) / parts).reshape((1, -1) + (1,) * (values.ndim - 1))
    low, high = values[:-1, None], values[1:, None]
    # Of two equal neighbors the mean is exactly the same number.
    between = (low + share * (high - low)).reshape(-1, *values.shape[1:])
    return np.concatenate([between, values[-1:]])


def _straight(formed: Formed, pins: Floats, parts: int) -> Floats:
    """Return the bilinear skin, shape of its points."""
    if not formed.shift:
        return np.swapaxes(_linear(np.swapaxes(_linear(pins, parts), 0, 1), parts), 0, 1)
    along, up = np.arange(parts) / parts, (np.arange(parts) / parts)[:, None]
    fine = np.empty(((formed.rows - 1) * parts + 1, (formed.columns - 1) * parts + 1))
    ends = np.swapaxes(_linear(np.swapaxes(pins, 0, 1), parts), 0, 1)
    fine[::parts] = ends
    for row in range(formed.rows - 1):
        # a b are the pins of this row, d c those of the next; the diagonal is the shorter one.
        a, b = pins[row, :-1, None, None], pins[row, 1:, None, None]
        d, c = pins[row + 1, :-1, None, None], pins[row + 1, 1:, None, None]
        if (formed.shift > 0.0) == (row % 2 == 0):
            near = a + along * (b - a) + up * (d - a)
            far = c + (1 - along) * (d - c) + (1 - up) * (b - c)
            patch = np.where(along + up <= 1.0, near, far)
        else:
            near = a + along * (b - a) + up * (c - b)
            far = a + along * (c - d) + up * (d - a)
            patch = np.where(along >= up, near, far)
        rows = slice(row * parts + 1, (row + 1) * parts)
        fine[rows, :-1] = np.moveaxis(patch, 0, 1)[1:].reshape(parts - 1, -1)
        fine[rows, -1] = (pins[row, -1] + up * (pins[row + 1, -1] - pins[row, -1]))[1:, 0]
    return fine


def _join_rows(
    formed: Formed,
    pins: Floats,
    parts: int,
    interpolate: Callable[[Floats, Floats, Floats], Floats],
) -> Floats:
    """Return a skin interpolated along the rows of pins, then across them, shape of its points."""
    point = place_points(formed, parts)
    first = formed.points
    fine = np.empty(point.shape[:2])
    lines = np.arange(len(point))
    period = 2 * parts if formed.shift else 1
    for phase in range(period):
        # These lines have their points at the same x: one pass of splines serves them all.
        same_x = lines[phase::period]
        if not same_x.size:
            break
        at_rows = np.empty((formed.rows, point.shape[1]))
        for start in range(2 if formed.shift else 1):
            step = slice(start, None, 2 if formed.shift else 1)
            at_rows[step] = interpolate(first[start, :, 0], pins[step].T, point[same_x[0], :, 0]).T
        fine[same_x] = interpolate(first[:, 0, 1], at_rows, point[same_x, 0, 1])
    return _bound(formed, pins, point[..., 0], fine, parts) if formed.shift else fine


def _bound(formed: Formed, pins: Floats, x: Floats, fine: Floats, parts: int) -> Floats:
    """Return a skin bounded by the heights of the pins beyond the end of a shifted row."""
    row = np.minimum(np.arange(len(fine)) // parts, formed.rows - 2)
    along, direction = formed.points[..., 0], np.sign(formed.along)
    for end, inner in ((0, 1), (-1, -2)):
        # The ends of the two rows beside a line, and the four pins of the last cell.
        ends = np.stack([along[row, end], along[row + 1, end]]) * direction
        ahead = x * direction
        beyond = (
            ahead < ends.max(axis=0)[:, None] if end == 0 else ahead > ends.min(axis=0)[:, None]
        )
        cell = np.stack(
            [pins[row, end], pins[row, inner], pins[row + 1, end], pins[row + 1, inner]]
        )
        bounded = np.clip(fine, cell.min(axis=0)[:, None], cell.max(axis=0)[:, None])
        fine = np.where(beyond, bounded, fine)
    return fine


@dataclass(frozen=True, eq=False)
class SurfaceGrid:
    """Rows and columns of points of a skin, `parts` per pitch: in plan (m, 2), now and before (m,), m."""

    formed: Formed
    parts: int
    position: Floats
    height: Floats
    former: Floats
    rows: int
    columns: int

    @cached_property
    def faces(self) -> Faces:
        """Triangles of the skin, counter-clockwise seen from above."""
        return make_skin(self.position, self.height, self.rows, self.columns)

    @property
    def raised(self) -> Floats:
        """Height of each point above its former height, m."""
        return self.height - self.former

    @property
    def pins(self) -> Faces:
        """The point at each pin top, (n,)."""
        index = np.arange(self.rows * self.columns, dtype=np.int32).reshape(self.rows, self.columns)
        return index[:: self.parts, :: self.parts].ravel()

    def nearest(self, of_pins: Array) -> Array:
        """Return at each point the value of the pin in the nearest row and column."""
        row, column = (
            (np.arange((count - 1) * self.parts + 1) + self.parts // 2) // self.parts
            for count in (self.formed.rows, self.formed.columns)
        )
        return of_pins[(row[:, None] * self.formed.columns + column).ravel()]

    def values(self) -> dict[str, Floats]:
        """Return height, force and mode at each point: force straight between pins, mode of the nearest."""
        force = interpolate_skin(self.formed, self.formed.force, "bilinear", self.parts, 0.0)
        mode = self.nearest(self.formed.mode).astype(np.float64)
        return {"height": self.height, "force": force, "mode": mode}

    def values_with_base(self, level: float) -> dict[str, Floats]:
        """Return the same, followed by as many points of a base: without force, in the mode of no pin."""
        base = {"height": level, "force": 0.0, "mode": float(NO_PIN)}
        values = self.values()
        return {
            name: np.append(values[name], np.full_like(values[name], base[name])) for name in base
        }


def fit_skin(formed: Formed, skin_name: str, parts: int, cap: float) -> SurfaceGrid:
    """Return a skin of `SKINS` with `parts` points per pitch; `cap`: radius of a pin's flat end, m."""
    position = place_points(formed, parts)
    rows, columns = position.shape[:2]
    now = interpolate_skin(formed, formed.height, skin_name, parts, cap)
    before = interpolate_skin(formed, formed.former, skin_name, parts, cap)
    return SurfaceGrid(formed, parts, position.reshape(-1, 2), now, before, rows, columns)
