"""Parts of many runs as one part, whose numbers are arrays: one value a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["Floats", "kind", "numbers", "together"]

Part = TypeVar("Part")
Floats = NDArray[np.float64]


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
        array (b,); parts within the parts likewise. The rules of parameters are not checked
        again.
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
    if all(value is first or value == first for value in values):
        return first
    return together(values) if is_dataclass(first) else numbers(values)


def numbers(values: Sequence[float]) -> Floats:
    """Return a number of each run, shape (b,)."""
    return np.array(values, dtype=np.float64)
