"""Snapshot of a controller's memory: numbers, enumerations, arrays, and named tuples of them."""

from __future__ import annotations

import math
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import StateError

#: No number a controller remembers is larger, but those that may be infinite.
LARGEST = 1e75


def flatten(memory: Any, arrays: list[NDArray[Any]]) -> Any:
    """Return a memory as JSON holds it; its arrays are put behind those in `arrays`.

    A named tuple becomes a list that starts with its name, an array its place among the arrays.

    `memory`: a controller's: numbers, enumerations, arrays, and tuples of them; `arrays`: grows.
    """
    if isinstance(memory, np.ndarray):
        arrays.append(np.ascontiguousarray(memory, memory.dtype.newbyteorder("<")))
        return {"array": len(arrays) - 1}
    if isinstance(memory, tuple):
        return [type(memory).__name__, *(flatten(item, arrays) for item in memory)]
    if isinstance(memory, Enum):
        return memory.value
    # Numbers of numpy become Python's own, which JSON writes so that they read back as the same ones.
    return memory.item() if isinstance(memory, np.generic) else memory


def rebuild(template: Any, kept: Any, arrays: list[NDArray[Any]]) -> Any:
    """Return the memory that `flatten` took apart, in the types of a memory of the same controller.

    `template`: what the controller begins with; `kept`: from `flatten`; `arrays`: those that were put in,
    read back. Raises StateError when the memory is that of another controller, or damaged.
    """
    try:
        return _rebuild_like(template, kept, arrays)
    except (ValueError, TypeError, KeyError, IndexError, OverflowError):
        raise StateError(
            f"The kept state's memory of the controller must be a {type(template).__name__} "
            f"(got {str(kept)[:60]}). Reset the session to begin with a bed at rest."
        ) from None


def _rebuild_like(template: Any, kept: Any, arrays: list[NDArray[Any]]) -> Any:
    """Return `kept` in the types of the template; any error means another structure."""
    kind = type(template)
    if isinstance(template, np.ndarray):
        array = arrays[kept["array"]]
        if array.ndim != template.ndim or array.dtype.kind != template.dtype.kind:
            raise ValueError("another array")
        return array.astype(template.dtype)
    if isinstance(template, tuple):
        name, *items = kept
        if name != kind.__name__:
            raise ValueError("another named tuple")
        like = [_rebuild_like(part, item, arrays) for part, item in zip(template, items, strict=True)]
        return kind(*like) if hasattr(kind, "_fields") else kind(like)
    if template is None:
        if kept is not None:
            raise ValueError("something instead of nothing")
        return None
    if not isinstance(template, Enum):
        _check_number(template, kept)
    return kind(kept)


def _check_number(template: Any, kept: Any) -> None:
    """Refuse what is no number, or none that a controller comes to: whole numbers count something.

    Infinite is only what begins so; no other number is so large that the square of its square is.
    """
    if not isinstance(kept, (bool, int, float)) or math.isnan(kept):
        raise ValueError("no number")
    if isinstance(template, int) and not isinstance(template, bool):
        if not 0 <= kept <= 2**53:
            raise ValueError("no count")
    elif abs(kept) > LARGEST and kept != template:
        raise ValueError("a number that is too large")
