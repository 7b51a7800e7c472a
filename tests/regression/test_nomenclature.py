"""The pages on symbols and equations say what the code says."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest
from digiclay.core.base.quantity import list_quantities
from digiclay.core.control.methods import METHODS
from digiclay.core.scene.schema import SECTIONS, import_parameters

ROOT = Path(__file__).parents[2]
EQUATIONS = ROOT / "docs" / "equations.md"


@pytest.fixture(scope="module")
def maker() -> ModuleType:
    """The program that makes the page."""
    spec = importlib.util.spec_from_file_location("nomenclature", ROOT / "tools" / "nomenclature.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_of_symbols_is_the_one_the_declarations_make(maker: ModuleType) -> None:
    written = maker.PAGE.read_text(encoding="utf-8")
    assert written == maker.page(), "run `python tools/nomenclature.py`"


@pytest.mark.parametrize("section", SECTIONS)
def test_every_parameter_is_on_the_page_of_symbols(maker: ModuleType, section: str) -> None:
    text = maker.PAGE.read_text(encoding="utf-8")
    names = list_quantities(import_parameters(section, "virtual_master"))
    assert [name for name in names if f"`{section}.{name}`" not in text] == []


def test_every_parameter_says_where_it_comes_from(maker: ModuleType) -> None:
    named = {
        source
        for section in SECTIONS
        for method in METHODS
        for known in list_quantities(import_parameters(section, method)).values()
        for source in known.source.split(", ")
    }
    # The paper, derived, chosen; or a reference that the page lists, and none that nobody takes a value from.
    assert named - {"P", "D", "C"} == set(maker.REFERENCES)


def test_all_fourteen_equations_have_a_row() -> None:
    numbers = re.findall(r"^\| (\d+)", EQUATIONS.read_text(encoding="utf-8"), re.MULTILINE)
    assert {int(n) for n in numbers} == set(range(1, 15))


def test_every_place_in_the_code_the_equations_name_exists() -> None:
    text = EQUATIONS.read_text(encoding="utf-8")
    named = re.findall(r"`core/([\w/]+)\.py: ([\w.]+)`", text)
    assert len(named) > 12
    missing = []
    for module, name in named:
        code = (ROOT / "addon" / "digiclay" / "core" / f"{module}.py").read_text(encoding="utf-8")
        parts = name.split(".")
        if not all(
            re.search(rf"\b(def|class) {part}\b|^ *{part}\b *[:=]", code, re.MULTILINE) for part in parts
        ):
            missing.append(f"{module}: {name}")
    assert missing == []
