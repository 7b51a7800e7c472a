"""Spikes that a stroke leaves are told from what was there, what the finger forms, and edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.arrays import Floats
from digiclay.core.control.blister import Blister
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.layout import Grid, Layout, make_grid
from digiclay.strokes.stroke import Brush, Stroke, draw, start
from digiclay.strokes.sweep import LIMIT, find_spike, measure_excess_heights

BED = make_grid(Layout(11, 11))
FLAT = np.full(BED.count, 40e-3)
#: A pin beside the path of `stroke`, and one on it.
BESIDE, BELOW = 8 * 11 + 5, 5 * 11 + 5
STYLUS = Fingertip(length=1.5e-3, width=1.5e-3, height=6e-3)


def stroke(brush: Brush = Brush.LOWER, before: Floats = FLAT) -> Stroke:
    """Return a finished stroke along x through the middle of the bed."""
    drawn = draw(start(1, -12e-3, 0.0, 4e-3, brush=brush), 1.0, 12e-3, 0.0, 4e-3)
    return replace(drawn, height=before)


def spiked(cell: int, by: float, ground: Floats = FLAT) -> Floats:
    """Return heights with one pin that is off, m."""
    height = ground.copy()
    height[cell] += by
    return height


def find(one: Stroke, target: Floats, finger: Fingertip | None = None, grid: Grid = BED) -> int | None:
    """Return the worst spike that a stroke has left."""
    return find_spike(one, grid, target, finger or Fingertip(), Blister())


@pytest.mark.parametrize("brush", [Brush.LOWER, Brush.RAISE, Brush.LEVEL])
def test_a_spike_beside_the_path_is_found_and_the_worst_comes_first(brush: Brush) -> None:
    assert find(stroke(brush), spiked(BESIDE, -1e-3)) == find(stroke(brush), spiked(BESIDE, 1e-3)) == BESIDE
    assert find(stroke(), spiked(BELOW, 3e-3, spiked(BESIDE, -2e-3))) == BELOW
    # A pin within the limit is no spike.
    found = [find(stroke(), spiked(BESIDE, part * LIMIT * BED.layout.pitch)) for part in (0.99, 1.01)]
    assert found == [None, BESIDE]


def test_a_spike_that_was_there_before_the_stroke_stays() -> None:
    there = spiked(BESIDE, 5e-3)
    assert find(stroke(before=there), there) is None
    # A groove beside it does not change that; one that makes it stand out farther does.
    assert find(stroke(before=there), there - 1e-3 * (np.arange(BED.count) < 60)) is None
    assert find(stroke(before=there), spiked(BESIDE, 6e-3)) == BESIDE


def test_a_sharp_edge_stays() -> None:
    cliff = FLAT + np.where(BED.x > 0.0, 10e-3, 0.0)
    ridge_one_pin_wide = FLAT + np.where(np.abs(BED.y) < 1e-3, 10e-3, 0.0)
    for edge in (cliff, -cliff, ridge_one_pin_wide, 80e-3 - ridge_one_pin_wide):
        assert find(stroke(), edge) is None


@pytest.mark.parametrize(
    ("brush", "by", "finger", "stays"),
    [
        (Brush.LOWER, -5e-3, STYLUS, True),  # the dent of a stylus
        (Brush.LOWER, 5e-3, STYLUS, False),  # no stylus that presses raises a pin
        (Brush.LOWER, -5e-3, Fingertip(), False),  # a fingertip is wider than a pin
        (Brush.RAISE, -5e-3, STYLUS, False),
    ],
)
def test_what_the_fingers_own_form_leaves_below_the_path_stays(brush, by, finger, stays):
    assert (find(stroke(brush), spiked(BELOW, by), finger) is None) == stays


def test_the_top_of_a_narrow_blister_and_the_dent_of_a_click_stay() -> None:
    narrow = Blister(radius=3e-3, edge_radius=6e-3, flat_radius=0.5e-3)
    peak = spiked(BELOW, 4e-3)
    assert find_spike(stroke(Brush.RAISE), BED, peak, Fingertip(), narrow) is None
    assert find(stroke(Brush.RAISE), peak) == BELOW
    click = replace(start(1, 0.0, 0.0, 4e-3), height=FLAT)
    assert find(click, spiked(BELOW, -4e-3), STYLUS) is None
    assert find(click, spiked(BESIDE, -4e-3), STYLUS) == BESIDE


@pytest.mark.parametrize("arrangement", ["aligned", "staggered", "hexagonal"])
def test_a_pin_is_compared_with_its_own_neighbors(arrangement: str) -> None:
    grid = make_grid(Layout(7, 7, arrangement=arrangement))
    for cell in range(grid.count):
        far = np.hypot(grid.x - grid.x[cell], grid.y - grid.y[cell])
        near = (far > 0.0) & (far < 1.45 * grid.layout.pitch)
        height = np.where(near, 41e-3, 45e-3)
        height[cell] = 43e-3
        assert measure_excess_heights(grid, height)[cell] == pytest.approx(2e-3, abs=1e-12)
        height[near.argmax()] = 44e-3
        assert measure_excess_heights(grid, height)[cell] == 0.0


@pytest.mark.parametrize("rows", [1, 2])
def test_a_bed_of_few_pins_has_no_spikes_without_neighbors(rows: int) -> None:
    grid = make_grid(Layout(rows, 1))
    found = measure_excess_heights(grid, np.linspace(40e-3, 41e-3, rows))
    np.testing.assert_allclose(found, [0.0] if rows == 1 else [-1e-3, 1e-3], rtol=0, atol=1e-12)
