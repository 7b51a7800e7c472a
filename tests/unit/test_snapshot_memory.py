"""A controller's memory, kept by its structure: it comes back in its types, or is refused."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
import pytest
from digiclay.core.base.errors import StateError
from digiclay.core.session.snapshot import flatten, rebuild
from numpy.typing import NDArray


class Color(IntEnum):
    """Something a controller might remember."""

    RED = 1
    BLUE = 2


class Inner(NamedTuple):
    """A part of a memory."""

    edge: float = 0.0
    felt: bool = False


class Outer(NamedTuple):
    """A memory with everything in it."""

    color: Color
    inner: Inner
    table: NDArray[np.float64]
    count: int = 0


def test_a_memory_comes_back_in_its_types_with_its_arrays() -> None:
    memory = Outer(Color.BLUE, Inner(-math.inf, np.bool_(True)), np.array([[0.1, 2.0]]), np.int64(7))
    arrays: list[NDArray[Any]] = []
    text = flatten(memory, arrays)
    back = rebuild(Outer(Color.RED, Inner(-math.inf), np.zeros((0, 2))), text, arrays)
    assert back.table.tolist() == [[0.1, 2.0]]
    assert [*back[:2], back.count] == [Color.BLUE, Inner(-math.inf, True), 7]
    assert [type(item) for item in (back.color, back.inner.edge, back.inner.felt, back.count)] == [
        Color, float, bool, int,
    ]  # fmt: skip


@pytest.mark.parametrize(
    "kept_memory",
    [None, 3, "Inner", [], ["Inner"], ["Inner", 0.0], ["Inner", 0.0, False, 1], ["Inner", "a", False],
     ["Inner", math.nan, False], ["Inner", math.inf, False], ["Inner", -1e76, False],
     ["Inner", 10**400, False], {"array": 0}, ["Outer", 0.0, False]],
)  # fmt: skip
def test_a_memory_of_another_structure_is_refused(kept_memory: Any) -> None:
    with pytest.raises(StateError, match="memory of the controller must be a Inner"):
        rebuild(Inner(), kept_memory, [])


@pytest.mark.parametrize("count", [-1, 2**53 + 1, 1e30, -math.inf, 10**400])
def test_a_memory_with_a_count_that_is_none_is_refused(count: Any) -> None:
    arrays = [np.zeros((0, 2))]
    template = Outer(Color.RED, Inner(), arrays[0])
    assert rebuild(template, ["Outer", 1, ["Inner", 0.0, False], {"array": 0}, 3], arrays).count == 3
    with pytest.raises(StateError, match="memory of the controller must be a Outer"):
        rebuild(template, ["Outer", 1, ["Inner", 0.0, False], {"array": 0}, count], arrays)
