"""The built pages: links, anchors and pictures lead to something; nothing is loaded from elsewhere."""

import functools
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from tests.scene_files import read_text, write_text

#: Attributes that load something as soon as the page is opened.
LOADED = {("img", "src"), ("script", "src"), ("link", "href"), ("iframe", "src"), ("source", "src")}
STYLES = re.compile(r"url\(\s*[\"']?([^\"')]+)|@import\s+[\"']([^\"']+)")


class Page(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "id" or (tag == "a" and name == "name"):
                self.anchors.add(value or "")
            elif tag == "a" and name == "href":
                self.links.append(value or "")
            elif (tag, name) in LOADED and ("rel", "canonical") not in attrs:
                self.loaded.append(value or "")


@functools.cache
def read_page(path: Path) -> Page:
    return Page(read_text(path))


def broken(site: Path, path: Path) -> list[str]:
    """Return the links of a page, and what it loads, that lead to no file or to no anchor of one."""
    page, wrong = read_page(path), []
    for target in (*page.links, *page.loaded):
        parts = urlsplit(target)
        if parts.scheme in ("http", "https", "mailto", "data", "javascript"):
            continue
        there = (path.parent / unquote(parts.path)).resolve() if parts.path else path
        anchor = unquote(parts.fragment)
        known = there.is_file() and site.resolve() in there.parents
        if known and anchor and there.suffix == ".html":
            known = anchor in read_page(there).anchors | {"__top"}
        if not known:
            wrong.append(target)
    return wrong


@pytest.fixture(scope="module")
def pages(site: Path) -> list[Path]:
    """All pages of the site, but the one for addresses that do not exist: it is not opened from a file."""
    return [path for path in sorted(site.rglob("*.html")) if path.name != "404.html"]


def test_every_link_and_picture_of_the_site_leads_to_something(
    site: Path, pages: list[Path]
) -> None:
    found = {path.relative_to(site).as_posix(): broken(site, path) for path in pages}
    assert len(found) > 50
    assert sum(len(read_page(path).links) for path in pages) > 3000
    assert {name: wrong for name, wrong in found.items() if wrong} == {}
    schemes = {urlsplit(link).scheme for path in pages for link in read_page(path).links}
    assert schemes <= {"", "https", "mailto"}  # those to other machines are not followed


def test_a_page_with_a_missing_file_anchor_or_picture_is_noticed(tmp_path: Path) -> None:
    text = '<h2 id="a">A</h2><a href="#a">1</a><a href="#b">2</a><a href="x.html">3</a><img src="p.png">'
    write_text(tmp_path / "page.html", text)
    assert broken(tmp_path, tmp_path / "page.html") == ["#b", "x.html", "p.png"]


def test_no_page_loads_anything_from_another_machine(site: Path, pages: list[Path]) -> None:
    loaded = {one for path in pages for one in read_page(path).loaded}
    sheets = {path.name: read_text(path) for path in site.rglob("*.css")}
    styled = {one or two for text in sheets.values() for one, two in STYLES.findall(text)}
    assert len(loaded) > 10
    assert len(sheets) > 1
    assert [one for one in loaded | styled if "//" in one and not one.startswith("data:")] == []


def test_the_search_has_every_page(site: Path, pages: list[Path]) -> None:
    text = read_text(site / "search" / "search_index.js")
    docs = json.loads(text[text.index("{") :])["docs"]
    found = {entry["location"].partition("#")[0] or "index.html" for entry in docs}
    assert {path.relative_to(site).as_posix() for path in pages} == found
