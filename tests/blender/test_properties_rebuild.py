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

from tests.blender.at_hand import instances, new_bed

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


def identity(bed: Any) -> tuple[Any, ...]:
    """Return what a rebuilt bed keeps."""
    tip = view.fingertip_of(bed)
    counts = (len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.node_groups))
    places = (tuple(bed.location), tuple(tip.location))
    return bed.session_uid, tip.session_uid, *places, *counts, view.color_source(bed)


def test_a_rebuilt_bed_is_the_same_with_its_new_pins_at_rest_where_its_layout_says(bed: Any) -> None:
    view.color_by(bed, "force")
    bed[bed_state.STATE], before, settings = b"of 48 pins", identity(bed), bed.digiclay
    settings.layout.rows, settings.layout.columns, settings.layout.arrangement = 9, 20, "hexagonal"
    settings.actuator.rest_height = 30.0
    assert bpy.ops.digiclay.rebuild() == {"FINISHED"}
    cells = bridge.read_cells(bed.data)
    wanted = make_grid(properties.scene_of(bed).layout)
    np.testing.assert_allclose(cells["position"], wanted.positions, rtol=0, atol=FLOAT32)
    np.testing.assert_allclose(cells["height"], 0.030, rtol=0, atol=FLOAT32)
    assert set(cells["mode"]) == {Mode.REST}
    assert (identity(bed), bed_state.read_snapshot(bed), len([*instances(bed)])) == (before, None, 180)
    # The housing is about all of them.
    shown = bed.evaluated_get(bpy.context.evaluated_depsgraph_get())
    housing, pins = (max(vertex.co.x for vertex in one.data.vertices) for one in (shown, bed))
    assert housing > pins
    bpy.data.objects.remove(view.fingertip_of(bed))
    bpy.ops.digiclay.rebuild()
    assert view.fingertip_of(bed) is not None


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
    assert len([*instances(copy)]) == 48
