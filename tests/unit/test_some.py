"""Whether a test holds somewhere, and how often: as numpy has it."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.base.counting import how_many, some

CASES = {
    "no cell": np.zeros(0, np.bool_),
    "nowhere": np.zeros(150, np.bool_),
    "in the last cell": np.arange(150) == 149,
    "everywhere": np.ones(7, np.bool_),
    "in a comparison with nan": np.array([np.nan, 1.0, 2.0]) > 1.0,
    "in every other column of a table": (np.arange(24).reshape(4, 6) % 5 == 0)[:, ::2],
}


@pytest.mark.parametrize("test", CASES.values(), ids=CASES.keys())
def test_it_holds_somewhere_where_numpy_says_so(test: np.ndarray) -> None:
    assert some(test) is bool(test.any())


@pytest.mark.parametrize("test", CASES.values(), ids=CASES.keys())
def test_it_holds_as_often_as_numpy_says(test: np.ndarray) -> None:
    assert how_many(test) == np.count_nonzero(test, axis=0).tolist()
