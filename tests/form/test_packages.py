"""The packages: the extension, and those that stand beside it and import it."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.form.test_architecture import PACKAGE, ROOT, find_circle, find_own_name, imports

#: Packages beside the extension: they import it, and it never imports them.
BESIDE = {name: ROOT / name for name in ("benchmarks", "digiclay_paper", "digiclay_serve", "digiclay_study")}
#: The one file of the extension that looks for the others by their names, to hand them the command line.
DOOR = PACKAGE / "commands" / "outside.py"


@pytest.mark.parametrize("package", BESIDE.values(), ids=BESIDE)
def test_no_module_imports_itself_by_way_of_others(package: Path) -> None:
    assert find_circle(package) == []


@pytest.mark.parametrize("package", BESIDE.values(), ids=BESIDE)
def test_package_imports_itself_relatively(package: Path) -> None:
    assert find_own_name(package) == []


def test_the_extension_never_imports_what_stands_beside_it() -> None:
    files = [path for path in PACKAGE.rglob("*.py") if path != DOOR]
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {target}"
        for path in files
        for line, target, _ in imports(path)
        if target.split(".")[0] in BESIDE
    ]
    installed = ("digiclay_paper", "digiclay_serve", "digiclay_study")
    texts = {path.name: path.read_text(encoding="utf-8") for path in files}
    named = [name for name, text in texts.items() if any(package in text for package in installed)]
    assert (wrong, named) == ([], [])
    assert all(package in DOOR.read_text(encoding="utf-8") for package in installed)


@pytest.mark.parametrize("package", BESIDE.values(), ids=BESIDE)
def test_what_stands_beside_the_extension_imports_no_part_of_its_neighbor(package: Path) -> None:
    others = {name for name, path in BESIDE.items() if path != package}
    if package.name == "benchmarks":  # only in a checkout, where the suite's trials are beside it
        others.remove("digiclay_study")
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {target}"
        for path in package.rglob("*.py")
        for line, target, _ in imports(path)
        if target.split(".")[0] in others
    ]
    assert wrong == []


@pytest.mark.parametrize("package", BESIDE.values(), ids=BESIDE)
def test_every_module_beside_the_extension_has_a_docstring(package: Path) -> None:
    files = {path: ast.parse(path.read_text(encoding="utf-8")) for path in package.rglob("*.py")}
    assert [str(path) for path, tree in files.items() if not ast.get_docstring(tree)] == []
