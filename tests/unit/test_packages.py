"""The packages: the extension, and beside it the benchmarks and the paper's reproduction, which import it."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.unit.test_architecture import PACKAGE, ROOT, imports

#: Packages beside the extension: they import it, and it never imports them.
BESIDE = {name: ROOT / name for name in ("benchmarks", "digiclay_paper")}
#: The one file of the extension that looks for the paper's package by its name, to hand it the command line.
DOOR = PACKAGE / "commands" / "outside.py"


def package_imports(package: Path) -> dict[str, set[str]]:
    """Return what each module of a package imports of it, also inside functions."""
    parts = {path: path.relative_to(package).with_suffix("").parts for path in package.rglob("*.py")}
    names = {".".join(own).removesuffix(".__init__"): path for path, own in parts.items()}
    found: dict[str, set[str]] = {}
    for name, path in names.items():
        found[name] = set()
        for _, target, imported in imports(path):
            dots = len(target) - len(target.lstrip("."))
            if dots:
                base = [*parts[path][: len(parts[path]) - dots], *filter(None, target[dots:].split("."))]
                known = [".".join([*base, one]) for one in imported]
                found[name] |= {one if one in names else ".".join(base) for one in known} & names.keys()
    return found


@pytest.mark.parametrize("package", BESIDE.values(), ids=BESIDE)
def test_no_module_imports_itself_by_way_of_others(package: Path) -> None:
    left = package_imports(package)
    assert left
    while free := {name for name, others in left.items() if not others & left.keys() - {name}}:
        left = {name: others for name, others in left.items() if name not in free}
    # What is left imports, or is imported by, a circle.
    assert sorted(left) == []


@pytest.mark.parametrize("package", BESIDE.values(), ids=BESIDE)
def test_package_imports_itself_relatively(package: Path) -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {target}"
        for path in package.rglob("*.py")
        for line, target, _ in imports(path)
        if target.split(".")[0] == package.name
    ]
    assert wrong == []


def test_the_extension_never_imports_what_stands_beside_it() -> None:
    files = [path for path in PACKAGE.rglob("*.py") if path != DOOR]
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {target}"
        for path in files
        for line, target, _ in imports(path)
        if target.split(".")[0] in BESIDE
    ]
    named = [path.name for path in files if "digiclay_paper" in path.read_text(encoding="utf-8")]
    assert (wrong, named) == ([], [])
    assert "digiclay_paper" in DOOR.read_text(encoding="utf-8")


@pytest.mark.parametrize("package", BESIDE.values(), ids=BESIDE)
def test_what_stands_beside_the_extension_imports_no_part_of_its_neighbor(package: Path) -> None:
    others = {name for name, path in BESIDE.items() if path != package}
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
