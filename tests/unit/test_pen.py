"""What the pressure of a pen asks for."""

from __future__ import annotations

import math

import pytest
from digiclay.press.pen import CURVE_ITEMS, find_share

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
