"""The pulp's exponential spring (equation 11)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.contact import LARGEST_EXPONENT, Contact
from digiclay.core.model.fingertip import LEVEL, Fingertip
from digiclay.core.model.layout import Layout, make_grid

from tests.assemble import under


def test_tension_begins_at_zero_at_the_offset() -> None:
    assert Contact(offset=0.5e-3).tension(np.array([0.5e-3])).tolist() == [0.0]


def test_there_is_no_tension_below_the_offset() -> None:
    assert Contact(offset=0.5e-3).tension(np.array([-1.0, 0.0, 0.4e-3])).tolist() == [0.0, 0.0, 0.0]


def test_the_stiffness_at_first_touch_is_b() -> None:
    # T = b x (1 + m x/2): at 1 nm the second term is 1e-6.
    assert Contact().tension(np.array([1e-9])) / 1e-9 == pytest.approx(250.0, rel=2e-6)


def test_tension_follows_the_exponential() -> None:
    depth = np.array([0.3e-3, 1e-3, 2.4e-3])
    expected = [250.0 / 2000.0 * (math.exp(2000.0 * x) - 1.0) for x in depth]
    assert Contact().tension(depth) == pytest.approx(expected, rel=1e-13)  # rounding


def test_stiffness_grows_with_tension_by_the_exponent() -> None:
    # T' = b + m T, by a central difference: truncation (m dx)²/6, 7e-9; rounding 1e-10.
    contact, dx = Contact(), 1e-7
    low, here, high = contact.tension(np.array([1e-3 - dx, 1e-3, 1e-3 + dx]))
    assert (high - low) / (2 * dx) == pytest.approx(250.0 + 2000.0 * here, rel=1e-7)


def test_tension_stays_finite_at_any_depth() -> None:
    assert np.isfinite(Contact().tension(np.array([1.0, 1e6]))).all()


def test_the_cut_lies_beyond_all_physical_depths() -> None:
    assert LARGEST_EXPONENT / Contact().exponent > 0.1  # 250 mm, more than a stroke


@pytest.mark.parametrize("arrangement", ["aligned", "hexagonal"])
@pytest.mark.parametrize("depth", [1e-3, 1.5e-3, 2e-3, 2.4e-3])
def test_the_cells_together_carry_what_a_flat_plate_does(arrangement: str, depth: float) -> None:
    # The share f_d was fitted for this: 0.34 on the square grid, 0.29 on the hexagonal one. One constant
    # cannot match all depths: a quarter from 1 to 2.4 mm, averaged over where the finger stands.
    share = 0.29 if arrangement == "hexagonal" else 0.34
    contact, bed = Contact(share=share), make_grid(Layout(rows=15, columns=15, arrangement=arrangement))
    offsets = np.stack(np.meshgrid(np.arange(6), np.arange(6)), axis=-1).reshape(-1, 2) * 0.5e-3
    poses = np.array([[x, y, -depth, *LEVEL] for x, y in offsets])
    carried = share * contact.tension(-under(Fingertip().outline(poses), bed.x, bed.y)).sum(axis=1)
    assert carried.mean() == pytest.approx(float(contact.tension(np.array([depth]))[0]), rel=0.25)


def test_an_exponent_of_zero_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"^Contact\.exponent must be above 0 1/m \(got 0 1/m\)\.$"):
        Contact(exponent=0.0)
