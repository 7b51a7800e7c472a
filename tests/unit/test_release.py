"""When a stroke of the Press tool takes its mouse button to be up, by what events name as the one before."""

from __future__ import annotations

import pytest
from digiclay.press.pointer import begin_button, read_event

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


def test_moves_and_wheel_in_the_second_stroke_leave_it_held() -> None:
    moves = [("MOUSEMOVE", DOWN), ("TIMER", UP), ("WHEELUPMOUSE", DOWN), ("TIMER_REPORT", UP), ("TIMER", UP)]
    assert not any(is_up(("PRESS", UP), *moves))


def test_a_release_that_a_pie_menu_takes_is_told_by_the_next_move() -> None:
    told = is_up(
        ("PRESS", UP), ("MOUSEMOVE", DOWN), ("Z", DOWN), ("TIMER", DOWN), ("TIMER", KEY), ("TIMER", KEY_UP),
        ("MOUSEMOVE", UP),
    )  # fmt: skip
    assert told == [False] * 5 + [True]


def test_a_release_is_told_by_a_timer_after_another_key() -> None:
    assert is_up(("PRESS", UP), ("TIMER", KEY), ("TIMER", UP)) == [False, True]


def test_a_release_after_the_first_press_of_all_is_told_by_a_move() -> None:
    # Nothing but this stroke's release can be named then.
    assert is_up(("PRESS", ("HOME", "RELEASE")), ("TIMER", ("HOME", "RELEASE")), ("MOUSEMOVE", UP))[-1]


def test_a_stroke_begun_by_a_drag_learns_from_a_timer_what_was_before() -> None:
    # A drag is a move: it names the press itself, and a move copied from Blender's record what was before.
    told = is_up(("CLICK_DRAG", DOWN), ("MOUSEMOVE", UP), ("TIMER", UP), ("TIMER_REPORT", UP), ("TIMER", UP))
    assert not any(told)
    assert is_up(("CLICK_DRAG", DOWN), ("TIMER", UP), ("TIMER", KEY), ("MOUSEMOVE", UP))[-1]
