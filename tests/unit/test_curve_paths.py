"""Paths along curves: joined, clipped to the bed, in steps of a millimeter, closed without a seam."""

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.layout import Layout, make_grid
from digiclay.strokes.curve_paths import (
    clip_line,
    clip_to_bed,
    divide_line,
    divide_lines,
    join_edges,
    measure_length,
)

from tests.assemble import assert_near, refused_in_a_line

LOW, HIGH = np.array([-2.0, -1.0]), np.array([2.0, 1.0])
SQUARE = [[-1, -0.5], [1, -0.5], [1, 0.5], [-1, 0.5], [-1, -0.5]]
#: Lines, and their parts in the rectangle.
CLIPPED = {
    "inside": ([[-1, 0], [1, 0.5]], [[[-1, 0], [1, 0.5]]]),
    "beside": ([[3, 0], [4, 0]], []),
    "beside, along a side": ([[-2, 1.5], [2, 1.5]], []),
    "along a side of the rectangle": ([[-3, 1], [3, 1]], [[[-2, 1], [2, 1]]]),
    "across": ([[-4, 0], [4, 0]], [[[-2, 0], [2, 0]]]),
    "past a corner": ([[1, 3], [4, 0]], []),
    "out and in again": ([[0, 0], [0, 3], [1, 3], [1, 0]], [[[0, 0], [0, 1]], [[1, 1], [1, 0]]]),
    "touching the side from inside": ([[-1, 0], [0, 1], [1, 0]], [[[-1, 0], [0, 1], [1, 0]]]),
    "touching the side from outside": ([[-1, 2], [0, 1], [1, 2]], []),
    "a place twice": ([[0, 0], [0, 0], [1, 0]], [[[0, 0], [0, 0], [1, 0]]]),
    "closed, inside": (SQUARE, [SQUARE]),
    "closed, begun inside": (
        [[0, 0], [3, 0], [3, 0.5], [0, 0.5], [0, 0]],
        [[[2, 0.5], [0, 0.5], [0, 0], [2, 0]]],
    ),
    "closed, begun outside": (
        [[3, 0], [3, 0.5], [0, 0.5], [0, 0], [3, 0]],
        [[[2, 0.5], [0, 0.5], [0, 0], [2, 0]]],
    ),
    "through the whole": ([[-1e6, -1e6], [1e6, 1e6]], [[[-1, -1], [1, 1]]]),
}


@pytest.mark.parametrize("line, parts", CLIPPED.values(), ids=CLIPPED)
def test_of_a_line_the_parts_on_the_bed_are_left(line, parts):
    found = clip_line(np.array(line, float), LOW, HIGH)
    assert len(found) == len(parts)
    for part, wanted in zip(found, parts, strict=True):
        assert_near(part, wanted, 1e-9)


EDGES = {
    "none": ([], []),
    "an open one": ([(0, 1), (1, 2)], [[0, 1, 2]]),
    "a closed one": ([(0, 1), (1, 2), (2, 0)], [[0, 1, 2, 0]]),
    "a closed one before an open one": ([(0, 1), (1, 2), (2, 0), (3, 4)], [[0, 1, 2, 0], [3, 4]]),
    "two open ones": ([(0, 1), (2, 3), (3, 4)], [[0, 1], [2, 3, 4]]),
    "in no order": ([(3, 4), (0, 1)], [[3, 4], [0, 1]]),
}


@pytest.mark.parametrize("edges, lines", EDGES.values(), ids=EDGES)
def test_edges_that_follow_one_another_are_a_line(edges, lines):
    places = np.arange(10.0).reshape(5, 2)
    found = join_edges(places, np.array(edges, np.int64).reshape(-1, 2))
    assert [line[:, 0].tolist() for line in found] == [[2.0 * at for at in line] for line in lines]


def test_a_line_is_divided_into_millimeters_and_has_its_corners_and_its_ends():
    line = 1e-3 * np.array([[0, 0], [0, 0], [10.3, 0], [10.3, 7.1], [10.3, 7.1]])
    path = divide_line(line)
    steps = np.hypot(*np.diff(path, axis=0).T)
    assert len(path) == 1 + 18  # 17.4 mm
    # A place is moved to a corner by at most half a step.
    assert 0.4e-3 < steps.min() <= steps.max() < 1.5e-3
    assert_near([path[0], path[-1]], line[[0, -1]], 0.0)
    assert np.hypot(*(path - line[2]).T).min() < 1e-12


def test_many_places_become_few_on_the_same_circle_which_is_closed():
    angle = np.linspace(0.0, 2.0 * np.pi, 100_001)
    circle = 20e-3 * np.column_stack([np.cos(angle), np.sin(angle)])
    circle[-1] = circle[0]
    (path,) = divide_lines(clip_to_bed([circle], make_grid(Layout())))
    assert len(path) == 1 + 126  # 2 pi 20 mm
    assert_near(path[-1], path[0], 0.0)
    assert_near(np.hypot(*path.T), 20e-3, 1e-8)
    # A chord of a millimeter is 6 µm inside the circle.
    assert measure_length([path]) == pytest.approx(2.0 * np.pi * 20e-3, rel=2e-4)


def test_the_bed_ends_half_a_pitch_beyond_its_pins():
    grid = make_grid(Layout(5, 9))
    (part,) = clip_to_bed([np.array([[-1.0, 0.0], [1.0, 0.0]])], grid)
    assert_near(part, [[-13.5e-3, 0.0], [13.5e-3, 0.0]], 1e-12)
    assert clip_to_bed([np.zeros((1, 2)), np.zeros((2, 2)), np.ones((2, 2))], grid) == []


ACROSS = np.array([[-30e-3, 0.0], [30e-3, 0.0]])
REFUSED = {
    "none": ([], r"Curves must have a line over the bed \(got none\)"),
    "longer than 10 m": ([ACROSS] * 167, r"length must be at most 10 m on the bed \(got 10.02 m\)"),
    "more than 500": ([ACROSS / 100.0] * 501, r"lines must be at most 500 on the bed \(got 501\)"),
}


@pytest.mark.parametrize("lines, words", REFUSED.values(), ids=REFUSED)
def test_no_line_and_one_too_many_are_refused(lines, words):
    with refused_in_a_line(ParameterError, words):
        divide_lines(lines)
    assert len(divide_lines(lines[1:] or [ACROSS])) == max(1, len(lines) - 1)
