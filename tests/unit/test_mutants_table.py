"""The table of the mutation run names every control method and stepper, and tests that are there."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
CORE = ROOT / "addon" / "digiclay" / "core"
TABLE = tomllib.loads((ROOT / "tools" / "mutants.toml").read_text(encoding="utf-8"))


def test_every_control_method_and_stepper_has_tests_that_judge_its_mutants() -> None:
    there = {f"{room}.{path.stem}" for room in ("control", "steppers") for path in CORE.glob(f"{room}/*.py")}
    assert (
        sorted(
            name
            for name in there - TABLE["modules"].keys()
            if not name.endswith(("__init__", "control.methods"))
        )
        == []
    )


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
