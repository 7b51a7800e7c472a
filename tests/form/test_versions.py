"""Bounds of the libraries, by pyproject.toml and the pins of `tests/release`; the version in citations."""

import re
import tomllib
from pathlib import Path

import pytest
from digiclay import __version__

from tests.scene_files import read_text

ROOT = Path(__file__).parents[2]
DEPENDENCIES = tomllib.loads(read_text(ROOT / "pyproject.toml"))["project"]["dependencies"]
#: Of each library the lowest version and the major version that is too high.
BOUNDS = {
    name: (low, int(above))
    for line in DEPENDENCIES
    for name, low, above in re.findall(r"^([\w-]+)>=([\d.]+),<(\d+)$", line)
}


def numbers(version: str) -> list[int]:
    return [int(part) for part in f"{version}.0.0".split(".")[:3]]


def read_pins(name: str) -> dict[str, list[int]]:
    text = read_text(ROOT / "requirements" / f"{name}.txt")
    pins = dict(re.findall(r"^([\w-]+)==([\d.]+)$", text, re.MULTILINE))
    return {library: numbers(pin) for library, pin in pins.items() if library in BOUNDS}


def test_every_library_is_bounded_and_the_lowest_pins_are_the_bounds() -> None:
    assert len(BOUNDS) == len(DEPENDENCIES)
    assert read_pins("lowest") == {name: numbers(low) for name, (low, _) in BOUNDS.items()}


@pytest.mark.parametrize("file", ["highest", "demo", "extension", "matrix-5.2"])
def test_every_pin_lies_between_the_lowest_and_the_highest(file: str) -> None:
    pins, highest = read_pins(file), read_pins("highest")
    assert pins
    for name, pin in pins.items():
        low, above = BOUNDS[name]
        assert numbers(low) <= pin <= highest[name] < [above], name


@pytest.mark.parametrize("file", ["CITATION.cff", "docs/paper.md"])
def test_a_citation_has_the_version_of_the_program(file: str) -> None:
    text = read_text(ROOT / file)
    assert re.findall(r"^ *version *[:=] *{?([\d.]+)", text, re.MULTILINE) == [__version__]
