"""Pictures of the docs: each has the command that makes it (CONTRIBUTING.md), and is shown."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.form.test_pages import PAGES

ROOT = Path(__file__).parents[2]
TABLE = ROOT / "CONTRIBUTING.md"
ROW = re.compile(r"^\| (`[\w.]+\.(?:jpg|png)`.*?) \| (.*) \|$", re.MULTILINE)
SHOWN = re.compile(r"!\[[^\]]*\]\(([^)\s]+)\)")


@pytest.fixture(scope="module")
def made() -> dict[str, str]:
    """The command of each picture of the table."""
    table = ROW.findall(TABLE.read_text(encoding="utf-8"))
    return {name: made for names, made in table for name in re.findall(r"`([^`]+)`", names)}


def test_every_picture_is_shown_and_has_a_row_of_the_table(made: dict[str, str]) -> None:
    targets = [(page, found) for page in PAGES for found in SHOWN.findall(page.read_text(encoding="utf-8"))]
    shown = {(page.parent / target).resolve() for page, target in targets}
    assert sorted(made) == sorted(path.name for path in shown)
    assert sorted(set((ROOT / "docs" / "pictures").iterdir()) - shown) == []


def test_what_makes_a_picture_exists(made: dict[str, str]) -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for name, cell in made.items():
        command = next(iter(re.findall(r"`([^`]+)`", cell)), "")
        if command.startswith("python tools/"):
            source = (ROOT / command.split()[1]).read_text(encoding="utf-8")
            assert f'"{name}"' in source, command
        elif command.startswith("make "):
            assert f"\n{command.removeprefix('make ')}:" in makefile
        elif not command:  # a page has the command
            assert re.search(r"\]\(docs/\w+\.md#|same section", cell), name
        else:  # tests.form.test_pages.py checks the arguments
            assert command.startswith(("python -m benchmarks ", "digiclay "))
