"""Drawing of the overlay, and of the patch under the Press tool's cursor, by Blender's gpu module."""

import math
from collections.abc import Sequence
from typing import Any

import blf
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..core.base.arrays import Floats
from .picture import Color, Dot, Line, Picture, Words

#: Corners of a dot.
CORNERS = 20
#: Length of a dash and of the space after it, in widths of the line.
DASH = 4.0
FONT = 0


def draw(picture: Picture, width: float, height: float) -> None:
    """Draw a picture into a region of a size in pixels. `width`, `height`: of the region, pixels."""
    gpu.state.blend_set("ALPHA")
    try:
        for box in picture.boxes:
            right, top = box.x + box.width, box.y + box.height
            corners = np.array([[box.x, box.y], [right, box.y], [right, top], [box.x, top]])
            _fill(corners, [(0, 1, 2), (0, 2, 3)], box.color, box.alpha)
        for line in picture.lines:
            _stroke(line, (width, height))
        for dot in picture.dots:
            _dot(dot)
        for words in picture.words:
            _write(words)
    finally:
        gpu.state.blend_set("NONE")


def cursor(lines: list[Line], words: Sequence[Words] = ()) -> None:
    """Draw lines and text about the mouse. `words`: in pixels of the window."""
    _, _, width, height = gpu.state.viewport_get()
    draw(Picture(lines=lines, words=list(words)), width, height)


def _stroke(line: Line, size: tuple[float, float]) -> None:
    """Draw a line into a region of a size in pixels, with smooth edges."""
    points = _dashes(line) if line.dashed else line.points
    kind = "LINES" if line.dashed or line.pairs else "LINE_STRIP"
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    flat = np.column_stack([points, np.zeros(len(points))]).astype(np.float32)
    batch = batch_for_shader(shader, kind, {"pos": flat})
    shader.bind()
    shader.uniform_float("viewportSize", size)
    shader.uniform_float("lineWidth", line.width)
    shader.uniform_float("color", (*line.color, 1.0))
    batch.draw(shader)


def _dashes(line: Line) -> Floats:
    """Return ends of dashes (2 k, 2) along a straight line from its first to its last point."""
    start, end = line.points[0], line.points[-1]
    count = max(1, int(np.linalg.norm(end - start) / (2.0 * DASH * line.width)))
    share = (np.arange(count)[:, None] + [0.0, 0.5]).ravel() / count
    return start + (end - start) * share[:, None]


def _dot(dot: Dot) -> None:
    """Draw a filled circle."""
    turn = np.linspace(0.0, 2.0 * math.pi, CORNERS, endpoint=False)
    rim = np.column_stack([dot.x + dot.radius * np.cos(turn), dot.y + dot.radius * np.sin(turn)])
    _fill(rim, [(0, i, i + 1) for i in range(1, CORNERS - 1)], dot.color, 1.0)


def _fill(
    points: Floats, triangles: list[tuple[int, int, int]], color: Color, alpha: float
) -> None:
    """Fill a convex shape."""
    shader: Any = gpu.shader.from_builtin("UNIFORM_COLOR")
    batch = batch_for_shader(shader, "TRIS", {"pos": points.astype(np.float32)}, indices=triangles)
    shader.bind()
    shader.uniform_float("color", (*color, alpha))
    batch.draw(shader)


def measure(text: str, size: float) -> float:
    """Return the width of a text of a size, pixels."""
    blf.size(FONT, size)
    return float(blf.dimensions(FONT, text)[0])


def _write(words: Words) -> None:
    """Write a line of text."""
    blf.size(FONT, words.size)
    blf.color(FONT, *words.color, 1.0)
    x = words.x - measure(words.text, words.size) if words.to_the_right_end else words.x
    blf.position(FONT, round(x), round(words.y), 0.0)
    blf.draw(FONT, words.text)
