"""Cached constant arrays.

Numpy takes two operands of one shape twice as fast as an array and a number, and at the few
hundred cells under and around a finger it is the calls that cost.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["filled"]


@lru_cache(maxsize=128)
def filled(numbers: tuple[float, ...], count: int, kind: type = np.float64) -> tuple[NDArray[Any], ...]:
    """Return an array of `count` copies of each number; they are shared, so nobody can write to them."""
    rows: NDArray[Any] = np.array(numbers, kind).repeat(count).reshape(len(numbers), count)
    rows.flags.writeable = False
    return tuple(rows)
