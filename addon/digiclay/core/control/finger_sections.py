"""Cells of several fingers, one after the other, in the formulas of one finger: numbers of each, and sums.

Arrays are (m,) or (r, m), of m cells; numbers of the fingers are lists of f.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..base.arrays import Cells, Flags, Floats, count_true


class Whole:
    """All cells are those of one finger."""

    #: Where the cells of each finger are.
    parts: Sequence[slice] = (slice(None),)

    def spread(self, numbers: Sequence[Any]) -> Any:
        """Return numbers, or tuples of r numbers, of the fingers such that arrays combine with them."""
        return numbers[0]

    def cut(self, values: Floats) -> list[Floats]:
        """Return the values of each finger."""
        return [values]

    def add(self, values: Floats) -> list[float]:
        """Return the sum of values (m,) of each finger."""
        return [float(np.add.reduce(values))]

    def add_rows(self, rows: Floats) -> Sequence[Floats]:
        """Return the sums (r,) over the cells of each finger, of rows (r, m)."""
        return [np.add.reduce(rows, axis=1)]

    def count(self, values: Floats) -> list[int]:
        """Return the number of cells of each finger."""
        return [values.size]

    def average(self, values: Floats, test: Flags, instead: list[float]) -> list[float]:
        """Return the mean of values where a test holds, or where it holds nowhere what is instead."""
        count = count_true(test)
        return [float(values.dot(test)) / count] if count else instead

    def find_largest(self, values: Floats) -> Any:
        """Return the largest value of each finger, spread."""
        return np.maximum.reduce(values)

    def multiply(self, forms: Sequence[Any], basis: Floats, out: Floats | None = None) -> Floats:
        """Return forms (k, 6) of each finger over the basis of its cells, (k, m)."""
        rows: Floats = np.array(forms[0]).dot(basis, out=out)
        return rows

    def find_bounds(self, cells: Cells) -> list[int]:
        """Return where in some of the cells, in ascending order, those of each finger begin, and the end."""
        return [0, cells.size]

    def pick(self, cells: Cells, wanted: list[bool]) -> tuple[Cells, list[int], Whole]:
        """Return those of some cells whose finger is wanted, the fingers that have any, their sections."""
        return cells, [0] if wanted[0] and cells.size else [], self


class Sections(Whole):
    """Cells of fingers one after the other, (f,) of each, at least one."""

    def __init__(self, sizes: Sequence[int]) -> None:
        edges = [0]
        for size in sizes:
            edges.append(edges[-1] + size)
        self.sizes, self.starts, self.edges = np.array(sizes), np.array(edges[:-1]), np.array(edges)
        self.parts = [slice(*ends) for ends in pairwise(edges)]

    def spread(self, numbers: Sequence[Any]) -> Any:
        """See `Whole`; rows of tuples."""
        if all(one is numbers[0] for one in numbers) and not isinstance(numbers[0], tuple):
            return numbers[0]
        return np.array(numbers).T.repeat(self.sizes, axis=-1)

    def cut(self, values: Floats) -> list[Floats]:
        """See `Whole`."""
        return [values[..., part] for part in self.parts]

    def add(self, values: Floats) -> list[float]:
        """See `Whole`."""
        sums: list[float] = np.add.reduceat(values, self.starts).tolist()
        return sums

    def add_rows(self, rows: Floats) -> Sequence[Floats]:
        """See `Whole`."""
        return list(np.add.reduceat(rows, self.starts, axis=1).T)

    def count(self, values: Floats) -> list[int]:
        """See `Whole`."""
        return [part.stop - part.start for part in self.parts]

    def average(self, values: Floats, test: Flags, instead: list[float]) -> list[float]:
        """See `Whole`."""
        sums = zip(self.add(values * test), self.add(test.astype(np.float64)), instead, strict=True)
        return [own / count if count else other for own, count, other in sums]

    def find_largest(self, values: Floats) -> Any:
        """See `Whole`."""
        return np.maximum.reduceat(values, self.starts).repeat(self.sizes)

    def multiply(self, forms: Sequence[Any], basis: Floats, out: Floats | None = None) -> Floats:
        """See `Whole`."""
        rows = np.empty((len(forms[0]), basis.shape[1])) if out is None else out
        for form, part in zip(np.array(forms), self.parts, strict=True):
            np.matmul(form, basis[:, part], out=rows[:, part])
        return rows

    def find_bounds(self, cells: Cells) -> list[int]:
        """See `Whole`."""
        bounds: list[int] = cells.searchsorted(self.edges).tolist()
        return bounds

    def pick(self, cells: Cells, wanted: list[bool]) -> tuple[Cells, list[int], Whole]:
        """See `Whole`."""
        if not all(wanted):
            cells = cells[np.repeat(wanted, self.sizes)[cells]]
        sizes = [after - before for before, after in pairwise(self.find_bounds(cells))]
        return cells, [i for i, size in enumerate(sizes) if size], Sections([size for size in sizes if size])


class Shared(Whole):
    """All cells are those of each finger: arrays are (f, m), or (r, f, m)."""

    def spread(self, numbers: Sequence[Any]) -> Any:
        """See `Whole`."""
        return np.array(numbers).T[..., None]

    def multiply(self, forms: Sequence[Any], basis: Floats, out: Floats | None = None) -> Floats:
        """See `Whole`."""
        rows: Floats = np.matmul(np.array(forms).swapaxes(0, 1), basis, out=out)
        return rows


WHOLE, SHARED = Whole(), Shared()
