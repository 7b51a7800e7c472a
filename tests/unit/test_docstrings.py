"""The lint rule for docstrings: which functions it takes, and what it asks for."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tools.docstrings import documented, lacking, main

GOOD = '"""Turn.\n\n    Parameters\n    ----------\n    angle, speed : float\n        rad, rad/s.\n    """'
SHORT = '"""Turn.\n\n    Parameters\n    ----------\n    angle : float\n        rad.\n    """'
OLD = '"""Turn.\n\n    Parameters\n    ----------\n    angle, speed, axis : float\n        rad.\n    """'
HEADS = {
    "def turn(angle, speed):": True,
    "def turn(angle, *, speed):": True,
    "def turn(angle):": False,
    "def turn():": False,
    "def _turn(angle, speed):": False,
}


def checkout(folder: Path, text: str) -> Path:
    """Make a checkout of one module."""
    module = folder / "benchmarks" / "wheel.py"
    module.parent.mkdir()
    module.write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize(("head", "needs"), HEADS.items())
def test_a_public_function_of_two_parameters_needs_the_section(
    head: str, needs: bool, tmp_path: Path
) -> None:
    root = checkout(tmp_path, f'{head}\n    """Turn."""\n')
    assert lacking(root) == ({("benchmarks/wheel.py", "turn")} if needs else set())


@pytest.mark.parametrize(("text", "right"), [(GOOD, True), (SHORT, False), (OLD, False), ("pass", False)])
def test_the_section_names_the_parameters_and_no_others(text: str, right: bool, tmp_path: Path) -> None:
    root = checkout(tmp_path, f"def turn(angle, speed):\n    {text}\n")
    assert (lacking(root) == set()) == right


def test_what_follows_the_section_is_no_part_of_it() -> None:
    more = "Returns\n    -------\n    axis : int\n    "
    (function,) = ast.parse(f"def turn(angle, speed):\n    {GOOD[:-3]}\n    {more}{GOOD[-3:]}\n").body
    assert isinstance(function, ast.FunctionDef)
    assert documented(function) == {"angle", "speed"}


@pytest.mark.parametrize("bases", [("Protocol", "Turns"), ("Protocol", ""), ("", "Turns")])
def test_a_method_that_a_base_class_declares_is_documented_there(
    bases: tuple[str, str], tmp_path: Path
) -> None:
    declared = f"class Turns({bases[0]}):\n  def turn(self, angle, speed):\n    {GOOD}\n"
    own = f"class Wheel({bases[1]}):\n  def turn(self, angle, speed):\n    pass\n"
    assert lacking(checkout(tmp_path, own)) == {("benchmarks/wheel.py", "Wheel.turn")}
    (tmp_path / "benchmarks" / "wheel.py").write_text(declared + own, encoding="utf-8")
    assert lacking(tmp_path) == set()


def test_a_class_that_is_no_base_declares_nothing(tmp_path: Path) -> None:
    other = f"class Turns:\n  def turn(self, angle, speed):\n    {GOOD}\n"
    own = "class Wheel:\n  def turn(self, angle, speed):\n    pass\n"
    assert lacking(checkout(tmp_path, other + own)) == {("benchmarks/wheel.py", "Wheel.turn")}


def test_the_check_fails_for_a_function_without_the_section(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = checkout(tmp_path, "def turn(angle, speed):\n    pass\n")
    assert main(root) == 1
    assert capsys.readouterr().out.startswith("benchmarks/wheel.py: turn: ")
    (tmp_path / "benchmarks" / "wheel.py").write_text(f"def turn(angle, speed):\n    {GOOD}\n")
    assert main(root) == 0
