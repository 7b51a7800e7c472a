"""What the pressure of a pen asks for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from digiclay.press.pointer import CURVE_ITEMS, FULL_TILT, find_lean, find_share

CURVES = [item[0] for item in CURVE_ITEMS]


@pytest.mark.parametrize("curve", CURVES)
def test_a_curve_goes_from_nothing_to_all_and_never_back(curve: str) -> None:
    shares = [find_share(pressure / 100, curve) for pressure in range(101)]
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert shares == sorted(shares)


def test_half_the_pressure_of_a_soft_pen_goes_deepest() -> None:
    soft, linear, firm = (find_share(0.5, curve) for curve in CURVES)
    assert (soft, linear, firm) == (pytest.approx(math.sqrt(0.5)), 0.5, 0.25)


@pytest.mark.parametrize(("odd", "share"), [(-1.0, 0.0), (7.0, 1.0), (math.inf, 1.0), (math.nan, 1.0)])
def test_a_driver_that_reports_nonsense_does_no_harm(odd: float, share: float) -> None:
    assert [find_share(odd, curve) for curve in CURVES] == [share] * 3


#: A view from above with its up along y; one from the front and above; one level with the bed.
ABOVE = np.eye(3)
FRONT = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]])
BESIDE = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@pytest.mark.parametrize("seen", [ABOVE, FRONT])
def test_a_pen_leans_over_the_bed_as_over_the_tablet(seen: np.ndarray) -> None:
    assert find_lean((1.0, 0.0), seen) == pytest.approx((FULL_TILT, 0.0))
    # Towards the user is down in the view.
    assert find_lean((0.0, 0.5), seen) == pytest.approx((0.0, -0.5 * FULL_TILT))


def test_in_a_level_view_the_far_side_is_behind_the_bed() -> None:
    assert find_lean((1.0, 0.0), BESIDE) == pytest.approx((0.0, FULL_TILT))
    assert find_lean((0.0, -1.0), BESIDE) == pytest.approx((-FULL_TILT, 0.0))


def test_a_view_turned_on_its_side_has_its_right_along_the_pins_and_still_a_far_side() -> None:
    assert find_lean((0.0, -1.0), np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])) == (
        pytest.approx((FULL_TILT, 0.0))
    )


def test_no_pen_leans_farther_than_full_tilt_and_nonsense_is_upright() -> None:
    assert math.hypot(*find_lean((1.0, 1.0), ABOVE)) == pytest.approx(FULL_TILT)
    assert [find_lean(odd, ABOVE) for odd in ((math.nan, 0.0), (0.0, math.inf), (0.0, 0.0))] == [
        (0.0, 0.0)
    ] * 3
