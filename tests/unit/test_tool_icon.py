"""The Press tool's icon is what its drawing in tools/ gives."""

from __future__ import annotations

import runpy
from pathlib import Path

TOOL = runpy.run_path(str(Path(__file__).parents[2] / "tools" / "tool_icon.py"))


def test_the_icon_is_that_of_the_drawing() -> None:
    assert TOOL["ICON"].read_bytes() == TOOL["encode"]()


def test_every_triangle_faces_the_viewer() -> None:
    def area(triangle: tuple[tuple[int, int], ...]) -> int:
        (a, b), (c, d), (e, f) = triangle
        return (c - a) * (f - b) - (e - a) * (d - b)

    assert min(area(corners) for corners, _ in TOOL["draw"]()) > 0
