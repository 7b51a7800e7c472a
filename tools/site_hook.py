"""Hook of MkDocs (`mkdocs.yml`): pages made at the build, anchors and links as in the repository."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

import site_pages
from manual import make_anchor
from mkdocs.structure.files import File

#: Page that lists the packages of the code; the pages of the packages follow it in the navigation.
PYTHON = "reference/python.md"


def _lists(nav: list[Any]) -> Iterator[list[Any]]:
    """Yield the lists of a navigation, from the outside inwards."""
    yield nav
    for entry in nav:
        for inside in entry.values() if isinstance(entry, dict) else ():
            if isinstance(inside, list):
                yield from _lists(inside)


def on_config(config: Any) -> None:
    """Set the form of the anchors, and add the packages to the navigation."""
    config.mdx_configs.setdefault("toc", {})["slugify"] = make_anchor
    pages = [{name: f"reference/python/{name}.md"} for name in site_pages.list_packages()]
    places = [one for one in _lists(config.nav) if PYTHON in one]
    if len(places) != 1:
        raise ValueError(
            f"mkdocs.yml: nav must have {PYTHON} once, got {len(places)}: packages are added there"
        )
    places[0].extend(pages)


def on_files(files: Any, config: Any) -> None:
    """Add the pages that are made from the code, those from outside docs/, and the measured results."""
    packages = site_pages.list_packages()
    made: dict[str, str | bytes] = {
        "reference/commands.md": site_pages.make_commands_page(),
        "reference/parameters.md": site_pages.make_parameters_page(),
        PYTHON: site_pages.make_packages_page(packages),
    }
    for name, modules in packages.items():
        made[f"reference/python/{name}.md"] = site_pages.make_package_page(name, modules)
    for page, source in site_pages.ELSEWHERE.items():
        made[page] = (site_pages.ROOT / source).read_text(encoding="utf-8")
    for path in (site_pages.ROOT / "benchmarks" / "results").iterdir():
        place = site_pages.find_place(path.relative_to(site_pages.ROOT).as_posix())
        if place:
            made[place] = path.read_bytes()
    for place, content in made.items():
        files.append(File.generated(config, place, content=content))


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Return the text of a page with the links of the site."""
    place = page.file.src_uri
    if place.startswith("reference/"):
        return markdown
    source = site_pages.ELSEWHERE.get(place, f"docs/{place}")
    return site_pages.relink(markdown, source, place)
