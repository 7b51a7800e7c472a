"""Brief section of the overlay: force, set point, time and state in two rows; no Blender."""

from __future__ import annotations

from ..ui_text import localize
from .sections import ROW, Pen, Readings, describe_state, force_message


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
