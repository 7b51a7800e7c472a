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

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.spline import interpolate_monotone
from .formed import Formed
from .membrane import relax_membrane

#: Skins by name, with what is said of them in the help.
SKINS: dict[str, str] = {
    "bilinear": "straight between the pins",
    "smooth": "monotone cubic splines through the pin tops",
    "membrane": "a thin skin stretched over the flat ends of the pins",
}


def place_points(formed: Formed, parts: int) -> Floats:
    """Return the points of a skin, m, shape (rows, columns, 2), with `parts` points a pitch.

    `parts`: points of the skin in a pitch.
    """
    grid = formed.position.reshape(formed.rows, formed.columns, 2)
    across = _linear(grid, parts)
    fine = _linear(np.swapaxes(across, 0, 1), parts)
    return np.swapaxes(fine, 0, 1)


def interpolate_skin(formed: Formed, height: Floats, skin: str, parts: int, cap: float) -> Floats:
    """Return the heights of a skin over its points, m, row by row.

    `formed`: the pins; `height` (n,), their heights to cover, m; `skin`: a key of `SKINS`; `parts`: points a
    pitch; `cap`: radius of a pin's flat end, m; of use to the membrane only.
    """
    if parts == 1:
        return height
    pins = height.reshape(formed.rows, formed.columns)
    makers: dict[str, Callable[[], Floats]] = {
        "bilinear": lambda: _straight(formed, pins, parts),
        "smooth": lambda: _smooth(formed, pins, parts),
        "membrane": lambda: relax_membrane(
            formed, place_points(formed, parts), _straight(formed, pins, parts), parts, cap
        ),
    }
    return makers[skin]().ravel()


def find_nearest_pin(formed: Formed, parts: int) -> NDArray[np.int32]:
    """Return the pin whose row and column each point of a skin is nearest to, row by row.

    `parts`: points of the skin in a pitch.
    """
    row, column = (np.arange((count - 1) * parts + 1) for count in (formed.rows, formed.columns))
    nearest = ((row + parts // 2) // parts)[:, None] * formed.columns + (column + parts // 2) // parts
    pins: NDArray[np.int32] = nearest.ravel().astype(np.int32)
    return pins


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
    return _held(formed, pins, point[..., 0], fine, parts) if formed.shift else fine


def _held(formed: Formed, pins: Floats, x: Floats, fine: Floats, parts: int) -> Floats:
    """Return a skin that goes no further than the pins where it lies beyond the end of a shifted row.

    There its rows are continued straight, so that a tilted bed has a plane skin; `x` is that of its points.
    """
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
