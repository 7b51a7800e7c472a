"""Arrays of a few hundred cells, (n,), or of the cells of b runs, (n, b): constants, tests and linear maps.

At that size the calls of numpy cost most. A number that differs from run to run is an array (b,),
which numpy broadcasts along the last axis; a linear map (o, i) that differs is an array (o, i, b).
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
#: Numbers of any kind: a column of a run's history, say.
Array = NDArray[Any]
Flags = NDArray[np.bool_]
#: Codes of `Mode`.
Modes = NDArray[np.int8]
#: Numbers of cells.
Cells = NDArray[np.intp]
#: Numbers of points, or places in a table.
Indices = NDArray[np.int64]
#: Corners of triangles (f, 3), numbers of vertices.
Faces = NDArray[np.int32]

#: Largest difference of equal lengths, m, forces, N, times, s, and ranks. Values that are equal by
#: the lattice, symmetry or the clock differ by rounding, at most 1e-12, which depends on the
#: processor and must not decide. Of equal values the first is taken.
TIE = 1e-9
PARTS = 2.0**30
#: Smallest normal number: keeps 0 / 0 from being NaN.
TINY = float(np.finfo(float).tiny)
#: Most shapes of a set of `Constants`.
MOST_SHAPES = 64


class Constants(dict[tuple[int, ...], tuple[Any, ...]]):
    """Numbers for calculations with arrays of a shape: ``Constants((0.0, 1.0))[shape]``.

    Numpy combines two operands of one shape twice as fast as an array and a number, so for the
    cells of one run, (n,), each becomes an array of elements of a kind, cached and read-only.
    Numbers that differ from run to run are arrays (b,).
    """

    def __init__(self, numbers: tuple[Any, ...], kind: type = np.float64) -> None:
        super().__init__()
        self._numbers, self._kind = numbers, kind

    def __missing__(self, shape: tuple[int, ...]) -> tuple[Any, ...]:
        """Make the numbers for arrays of a new shape, (n,) or (n, b)."""
        if len(self) >= MOST_SHAPES:
            self.clear()
        numbers = self._numbers
        if len(shape) == 1:
            rows: Array = np.array(numbers, self._kind).repeat(*shape).reshape(len(numbers), *shape)
            rows.flags.writeable = False
            numbers = tuple(rows)
        elif self._kind is not np.float64:
            numbers = tuple(map(self._kind, numbers))
        self[shape] = numbers
        return numbers


def settle(values: Any) -> Any:
    """Return numbers rounded to about `TIE`: those that are equal except for rounding become identical."""
    # To multiples of a power of two: no number of a few digits is halfway between two of them.
    return np.rint(values * PARTS) / PARTS


def find_first_largest(values: Floats) -> Any:
    """Return the first row whose value is the largest, in each column of (r[, m]) values; see `TIE`."""
    return (values >= np.maximum.reduce(values) - TIE).argmax(axis=0)


def any_true(test: NDArray[np.bool_]) -> bool:
    """Return whether a test holds anywhere; numpy's own `any` takes twice as long."""
    return 1 in test.tobytes()


def count_true(test: NDArray[np.bool_]) -> Any:
    """Return for how many cells a test (n,) holds; for a test (n, b) a list, one number per run."""
    return test.tobytes().count(1) if test.ndim == 1 else np.count_nonzero(test, axis=0).tolist()


class Copies(NamedTuple):
    """Cells (g,) that are in several of f rows, and their p entries, in the order of rows."""

    cells: Cells
    row: Cells
    which: Cells
    number: Cells
    """(p,): Of the entries: rows, indices among these cells, and numbers among the entries of all cells."""
    entries: Cells
    """(c, g): Entries of each cell; the first one fills up columns of fewer."""


def find_copies(inside: Flags) -> Copies:
    """Return the cells that are in several rows (f, n)."""
    (cells,) = (np.add.reduce(inside, axis=0, dtype=np.intp) > 1).nonzero()
    shared = inside[:, cells]
    row, which = shared.nonzero()
    number, rank = np.cumsum(inside).reshape(inside.shape), np.cumsum(shared, axis=0)
    entries = np.empty((rank.max(initial=1), cells.size), np.intp)
    order = np.arange(row.size)
    entries[:, which[::-1]] = order[::-1]
    entries[rank[row, which] - 1, which] = order
    return Copies(cells, row, which, number[row, cells[which]] - 1, entries)


def per_row(values: Floats, dimensions: int) -> Floats:
    """Return numbers (r,), (r, 1) or (r, b) such that rows (r, n) or (r, n, b) combine with them."""
    return values.reshape(len(values), *(1,) * (dimensions - 2), -1)


def apply_map(linear: Floats, rows: Floats) -> Floats:
    """Return the result (o, n[, b]) of a linear map (o, i[, b]) for rows (i, n[, b])."""
    out: Floats = np.empty((len(linear), *rows.shape[1:]))
    prepare_map(linear, rows, out)()
    return out


def prepare_map(linear: Floats, rows: Floats, out: Floats) -> Callable[[], Any]:
    """Return a function that maps the rows at its call into contiguous `out`; see `apply_map`."""
    if linear.ndim == 3:
        return partial(_by_run, linear, rows, out)
    if rows.ndim > 2:
        rows, out = rows.reshape(len(rows), -1), out.reshape(len(out), -1)
    # `dot` is called faster, but copies rows that are not contiguous.
    return partial(linear.dot if rows.flags.c_contiguous else partial(np.matmul, linear), rows, out)


def _by_run(linear: Floats, rows: Floats, out: Floats) -> None:
    """Apply the linear map of each run; row by row, which is four times as fast as all rows at once."""
    for weights, row in zip(linear, out, strict=True):
        np.einsum("ib,inb->nb", weights, rows, out=row)
