"""Parameters: defaults, types, bounds, and the one line when a rule is broken, also by parts together."""

import math
import re
from dataclasses import dataclass

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.base.quantity import Parameters, find_nearest_name, parse, quantity
from digiclay.core.model.layout import Layout
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.model.sensors import Sensing
from digiclay.core.model.trajectory import Trajectory


@dataclass(frozen=True)
class Lever(Parameters):
    length: float = quantity(0.1, "length", unit="m", symbol="l", source="P", above=0.0, below=10.0)
    teeth: int = quantity(12, "teeth", at_least=3, at_most=99)
    metal: str = quantity("brass", "what it is made of", choices=("brass", "steel", "true"))
    notches: tuple[float, ...] = quantity((0.1, 0.2), "notches", unit="m", at_least=0.0)


@pytest.mark.parametrize(
    "given, field, kind, value",
    [
        ({}, "notches", tuple, (0.1, 0.2)),
        ({"length": 1}, "length", float, 1.0),
        ({"teeth": 7.0}, "teeth", int, 7),
        ({"teeth": 3}, "teeth", int, 3),  # bounds are included
        ({"teeth": 99}, "teeth", int, 99),
        ({"notches": [0, 0.5]}, "notches", tuple, (0.0, 0.5)),
        # Numbers of numpy, as a loop over an array gives them.
        ({"teeth": np.float32(15)}, "teeth", int, 15),
        ({"length": np.float32(0.5)}, "length", float, 0.5),
        ({"notches": np.array([0.0, 0.5])}, "notches", tuple, (0.0, 0.5)),
        ({"notches": (np.float64(0.25), np.int8(1))}, "notches", tuple, (0.25, 1.0)),
        # A word that TOML takes for a truth value.
        ({"metal": "true"}, "metal", str, "true"),
        ({"metal": True}, "metal", str, "true"),
    ],
)
def test_a_valid_value_has_the_type_of_its_default(given, field, kind, value):
    found = getattr(Lever(**given), field)
    assert (type(found), found) == (kind, value)


@pytest.mark.parametrize(
    "given, line",
    [
        ({"length": 0}, "Lever.length must be above 0 m (got 0 m)."),
        ({"length": 10.0}, "Lever.length must be below 10 m (got 10 m)."),
        ({"length": math.nan}, "Lever.length must be a finite number (got nan m)."),
        (
            {"length": 10**400},
            "Lever.length must be a finite number (got a whole number of 401 digits).",
        ),
        ({"length": "long"}, "Lever.length must be a number (got 'long')."),
        ({"length": True}, "Lever.length must be a number (got True)."),
        ({"teeth": 2}, "Lever.teeth must be at least 3 (got 2)."),
        ({"teeth": 100}, "Lever.teeth must be at most 99 (got 100)."),
        ({"teeth": 3.5}, "Lever.teeth must be a whole number (got 3.5)."),
        ({"teeth": False}, "Lever.teeth must be a whole number (got False)."),
        ({"metal": "tin"}, "Lever.metal must be one of brass, steel, true (got 'tin')."),
        ({"metal": False}, "Lever.metal must be a text (got False)."),
        ({"length": np.bool_(True)}, "Lever.length must be a number (got True)."),
        (
            {"length": np.datetime64("2020")},
            "Lever.length must be a number (got datetime.date(2020, 1, 1)).",
        ),
        ({"notches": []}, "Lever.notches must be a list of numbers (got [])."),
        ({"notches": (0.1, -0.2)}, "Lever.notches must be at least 0 m (got -0.2 m)."),
        ({"notches": (0.1, "x")}, "Lever.notches must be a number (got 'x')."),
    ],
)
def test_a_broken_rule_is_one_line_with_owner_field_rule_and_value(given, line):
    with pytest.raises(ParameterError) as caught:
        Lever(**given)
    assert str(caught.value) == line


@pytest.mark.parametrize(
    "text, unit, value",
    [
        ("3 mm", "m", 3e-3),
        ("0.5 bar", "Pa", 5e4),
        ("1.6 cSt", "m2/s", 1.6e-6),
        (" 2  ms ", "s", 2e-3),
        ("-5e-1 N", "N", -0.5),
        # Signs that look alike: the micro sign, the Greek letter, one sign for both letters.
        ("20 \N{MICRO SIGN}m", "m", 20e-6),
        ("20 \N{GREEK SMALL LETTER MU}m", "m", 20e-6),
        ("20\N{NO-BREAK SPACE}\N{SQUARE MU M}", "m", 20e-6),
        ("9.81 m/s\N{SUPERSCRIPT TWO}", "m/s2", 9.81),
        ("\N{MINUS SIGN}3 mm", "m", -3e-3),
    ],
)
def test_a_quantity_with_a_unit_is_read_into_si(text, unit, value):
    assert parse(text, unit) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    "text, rule",
    [
        ("three mm", "must be a number, or a text such as '1.5 m'"),
        ("3,5 mm", "must be a number, or a text such as '1.5 m'"),
        ("3 parsec", "must have a unit known here"),
        ("3", "must have a unit known here"),
        ("3 bar", "must be in m or a multiple of it"),
    ],
)
def test_a_quantity_that_cannot_be_read_names_the_rule(text, rule):
    with pytest.raises(ValueError, match=rule):
        parse(text, "m")


def test_the_nearest_name_is_suggested_unless_all_are_unlike():
    names = ["density", "viscosity"]
    assert [find_nearest_name(name, names) for name in ("viscosty", "qqq")] == ["viscosity", ""]


def path(times, positions=None):
    """Return a level path, at the origin unless positions are given."""
    count = len(times)
    places = np.zeros((count, 3)) if positions is None else np.array(positions, float)
    return Trajectory(np.array(times, float), places, np.eye(1, 4).repeat(count, 0))


@pytest.mark.parametrize(
    "part, given, said",
    [
        (Layout, {"rows": 10_000, "columns": 10_000}, "rows * columns must have at most 20 million"),
        (Relaxation, {"weights": (0.0,) * 4}, "weights must not all be 0"),
        (Relaxation, {"times": (0.0, 0.07, 1.4)}, "times must be at least 1e-09 s (got 0 s)."),
        (Relaxation, {"weights": (1.0,) * 3}, "weights must have one value more than times, 4 (got 3)."),
        (Relaxation, {"weights": (1.0,) * 5}, "weights must have one value more than times, 4 (got 5)."),
        (Sensing, {"observer": "valve", "force_noise": 1e-3}, "force_noise must be 0 N with observer"),
        (Sensing, {"observer": "valve", "force_step": 1e-3}, "force_step must be 0 N with observer"),
        (Sensing, {"height_step": 1e-15}, "height_step must be 0 m, or at least 1e-12 m (got 1e-15 m)."),
        (path, {"times": [0.0, 1.0, 1.0 + 1e-12]}, "times must increase from waypoint to waypoint by"),
        (
            path, {"times": [0.0, 1.0], "positions": [[0, 0, 0], [0, np.nan, 0]]},
            "positions must be finite numbers (got nan at waypoint 2).",
        ),
    ],
)  # fmt: skip
def test_what_no_part_can_have_is_refused_with_the_rule(part, given, said):
    name = "Trajectory" if part is path else part.__name__
    with pytest.raises(ParameterError, match="^" + re.escape(f"{name}.{said}")):
        part(**given)
