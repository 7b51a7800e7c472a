"""Units a person reads: numbers of up to six digits survive 32 bits, messages are reworded whole."""

import math

import numpy as np
import pytest
from digiclay.settings.shown_units import SHOWN, convert_units, to_shown, to_si, unit_of
from hypothesis import given
from hypothesis import strategies as some


@given(
    digits=some.integers(-999_999, 999_999),
    exponent=some.integers(-9, 6),
    unit=some.sampled_from(list(SHOWN)),
)
def test_a_number_of_six_digits_typed_is_that_number_in_si(digits, exponent, unit):
    _, power = SHOWN[unit]
    meant = float(f"{digits}e{exponent}")
    assert to_si(float(np.float32(to_shown(meant, power))), power) == meant


@given(
    value=some.floats(allow_nan=False, allow_infinity=False),
    power=some.sampled_from([-5, -3, 0, 3, 6]),
)
def test_the_number_shown_is_the_si_value_rounded_once(value, power):
    # One rounding is half a unit of the last place; what is too large or too small for a float may
    # end.
    there = to_shown(value, power)
    if math.isfinite(there) and abs(there) > 1e-300:
        assert math.isclose(there, value * 10.0**power, rel_tol=4e-16)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_handed_on_to_be_refused(value):
    assert repr(to_si(value, 3)) == repr(value)


@pytest.mark.parametrize(
    "unit, default, shown_in",
    [
        ("m", 3e-3, "mm"), ("Pa", 5e4, "bar"), ("s", 5e-3, "ms"), ("s", 2.0, "s"), ("s", 0.0, "s"),
        ("N", 0.4, "N"), ("1/m", 500.0, "1/mm"), ("", 0.18, ""),
    ],
)  # fmt: skip
def test_each_quantity_is_shown_in_the_unit_a_person_reads(unit, default, shown_in):
    assert unit_of(unit, default)[0] == shown_in


@pytest.mark.parametrize(
    "said, reads",
    [
        (
            "must be at least actuator.bore, 0.002 m: they overlap",
            "must be at least actuator.bore, 2 mm: they overlap",
        ),
        ("between -5e+04 Pa and 50000 Pa", "between -0.5 bar and 0.5 bar"),
        ("0.05 m/s, 1e-05 m2/s, 500 1/m", "50 mm/s, 10 mm²/s, 0.5 1/mm"),
        ("0.4 N, 3 mm, 5 s, 2 m2, valve2 m", "0.4 N, 3 mm, 5 s, 2 m2, valve2 m"),
    ],
)
def test_a_message_is_reworded_where_it_measures_and_nowhere_else(said, reads):
    assert convert_units(said) == reads
