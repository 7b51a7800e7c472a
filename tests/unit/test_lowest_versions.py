"""Bounds of the libraries: pyproject.toml, and the pins of the lowest and the highest versions.

`tests/release` installs these versions and runs with them.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DEPENDENCIES = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
#: Of each library the lowest version and the major version that is too high.
BOUNDS = {
    name: (lowest, int(above))
    for name, lowest, above in (
        re.fullmatch(r"([\w-]+)>=([\d.]+),<(\d+)", one).groups() for one in DEPENDENCIES
    )
}


def pins(name: str) -> dict[str, str]:
    """Return the versions of a file in requirements/."""
    text = (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
    return dict(re.findall(r"^([\w-]+)==([\d.]+)$", text, re.MULTILINE))


def test_the_lowest_versions_are_those_of_the_package() -> None:
    lowest = {name: f"{low}.0.0".split(".")[:3] for name, (low, _) in BOUNDS.items()}
    assert {name: version.split(".") for name, version in pins("lowest").items()} == lowest


@pytest.mark.parametrize("file", ["lowest", "highest", "demo", "extension", "matrix-5.2"])
def test_every_pinned_version_is_within_the_bounds(file: str) -> None:
    def numbers(version: str) -> tuple[int, ...]:
        return tuple(map(int, version.split(".")))

    bounded = {name: version for name, version in pins(file).items() if name in BOUNDS}
    assert bounded
    wrong = {
        name: version
        for name, version in bounded.items()
        if not (numbers(BOUNDS[name][0]) <= numbers(version) < (BOUNDS[name][1],))
    }
    assert wrong == {}


def test_the_highest_versions_are_not_below_those_of_the_other_files() -> None:
    for file in ("demo", "extension", "matrix-5.2"):
        for name, version in pins(file).items():
            if name in BOUNDS:
                highest = pins("highest")[name]
                assert list(map(int, highest.split("."))) >= list(map(int, version.split("."))), name
