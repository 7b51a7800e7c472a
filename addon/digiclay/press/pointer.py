"""Input of the hand: pressure and tilt of a pen, and a mouse button that is up. No Blender."""

import math
from dataclasses import dataclass, replace

import numpy as np

from ..core.base.arrays import Floats
from ..strokes.stroke import Place

#: Lean of a pen at full tilt, rad: tablets report up to some 60°.
FULL_TILT = math.radians(60.0)
#: Exponent of each curve: a soft pen reaches the set value with a light hand, a firm one with a
#: heavy hand.
EXPONENTS = {"SOFT": 0.5, "LINEAR": 1.0, "FIRM": 2.0}
#: The curves as items of a property in Blender.
CURVE_ITEMS = (
    ("SOFT", "Soft", "The square root of the pressure: a light touch goes deep"),
    ("LINEAR", "Linear", "The pressure itself"),
    ("FIRM", "Firm", "The square of the pressure: fine control of light touches"),
)


def find_share(pressure: float, curve: str) -> float:
    """Return the share, 0 to 1, that a pressure of 0 to 1 asks for; 1 where the pressure is NaN."""
    if math.isnan(pressure):
        return 1.0
    return float(min(max(pressure, 0.0), 1.0) ** EXPONENTS[curve])


def find_lean(tilt: Place, seen: Floats) -> Place:
    """Return a pen's lean towards x and y of the bed, rad, by its tilt, -1 to 1, and the view's axes."""
    # A pen leans over the bed as over the tablet: its far side is what lies farther up in the view.
    right, up = float(tilt[0]), -float(tilt[1])
    size = math.hypot(right, up)
    if not math.isfinite(size) or size == 0.0:
        return 0.0, 0.0
    # In a level view the upward direction has no part in the plane of the bed; what is square to
    # aside has.
    aside = seen[:2, 0] if math.hypot(*seen[:2, 0]) > 1e-6 else np.array([seen[1, 1], -seen[0, 1]])
    aside = aside / math.hypot(*aside)
    away = np.array([-aside[1], aside[0]])
    x, y = FULL_TILT * min(1.0, 1.0 / size) * (right * aside + up * away)
    return float(x), float(y)


@dataclass
class HeldKeys:
    """Keys that are down, as the last event over a 3D view had them."""

    ctrl: bool = False
    shift: bool = False


HELD = HeldKeys()

Named = tuple[str, str]

PRESS, RELEASE = ("LEFTMOUSE", "PRESS"), ("LEFTMOUSE", "RELEASE")


@dataclass(frozen=True)
class Button:
    """State of the mouse button in a stroke, derived from events."""

    #: Type and value of the key's or button's event before the press; None until a timer has named
    #: it.
    before: Named | None
    #: Another key or button has been used since.
    used: bool = False
    #: It is up.
    up: bool = False


def begin_button(value: str, named: Named) -> Button:
    """Return the button at the event by which a stroke begins: its value, and the event that it names."""
    return Button(None if value == "CLICK_DRAG" else named)


def read_event(button: Button, kind: str, named: Named) -> Button:
    """Return the button after another event of the stroke: its type, and the event that it names."""
    if button.before is None:
        return replace(button, before=named) if kind.startswith("TIMER") else button
    used = button.used or named not in (PRESS, button.before)
    return replace(button, used=used, up=used and named == RELEASE)
