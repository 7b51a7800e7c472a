"""The index page needs nothing but itself, and pictures are what they say they are."""

from __future__ import annotations

import base64
from html.parser import HTMLParser
from io import BytesIO

import matplotlib.image
import numpy as np
import pytest
from digiclay.commands.gallery import Card, height_map, page
from digiclay.core.files.formats import encode_png


class Reader(HTMLParser):
    """Collects tags, references and text, and checks that tags are closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.references: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note a tag and what it refers to."""
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)
        self.references += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        """Close the tag that was opened last."""
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Note a text."""
        self.text.append(data)


def read(made: str) -> Reader:
    """Read a page."""
    reader = Reader()
    reader.feed(made)
    reader.close()
    assert reader.open == []
    return reader


def test_the_page_refers_to_nothing_but_files_beside_it_and_holds_its_thumbnails() -> None:
    picture = encode_png(np.full((3, 5, 3), 77, np.uint8))
    done = Card("a", picture, [("lag", "1 mm")], [("film", "runs/a b/film #1.mp4")], leads="f.mp4")
    failed = Card("b", error="it broke", links=[("log", "l")])
    reader = read(page("Batch", "1 of 2 jobs done.", [done, failed]))
    kind, _, data = reader.references.pop(1).partition(",")
    assert (kind, base64.b64decode(data)) == ("data:image/png;base64", picture)
    assert reader.references == ["f.mp4", "runs/a%20b/film%20%231.mp4", "l"]


def test_names_and_errors_are_shown_as_they_are_and_never_as_html() -> None:
    nasty = '<script>alert("x")</script> & Söhne'
    reader = read(page(nasty, nasty, [Card(nasty, facts=[(nasty, nasty)]), Card(nasty, error=nasty)]))
    assert "script" not in reader.open
    assert sum(nasty in text for text in reader.text) == 8  # the title stands in the head as well


@pytest.mark.parametrize("shape", [(1, 1), (7, 3), (40, 61)])
def test_a_png_is_read_back_by_another_program_as_it_was(shape: tuple[int, int]) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (*shape, 3), np.uint8)
    back = matplotlib.image.imread(BytesIO(encode_png(pixels)), format="png")
    np.testing.assert_array_equal(np.round(back[..., :3] * 255.0).astype(np.uint8), pixels)


def test_a_map_of_heights_has_about_the_width_asked_for_and_shows_high_pins_bright_far_ones_above() -> None:
    for shape in ((1, 1), (25, 25), (3, 40), (1000, 700)):
        rows, columns, channels = height_map(np.zeros(shape), 320).shape
        assert (channels, 160 < max(rows, columns) <= 320) == (3, True)
    height = np.zeros((4, 4))
    height[3, 0] = 1.0  # far, left
    shown = height_map(height, 4).astype(int).sum(axis=2)
    assert np.unravel_index(shown.argmax(), shown.shape) == (0, 0)
