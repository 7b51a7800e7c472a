"""A button that cannot be pressed says why: Blender shows it where the mouse rests on it."""

from __future__ import annotations

from typing import Any

import bpy
import pytest
from digiclay import operators

from tests.blender.session.live import Clock, press, started

NAMES = sorted(kind.bl_idname for kind in operators.CLASSES if issubclass(kind, bpy.types.Operator))
#: What Blender says of an operator that says nothing.
NOTHING = "failed, context is incorrect"


def refused(name: str) -> str:
    """Return why an operator declines to be called, or an empty text when it does not."""
    area, _, own = name.partition(".")
    operator = getattr(getattr(bpy.ops, area), own)
    if operator.poll():
        return ""
    with pytest.raises(RuntimeError) as told:
        operator()
    return str(told.value).partition(".poll() ")[2]


def declining() -> dict[str, str]:
    """Return what every operator that declines says."""
    return {name: words for name in NAMES if (words := refused(name))}


def check(said: dict[str, str], least: int) -> None:
    """Check that at least so many operators decline, and that each gives a reason."""
    assert len(said) >= least
    assert [name for name, words in said.items() if NOTHING in words] == []


def test_without_a_bed_every_operator_that_needs_one_says_so() -> None:
    check(declining(), 20)


def test_with_a_bed_at_rest_what_needs_a_session_or_a_take_says_so(bed: Any) -> None:
    check(declining(), 10)


def test_in_a_session_what_must_wait_for_its_end_says_so(bed: Any, clock: Clock) -> None:
    started(bed)
    press(bed, clock)
    check(declining(), 5)


def test_in_edit_mode_what_needs_object_mode_says_so(bed: Any) -> None:
    bpy.ops.object.mode_set(mode="EDIT")
    check(declining(), 5)
    bpy.ops.object.mode_set(mode="OBJECT")
