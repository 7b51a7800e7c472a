"""Index page of a job series, one self-contained HTML file, and its thumbnails."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from ..core.base.errors import OutputError
from ..core.files.formats import encode_png
from ..core.files.run_folder import write_whole
from ..device.heat import COLORS

#: Files that can be one; and its width, pixels.
NAMES = ("thumbnail.jpg", "thumbnail.png")
WIDTH = 320


def of_picture(still: Path, folder: Path) -> None:
    """Make one of a picture that Blender has drawn. `folder`: of the thumbnail."""
    from ..compat import bpy, scratch

    out = folder / NAMES[0]
    with scratch():
        image = bpy.data.images.load(str(still))
        wide, high = image.size
        image.scale(WIDTH, max(1, round(WIDTH * high / wide)))
        image.file_format = "JPEG"
        try:
            image.save(filepath=str(out), quality=85)
        except RuntimeError as error:
            raise OutputError(f"{out} cannot be written: {' '.join(str(error).split())}") from None


def of_heights(height: NDArray[np.float64], rows: int, columns: int, folder: Path) -> None:
    """Make one of heights (n,), seen from above."""
    write_whole(folder / NAMES[1], encode_png(height_map(height.reshape(rows, columns))))


def height_map(height: NDArray[np.float64], wide: int = WIDTH) -> NDArray[np.uint8]:
    """Return a bed seen from above as pixels (rows, columns, 3): dark is low, bright is high."""
    every = max(1, -(-max(height.shape) // wide))
    shown = height[::every, ::every][::-1]
    times = max(1, wide // max(shown.shape))
    level = (shown - shown.min()) / max(float(np.ptp(shown)), 1e-9) * (len(COLORS) - 1)
    codes = np.arange(len(COLORS))
    colors = np.stack([np.interp(level, codes, channel) for channel in np.array(COLORS).T], axis=-1)
    return (colors * 255.0 + 0.5).astype(np.uint8).repeat(times, axis=0).repeat(times, axis=1)


STYLE = """\
:root { color-scheme: light dark; --ink: #1a1f26; --faded: #5a626d; --paper: #f4f5f6; --card: #fff;
  --edge: #d5d9de; --bad: #b3261e; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e8eaed; --faded: #9aa3ae; --paper: #15181c; --card: #1f2429;
    --edge: #353c44; --bad: #ff8a80; } }
body { font: 15px/1.45 system-ui, sans-serif; color: var(--ink); background: var(--paper); margin: 2rem auto;
  max-width: 1400px; padding: 0 1rem; }
h1 { font-size: 1.5rem; margin: 0 0 .2rem; } p { color: var(--faded); margin: 0 0 1.2rem; }
main { display: grid; gap: 1rem; grid-template-columns: repeat(auto-fill, minmax(280px, 1fr)); }
article { background: var(--card); border: 1px solid var(--edge); border-radius: 8px; overflow: hidden; }
article img { display: block; width: 100%; aspect-ratio: 8 / 5; object-fit: contain; background: #cbced1; }
article div { padding: .6rem .8rem .8rem; }
h2 { font-size: 1rem; margin: 0 0 .3rem; overflow-wrap: anywhere; }
dl { display: grid; grid-template-columns: auto 1fr; gap: .1rem .8rem; margin: 0 0 .5rem; font-size: .87rem; }
dt { color: var(--faded); } dd { margin: 0; text-align: right; font-variant-numeric: tabular-nums; }
a { color: inherit; margin-right: .7rem; font-size: .87rem; } a.picture { margin: 0; }
.failed { border-color: var(--bad); } .failed strong { color: var(--bad); }
.failed span { overflow-wrap: anywhere; }
table { border-collapse: collapse; margin: .6rem 0 1.2rem; font-size: .87rem;
  display: block; overflow-x: auto; }
th, td { border-bottom: 1px solid var(--edge); padding: .2rem .7rem .2rem 0; text-align: right;
  vertical-align: top; font-variant-numeric: tabular-nums; }
th { color: var(--faded); font-weight: normal; }
th:first-child, td:first-child { text-align: left; }
p > img { max-width: 100%; background: #fff; }
"""


@dataclass(frozen=True)
class Card:
    """Content of the page for one job."""

    name: str
    #: A small JPEG or PNG; empty where there is none.
    thumbnail: bytes = b""
    #: What is measured, and its value with unit.
    facts: Sequence[tuple[str, str]] = field(default_factory=tuple)
    #: What a file is, and its path from the page.
    links: Sequence[tuple[str, str]] = field(default_factory=tuple)
    #: Path of what the thumbnail leads to; empty where it leads nowhere.
    leads: str = ""
    #: Why the job was not done; empty where it was.
    error: str = ""


def page(title: str, summary: str, cards: Sequence[Card], refresh: int = 0) -> str:
    """Return the page of a batch; a browser loads it again after `refresh` seconds, never for 0."""
    body = [f"<p>{escape(summary)}</p>", "<main>", *(_card(card) for card in cards), "</main>"]
    return wrap(title, body, refresh)


def wrap(title: str, body: Sequence[str], refresh: int = 0) -> str:
    """Return a self-contained page of lines of HTML."""
    again = [f'<meta http-equiv="refresh" content="{refresh}">'] if refresh else []
    lines = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        *again,
        f"<title>{escape(title)}</title>",
        f"<style>\n{STYLE}</style></head><body>",
        f"<h1>{escape(title)}</h1>",
        *body,
        "</body></html>",
    ]
    return "\n".join(lines) + "\n"


def make_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a table."""
    cells = [("th", head), *(("td", row) for row in rows)]
    lines = ["".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in row) for tag, row in cells]
    return ["<table>", *(f"<tr>{line}</tr>" for line in lines), "</table>"]


def make_links(links: Sequence[tuple[str, str]]) -> str:
    """Return links to files beside the page."""
    return "\n".join(f'<a href="{escape(quote(path))}">{escape(name)}</a>' for name, path in links)


def _card(card: Card) -> str:
    """Return one job's part of the page."""
    name, links = escape(card.name), make_links(card.links)
    if card.error:
        why = f"<strong>failed</strong> <span>{escape(card.error)}</span>"
        return f'<article class="failed"><div><h2>{name}</h2>{why}<br>{links}</div></article>'
    facts = "".join(
        f"<dt>{escape(fact)}</dt><dd>{escape(value)}</dd>" for fact, value in card.facts
    )
    return f"<article>{_picture(card)}<div><h2>{name}</h2><dl>{facts}</dl>{links}</div></article>"


def _picture(card: Card) -> str:
    """Return the thumbnail, within the page."""
    if not card.thumbnail:
        return ""
    kind = "png" if card.thumbnail.startswith(b"\x89PNG") else "jpeg"
    data = base64.b64encode(card.thumbnail).decode("ascii")
    shown = f'<img alt="{escape(card.name)}" src="data:image/{kind};base64,{data}">'
    return (
        f'<a class="picture" href="{escape(quote(card.leads))}">{shown}</a>'
        if card.leads
        else shown
    )
