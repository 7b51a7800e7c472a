"""Constants, tests and linear maps are what numpy makes of them, of one run and of many."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.base.arrays import MOST_SHAPES, Constants, any_true, apply_map, count_true
from digiclay.core.base.arrays import prepare_map as prepare

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


def test_constants_of_one_run_are_shared_and_cannot_be_written_to() -> None:
    known = Constants((1.0,))
    (one,) = known[5,]
    assert known[5,][0] is one
    with pytest.raises(ValueError, match="read-only"):
        one[0] = 2.0


def test_constants_of_any_number_of_shapes_are_few() -> None:
    known = Constants((1.0,))
    sizes = [known[count,][0].size for count in range(3 * MOST_SHAPES)]
    assert (sizes, len(known) <= MOST_SHAPES) == (list(range(3 * MOST_SHAPES)), True)


def test_constants_of_many_runs_are_the_numbers_themselves_in_their_kind() -> None:
    own = np.array([1.0, 2.0])
    assert Constants((3.0, own))[4, 2] == (3.0, own)
    (code,) = Constants((3,), np.int8)[4, 2]
    assert type(code) is np.int8


@pytest.mark.parametrize("rows", ["of one run", "of many", "of many, a part of them"])
def test_one_map_of_all_runs_is_a_product(rows: str) -> None:
    rng = np.random.default_rng(1)
    linear, values = rng.random((2, 3)), rng.random((3, 5, 4))
    given = {"of one run": values[..., 0], "of many": values, "of many, a part of them": values[:, 1:3]}[rows]
    np.testing.assert_allclose(apply_map(linear, given), np.tensordot(linear, given, 1), rtol=1e-14)


def test_a_map_of_each_run_is_a_product_a_run() -> None:
    rng = np.random.default_rng(1)
    linear, values = rng.random((2, 3, 4)), rng.random((3, 5, 4))
    alone = [linear[..., run] @ values[..., run] for run in range(4)]
    np.testing.assert_allclose(apply_map(linear, values), np.stack(alone, axis=-1), rtol=1e-14)


def test_a_prepared_map_takes_the_rows_as_they_are_when_it_is_called() -> None:
    rows, made = np.zeros((2, 3)), np.empty((1, 3))
    product = prepare(np.array([[1.0, 10.0]]), rows, made)
    rows[:] = [[1.0], [2.0]]
    product()
    np.testing.assert_array_equal(made, [[21.0, 21.0, 21.0]])
