"""The blister's two profiles."""

from __future__ import annotations

import math

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.control.blister import Blister

CONE, BELL = Blister(), Blister(profile="gaussian")


def test_the_cone_is_flat_on_top() -> None:
    assert CONE.evaluate_profile(np.array([0.0, 3e-3, 6e-3])).tolist() == [1.0, 1.0, 1.0]


def test_the_cone_falls_linearly_to_its_radius() -> None:
    assert CONE.evaluate_profile(np.array([8.25e-3, 10.5e-3, 15e-3])) == pytest.approx(
        [0.75, 0.5, 0.0], abs=1e-15
    )


def test_the_bell_is_a_gaussian() -> None:
    expected = [1.0, math.exp(-0.5), math.exp(-2.0)]
    assert BELL.evaluate_profile(np.array([0.0, 7e-3, 14e-3])) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("blister", [CONE, BELL], ids=["cone", "gaussian"])
def test_the_center_is_at_the_master(blister: Blister) -> None:
    assert blister.interpolate(np.zeros(1), 40e-3, 55e-3) == pytest.approx(55e-3, abs=1e-17)


def test_the_rim_of_the_cone_is_at_the_edge_height() -> None:
    assert CONE.interpolate(np.array([15e-3]), 40e-3, 55e-3) == pytest.approx(40e-3, abs=1e-17)


def test_a_master_below_the_edge_makes_a_dent() -> None:
    assert CONE.interpolate(np.array([10.5e-3]), 40e-3, 30e-3) == pytest.approx(35e-3, abs=1e-17)


def test_a_flat_top_as_wide_as_the_blister_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"^Blister\.flat_radius must be below the radius, 0\.015 m"):
        Blister(flat_radius=15e-3)


def test_an_edge_inside_the_blister_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"^Blister\.edge_radius must be above the radius, 0\.015 m"):
        Blister(edge_radius=15e-3)
