"""Texts with values and messages are translated: found by reading the source of what the user sees."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from string import Formatter

import digiclay
from digiclay import translations

from tests.scene_files import read_text

ROOT = Path(digiclay.__file__).parent
FOLDERS = ("operators", "panels", "press", "overlay", "live")
WORD = re.compile(r"[A-Za-z]{3,}")
#: Beginnings of what is no language: names of Blender, lines of a preset, features as files name
#: them.
NAMES = (
    "3D View",
    "Object Mode",
    "Error: ",
    "wm = ",
    "settings",
    "DIGICLAY_PT_part_",
    "use_",
    "session:",
    "display:",
    "shape:",
    ", crest ",
    "    {} mm²",
    "Lengths in ",
)


def source() -> Iterator[tuple[str, ast.Module]]:
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).glob("*.py")):
            yield f"{folder}/{path.name}", ast.parse(read_text(path))


def inner(tree: ast.AST, *kinds: type[ast.AST]) -> set[int]:
    found = (node for node in ast.walk(tree) if isinstance(node, kinds))
    return {id(one) for node in found for one in ast.walk(node)}


def join(node: ast.JoinedStr) -> str:
    return "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)


def test_no_text_with_values_escapes_translation() -> None:
    found = [
        f"{name}:{node.lineno}: {join(node)}"
        for name, tree in source()
        for raised in [inner(tree, ast.Raise)]
        for node in ast.walk(tree)
        if isinstance(node, ast.JoinedStr) and id(node) not in raised
        if WORD.search(join(node).replace("{}", "")) and not join(node).startswith(NAMES)
    ]
    assert found == []


def test_every_report_goes_through_the_one_function() -> None:
    plain = [
        f"{name}:{node.lineno}"
        for name, tree in source()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr == "report"
        if isinstance(node.args[1], ast.Constant | ast.JoinedStr)
    ]
    assert plain == []


def test_a_translation_has_the_places_of_its_text() -> None:
    def places(text: str) -> list[tuple[str | None, str | None]]:
        return [(spec, how) for _, name, spec, how in Formatter().parse(text) if name is not None]

    messages = translations._catalog("de")["messages"]
    assert [text for text, german in messages.items() if places(text) != places(german)] == []
