"""Layouts of the cells of several fingers: in sequence, finger by finger, or in columns.

The same formulas serve one finger and several: `Whole` combines numbers of fingers, lists of f,
with arrays of cells, (m,) or (r, m).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ..base.arrays import Cells, Flags, Floats, count_true, find_copies, find_first_largest
from ..model.layout import RELATIVE_TOLERANCE

#: Coordinate of a pin that only fills up a column, m: beyond every blister; and its basis.
BEYOND = 1e3
OUTSIDE = np.array([1.0, BEYOND, BEYOND, *(BEYOND**2,) * 3])[:, None]


class Whole:
    """Cells of one finger."""

    #: Cells of each finger.
    parts: Sequence[slice] = (slice(None),)

    def spread(self, numbers: Sequence[Any]) -> Any:
        """Return one number per finger, or a tuple of r, in a form that arrays combine with."""
        return numbers[0]

    def repeat(self, values: Floats) -> Floats:
        """Return values (..., f), one per finger, in a form that arrays (..., m) combine with."""
        return values

    def cut(self, values: Any) -> list[Any]:
        """Return the values of each finger."""
        return [values]

    def reduce(self, ufunc: np.ufunc, values: Floats) -> Floats:
        """Return the values (..., m) of each finger, reduced by a ufunc, (..., f)."""
        return ufunc.reduce(values, -1, None, None, True)

    def add(self, values: Floats) -> list[float]:
        """Return the sum of values (m,) of each finger."""
        return self.reduce(np.add, values).tolist()

    def average(self, values: Floats, test: Flags, instead: list[float]) -> list[float]:
        """Return the mean of each finger's values where a test holds; `instead`: if it holds nowhere."""
        count = count_true(test)
        return [float(values.dot(test)) / count] if count else instead

    def multiply(self, forms: Sequence[Any], basis: Floats, out: Floats | None = None) -> Floats:
        """Return forms (k, 6) of each finger over the basis of its cells, (k, m)."""
        return np.array(forms[0]).dot(basis, out=out)

    def find_bounds(self, cells: Cells) -> list[int]:
        """Return the start of each finger's cells in a selection of the cells, ascending, and the end."""
        return [0, cells.size]

    def pick(self, cells: Cells, wanted: list[bool]) -> tuple[Cells, list[int], Whole]:
        """Return the cells of wanted fingers in a selection, the fingers that have any, their sections."""
        return cells, [0] if wanted[0] and cells.size else [], self


class Sections(Whole):
    """Cells of several fingers in sequence; `sizes` (f,): their numbers, each at least one."""

    def __init__(self, sizes: Sequence[int]) -> None:
        self.sizes, self.edges = np.array(sizes), np.cumsum([0, *sizes])
        self.parts = [slice(*ends) for ends in pairwise(self.edges.tolist())]

    def spread(self, numbers: Sequence[Any]) -> Any:
        """See `Whole`; rows of tuples."""
        if all(number is numbers[0] for number in numbers) and not isinstance(numbers[0], tuple):
            return numbers[0]
        return self.repeat(np.array(numbers).T)

    def repeat(self, values: Floats) -> Floats:
        """See `Whole`."""
        return values.repeat(self.sizes, -1)

    def cut(self, values: Any) -> list[Any]:
        """See `Whole`."""
        return [values[..., part] for part in self.parts]

    def reduce(self, ufunc: np.ufunc, values: Floats) -> Floats:
        """See `Whole`."""
        return ufunc.reduceat(values, self.edges[:-1], -1)

    def average(self, values: Floats, test: Flags, instead: list[float]) -> list[float]:
        """See `Whole`."""
        sums = self.add(np.where(test, values, 0.0))
        counts = np.add.reduceat(test, self.edges[:-1], dtype=np.intp).tolist()
        triples = zip(sums, counts, instead, strict=True)
        return [total / count if count else default for total, count, default in triples]

    def multiply(self, forms: Sequence[Any], basis: Floats, out: Floats | None = None) -> Floats:
        """See `Whole`."""
        rows = np.empty((len(forms[0]), basis.shape[1])) if out is None else out
        for form, part in zip(np.array(forms), self.parts, strict=True):
            np.matmul(form, basis[:, part], out=rows[:, part])
        return rows

    def find_bounds(self, cells: Cells) -> list[int]:
        """See `Whole`."""
        return cells.searchsorted(self.edges).tolist()

    def pick(self, cells: Cells, wanted: list[bool]) -> tuple[Cells, list[int], Whole]:
        """See `Whole`."""
        if not all(wanted):
            cells = cells[np.repeat(wanted, self.sizes)[cells]]
        sizes = [after - before for before, after in pairwise(self.find_bounds(cells))]
        return (
            cells,
            [i for i, size in enumerate(sizes) if size],
            Sections([size for size in sizes if size]),
        )


class Shared(Whole):
    """Cells that all fingers share: arrays are (f, m), or (r, f, m)."""

    def spread(self, numbers: Sequence[Any]) -> Any:
        """See `Whole`."""
        return np.array(numbers).T[..., None]

    def multiply(self, forms: Sequence[Any], basis: Floats, out: Floats | None = None) -> Floats:
        """See `Whole`."""
        return np.matmul(np.array(forms).swapaxes(0, 1), basis, out=out)


WHOLE, SHARED = Whole(), Shared()


class Columns:
    """Active cells in columns, one per finger: the cells in its disc, and a part of those in no disc.

    Entries (k,) are the cells of all columns in sequence, the first finger first.
    """

    def __init__(self, basis: Floats, discs: tuple[Floats, Floats, Floats]) -> None:
        x, y, radius = (values[:, None] for values in discs)
        limit = radius * np.abs(radius) * (1.0 + RELATIVE_TOLERANCE)
        inside = (basis[1] - x) ** 2 + (basis[2] - y) ** 2 <= limit
        (left,) = (~inside.any(axis=0)).nonzero()
        inside[np.arange(left.size) * len(inside) // max(left.size, 1), left] = True
        self.inside, self._basis = inside, basis
        #: Finger and cell of each entry.
        self.finger, self.cell = inside.nonzero()
        #: Cells in several columns, and their p entries; cells of these, and their positions, (2,
        #: p), m.
        self.copies = find_copies(inside)
        self.cells = self.copies.cells[self.copies.which]
        self.positions = basis[1:3, self.cells]
        #: An entry of each cell, (m,).
        self.only = np.empty(basis.shape[1], np.intp)
        self.only[self.cell] = np.arange(self.cell.size)

    def pick(self, rank: Floats) -> Cells:
        """Return the entry of the highest rank, (p,), of each cell in several columns, (g,)."""
        entries = self.copies.entries
        first = find_first_largest(rank[entries])
        return self.copies.number[entries[first, np.arange(first.size)]]

    @cached_property
    def padded(self) -> tuple[Cells, Flags, Floats, Cells]:
        """The columns side by side, (w, f): cells; fillers; basis, (6, w, f); indices of the entries."""
        sizes = self.inside.sum(axis=1)
        absent = np.arange(sizes.max())[:, None] >= sizes
        cells = np.zeros(absent.shape, np.intp)
        cells.T[~absent.T] = self.cell
        basis = self._basis[:, cells]
        basis[:, absent] = OUTSIDE
        finger, row = (~absent.T).nonzero()
        return cells, absent, basis, row * len(sizes) + finger
