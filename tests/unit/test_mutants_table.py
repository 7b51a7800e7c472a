"""The table of the mutation run names every module that is to be changed, and tests that are there."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CORE = ROOT / "addon" / "digiclay" / "core"
TABLE = tomllib.loads((ROOT / "tools" / "mutants.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("package", ["control", "engine", "metrics", "steppers"])
def test_every_module_of_a_package_has_tests_that_judge_its_mutants(package: str) -> None:
    there = {f"{package}.{path.stem}" for path in CORE.glob(f"{package}/*.py")}
    assert there - TABLE["modules"].keys() <= {f"{package}.__init__", "control.methods"}


def test_every_module_in_the_table_of_mutants_is_there() -> None:
    files = {name: CORE.joinpath(*name.split(".")).with_suffix(".py") for name in TABLE["modules"]}
    assert len(files) > 30
    assert [name for name, path in files.items() if not path.is_file()] == []


def test_every_test_that_judges_mutants_is_there() -> None:
    missing = []
    for test in {*TABLE["every"], *(test for tests in TABLE["modules"].values() for test in tests)}:
        file, _, name = test.partition("::")
        text = (ROOT / file).read_text(encoding="utf-8") if (ROOT / file).is_file() else ""
        if not re.search(rf"^def {name.partition('[')[0]}", text, re.MULTILINE):
            missing.append(test)
    assert sorted(missing) == []
