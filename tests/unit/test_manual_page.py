"""The shipped manual: made from the guide as it is, one page that leads nowhere else."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def maker() -> ModuleType:
    """The program that makes the page."""
    spec = importlib.util.spec_from_file_location("manual", ROOT / "tools" / "manual.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def page(maker: ModuleType) -> str:
    """The page in the extension's folder."""
    text: str = maker.PAGE.read_bytes().decode("utf-8")
    return text


def test_the_shipped_page_is_the_one_the_guide_makes(maker: ModuleType, page: str) -> None:
    assert page == maker.render(maker.GUIDE.read_text(encoding="utf-8")), "run `python tools/manual.py`"


def test_every_heading_and_table_of_the_guide_is_on_the_page(maker: ModuleType, page: str) -> None:
    guide = maker.GUIDE.read_text(encoding="utf-8")
    headings = re.findall(r"^#+ (.*)$", guide, re.MULTILINE)
    assert re.findall(r"<h\d[^>]*>(.*?)</h\d>", page) == headings
    assert page.count("<table>") == len(re.findall(r"^\|[-|]+\|$", guide, re.MULTILINE)) > 8
    # No Markdown is left between the tags.
    assert re.findall(r"\*\*|\]\(|^\|", re.sub(r"<style>.*</style>", "", page, flags=re.DOTALL)) == []


def test_every_link_of_the_page_leads_to_one_of_its_headings(page: str) -> None:
    anchors = re.findall(r'<h\d id="([^"]+)"', page)
    links = re.findall(r'href="([^"]*)"', page)
    assert len(links) >= len(anchors) - 1 > 8  # the contents have all but the title
    assert {link.removeprefix("#") for link in links} <= set(anchors)
    assert all(link.startswith("#") for link in links)


def test_the_page_runs_nothing_loads_nothing_and_is_small(page: str) -> None:
    assert re.findall(r"<(?:script|img|link|iframe|object)\b|\bon\w+=|\bsrc=|url\(|@import|://", page) == []
    assert "prefers-color-scheme: dark" in page
    assert len(page.encode()) < 60_000


def test_pictures_are_dropped_and_links_to_other_pages_are_text(maker: ModuleType) -> None:
    guide = "# A\n\n![caption](one.jpg)\n\n## First ridge\n\n"
    guide += "See [b c](other.md#d), [it](#first-ridge) and **F1**.\n"
    made: str = maker.render(guide)
    assert "caption" not in made
    assert '<p>See <span>b c</span>, <a href="#first-ridge">it</a> and <strong>F1</strong>.</p>' in made
