"""Formed surface: the pins now and before, what is between them, and the bodies made of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Faces, Floats, Indices
from ..base.errors import OutputError, ParameterError
from ..model.layout import find_neighbors
from .skin_mesh import check_heights, find_grid_shape


@dataclass(frozen=True, eq=False)
class Formed:
    """All pins of a bed, row by row.

    Raises ParameterError on fewer than 2 x 2 pins, arrays that do not fit, numbers that are not finite, or
    pins out of order.
    """

    position: Floats
    """(n, 2): Axes of the pins, m."""
    height: Floats
    """(n,): Pin tops, m."""
    former: Floats
    """(n,): The same before the surface was formed, m; one number for all will do."""
    force: Floats
    """(n,): Force on each pin, N."""
    mode: Indices
    """(n,): Codes of `modes.Mode`."""
    rows: int
    columns: int
    """Found from the positions."""

    @classmethod
    def of(
        cls, position: ArrayLike, height: ArrayLike, former: ArrayLike, force: ArrayLike, mode: ArrayLike
    ) -> Formed:
        """Check the arrays; one number will do for `former`, `force` and `mode`."""
        rows, columns = find_grid_shape(position)
        place, top = check_heights(position, height, rows, columns)
        _, before = check_heights(place, np.broadcast_to(former, top.shape), rows, columns, "former")
        _, pressed = check_heights(place, np.broadcast_to(force, top.shape), rows, columns, "force")
        codes = np.broadcast_to(np.asarray(mode, np.int64), top.shape)
        return cls(place, top, before, pressed, codes, rows, columns)

    @property
    def pitch(self) -> float:
        """Distance between neighbors in a row, m."""
        return float(np.hypot(*(self.position[1] - self.position[0])))

    @property
    def shift(self) -> float:
        """How far every other row is shifted the way the columns run, m; 0 in an aligned bed."""
        direction = np.sign(self.position[1, 0] - self.position[0, 0])
        shift = float(direction * (self.position[self.columns, 0] - self.position[0, 0]))
        return shift if abs(shift) > 1e-3 * self.pitch else 0.0

    @property
    def row_spacing(self) -> float:
        """Distance between rows, m."""
        return float(abs(self.position[self.columns, 1] - self.position[0, 1]))

    def nearest(self, place: Floats) -> Indices:
        """Return the pin in the nearest row that is nearest to each of some places, m, shape (k, 2)."""
        across = self.position[self.columns, 1] - self.position[0, 1]
        along = self.position[1, 0] - self.position[0, 0]
        row = np.rint((place[:, 1] - self.position[0, 1]) / across).clip(0, self.rows - 1).astype(np.int64)
        first = self.position[row * self.columns, 0]
        column = np.rint((place[:, 0] - first) / along).clip(0, self.columns - 1).astype(np.int64)
        return np.asarray(row * self.columns + column)

    @property
    def raised(self) -> Floats:
        """How far each pin is above where it was before, m."""
        return self.height - self.former

    @property
    def spacing(self) -> float:
        """Mean of the distances in a row and of rows, m."""
        return 0.5 * (self.pitch + self.row_spacing)

    @cached_property
    def neighbors(self) -> Indices:
        """Neighbors of the pins, (n, 8) in an aligned bed, else (n, 6), counter-clockwise; -1 off the bed."""
        return find_neighbors(self.rows, self.columns, self.shift / self.pitch, corners=True)

    def at(self, values: Floats, place: Floats) -> Floats:
        """Return values (n,) at places (..., 2), m: linear along rows, then across; NaN off the bed."""
        first = self.position[:: self.columns]
        along = self.position[1, 0] - self.position[0, 0]
        row = (place[..., 1] - first[0, 1]) / (first[1, 1] - first[0, 1])
        low = np.clip(np.floor(row), 0, self.rows - 2).astype(np.int64)
        up = row - low
        columns = [(place[..., 0] - first[low + step, 0]) / along for step in (0, 1)]
        parts = []
        for step, column in enumerate(columns):
            left = np.clip(np.floor(column), 0, self.columns - 2).astype(np.int64)
            over = np.clip(column - left, 0.0, 1.0)
            pin = (low + step) * self.columns + left
            parts.append(values[pin] * (1.0 - over) + values[pin + 1] * over)
        across = columns[0] * (1.0 - up) + columns[1] * up
        slack = 1e-6
        on_bed = (row >= -slack) & (row <= self.rows - 1 + slack)
        on_bed &= (across >= -slack) & (across <= self.columns - 1 + slack)
        share = np.clip(up, 0.0, 1.0)
        return np.where(on_bed, parts[0] * (1.0 - share) + parts[1] * share, np.nan)


def make_formed(history: Mapping[str, NDArray[Any]], row: int, former: int | float = 0) -> Formed:
    """Return a row of a history as a formed surface; `former`: a row (int), or one height, m (float)."""
    count = len(history["height"])
    for name, wanted in (("row", row), ("former", former)):
        if isinstance(wanted, int) and not -count <= wanted < count:
            raise OutputError(f"The history has {count} rows, 0 to {count - 1} (got {wanted} as {name}).")
    before = history["height"][former] if isinstance(former, int) else former
    if isinstance(former, float) and not np.isfinite(former):
        raise ParameterError("Export", "former", "must be a finite height", f"{former} m")
    arrays = (history[name][row] for name in ("force", "mode"))
    return Formed.of(history["position"], history["height"][row], before, *arrays)


#: Code of the mode at a vertex that belongs to no pin, such as one of the base.
NO_PIN = -1
#: Triangles, or vertices, that are worked on at once: a few MB, however large the body.
PIECE = 1 << 16


@dataclass(frozen=True, eq=False)
class Body:
    """Vertices and triangles under one name."""

    name: str
    """Letters, digits and underscores."""
    vertices: Floats
    """(v, 3): m, z up, in the space of the bed."""
    faces: Faces
    """(f, 3): Counter-clockwise seen from outside."""
    values: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    """(v,): Nothing, or height, m, force, N, and code of the control mode of each vertex."""
    groups: tuple[str, ...] = ()
    """Names of groups of faces, such as features."""
    group: Faces = field(default_factory=lambda: np.empty(0, np.int32))
    """(f,): To which group a face belongs: 1 is the first of `groups`, 0 none. Empty without groups."""
    vertex_group: Faces = field(default_factory=lambda: np.empty(0, np.int32))
    """(v,): The same for vertices; empty without groups."""
    closed: bool = True
    """Whether it encloses a volume."""


def split_pieces(table: NDArray[Any]) -> Iterator[NDArray[Any]]:
    """Give the rows of a table in order, at most `PIECE` at a time."""
    for start in range(0, len(table), PIECE):
        yield table[start : start + PIECE]
