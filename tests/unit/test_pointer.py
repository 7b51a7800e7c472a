"""Input of the hand: pressure and tilt of a pen, and a mouse button that is up."""

from __future__ import annotations

import math

import numpy as np
import pytest
from digiclay.press.pointer import CURVE_ITEMS, FULL_TILT, begin_button, find_lean, find_share, read_event

CURVES = [item[0] for item in CURVE_ITEMS]


@pytest.mark.parametrize("curve", CURVES)
def test_a_curve_goes_from_nothing_to_all_and_never_back(curve: str) -> None:
    shares = [find_share(pressure / 100, curve) for pressure in range(101)]
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert shares == sorted(shares)


def test_half_the_pressure_of_a_soft_pen_goes_deepest() -> None:
    soft, linear, firm = (find_share(0.5, curve) for curve in CURVES)
    assert (soft, linear, firm) == (pytest.approx(math.sqrt(0.5)), 0.5, 0.25)


@pytest.mark.parametrize(("odd", "share"), [(-1.0, 0.0), (7.0, 1.0), (math.inf, 1.0), (math.nan, 1.0)])
def test_a_driver_that_reports_nonsense_does_no_harm(odd: float, share: float) -> None:
    assert [find_share(odd, curve) for curve in CURVES] == [share] * 3


#: A view from above with its up along y; one from the front and above; one level with the bed.
ABOVE = np.eye(3)
FRONT = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]])
BESIDE = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


#: One turned on its side: its right is along the pins.
TURNED = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    ("tilt", "seen", "lean"),
    [
        ((1.0, 0.0), ABOVE, (1.0, 0.0)),
        ((1.0, 0.0), FRONT, (1.0, 0.0)),
        # Towards the user is down in the view.
        ((0.0, 0.5), ABOVE, (0.0, -0.5)),
        ((0.0, 0.5), FRONT, (0.0, -0.5)),
        # In a level view the far side is behind the bed.
        ((1.0, 0.0), BESIDE, (0.0, 1.0)),
        ((0.0, -1.0), BESIDE, (-1.0, 0.0)),
        ((0.0, -1.0), TURNED, (1.0, 0.0)),
        # No pen leans farther than full tilt, and nonsense is upright.
        ((1.0, 1.0), ABOVE, (0.5**0.5, -(0.5**0.5))),
        ((math.nan, 0.0), ABOVE, (0.0, 0.0)),
        ((0.0, math.inf), ABOVE, (0.0, 0.0)),
        ((0.0, 0.0), ABOVE, (0.0, 0.0)),
    ],
)
def test_a_pen_leans_over_the_bed_as_over_the_tablet(tilt, seen, lean):
    assert find_lean(tilt, seen) == pytest.approx((FULL_TILT * lean[0], FULL_TILT * lean[1]))


DOWN, UP = ("LEFTMOUSE", "PRESS"), ("LEFTMOUSE", "RELEASE")
KEY, KEY_UP = ("Z", "PRESS"), ("Z", "RELEASE")


def is_up(begins: tuple[str, tuple[str, str]], *events: tuple[str, tuple[str, str]]) -> list[bool]:
    """Return whether the button is taken to be up after each event of a stroke."""
    button, found = begin_button(*begins), []
    for kind, named in events:
        button = read_event(button, kind, named)
        found.append(button.up)
    return found


@pytest.mark.parametrize("kind", ["TIMER", "TIMER_REPORT", "TIMER_JOBS", "MOUSEMOVE", "INBETWEEN_MOUSEMOVE"])
def test_the_release_of_the_stroke_before_is_not_that_of_this_one(kind: str) -> None:
    # Timers of Blender, such as that of a message in the status bar, and copied moves name it all along.
    copied = [(kind, UP), ("TIMER", UP)] * 3
    assert not any(is_up(("PRESS", UP), *copied))


HOME = ("HOME", "RELEASE")
#: The event that begins a stroke, and others in it, of which the last alone may tell the release.
STROKES = {
    "moves and wheel in the second stroke leave it pressed": (
        ("PRESS", UP), ("MOUSEMOVE", DOWN), ("TIMER", UP), ("WHEELUPMOUSE", DOWN), ("TIMER_REPORT", UP),
    ),
    "the next move tells a release that a pie menu takes": (
        ("PRESS", UP), ("MOUSEMOVE", DOWN), ("Z", DOWN), ("TIMER", DOWN), ("TIMER", KEY), ("TIMER", KEY_UP),
        ("MOUSEMOVE", UP),
    ),
    "a timer after another key tells it": (("PRESS", UP), ("TIMER", KEY), ("TIMER", UP)),
    "a move tells it after the first press of all: no other release can be named": (
        ("PRESS", HOME), ("TIMER", HOME), ("MOUSEMOVE", UP),
    ),
    # A drag is a move: it names the press itself, and a move copied from Blender's record what was before.
    "a stroke begun by a drag learns from a timer what was before": (
        ("CLICK_DRAG", DOWN), ("MOUSEMOVE", UP), ("TIMER", UP), ("TIMER_REPORT", UP),
    ),
    "then a move after another key tells it": (
        ("CLICK_DRAG", DOWN), ("TIMER", UP), ("TIMER", KEY), ("MOUSEMOVE", UP),
    ),
}  # fmt: skip
LEFT_PRESSED = ("leave it pressed", "what was before")


@pytest.mark.parametrize("words", STROKES)
def test_a_release_is_told_by_what_later_events_name(words: str) -> None:
    begins, *events = STROKES[words]
    assert is_up(begins, *events) == [False] * (len(events) - 1) + [not words.endswith(LEFT_PRESSED)]
