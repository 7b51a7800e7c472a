"""A bed with a session is not selected, so that its pins have no outline; it is again after the session."""

from __future__ import annotations

from typing import Any

import bpy
import pytest
from digiclay.device import view
from digiclay.live import beds

from tests.blender.at_hand import new_bed

pytestmark = pytest.mark.usefixtures("extension")


@pytest.fixture
def bed() -> Any:
    """A bed from the Add menu, selected and active."""
    return new_bed(rows=5, columns=5)


def test_a_bed_taken_out_of_the_selection_is_active_still(bed: Any) -> None:
    beds.deselect(bed)
    assert not bed.select_get()
    assert bpy.context.object == bed


def test_a_bed_of_another_view_layer_is_left_alone(bed: Any) -> None:
    for collection in bed.users_collection:
        collection.objects.unlink(bed)
    beds.deselect(bed)  # Blender raises an error for an object the view layer does not have
    assert bed.name in bpy.data.objects


@pytest.mark.parametrize("before", [True, False])
def test_after_the_session_the_active_bed_is_selected_again_if_it_was_before(bed: Any, before: bool) -> None:
    bed.select_set(before)
    beds.deselect(bed)
    beds.select_active(frozenset({bed.session_uid}))
    assert bed.select_get() is before


def test_what_was_selected_meanwhile_stays_the_selection(bed: Any) -> None:
    beds.deselect(bed)
    tip = view.fingertip_of(bed)
    tip.select_set(True)
    beds.select_active(frozenset({bed.session_uid}))
    assert bpy.context.selected_objects == [tip]


def test_another_object_that_is_active_is_not_selected(bed: Any) -> None:
    cube = bpy.data.objects["Cube"]
    beds.deselect(bed)
    bpy.context.view_layer.objects.active = cube
    beds.select_active(frozenset({bed.session_uid}))
    assert bpy.context.selected_objects == []
