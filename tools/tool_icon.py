"""Write the icon of the Press tool: `python tools/tool_icon.py`.

Blender's tool icons are triangles on a square of 256 x 256: a head of 8 bytes, then three corners of two
bytes for each triangle, then a color of four bytes for each corner.
"""

import math
from collections.abc import Iterator
from pathlib import Path

ICON = Path(__file__).parents[1] / "addon" / "digiclay" / "press" / "press_tool.dat"
#: First bytes: the format, width and height less one, and the first corner of the drawing.
HEAD = b"VCO\x00" + bytes((255, 255, 0, 0))
#: sRGB with opacity: pins as the lines of Blender's own icons, the fingertip in the color of its ball.
PIN, TIP = (229, 229, 229, 255), (232, 153, 120, 255)
#: Pins: left edge of each, their width, their foot, and their tops, lowest under the fingertip.
LEFT, WIDE, FOOT = (28, 70, 112, 154, 196), 32, 30
TOPS = (128, 104, 84, 104, 128)
#: Middle and half sizes of the fingertip; its corners.
MIDDLE, HALF, CORNERS = (128, 164), (56, 62), 28

Point = tuple[int, int]
Triangle = tuple[Point, Point, Point]
Color = tuple[int, int, int, int]


def draw() -> Iterator[tuple[Triangle, Color]]:
    """Yield the triangles of five pins and a fingertip that presses them, with their colors."""
    for left, top in zip(LEFT, TOPS, strict=True):
        a, b, c, d = (left, FOOT), (left + WIDE, FOOT), (left + WIDE, top), (left, top)
        yield (a, b, c), PIN
        yield (a, c, d), PIN
    turns = [2.0 * math.pi * corner / CORNERS for corner in range(CORNERS)]
    rim = [
        (round(MIDDLE[0] + HALF[0] * math.cos(turn)), round(MIDDLE[1] + HALF[1] * math.sin(turn)))
        for turn in turns
    ]
    for corner in range(1, CORNERS - 1):
        yield (rim[0], rim[corner], rim[corner + 1]), TIP


def encode() -> bytes:
    """Return the icon's file."""
    triangles = list(draw())
    corners = bytes(number for corners, _ in triangles for point in corners for number in point)
    colors = bytes(number for _, color in triangles for number in color * 3)
    return HEAD + corners + colors


if __name__ == "__main__":
    ICON.write_bytes(encode())
    print(ICON)
