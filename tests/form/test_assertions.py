"""Every test judges something: it asserts, expects an error or a warning, or calls a helper that does."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
#: What judges besides an assert, by its last name.
JUDGES = {"raises", "warns", "fail"}


def calls(function: ast.AST) -> Iterator[str]:
    """Yield the last name of all that is called in a function: ``path`` of ``a.path(...)`` too."""
    for node in ast.walk(function):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute | ast.Name):
            yield node.func.attr if isinstance(node.func, ast.Attribute) else node.func.id


def asserts(function: ast.AST) -> bool:
    """Return whether a function asserts more than a constant, or expects an error."""
    constant = [isinstance(n.test, ast.Constant) for n in ast.walk(function) if isinstance(n, ast.Assert)]
    return not all(constant) or any(name in JUDGES or name.startswith("assert_") for name in calls(function))


def find_idle(sources: dict[str, str]) -> list[str]:
    """Return ``file::test`` of the tests that judge nothing, neither themselves nor by a helper."""
    functions = [
        (name, node)
        for name, source in sources.items()
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    ]
    judges = {node.name for _, node in functions if not node.name.startswith("test") and asserts(node)}
    return [
        f"{name}::{node.name}"
        for name, node in functions
        if node.name.startswith("test") and not asserts(node) and judges.isdisjoint(calls(node))
    ]


def test_every_test_judges_something() -> None:
    paths = (ROOT / "tests").rglob("*.py")
    assert find_idle({str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in paths}) == []


@pytest.mark.parametrize(
    ("body", "idle"),
    [
        ("run()", True),
        ("value = run(); assert 'always'", True),
        ("check(run())", False),
        ("raises(E)", False),
    ],
)
def test_a_test_that_judges_nothing_is_found(body: str, idle: bool) -> None:
    source = f"def run(): return 1\ndef check(value):\n    assert value\ndef test_it():\n    {body}\n"
    assert bool(find_idle({"tests/test_it.py": source})) == idle
