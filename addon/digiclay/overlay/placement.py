"""Placement of the overlay in a view, and of its sections; no Blender."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..ui_text import localize
from .picture import Box, Look, Picture
from .sections import ROW, SECTIONS, Pen, Readings, describe_state, force_message


def _brief_height(told: Readings) -> float:
    """Return the height of the brief section, pixels at a UI scale of 1."""
    return 2 * ROW


def _draw_brief(told: Readings, pen: Pen, top: float) -> None:
    """Write force, set point, simulated time and state in two rows."""
    now = localize("no force yet")
    if told.force.size:
        now = force_message(float(told.force[-1]), beyond=told.beyond)
    asked = "" if told.set_point is None else localize("of {:.2f} N", told.set_point)
    top = pen.row(top, now, asked)
    pen.row(top, f"{float(told.time[-1]) if told.time.size else 0.0:.1f} s", describe_state(told))


#: How tall the section is, and how it is drawn.
BRIEF = ((_brief_height, _draw_brief),)


class Content(NamedTuple):
    """Sections of the overlay, and their width at a UI scale of 1, pixels."""

    sections: tuple[Any, ...]
    width: float


COMPACT, FULL = Content(BRIEF, 190.0), Content(SECTIONS, 290.0)
#: Corners, and the height that Blender's own text and gizmos take there at a UI scale of 1, pixels.
CORNERS = {"top_left": 54.0, "top_right": 220.0, "bottom_left": 0.0, "bottom_right": 0.0}
#: Sizes at a UI scale of 1, pixels.
MARGIN, PADDING = 12.0, 10.0
#: Opacity of the box behind it all: the bed shines through a little.
BACK_ALPHA = 0.95
#: Most of the room's height that is taken: the bed is what one looks at.
SHARE = 0.75

#: Left, bottom, right and top of a part of the view, pixels.
Room = tuple[float, float, float, float]


def find_room(width: float, height: float, covered: list[tuple[str, float]]) -> Room:
    """Return the part of a view that no panel covers.

    `width`, `height`: of the view, pixels; `covered`: side on which a panel lies over the view (LEFT, RIGHT,
    TOP or BOTTOM), and how deep it is.
    """
    deep = {"LEFT": 0.0, "RIGHT": 0.0, "TOP": 0.0, "BOTTOM": 0.0}
    for side, depth in covered:
        deep[side] += depth
    return deep["LEFT"], deep["BOTTOM"], width - deep["RIGHT"], height - deep["TOP"]


def lay_out(
    told: Readings,
    look: Look,
    room: Room,
    scale: float,
    content: Content = FULL,
    corner: str = "bottom_right",
) -> Picture:
    """Lay the overlay out in a corner of the room there is.

    Where the view is low, sections there is no room for are left away; where it is narrow, all.

    `scale`: the UI scale: pixels for each of the sizes; `corner`: a key of `CORNERS`.
    """
    left, bottom, right, top = room
    at_top, at_left = corner.startswith("top"), corner.endswith("left")
    top -= CORNERS[corner] * scale
    width, margin, padding = content.width * scale, MARGIN * scale, PADDING * scale
    space, sections = SHARE * (top - bottom) - 2 * padding, []
    for height_of, draw in content.sections:
        height = height_of(told) * scale
        if 0.0 < height <= space:
            sections.append((height, draw))
            space -= height
    picture = Picture()
    if not sections or right - left < width + 2 * margin:
        return picture
    tall = sum(height for height, _ in sections) + 2 * padding
    x = left + margin if at_left else right - margin - width
    y = top - margin - tall if at_top else bottom + margin
    picture.boxes.append(Box(x, y, width, tall, look.back, BACK_ALPHA))
    pen = Pen(picture, look, x + padding, width - 2 * padding, scale)
    y += tall - padding
    for height, draw in sections:
        draw(told, pen, y)
        y -= height
    return picture
