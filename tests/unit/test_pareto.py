"""Pareto fronts and knees of known sets of points; generations of NSGA-II on a known front."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("optuna", reason="digiclay[study] is not installed")

from digiclay_study.tune_command import Trials, find_front, find_knee, propose_generations

POINTS = np.array([[1.0, 5.0], [2.0, 2.0], [3.0, 3.0], [2.0, 4.0], [5.0, 1.0], [np.nan, 0.0], [2.0, 2.0]])


def test_a_front_has_the_points_that_none_dominates_in_order() -> None:
    assert find_front(POINTS).tolist() == [0, 1, 4]
    values = np.random.default_rng(5).random((200, 2))
    front = find_front(values)
    one, other = values[front][:, None], values[None]
    better = np.all(one <= other, axis=2) & np.any(one < other, axis=2)
    assert better.any(axis=0).sum() == len(values) - len(front)
    assert not better[:, front].any()


@pytest.mark.parametrize(
    ("front", "knee"),
    [
        ([[0.0, 100.0], [1.0, 20.0], [6.0, 10.0], [10.0, 0.0]], 1),
        ([[1.0, 2.0]], 0),
        ([[1.0, 2.0], [2.0, 1.0]], 0),
    ],
)
def test_the_knee_is_where_both_are_small(front: list[list[float]], knee: int) -> None:
    assert find_knee(np.array(front)) == knee


def measure(shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return two outputs whose front is the line x0 from 0 to 1, x1 = 0.5: y1 = 1 - sqrt(y0)."""
    off = 1.0 + 8.0 * np.abs(shares[:, 1] - 0.5)
    return np.column_stack([shares[:, 0], off * (1.0 - np.sqrt(shares[:, 0] / off))])


def evolve(count: int, seed: int = 1) -> NDArray[np.float64]:
    """Return the outputs of all generations; a third of the plane is forbidden, a few points fail."""
    generations = propose_generations(2, 24, seed)
    shares, found = next(generations), []
    for _ in range(count):
        values = measure(shares)
        violation = np.maximum(shares[:, 0] - 0.67, 0.0)
        found.append(np.where(shares[:, :1] > 0.67, np.nan, values))
        values[3], violation[3] = np.inf, 2.0
        shares = generations.send(Trials(values, violation))
    return np.concatenate(found)


def find_gap(values: NDArray[np.float64]) -> float:
    """Return how far the front is above the known one at most, between outputs of 0.1 and 0.6."""
    front = values[find_front(values)]
    x = np.linspace(0.1, 0.6, 50)
    best = np.array([front[front[:, 0] <= one, 1].min() for one in x])
    return float(np.max(best - (1.0 - np.sqrt(x))))


def test_generations_come_near_the_known_front_and_nearer_than_the_same_number_of_random_points() -> None:
    found = evolve(12)
    shares = np.random.default_rng(1).random((len(found), 2))
    assert find_gap(found) < min(0.1, 0.5 * find_gap(measure(shares)))
    # The same outcomes lead to the same generations.
    first = found[: 4 * 24]
    assert np.array_equal(evolve(4), first, equal_nan=True)
    assert not np.array_equal(evolve(4, 2), first, equal_nan=True)
