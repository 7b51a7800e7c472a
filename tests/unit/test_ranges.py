"""Ranges of varied parameters: text forms, values at shares, what a scene's parameters make of them."""

from __future__ import annotations

from pathlib import Path

import pytest
from digiclay.core.base.errors import DigiclayError, ParameterError
from digiclay.core.scene.scene_source import Setting, find

from digiclay_study.point_series import Range, fit_ranges, read_range


@pytest.mark.parametrize(
    ("said", "range_"),
    [
        ("a.b=1:10", Range("a.b", 1.0, 10.0)),
        ("a.b=-1:0.5", Range("a.b", -1.0, 0.5)),
        ("a.b=1:100:log", Range("a.b", 1.0, 100.0, logarithmic=True)),
        ("a.b=2 mm:4 mm", Range("a.b", 2.0, 4.0, "mm")),
        ("a.b= cone, gaussian", Range("a.b", words=("cone", "gaussian"))),
    ],
)
def test_a_range_is_read_from_a_line(said: str, range_: Range) -> None:
    assert read_range(said) == range_


@pytest.mark.parametrize(
    ("said", "rule"),
    [
        ("a.b", "--vary must be KEY=LOW:HIGH, KEY=LOW:HIGH:log or KEY=A,B,C (got 'a.b')."),
        ("a.b=3", "--vary a.b must be LOW:HIGH, LOW:HIGH:log or at least two different values A,B"),
        ("a.b=1:2:5", "--vary a.b must be LOW:HIGH or LOW:HIGH:log, without a count (got '1:2:5')."),
        ("a.b=2:1", "--vary a.b must have LOW below HIGH (got '2:1')."),
        ("a.b=2:2", "--vary a.b must have two different finite numbers at LOW and HIGH (got '2:2')."),
    ],
)
def test_what_is_no_range_is_refused_with_key_rule_and_value(said: str, rule: str) -> None:
    with pytest.raises(ParameterError) as error:
        read_range(said)
    assert str(error.value).startswith(rule)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("a.b=1:3", ("1.0", "2.0", "3.0")),
        ("a.b=1:100:log", ("1.0", "10.0", "100.0")),
        ("a.b=2 mm:4 mm", ("2.0 mm", "3.0 mm", "4.0 mm")),
        ("a.b=x,y,z", ("x", "y", "z")),
    ],
)
def test_shares_of_a_range_are_values(said: str, words: tuple[str, ...]) -> None:
    assert tuple(read_range(said).find_word(share) for share in (0.0, 0.5, 1.0)) == words


def fit(*said: str, settings: tuple[Setting, ...] = ()) -> list[Range]:
    """Return ranges as the parameters of a sample have them."""
    return fit_ranges([read_range(one) for one in said], find("slow_press"), settings)


def test_values_are_as_the_parameter_has_them() -> None:
    rows, stroke = fit("layout.rows=11:15", "valve.stroke=20 um:40 um")
    # Every whole number of a range has an equal share, and stays one in SI.
    words = [rows.find_word(share) for share in (0.0, 0.19, 0.21, 0.5, 0.79, 0.81, 1.0)]
    assert words == ["11", "11", "12", "13", "14", "15", "15"]
    assert repr(rows.convert("12")) == "12"
    assert (stroke.convert("30 um"), stroke.si) == (pytest.approx(30e-6, rel=1e-15), "m")


@pytest.mark.parametrize(
    ("said", "rule"),
    [
        ("control.force_gian=1:2", "--vary: control.force_gian must be a known key (got 1.0)."),
        ("control=1:2", "--vary: control must be"),
        ("control.force_gain=-1:2", "--vary control.force_gain must be at least 0 1/N (got -1)."),
        ("control.force_gain=1:1e12", "--vary control.force_gain must be at most 1e+09 1/N (got 1e+12)."),
        ("layout.rows=11:12.5", "--vary layout.rows must have whole numbers at LOW and HIGH (got 12.5)."),
        ("layout.pitch=2 N:3 N", "--vary layout.pitch must be in m or a multiple of it (got 2 N)."),
        ("blister.profile=1:2", "--vary blister.profile must"),
        ("blister.profile=cone,con", "--vary: blister.profile must be one of"),
    ],
)
def test_what_the_parameter_cannot_be_is_refused(said: str, rule: str) -> None:
    with pytest.raises(DigiclayError) as error:
        fit(said)
    assert str(error.value).startswith(rule)


def test_a_parameter_is_given_once() -> None:
    with pytest.raises(ParameterError, match="must be given once"):
        fit("layout.pitch=1e-3:2e-3", "layout.pitch=2e-3:3e-3")
    with pytest.raises(ParameterError, match="must not be given to --set as well"):
        fit("layout.pitch=1e-3:2e-3", settings=(Setting("layout.pitch", "0.003"),))


def test_a_file_that_is_wrong_by_itself_is_told_first(tmp_path: Path) -> None:
    (tmp_path / "my.toml").write_text("[layout]\nrows = 0\n", encoding="utf-8")
    with pytest.raises(DigiclayError, match="rows"):
        fit_ranges([read_range("a.b=1:2")], tmp_path / "my.toml", ())
