"""A line over pins has no spikes, lies on what is even or tilted, and goes on beyond the edge."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.model.layout import Layout, make_grid
from digiclay.press.drape import drape

ARRANGEMENTS = ("aligned", "staggered", "hexagonal")


def ring(radius: float, count: int = 64) -> np.ndarray:
    """Return a circle about the middle of the bed, m."""
    turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return radius * np.column_stack([np.cos(turn), np.sin(turn)])


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_on_even_pins_the_line_is_even(arrangement: str) -> None:
    cells = make_grid(Layout(rows=9, columns=9, arrangement=arrangement))
    line = drape(cells, np.full(81, 0.04), ring(0.02))
    # A mean of equal numbers, in some roundings.
    np.testing.assert_allclose(line[:, 2], 0.04, rtol=1e-14, atol=0)


def test_a_step_of_15_mm_between_neighbors_makes_no_spike() -> None:
    cells = make_grid(Layout())
    height = np.where(cells.x > 0.0, 0.055, 0.04)
    places = ring(0.009)
    apart = np.abs(np.diff(drape(cells, height, places)[:, 2], append=0.04)[:-1])
    raw = np.abs(np.diff(height[cells.at(*places.T)]))
    assert raw.max() == pytest.approx(0.015)
    # The steepest part of a normal distribution of 3 mm over 15 mm: 0.4 * 15 / 3 = 2 mm a mm, and a place of
    # the ring is 0.88 mm from the next one.
    assert apart.max() < 2.0 * 0.88e-3 * 1.1


def test_a_single_high_pin_raises_the_line_by_a_sixth_of_its_height() -> None:
    cells = make_grid(Layout())
    height = np.full(cells.count, 0.04)
    height[cells.at(np.zeros(1), np.zeros(1))] += 0.012
    # The weight of the middle of a normal distribution over squares of one standard deviation: 1 / (2 pi).
    assert drape(cells, height, np.zeros((1, 2)))[0, 2] - 0.04 == pytest.approx(0.012 / (2 * np.pi), rel=0.02)


@pytest.mark.parametrize("place", [(0.05, 0.0), (-1.0, 2.0), (1e3, -1e3)])
def test_beyond_the_edge_the_line_has_the_height_of_the_edge(place: tuple[float, float]) -> None:
    cells = make_grid(Layout())
    height = np.full(cells.count, 0.04)
    height[cells.at(np.zeros(1), np.zeros(1))] = 0.09
    assert drape(cells, height, np.array([place]))[0, 2] == pytest.approx(0.04)


def test_a_bed_of_one_pin_has_its_height_everywhere() -> None:
    cells = make_grid(Layout(rows=1, columns=1))
    assert (drape(cells, np.array([0.03]), ring(0.01))[:, 2] == 0.03).all()
