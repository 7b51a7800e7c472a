"""Stabilized, straight and round paths of press strokes."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.strokes.stroke import EVEN_SPEED, lay_line, lay_path, lay_ring, pull, start


def test_a_place_stays_while_the_mouse_is_within_the_string() -> None:
    assert pull((1e-3, 2e-3), (3e-3, 2e-3), 2.5e-3) == (1e-3, 2e-3)


def test_the_mouse_pulls_the_place_behind_it_at_the_strings_length() -> None:
    assert pull((0.0, 0.0), (10e-3, 0.0), 4e-3) == pytest.approx((6e-3, 0.0), abs=1e-15)


def test_without_a_string_the_place_is_the_mouses() -> None:
    assert pull((0.0, 0.0), (3e-3, 4e-3), 0.0) == pytest.approx((3e-3, 4e-3), rel=1e-15)


def test_a_shaking_hand_draws_a_smoother_path() -> None:
    along = np.linspace(0.0, 50e-3, 200)
    shaking = np.column_stack([along, 1e-3 * np.sin(2.0 * np.pi * along / 3e-3)])
    places = [(0.0, 0.0)]
    for x, y in shaking:
        places.append(pull(places[-1], (float(x), float(y)), 5e-3))
    drawn = np.array(places)[50:]
    assert np.abs(drawn[:, 1]).max() < 0.4e-3


def test_a_ring_keeps_its_radius_and_is_closed() -> None:
    points = lay_ring((2e-3, -1e-3), (2e-3, 9e-3))
    np.testing.assert_allclose(np.linalg.norm(points - [2e-3, -1e-3], axis=1), 10e-3, rtol=1e-12)
    np.testing.assert_allclose(points[0], points[-1], atol=1e-15)
    np.testing.assert_allclose(points[0], [2e-3, 9e-3], atol=1e-15)
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() <= 1e-3 + 1e-12


def test_a_ring_without_a_radius_is_a_place() -> None:
    np.testing.assert_array_equal(lay_ring((1e-3, 2e-3), (1e-3, 2e-3)), [[1e-3, 2e-3]])


def test_a_laid_path_is_gone_along_evenly_and_is_let_go() -> None:
    stroke = lay_path(start(3, 0.0, 0.0, 4e-3), lay_line((0.0, 0.0), (30e-3, 40e-3)))
    assert not stroke.held
    assert [one.time for one in stroke.samples] == pytest.approx([0.0, 50e-3 / EVEN_SPEED])
    assert [one.depth for one in stroke.samples] == [4e-3, 4e-3]
    assert (stroke.samples[-1].x, stroke.samples[-1].y) == (30e-3, 40e-3)
