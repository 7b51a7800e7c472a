"""The site's navigation (`mkdocs.yml`): every page has its line."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[2]
#: Pages of the navigation that `tools/site_pages.py` makes at the build.
MADE = {"benchmarks.md", "changes.md", "contributing.md"}


def _targets(entry: Any) -> Iterator[str]:
    """Yield the pages of an entry of the navigation, in order."""
    if isinstance(entry, str):
        yield entry
    for one in entry.values() if isinstance(entry, dict) else entry if isinstance(entry, list) else ():
        yield from _targets(one)


@pytest.fixture(scope="module")
def listed() -> list[str]:
    """The pages of the navigation."""
    return list(_targets(yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]))


def test_every_page_is_in_the_navigation_of_the_site(listed: list[str]) -> None:
    pages = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")}
    assert sorted(pages - set(listed)) == [], "each page needs a line under nav in mkdocs.yml"


def test_the_navigation_names_each_page_once_and_none_that_is_missing(listed: list[str]) -> None:
    written = [name for name in listed if name not in MADE and not name.startswith("reference/")]
    assert [name for name in written if not (ROOT / "docs" / name).is_file()] == []
    assert len(listed) == len(set(listed)) > 25
    assert {*listed} >= MADE
