"""Arrays of a few hundred cells, (n,), or of the cells of b runs, (n, b): constants, tests and linear maps.

At that size it is numpy's calls that cost. A number that differs from run to run is an array (b,),
which numpy puts against the last axis; a linear map (o, i) that does is an array (o, i, b).
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
#: Codes of `Mode`.
Modes = NDArray[np.int8]
#: Numbers of cells.
Cells = NDArray[np.intp]
#: Numbers of points, or places in a table.
Indices = NDArray[np.int64]
#: Corners of triangles (f, 3), numbers of vertices.
Faces = NDArray[np.int32]

#: Lengths, m, forces, N, times, s, and ranks that differ by no more are equal. What the lattice, symmetry or
#: the clock makes equal differs by rounding, 1e-12 at most, which is other on another processor: it decides
#: nothing. Of equal ones the first is taken.
TIE = 1e-9
PARTS = 2.0**30
#: Smallest normal number: keeps 0 / 0 from being NaN.
TINY = float(np.finfo(float).tiny)
#: Shapes for which one set of `Constants` is kept.
MOST_SHAPES = 64


class Constants(dict[tuple[int, ...], tuple[Any, ...]]):
    """Numbers such that arrays of a shape can be calculated with them: ``Constants((0.0, 1.0))[shape]``.

    Numpy takes two operands of one shape twice as fast as an array and a number, so for the
    cells of one run, (n,), each becomes an array of elements of a kind; these are kept, shared and
    read-only. Numbers that differ from run to run are arrays (b,).
    """

    def __init__(self, numbers: tuple[Any, ...], kind: type = np.float64) -> None:
        super().__init__()
        self._numbers, self._kind = numbers, kind

    def __missing__(self, shape: tuple[int, ...]) -> tuple[Any, ...]:
        """Make the numbers for arrays of a shape, (n,) or (n, b), that has not been asked for."""
        if len(self) >= MOST_SHAPES:
            self.clear()
        made = self._numbers
        if len(shape) == 1:
            rows: NDArray[Any] = np.array(made, self._kind).repeat(*shape).reshape(len(made), *shape)
            rows.flags.writeable = False
            made = tuple(rows)
        elif self._kind is not np.float64:
            made = tuple(self._kind(one) for one in made)
        self[shape] = made
        return made


def settle(values: Any) -> Any:
    """Return numbers, or one, to about `TIE`: those that are equal but for rounding become the same."""
    # Halfway between two parts of a power of two no number lies that is written with a few digits.
    return np.rint(values * PARTS) / PARTS


def find_first_largest(values: Floats) -> Any:
    """Return the first row whose value is the largest, in each column of (r[, m]) values; see `TIE`."""
    return (values >= np.maximum.reduce(values) - TIE).argmax(axis=0)


def any_true(test: NDArray[np.bool_]) -> bool:
    """Return whether a test holds anywhere; numpy's own `any` takes twice as long."""
    return 1 in test.tobytes()


def count_true(test: NDArray[np.bool_]) -> Any:
    """Return for how many cells a test, (n,), holds; for a test (n, b) a list, one number a run."""
    return test.tobytes().count(1) if test.ndim == 1 else np.count_nonzero(test, axis=0).tolist()


class Copies(NamedTuple):
    """Cells (g,) that several of f rows have, and their p entries, in the order of rows."""

    cells: Cells
    row: Cells
    which: Cells
    number: Cells
    """(p,): Of the entries: their rows, which of these cells, and numbers among the entries of all cells."""
    entries: Cells
    """(c, g): Which are each cell's; the first one makes up the number."""


def find_copies(inside: Flags) -> Copies:
    """Return which cells several rows have, (f, n)."""
    (cells,) = (np.add.reduce(inside, axis=0, dtype=np.intp) > 1).nonzero()
    own = inside[:, cells]
    row, which = own.nonzero()
    number, rank = np.cumsum(inside).reshape(inside.shape), np.cumsum(own, axis=0)
    entries = np.empty((rank.max(initial=1), cells.size), np.intp)
    order = np.arange(row.size)
    entries[:, which[::-1]] = order[::-1]
    entries[rank[row, which] - 1, which] = order
    return Copies(cells, row, which, number[row, cells[which]] - 1, entries)


def per_row(values: Floats, dimensions: int) -> Floats:
    """Return numbers (r,), (r, 1) or (r, b) such that rows (r, n) or (r, n, b) combine with them."""
    return values.reshape(len(values), *(1,) * (dimensions - 2), -1)


def apply_map(linear: Floats, rows: Floats) -> Floats:
    """Return what a linear map (o, i[, b]) makes of rows (i, n[, b]), shape (o, n[, b])."""
    made: Floats = np.empty((len(linear), *rows.shape[1:]))
    prepare_map(linear, rows, made)()
    return made


def prepare_map(linear: Floats, rows: Floats, out: Floats) -> Callable[[], Any]:
    """Return a function that applies a map to rows, as they are then, into contiguous `out`: `apply_map`."""
    if linear.ndim == 3:
        return partial(_by_run, linear, rows, out)
    flat, made = (rows, out) if rows.ndim == 2 else (rows.reshape(len(rows), -1), out.reshape(len(out), -1))
    return partial(np.matmul, linear, flat, made)


def _by_run(linear: Floats, rows: Floats, out: Floats) -> None:
    """Work out each run's own linear map; row by row, over all of them numpy takes four times as long."""
    for one, made in zip(linear, out, strict=True):
        np.einsum("ib,inb->nb", one, rows, out=made)
