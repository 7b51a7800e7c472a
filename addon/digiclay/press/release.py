"""Release of the mouse button that another operator has taken in mid-stroke, a pie menu for example.

Blender does not report whether a button is down. Every event names the event of a key or a button before
it. A mouse move from the window system names the last of them. Timers, and moves that Blender adds or a
test simulates, are copies of Blender's own record: they name the one *before* the last. In the second of
two strokes that one is the release of the first stroke, and it remains so until another key or button is
used. A release therefore counts only when something else has been named since the stroke began: nothing can
take a release without a key or a button that opened it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

Named = tuple[str, str]

PRESS, RELEASE = ("LEFTMOUSE", "PRESS"), ("LEFTMOUSE", "RELEASE")


@dataclass(frozen=True)
class Button:
    """State of the mouse button in a stroke, derived from events.

    Attributes
    ----------
    before : (str, str) or None
        Type and value of the key's or button's event before the press; None until a timer has named it.
    used : bool
        Another key or button has been used since.
    up : bool
        It is up.
    """

    before: Named | None
    used: bool = False
    up: bool = False


def begin_button(value: str, named: Named) -> Button:
    """Return the button at the event by which a stroke begins.

    `value`: value of that event. A drag is a move: it does not name what was before the press; `named` (str,
    str), type and value of the event before, as that event names it.
    """
    return Button(None if value == "CLICK_DRAG" else named)


def read_event(button: Button, kind: str, named: Named) -> Button:
    """Return the button after another event of the stroke, the button's own release apart.

    `kind`: type of the event; `named` (str, str), type and value of the event before, as that event names it.
    """
    if button.before is None:
        return replace(button, before=named) if kind.startswith("TIMER") else button
    used = button.used or named not in (PRESS, button.before)
    return replace(button, used=used, up=used and named == RELEASE)
