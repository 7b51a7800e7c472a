"""A bed with a session is not selected, so that its pins have no outline; it is again after the session."""

from __future__ import annotations

from typing import Any

import bpy
import pytest
from digiclay.live import beds

from tests.blender.at_hand import new_bed

pytestmark = pytest.mark.usefixtures("extension")


@pytest.fixture
def bed() -> Any:
    """A bed from the Add menu, selected and active."""
    return new_bed(rows=5, columns=5)


def test_a_bed_of_another_view_layer_is_left_alone(bed: Any) -> None:
    for collection in bed.users_collection:
        collection.objects.unlink(bed)
    beds.deselect(bed)  # Blender raises an error for an object the view layer does not have
    assert bed.name in bpy.data.objects


@pytest.mark.parametrize(
    ("case", "wanted"),
    [("selected before", ["Digital Clay"]), ("not selected before", []), ("another is active", []),
     ("another was selected meanwhile", ["Cube"])],
)  # fmt: skip
def test_after_the_session_the_active_bed_is_selected_as_before(
    bed: Any, case: str, wanted: list[str]
) -> None:
    cube = bpy.data.objects["Cube"]
    bed.select_set(case != "not selected before")
    beds.deselect(bed)
    assert (bed.select_get(), bpy.context.object) == (False, bed)
    if case == "another is active":
        bpy.context.view_layer.objects.active = cube
    cube.select_set(case == "another was selected meanwhile")
    beds.select_active(frozenset({bed.session_uid}))
    assert [thing.name for thing in bpy.context.selected_objects] == wanted
