"""Skins over the pin tops: interpolation between them.

A skin divides every pitch into the same number of parts, along the rows and across them; between two rows
that are shifted against each other the points shift along. Every pin top is one of its points. There

*bilinear* is straight between pins: the bilinear patch over four pins of an aligned bed, the triangle
over three of a staggered or hexagonal one;
*smooth* is a monotone cubic spline along each row, and then across the rows: through every pin, and nowhere
above or below the pins it stands between;
*membrane* is what a thin stretched skin does that lies on the flat end of every pin: level over the ends,
and harmonic, as a soap film is at small slopes, between them.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Faces, Flags, Floats
from ..base.spline import interpolate_monotone
from .formed import NO_PIN, Formed, make_skin

#: The skin is as wanted when no point would move further than this under its own pull, m.
STILL = 1e-9
#: A point is at most a pitch or so from a fixed one: some 40 rounds settle a bed of any size.
ROUNDS = 1000


def relax_membrane(formed: Formed, position: Floats, start: Floats, parts: int, cap: float) -> Floats:
    """Return the heights of a membrane, m, shape of its points: finite elements from the heights `start`."""
    flat = position.reshape(-1, 2)
    height, free = _laid(formed, position, start, parts, cap)
    faces = make_skin(flat, np.zeros(len(flat)), *start.shape)
    stiffness = _Stiffness(flat, faces)
    # Conjugate gradients on the free points, with the diagonal taken out.
    weight = np.where(free, 1.0 / stiffness.diagonal, 0.0)
    rest = -stiffness(height) * free
    step = weight * rest
    direction, power = step, float(rest @ step)
    for _ in range(ROUNDS):
        if np.abs(step).max() <= STILL:
            break
        pull = stiffness(direction) * free
        length = power / float(direction @ pull)
        height = height + length * direction
        rest = rest - length * pull
        step = weight * rest
        power, former = float(rest @ step), power
        direction = step + power / former * direction
    return height.reshape(start.shape)


def _laid(formed: Formed, position: Floats, start: Floats, parts: int, cap: float) -> tuple[Floats, Flags]:
    """Return heights with every end of a pin level, and which points no pin carries."""
    height, free = start.copy(), np.ones(start.shape, bool)
    pins = position[::parts, ::parts]
    reach = int(np.ceil(cap / min(formed.pitch, formed.row_spacing) * parts * 1.5)) + 1
    lines, points = start.shape
    for down in range(-reach, reach + 1):
        for across in range(-reach, reach + 1):
            row = np.arange(formed.rows) * parts + down
            column = np.arange(formed.columns) * parts + across
            inside = ((row >= 0) & (row < lines))[:, None] & ((column >= 0) & (column < points))
            spot = np.ix_(np.clip(row, 0, lines - 1), np.clip(column, 0, points - 1))
            near = inside & (np.sum((position[spot] - pins) ** 2, axis=-1) <= (cap * (1.0 + 1e-9)) ** 2)
            at = spot[0].repeat(formed.columns, 1)[near], spot[1].repeat(formed.rows, 0)[near]
            height[at] = start[::parts, ::parts][near]
            free[at] = False
    height[::parts, ::parts], free[::parts, ::parts] = start[::parts, ::parts], False
    return height.ravel(), free.ravel()


class _Stiffness:
    """The cotangent Laplacian of a flat triangle mesh, applied to heights."""

    def __init__(self, position: Floats, faces: Faces) -> None:
        starts, ends, weights = [], [], []
        for corner in range(3):
            tip, start, end = (faces[:, (corner + k) % 3] for k in range(3))
            one, other = position[start] - position[tip], position[end] - position[tip]
            area = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
            weight = 0.5 * np.sum(one * other, axis=1) / area
            kept = np.abs(weight) > 1e-12  # across a right angle nothing pulls
            starts.append(start[kept])
            ends.append(end[kept])
            weights.append(weight[kept])
        self._start, self._end = np.concatenate(starts), np.concatenate(ends)
        self._weight, self._count = np.concatenate(weights), len(position)
        self.diagonal = self._gathered(self._weight, self._weight)

    def __call__(self, height: Floats) -> Floats:
        """Return the pull on each point, m."""
        pull = self._weight * (height[self._start] - height[self._end])
        return self._gathered(pull, -pull)

    def _gathered(self, at_start: Floats, at_end: Floats) -> Floats:
        """Add up what the edges give to their ends."""
        total: Floats = np.zeros(self._count)
        total += np.bincount(self._start, at_start, self._count)
        total += np.bincount(self._end, at_end, self._count)
        return total


#: Skins by name, with their lines in the help.
SKINS: dict[str, str] = {
    "bilinear": "straight between the pins",
    "smooth": "monotone cubic splines through the pin tops",
    "membrane": "a thin skin stretched over the flat ends of the pins",
}


def place_points(formed: Formed, parts: int) -> Floats:
    """Return the points of a skin, m, shape (rows, columns, 2), with `parts` points a pitch."""
    across = _linear(formed.position.reshape(formed.rows, formed.columns, 2), parts)
    return np.swapaxes(_linear(np.swapaxes(across, 0, 1), parts), 0, 1)


def interpolate_skin(formed: Formed, height: Floats, skin: str, parts: int, cap: float) -> Floats:
    """Return the heights, m, of the points of a skin of `SKINS` over pins of heights (n,), row by row."""
    if parts == 1:
        return height
    pins = height.reshape(formed.rows, formed.columns)
    if skin == "smooth":
        return _smooth(formed, pins, parts).ravel()
    straight = _straight(formed, pins, parts)
    if skin == "bilinear":
        return straight.ravel()
    return relax_membrane(formed, place_points(formed, parts), straight, parts, cap).ravel()


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
            near, far = a + along * (b - a) + up * (d - a), c + (1 - along) * (d - c) + (1 - up) * (b - c)
            patch = np.where(along + up <= 1.0, near, far)
        else:
            near, far = a + along * (b - a) + up * (c - b), a + along * (c - d) + up * (d - a)
            patch = np.where(along >= up, near, far)
        rows = slice(row * parts + 1, (row + 1) * parts)
        fine[rows, :-1] = np.moveaxis(patch, 0, 1)[1:].reshape(parts - 1, -1)
        fine[rows, -1] = (pins[row, -1] + up * (pins[row + 1, -1] - pins[row, -1]))[1:, 0]
    return fine


def _smooth(formed: Formed, pins: Floats, parts: int) -> Floats:
    """Return the smooth skin, shape of its points."""
    point = place_points(formed, parts)
    first = formed.position.reshape(formed.rows, formed.columns, 2)
    fine = np.empty(point.shape[:2])
    lines = np.arange(len(point))
    period = 2 * parts if formed.shift else 1
    for phase in range(period):
        # All these lines have their points at the same x: one pass of splines serves them all.
        some = lines[phase::period]
        if not some.size:
            break
        at_rows = np.empty((formed.rows, point.shape[1]))
        for start in range(2 if formed.shift else 1):
            step = slice(start, None, 2 if formed.shift else 1)
            at_rows[step] = interpolate_monotone(first[start, :, 0], pins[step].T, point[some[0], :, 0]).T
        fine[some] = interpolate_monotone(first[:, 0, 1], at_rows, point[some, 0, 1])
    return _bound(formed, pins, point[..., 0], fine, parts) if formed.shift else fine


def _bound(formed: Formed, pins: Floats, x: Floats, fine: Floats, parts: int) -> Floats:
    """Return a skin kept between the pins beyond the end of a shifted row, which is continued straight."""
    row = np.minimum(np.arange(len(fine)) // parts, formed.rows - 2)
    along = formed.position.reshape(formed.rows, formed.columns, 2)[..., 0]
    way = np.sign(along[0, 1] - along[0, 0])
    for end, inner in ((0, 1), (-1, -2)):
        # The nearer end of the two rows a line is between, and the four pins of the last cell.
        ends = np.stack([along[row, end], along[row + 1, end]]) * way
        beyond = x * way < ends.max(axis=0)[:, None] if end == 0 else x * way > ends.min(axis=0)[:, None]
        cell = np.stack([pins[row, end], pins[row, inner], pins[row + 1, end], pins[row + 1, inner]])
        bounded = np.clip(fine, cell.min(axis=0)[:, None], cell.max(axis=0)[:, None])
        fine = np.where(beyond, bounded, fine)
    return fine


@dataclass(frozen=True, eq=False)
class SurfaceGrid:
    """Rows and columns of points of a skin, `parts` a pitch: in plan (m, 2), now and before (m,), m."""

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
        """How far each point is above where it was before, m."""
        return self.height - self.former

    @property
    def pins(self) -> Faces:
        """Which point each pin top is, shape (n,)."""
        index = np.arange(self.rows * self.columns, dtype=np.int32).reshape(self.rows, self.columns)
        return index[:: self.parts, :: self.parts].ravel()

    def nearest(self, of_pins: NDArray[Any]) -> NDArray[Any]:
        """Return at each point the value of the pin in the nearest row and column."""
        row, column = (
            (np.arange((count - 1) * self.parts + 1) + self.parts // 2) // self.parts
            for count in (self.formed.rows, self.formed.columns)
        )
        return np.asarray(of_pins[(row[:, None] * self.formed.columns + column).ravel()])

    def values(self) -> dict[str, Floats]:
        """Return height, force and mode at each point: force straight between pins, mode of the nearest."""
        force = interpolate_skin(self.formed, self.formed.force, "bilinear", self.parts, 0.0)
        mode = self.nearest(self.formed.mode).astype(np.float64)
        return {"height": self.height, "force": force, "mode": mode}

    def values_with_base(self, level: float) -> dict[str, Floats]:
        """Return the same, and after it that of as many points of a base: no force, and no pin's mode."""
        base = {"height": level, "force": 0.0, "mode": float(NO_PIN)}
        return {
            name: np.append(value, np.full(value.size, base[name])) for name, value in self.values().items()
        }


def fit_skin(formed: Formed, skin_name: str, parts: int, cap: float) -> SurfaceGrid:
    """Return a skin of `SKINS` with `parts` points a pitch; `cap`: radius of a pin's flat end, m."""
    position = place_points(formed, parts)
    rows, columns = position.shape[:2]
    now, before = (
        interpolate_skin(formed, pins, skin_name, parts, cap) for pins in (formed.height, formed.former)
    )
    return SurfaceGrid(formed, parts, position.reshape(-1, 2), now, before, rows, columns)
