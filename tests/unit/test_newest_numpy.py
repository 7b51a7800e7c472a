"""What numpy has begun to warn of, wherever the tests happen to run with an older one."""

from __future__ import annotations

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "addon" / "digiclay"
#: Numpy 2.5 warns where these get a third argument: the array for the result must be called `out`.
NAMED_OUT = {"maximum", "minimum"}


def unnamed(code: str) -> list[int]:
    """Return the lines on which a result's array is handed in without its name."""
    return [
        node.lineno
        for node in ast.walk(ast.parse(code))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr in NAMED_OUT
        and len(node.args) > 2
    ]


def test_an_unnamed_result_is_found() -> None:
    assert unnamed("np.maximum(a, b, out=c)\nnp.maximum(a, b, c)") == [2]


def test_no_maximum_or_minimum_has_an_unnamed_result() -> None:
    found = {path.name: unnamed(path.read_text(encoding="utf-8")) for path in PACKAGE.rglob("*.py")}
    assert {name: lines for name, lines in found.items() if lines} == {}
