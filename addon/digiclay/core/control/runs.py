"""Common part of controllers for the cells of one run, shape (m,), or of a batch of b runs, (m, b)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats


@dataclass(frozen=True, eq=False)
class BatchControl:
    """Controller whose formulas hold for the cells of one run and for those of a batch.

    In a batch a number that differs from run to run is an array (b,), which numpy puts against the last
    axis by itself. The memory of a batch is a list, one memory a run.

    Attributes
    ----------
    runs : tuple of BatchControl
        In a batch the controllers of its runs, with plain numbers; empty in a single run.
    """

    runs: tuple[Any, ...] = field(default=(), kw_only=True)

    @property
    def batch_class(self) -> type[BatchControl]:
        """Class of the controller of a batch, with the same fields."""
        return type(self)


def decide_by_run(rule: Callable[..., Any]) -> Any:
    """Return a method of a batch's controller: a list of what a rule about one run comes to for each of them.

    `rule`: Method of the controller of a run: takes it, its memory, and one number of each further column.
    """

    def decide(batch: BatchControl, memory: list[Any], *columns: list[Any]) -> list[Any]:
        return list(map(rule, batch.runs, memory, *columns))

    return decide


def decide_by_any(rule: Callable[..., bool]) -> Any:
    """Return a method of a batch's controller: whether a rule holds for some run.

    `rule`: Method of the controller of a run: takes it and its memory.
    """

    def decide(batch: BatchControl, memory: list[Any]) -> bool:
        return any(map(rule, batch.runs, memory))

    return decide


def gather_by_run(rule: Callable[..., tuple[Any, ...]]) -> Any:
    """Return a method of a batch's controller: the numbers that a rule finds for each run, as arrays (b,).

    `rule`: Method of the controller of a run: takes it and its memory.
    """

    def gather(batch: BatchControl, memory: list[Any]) -> tuple[NDArray[Any], ...]:
        columns = zip(*map(rule, batch.runs, memory), strict=True)
        return tuple(np.array(column) for column in columns)

    return gather


def take_cells(values: NDArray[Any], cells: NDArray[np.intp]) -> NDArray[Any]:
    """Return the values of some cells.

    `values` (n,) or (n, b), of all cells of the bed, of every run's bed where they differ; `cells` int (m,)
    or (m, b).
    """
    return values.take(cells) if values.ndim == 1 else np.take_along_axis(values, cells, axis=0)


def sum_weighted(rows: Floats, weights: NDArray[Any]) -> Floats:
    """Return the sums over the cells of one or k rows times a weight.

    `rows` ([k,] m) or ([k,] m, b); `weights` (m,) or (m, b), numbers, or a test: the sums over the cells for
    which it holds. Returns ([k]) or ([k,] b).
    """
    sums: Floats = rows.dot(weights) if weights.ndim == 1 else np.einsum("...mb,mb->...b", rows, weights)
    return sums
