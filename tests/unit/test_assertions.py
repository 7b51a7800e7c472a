"""Every test judges something: it asserts, expects an error or a warning, or calls a helper that does."""

from __future__ import annotations

import ast
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
#: What judges besides an assert, by its last name.
JUDGES = {"raises", "warns", "fail"}
Function = ast.FunctionDef | ast.AsyncFunctionDef


def called(function: ast.AST) -> Iterator[str]:
    """Yield the last name of all that is called in a function: ``path`` of ``a.path(...)`` too."""
    for node in ast.walk(function):
        if isinstance(node, ast.Call):
            target = node.func
            if isinstance(target, (ast.Attribute, ast.Name)):
                yield target.attr if isinstance(target, ast.Attribute) else target.id


def asserts(function: ast.AST) -> bool:
    """Tell whether a function judges by itself: an assert of more than a constant, or an expected error."""
    for node in ast.walk(function):
        if isinstance(node, ast.Assert) and not isinstance(node.test, ast.Constant):
            return True
    return any(name in JUDGES or name.startswith("assert_") for name in called(function))


def functions(tree: ast.AST) -> Iterator[Function]:
    """Yield the functions of a module, inner ones and methods too."""
    return (node for node in ast.walk(tree) if isinstance(node, Function))


def imported(tree: ast.AST) -> set[str]:
    """Return the names a module takes from other modules of the tests."""
    return {
        name.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("tests")
        for name in node.names
    }


def idle(sources: dict[str, str]) -> list[str]:
    """Return ``file::test`` of the tests that judge nothing.

    A helper counts where it is a plain function of the same file or imported from another file of the
    tests, and judges by itself.
    """
    trees = {name: ast.parse(source) for name, source in sources.items()}
    helpers = {
        name: {one.name for one in functions(tree) if not one.name.startswith("test") and asserts(one)}
        for name, tree in trees.items()
    }
    everywhere = set().union(*helpers.values())
    found = []
    for name, tree in trees.items():
        known = helpers[name] | (everywhere & imported(tree))
        for test in functions(tree):
            if test.name.startswith("test") and not asserts(test) and known.isdisjoint(called(test)):
                found.append(f"{name}::{test.name}")
    return found


def test_every_test_asserts_something() -> None:
    sources = {
        str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
        for path in (ROOT / "tests").rglob("*.py")
    }
    assert idle(sources) == []


@pytest.mark.parametrize(
    "body",
    [
        "run()",
        "assert True",
        "value = run()\nassert 'always'",
        "def inner():\n    return run()\ninner()",
        "...",
    ],
)
def test_a_test_that_asserts_nothing_is_found(body: str) -> None:
    source = f"def run():\n    return 1\n\ndef test_one():\n{textwrap.indent(body, '    ')}\n"
    assert idle({"tests/test_it.py": source}) == ["tests/test_it.py::test_one"]


@pytest.mark.parametrize(
    "body", ["assert run() == 1", "with pytest.raises(ValueError):\n    run()", "check(run())", "near(run())"]
)
def test_a_test_that_asserts_is_left_alone(body: str) -> None:
    test = textwrap.indent(body, "    ")
    source = (
        "from tests.other import near\n"
        f"def check(value):\n    assert value\n\ndef run():\n    return 1\n\ndef test_one():\n{test}\n"
    )
    other = "def near(value):\n    assert value > 0.5\n"
    assert idle({"tests/test_it.py": source, "tests/other.py": other}) == []
