"""A bed made anew after its settings: other pins and housing, the same object, place and fingertip."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.base.errors import ParameterError
from digiclay.core.base.modes import Mode
from digiclay.core.model.layout import make_grid
from digiclay.device import view
from digiclay.live import bed_state
from digiclay.settings import properties

from tests.blender.at_hand import new_bed

pytestmark = pytest.mark.usefixtures("extension")
#: Positions are float32 and drawn ten times as large.
FLOAT32 = 0.1 * 2.0**-23


@pytest.fixture
def bed() -> Any:
    """A small bed away from the origin, its fingertip moved and its pins formed."""
    bed = new_bed(rows=6, columns=8)
    bed.location = (1.0, -2.0, 0.5)
    view.fingertip_of(bed).location.x += 0.05
    bed.data.vertices[7].co.z += 0.02
    bpy.context.view_layer.update()
    return bed


def test_the_pins_of_a_rebuilt_bed_stand_at_rest_where_its_layout_says(bed: Any) -> None:
    settings = bed.digiclay
    settings.layout.rows, settings.layout.arrangement, settings.actuator.rest_height = 9, "hexagonal", 30.0
    assert bpy.ops.digiclay.rebuild() == {"FINISHED"}
    cells = bridge.read_cells(bed.data)
    wanted = make_grid(properties.scene_of(bed).layout)
    np.testing.assert_allclose(cells["position"], wanted.positions, rtol=0, atol=FLOAT32)
    np.testing.assert_allclose(cells["height"], 0.030, rtol=0, atol=FLOAT32)
    assert set(cells["mode"]) == {Mode.REST}


def test_a_rebuilt_bed_is_the_same_object_in_the_same_place_with_the_same_fingertip(bed: Any) -> None:
    tip = view.fingertip_of(bed)
    before = (
        bed.session_uid,
        tuple(bed.location),
        tip.session_uid,
        tuple(tip.location),
        len(bpy.data.objects),
        len(bpy.data.meshes),
        len(bpy.data.node_groups),
    )
    bed.digiclay.layout.columns = 11
    bpy.ops.digiclay.rebuild()
    tip = view.fingertip_of(bed)
    assert before == (
        bed.session_uid, tuple(bed.location), tip.session_uid, tuple(tip.location),
        len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.node_groups),
    )  # fmt: skip


def test_a_rebuilt_bed_draws_its_new_pins(bed: Any) -> None:
    bed.digiclay.layout.columns = 11
    bpy.ops.digiclay.rebuild()
    graph = bpy.context.evaluated_depsgraph_get()
    drawn = [item for item in graph.object_instances if item.is_instance and item.parent.original == bed]
    assert len(drawn) == 66


def test_the_housing_of_a_rebuilt_bed_is_about_its_pins(bed: Any) -> None:
    bed.digiclay.layout.columns = 20
    bpy.ops.digiclay.rebuild()
    shown = bed.evaluated_get(bpy.context.evaluated_depsgraph_get())
    reach = max(vertex.co.x for vertex in shown.data.vertices)
    assert reach > max(vertex.co.x for vertex in bed.data.vertices)


def test_a_fingertip_that_was_deleted_comes_back(bed: Any) -> None:
    bpy.data.objects.remove(view.fingertip_of(bed))
    bpy.ops.digiclay.rebuild()
    assert view.fingertip_of(bed) is not None


def test_the_state_of_other_pins_is_forgotten(bed: Any) -> None:
    bed[bed_state.STATE] = b"of 48 pins"
    bpy.ops.digiclay.rebuild()
    assert bed_state.read_snapshot(bed) is None


def test_how_a_bed_is_colored_outlives_its_pins(bed: Any) -> None:
    view.color_by(bed, "force")
    bed.digiclay.layout.rows = 7
    bpy.ops.digiclay.rebuild()
    assert view.color_source(bed) == "force"


def test_settings_that_do_not_go_together_leave_the_bed_as_it_is(bed: Any) -> None:
    bed.digiclay.layout.pitch = 1.0
    before = (len(bpy.data.objects), bed.data.name)
    with pytest.raises(RuntimeError, match=r"Layout: Pitch must be at least Actuator: Bore, 2 mm"):
        bpy.ops.digiclay.rebuild()
    assert before == (len(bpy.data.objects), bed.data.name)


@pytest.mark.parametrize(
    ("field", "value"),
    [("rows", 8), ("pitch", 3.5), ("arrangement", "staggered"), ("arrangement", "hexagonal")],
)
def test_the_panel_says_when_a_bed_is_no_longer_as_its_layout(field: str, value: object, bed: Any) -> None:
    assert properties.rebuild_reason(bed) == ""
    setattr(bed.digiclay.layout, field, value)
    assert properties.rebuild_reason(bed) != ""
    bpy.ops.digiclay.rebuild()
    assert properties.rebuild_reason(bed) == ""


def test_rows_and_columns_exchanged_are_another_bed_of_as_many_pins(bed: Any) -> None:
    bed.digiclay.layout.rows, bed.digiclay.layout.columns = 8, 6
    assert properties.rebuild_reason(bed) == "The pins differ from the parameters of Layout"
    with pytest.raises(ParameterError, match="press Rebuild"):
        properties.scene_of(bed)


def test_a_copy_of_the_bed_keeps_its_pins_when_the_other_is_rebuilt(bed: Any) -> None:
    copy = bed.copy()
    bpy.context.scene.collection.objects.link(copy)
    bed.digiclay.layout.columns = 11
    bpy.ops.digiclay.rebuild()
    bpy.context.view_layer.update()
    graph = bpy.context.evaluated_depsgraph_get()
    drawn = [item for item in graph.object_instances if item.is_instance and item.parent.original == copy]
    assert len(drawn) == 48
