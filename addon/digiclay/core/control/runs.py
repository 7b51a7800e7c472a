"""Common part of controllers for the cells of one run, shape (m,), or of a stack of b runs, (m, b)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["BatchControl", "sum_weighted", "take_cells"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BatchControl:
    """A controller whose formulas hold for the cells of one run and for those of a stack.

    In a stack a number that differs from run to run is an array (b,), which numpy puts against the last
    axis by itself. The memory of a stack is a list, one memory a run, and what is decided about a run is
    decided run by run, in plain numbers.

    Attributes
    ----------
    runs : tuple of BatchControl
        In a stack the controllers of its runs; empty in a single run.
    """

    runs: tuple[Any, ...] = field(default=(), kw_only=True)

    def decide(self, rule: Callable[..., Any], memory: Any, *columns: Any) -> Any:
        """Return what a rule about one run comes to; in a stack a list, one result a run.

        Parameters
        ----------
        rule : callable
            Takes a controller of one run, its memory, and one number of each column.
        memory : object
        *columns : float or list (b,)
        """
        if self.runs:
            return list(map(rule, self.runs, memory, *columns))
        return rule(self, memory, *columns)

    def any_run(self, rule: Callable[..., bool], memory: Any) -> bool:
        """Tell whether a rule holds for the run, or for any of a stack; see `decide`.

        Parameters
        ----------
        rule : callable
            As `decide` takes it.
        memory : object
        """
        return any(map(rule, self.runs, memory)) if self.runs else rule(self, memory)

    def gather(self, rule: Callable[..., tuple[Any, ...]], memory: Any) -> tuple[Any, ...]:
        """Return the numbers that a rule finds in a memory; in a stack arrays (b,); see `decide`.

        Parameters
        ----------
        rule : callable
            As `decide` takes it.
        memory : object
        """
        found = self.decide(rule, memory)
        return tuple(np.array(column) for column in zip(*found, strict=True)) if self.runs else found


def take_cells(values: NDArray[Any], cells: NDArray[np.intp]) -> NDArray[Any]:
    """Return the values of some cells.

    Parameters
    ----------
    values : ndarray (n,) or (n, b)
        Of all cells of the bed, of every run's bed where they differ.
    cells : ndarray of int (m,) or (m, b)
    """
    return values.take(cells) if values.ndim == 1 else np.take_along_axis(values, cells, axis=0)


def sum_weighted(rows: Floats, weights: Floats) -> Floats:
    """Return the sums over the cells of one or k rows times a weight.

    Parameters
    ----------
    rows : ndarray ([k,] m) or ([k,] m, b)
    weights : ndarray (m,) or (m, b)

    Returns
    -------
    ndarray ([k]) or ([k,] b)
    """
    sums: Floats = rows.dot(weights) if weights.ndim == 1 else np.einsum("...mb,mb->...b", rows, weights)
    return sums
