"""The index page needs nothing but itself, and pictures are what they say they are."""

from __future__ import annotations

import base64
import re
from collections import Counter
from html import unescape
from io import BytesIO

import matplotlib.image
import numpy as np
import pytest
from digiclay.commands.gallery import Card, height_map, page
from digiclay.core.files.formats import encode_png


def read(made: str) -> list[str]:
    """Return what a page refers to; its tags are closed."""
    tags = re.findall(r"<(/?)(\w+)", made)
    opened, closed = (Counter(tag for end, tag in tags if end == kind) for kind in ("", "/"))
    assert opened - Counter(dict.fromkeys(("meta", "img", "br"), len(tags))) == closed
    return [unescape(found) for found in re.findall(r'(?:src|href)="([^"]*)"', made)]


def test_the_page_refers_to_nothing_but_files_beside_it_and_holds_its_thumbnails() -> None:
    picture = encode_png(np.full((3, 5, 3), 77, np.uint8))
    done = Card("a", picture, [("lag", "1 mm")], [("film", "runs/a b/film #1.mp4")], leads="f.mp4")
    failed = Card("b", error="it broke", links=[("log", "l")])
    leads, shown, *links = read(page("Batch", "1 of 2 jobs done.", [done, failed]))
    kind, _, data = shown.partition(",")
    assert (kind, base64.b64decode(data)) == ("data:image/png;base64", picture)
    assert [leads, *links] == ["f.mp4", "runs/a%20b/film%20%231.mp4", "l"]


def test_names_and_errors_are_shown_as_they_are_and_never_as_html() -> None:
    nasty = '<script>alert("x")</script> & Söhne'
    made = page(nasty, nasty, [Card(nasty, facts=[(nasty, nasty)]), Card(nasty, error=nasty)])
    assert read(made) == []
    assert "<script" not in made
    assert unescape(made).count(nasty) == 8  # the title stands in the head as well


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
