"""Parts of a batch as one part, with one value a run; and linear maps likewise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["Floats", "kind", "mapped", "numbers", "together"]

Part = TypeVar("Part")
Floats = NDArray[np.float64]

#: Multiplications of a matrix product that the linear algebra library does on one core: waking another one
#: takes longer than the product, and it stays awake for a while.
PRODUCT = 2**17


def kind(value: Any) -> Any:
    """Return all of a part but its numbers: parts of one kind can be stacked.

    Parameters
    ----------
    value : object
        A dataclass, and in its fields dataclasses, numbers, tuples, texts or None.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return type(value), *(kind(getattr(value, field.name)) for field in fields(value))
    if isinstance(value, tuple):
        return tuple(kind(one) for one in value)
    return float if isinstance(value, float) else value


def together(parts: Sequence[Part]) -> Part:
    """Return a part that stands for those of all runs.

    Parameters
    ----------
    parts : sequence of dataclass
        Of one `kind`. A number that is the same in all of them stays a number, others become an
        array (b,), and arrays get the runs as their last axis; parts within the parts likewise.
        The rules of parameters are not checked again.
    """
    first: Any = parts[0]
    part: Any = object.__new__(type(first))
    for field in fields(first):
        object.__setattr__(part, field.name, _one([getattr(one, field.name) for one in parts]))
    stands_for_all: Part = part
    return stands_for_all


def _one(values: list[Any]) -> Any:
    """Return what stands for a value in all runs."""
    first = values[0]
    if isinstance(first, np.ndarray):
        return first if all(np.array_equal(value, first) for value in values) else np.stack(values, axis=-1)
    if all(value is first or value == first for value in values):
        return first
    return together(values) if is_dataclass(first) else numbers(values)


def numbers(values: Sequence[float]) -> Floats:
    """Return a number of each run, shape (b,)."""
    return np.array(values, dtype=np.float64)


def mapped(maps: Floats, rows: Floats) -> Floats:
    """Return rows (o, n, b) that a linear map, (o, i) or one a run (o, i, b), makes of rows (i, n, b)."""
    made: Floats = np.empty((len(maps), *rows.shape[1:]))
    if maps.ndim == 3:
        # Row by row: over all of them at once numpy takes four times as long.
        for row, out in zip(maps, made, strict=True):
            np.einsum("ib,inb->nb", row, rows, out=out)
        return made
    flat, given = made.reshape(len(maps), -1), rows.reshape(len(rows), -1)
    step = max(1, PRODUCT // max(1, maps.size))
    for first in range(0, flat.shape[1], step):
        np.matmul(maps, given[:, first : first + step], flat[:, first : first + step])
    return made
