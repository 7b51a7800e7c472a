"""Paths along curves: joined, clipped to the bed, in steps of a millimeter, closed without a seam."""

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.layout import Layout, make_grid
from digiclay.strokes.curve_paths import divide_line, join_edges, lay_lines, refuse_paths

from tests.assemble import assert_near, refused_in_a_line

#: A bed of 27 mm by 15 mm.
BED = make_grid(Layout(5, 9))
SQUARE = [[-5, -5], [5, -5], [5, 5], [-5, 5], [-5, -5]]
#: Lines, mm; the ends of their paths on the bed, mm; and whether these are all of the line.
ON_BED = {
    "inside": ([[-10, 0], [10, 0]], [[[-10, 0], [10, 0]]], True),
    "beside": ([[20, 0], [40, 0]], [], False),
    "up to the rims of its pins": ([[-13.5, 7.5], [13.5, 7.5]], [[[-13.5, 7.5], [13.5, 7.5]]], True),
    "over its sides": ([[-40, 0], [40, 0]], [[[-13, 0], [13, 0]]], False),
    "past a corner": ([[10, 20], [40, 0]], [], False),
    "out and in": ([[0, 0], [0, 9], [5, 9], [5, 0]], [[[0, 0], [0, 7]], [[5, 7], [5, 0]]], False),
    "a place twice": ([[0, 0], [0, 0], [10, 0]], [[[0, 0], [10, 0]]], True),
    "without length": ([[0, 0], [0, 0]], [], False),
    "closed, inside": (SQUARE, [[[-5, -5], [-5, -5]]], True),
    "closed, begun inside": (
        [[0, 0], [20, 0], [20, 5], [0, 5], [0, 0]], [[[13, 5], [13, 0]]], False,
    ),
    "closed, begun outside": (
        [[20, 0], [20, 5], [0, 5], [0, 0], [20, 0]], [[[13, 5], [13, 0]]], False,
    ),
}  # fmt: skip


@pytest.mark.parametrize("line, ends, whole", ON_BED.values(), ids=ON_BED)
def test_what_of_a_line_is_on_the_bed_is_a_path(line, ends, whole):
    paths, all_of_it = lay_lines("Curve", [1e-3 * np.array(line, float)], BED)
    assert all_of_it == whole
    assert len(paths) == len(ends)
    for path, wanted in zip(paths, ends, strict=True):
        # Steps are a millimeter, unless that does not divide the length.
        assert_near(1e3 * path[[0, -1]], wanted, 1e-5)
        steps = np.hypot(*np.diff(path, axis=0).T)
        assert 0.9e-3 < steps.min() <= steps.max() < 1.0001e-3


@pytest.mark.parametrize("place", [[np.nan, 0.0], [np.inf, 0.0], [1e300, 0.0], [1001.0, 0.0]])
def test_a_line_that_is_endless_is_refused_by_name(place):
    with refused_in_a_line(ParameterError, r"Curve\.length must be finite, and below 1000 m"):
        lay_lines("Curve", [np.zeros((2, 2)), np.array([[0.0, 0.0], place])], BED)


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
    (path,), _ = lay_lines("Curve", [circle], make_grid(Layout()))
    assert len(path) == 1 + 126  # 2 pi 20 mm
    assert_near(path[-1], path[0], 0.0)
    assert_near(np.hypot(*path.T), 20e-3, 1e-8)


REFUSED = {
    "none": ([], r"Curves must have a line over the bed \(got none\)"),
    "longer than 10 m": (
        [2501] * 3 + [2502],
        r"length must be at most 10 m on the bed \(got 10\.001 m\)",
    ),
    "more than 500": ([2] * 501, r"lines must be at most 500 on the bed \(got 501\)"),
}


@pytest.mark.parametrize("sizes, words", REFUSED.values(), ids=REFUSED)
def test_no_path_and_one_too_many_are_refused(sizes, words):
    with refused_in_a_line(ParameterError, words):
        refuse_paths([np.zeros((size, 2)) for size in sizes])
    refuse_paths([np.zeros((size, 2)) for size in [size - 1 for size in sizes[1:]] or [1]])
