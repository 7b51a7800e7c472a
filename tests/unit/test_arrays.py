"""Constants, tests and linear maps are what numpy makes of them, of one run and of many."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.base.arrays import MOST_SHAPES, Constants, any_true, count_true

CASES = {
    "no cell": np.zeros(0, np.bool_),
    "nowhere": np.zeros(150, np.bool_),
    "in the last cell": np.arange(150) == 149,
    "everywhere": np.ones(7, np.bool_),
    "in a comparison with nan": np.array([np.nan, 1.0, 2.0]) > 1.0,
    "in every other column of a table": (np.arange(24).reshape(4, 6) % 5 == 0)[:, ::2],
}


@pytest.mark.parametrize("test", CASES.values(), ids=CASES.keys())
def test_it_holds_somewhere_and_as_often_as_numpy_says(test: np.ndarray) -> None:
    assert any_true(test) is bool(test.any())
    assert count_true(test) == np.count_nonzero(test, axis=0).tolist()


def test_constants_of_one_run_are_shared_few_and_read_only_and_of_many_the_numbers_themselves() -> None:
    known, own = Constants((1.0,)), np.array([1.0, 2.0])
    (one,) = known[5,]
    assert known[5,][0] is one
    with pytest.raises(ValueError, match="read-only"):
        one[0] = 2.0
    sizes = [known[count,][0].size for count in range(3 * MOST_SHAPES)]
    assert (sizes, len(known) <= MOST_SHAPES) == (list(range(3 * MOST_SHAPES)), True)
    assert Constants((3.0, own))[4, 2] == (3.0, own)
    (code,) = Constants((3,), np.int8)[4, 2]
    assert type(code) is np.int8
