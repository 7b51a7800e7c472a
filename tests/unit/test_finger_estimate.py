"""The filter of Method III finds a fingertip from its undersides: place, velocity, size and elongation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from digiclay.core.control.finger_estimate import Estimate, FingerFilter, Spread, invert_six
from digiclay.core.model.fingertip import Fingertip, compute_forms, compute_underside
from numpy.typing import NDArray

from tests.assemble import make_basis

Floats = NDArray[np.float64]

PERIOD = 5e-3
#: Elongation of the default fingertip, 10 by 8 mm.
LONG = (100.0 - 64.0) / (100.0 + 64.0)
#: Cells about the origin, 3 mm apart.
X, Y = (grid.ravel() * 3e-3 for grid in np.meshgrid(np.arange(-6.0, 7.0), np.arange(-6.0, 7.0)))


def filter_of(tip: Fingertip) -> FingerFilter:
    """Return a filter of a fingertip, with the spread that Method III has."""
    return FingerFilter(tip, Spread(1.0, 0.5, 0.05, 30e-6), PERIOD)


def underside(tip: Fingertip, x: float, y: float, z: float, turn: float) -> Floats:
    """Return the underside that the physics has over all cells, m."""
    pose = np.array([[x, y, z, math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2)]])
    under: Floats = compute_underside(*compute_forms(tip.outline(pose)), make_basis(X, Y))[0]
    return under


def follow(
    known: FingerFilter, tip: Fingertip, speed: float = 0.0, turn: float = 0.0, count: int = 200
) -> Estimate:
    """Return what a filter makes of a fingertip that moves along x, by the cells less than 2 mm above it."""
    found = known.begin(-9e-3, 0.0, 40.5e-3)
    for number in range(count):
        found = known.predict(found)
        under = underside(tip, speed * number * PERIOD - 10e-3, 1e-3, 40e-3, turn)
        here = under < 42e-3
        at = known.measure(found.mean, make_basis(X, Y)[:, here])
        found, _ = known.correct(found, at, under[here], np.full(np.count_nonzero(here), 1e-10))
    return found


@pytest.mark.parametrize(
    ("size", "speed", "turn"),
    [(1.0, 0.0, 0.0), (1.0, 20e-3, 0.0), (1.0, 10e-3, 0.5 * math.pi), (1.0, 10e-3, 2.5), (0.75, 5e-3, 0.6),
     (1.3, 5e-3, 0.0)],
    ids=["at rest", "dragged", "across", "turned far", "smaller than known, turned", "larger"],
)  # fmt: skip
def test_a_fingertip_is_found(size: float, speed: float, turn: float) -> None:
    tip = Fingertip(10e-3 * size, 8e-3 * size, 8e-3 * size)
    x, y, z, vx, vy, vz, scale, along, askew = follow(filter_of(Fingertip()), tip, speed, turn).mean
    # To a micrometer at rest; the last of 200 periods begins 199 periods after the first.
    place = (-10e-3 + 199 * PERIOD * speed, 1e-3, 40e-3)
    assert (x, y, z) == pytest.approx(place, abs=20e-6 if speed else 1e-6)
    assert (vx, vy, vz) == pytest.approx((speed, 0.0, 0.0), abs=0.2e-3)
    assert scale == pytest.approx(math.log(size), abs=5e-3)
    turned = LONG * math.cos(2.0 * turn), LONG * math.sin(2.0 * turn)
    assert (along, askew) == pytest.approx(turned, abs=5e-3)


def test_a_first_contact_is_uncertain_by_millimeters_and_a_first_underside_is_weighed_with_it() -> None:
    known = filter_of(Fingertip())
    first = known.begin(0.0, 0.0, 40e-3)
    spread = np.sqrt(np.diag(first.covariance))
    assert spread == pytest.approx([2e-3, 2e-3, 1e-3, 2e-2, 2e-2, 2e-2, 0.1, 0.2, 0.2])
    # Over the lowest point, and as uncertain as that: half of the error is believed.
    at = known.measure(first.mean, make_basis(np.zeros(1), np.zeros(1)))
    after, left = known.correct(first, at, np.array([40.4e-3]), np.array([1e-6]))
    assert (after.mean[2], left[0]) == pytest.approx((40.2e-3, 0.2e-3))


@pytest.mark.parametrize("known", [Fingertip(15e-3), Fingertip(width=4.8e-3), Fingertip(8e-3)])
def test_a_fingertip_known_too_long_too_narrow_or_round_is_found(known: Fingertip) -> None:
    *_, size, along, askew = follow(filter_of(known), Fingertip(), speed=5e-3, turn=0.6).mean
    mean = np.exp(-size) * known.height * 0.5 * (known.length**-2 + known.width**-2)
    curvatures = np.linalg.eigvalsh(mean * np.array([[1.0 - along, -askew], [-askew, 1.0 + along]]))
    # Of the lowest point: 8 mm over the squares of 10 and 8 mm. Farther off the known one is another body.
    assert curvatures == pytest.approx([80.0, 125.0], rel=0.1)


def test_the_errors_left_are_those_of_the_corrected_fingertip() -> None:
    known = filter_of(Fingertip())
    found, basis = known.begin(0.2e-3, 0.0, 40e-3), make_basis(X, Y)
    found.mean[7] = LONG
    under = underside(Fingertip(), 0.0, 0.0, 40e-3, 0.0)
    here = under < 42e-3
    found, left = known.correct(
        found, known.measure(found.mean, basis[:, here]), under[here], np.full(here.sum(), 1e-10)
    )
    again = under[here] - known.measure(found.mean, basis[:, here]).under
    # They are the slopes' prediction: right but for the curvature over 0.2 mm, 2.5 µm at a radius of 8 mm.
    assert left == pytest.approx(again, abs=5e-6)


def test_the_underside_at_another_place_is_that_of_the_physics() -> None:
    known = filter_of(Fingertip())
    shape = Estimate(np.array([*(0.0,) * 7, LONG * math.cos(0.8), LONG * math.sin(0.8)]), np.eye(9))
    found = known.find_underside((1e-3, 2e-3, 40e-3), shape, make_basis(X, Y))
    true = underside(Fingertip(), 1e-3, 2e-3, 40e-3, 0.4)
    assert found == pytest.approx(true, abs=1e-15)


def test_slopes_are_differences_of_the_underside() -> None:
    known, basis = filter_of(Fingertip()), make_basis(X, Y)
    mean = np.array([0.5e-3, -0.3e-3, 40e-3, 0.0, 0.0, 0.0, 0.02, 0.2, 0.1])
    at = known.measure(mean, basis)
    near = at.under < 45e-3
    for row, place in enumerate((6, 0, 1, 7, 8, 2)):
        step = np.zeros(9)
        step[place] = 1e-5
        slope = (known.measure(mean + step, basis).under - known.measure(mean - step, basis).under) / 2e-5
        assert at.slopes[row][near] == pytest.approx(slope[near], rel=1e-4, abs=1e-6)


@pytest.mark.parametrize(
    "order", [(0, 1, 2, 3, 4, 5), (5, 4, 3, 2, 1, 0), (1, 2, 3, 4, 5, 0), (0, 5, 1, 4, 2, 3)]
)
def test_the_inverse_is_that_of_numpy_also_where_pivots_vanish(order: tuple[int, ...]) -> None:
    matrix = np.random.default_rng(order[0]).normal(size=(6, 6)) * np.logspace(-3, 3, 6)
    assert invert_six(matrix) == pytest.approx(np.linalg.inv(matrix), rel=1e-9)
    # But for one number a row too small to divide by.
    tiny = matrix * 1e-13 - np.eye(6)[list(order)]
    assert invert_six(tiny) == pytest.approx(np.linalg.inv(tiny), rel=1e-9, abs=1e-15)
    # A singular covariance, as of a crafted snapshot, has none.
    assert np.isnan(invert_six(np.zeros((6, 6)))).any()
