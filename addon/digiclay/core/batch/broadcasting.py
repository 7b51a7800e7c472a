"""Parts of many runs as one part, whose numbers are arrays: one value a run."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

from ..base.arrays import Floats

Part = TypeVar("Part")


def classify(value: Any) -> Any:
    """Return all of a part but its numbers: parts of one kind can be merged.

    `value`: a dataclass, and in its fields dataclasses, numbers, tuples, texts or None.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return type(value), *(classify(getattr(value, field.name)) for field in fields(value))
    if isinstance(value, tuple):
        return tuple(classify(one) for one in value)
    return float if isinstance(value, float) else value


def merge_parts(parts: Sequence[Part]) -> Part:
    """Return a part that stands for those of all runs; the first one itself where all are alike.

    `parts`: of one `classify`. What is the same in all of them stays as it is; a number that is not becomes
    an array (b,), and arrays get one axis more, the last; parts within the parts likewise. The rules of
    parameters are not checked again.
    """
    first: Any = parts[0]
    own = {field.name: _one([getattr(one, field.name) for one in parts]) for field in fields(first)}
    if all(value is getattr(first, name) for name, value in own.items()):
        return parts[0]
    part: Any = object.__new__(type(first))
    for name, value in own.items():
        object.__setattr__(part, name, value)
    stands_for_all: Part = part
    return stands_for_all


def _one(values: list[Any]) -> Any:
    """Return what stands for a value in all runs."""
    first = values[0]
    if isinstance(first, np.ndarray):
        alike = all(value is first or np.array_equal(value, first) for value in values)
        return first if alike else np.stack(values, axis=-1)
    if is_dataclass(first):
        return merge_parts(values)
    if isinstance(first, tuple):
        own = tuple(_one(list(several)) for several in zip(*values, strict=True))
        return first if all(map(operator.is_, own, first)) else own
    return first if all(value is first or value == first for value in values) else np.array(values)


def list_numbers(values: Sequence[float]) -> Floats:
    """Return a number of each run, shape (b,)."""
    return np.array(values, dtype=np.float64)
