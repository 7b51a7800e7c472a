"""The sidebar's tab: which panels there are, and which bed they are about. Drawn they are in tests/window."""

from __future__ import annotations

from typing import Any

import bpy
import pytest
from digiclay import panels
from digiclay.core.control.methods import METHODS
from digiclay.core.scene.schema import SECTIONS
from digiclay.panels.base import CATEGORY
from digiclay.panels.parameters import in_use
from digiclay.roles import bed_of, fingertip_of

from tests.blender.at_hand import new_bed

pytestmark = pytest.mark.usefixtures("extension")

#: Sections drawn by a panel of another kind: a shape is chosen rather than typed.
ELSEWHERE = {"shape"}


@pytest.fixture
def bed() -> Any:
    """A small bed, active."""
    return new_bed(rows=6, columns=6)


def panel(name: str) -> Any:
    """Return a panel by the end of its idname."""
    return getattr(bpy.types, f"DIGICLAY_PT_{name}")


def test_the_panels_are_about_the_bed_that_the_active_object_belongs_to(bed: Any) -> None:
    bpy.ops.mesh.digital_clay_add(rows=5, columns=5)
    assert bed_of(bpy.context) == bpy.context.object
    cube = bpy.data.objects["Cube"]
    cube.parent = fingertip_of(bed)
    for part in (bed, *bed.children_recursive):
        bpy.context.view_layer.objects.active = part
        assert bed_of(bpy.context) == bed
    assert len(bed.children_recursive) == 3  # fingertip, its ellipsoid, the cube
    assert not panel("start").poll(bpy.context)
    assert panel("device").poll(bpy.context)


@pytest.mark.parametrize("active", ["Cube", None])
def test_without_a_bed_there_is_only_the_panel_that_offers_one(active: str | None, bed: Any) -> None:
    bpy.context.view_layer.objects.active = bpy.data.objects[active] if active else None
    shown = [
        kind.bl_idname for kind in panels.CLASSES if hasattr(kind, "bl_category") and kind.poll(bpy.context)
    ]
    assert shown == ["DIGICLAY_PT_start"]


def test_every_part_of_a_scene_has_a_panel() -> None:
    names = [name for name in SECTIONS if name not in ELSEWHERE]
    assert [name for name in names if not hasattr(bpy.types, f"DIGICLAY_PT_part_{name}")] == []


def test_the_tab_shows_what_a_sculptor_needs_and_keeps_what_a_researcher_needs_closed() -> None:
    drawn = [kind for kind in panels.CLASSES if issubclass(kind, bpy.types.Panel)]
    drawn = [kind for kind in drawn if kind.bl_region_type != "HEADER"]  # opens from the header of the tool
    places = {(kind.bl_space_type, kind.bl_region_type, kind.bl_category) for kind in drawn}
    assert places == {("VIEW_3D", "UI", CATEGORY)}
    orders = [(kind.bl_parent_id, kind.bl_order) for kind in drawn]
    assert len(set(orders)) == len(orders)
    tree: dict[str, list[str]] = {}
    for kind in sorted(drawn, key=lambda kind: kind.bl_order):
        tree.setdefault(kind.bl_parent_id.removeprefix("DIGICLAY_PT_"), []).append(kind.bl_label)
    assert tree[""] == ["Digital Clay", "Session", "Show", "Export", "Laboratory"]
    assert (tree["session"], tree["export"]) == (["Shapes", "Takes"], ["Features"])
    assert tree["laboratory"] == ["View Details", "Fingertip", "Device", "Control"]
    opened = {kind.bl_label for kind in drawn if "DEFAULT_CLOSED" not in kind.bl_options}
    assert opened == {"Digital Clay", "Session", "Show", "Export"}


@pytest.mark.parametrize("method", METHODS)
def test_a_blister_is_shown_where_the_method_forms_one(method: str, bed: Any) -> None:
    bed.digiclay.method = method
    assert panel("part_blister").poll(bpy.context) == (METHODS[method].blister is not None)


@pytest.mark.parametrize(
    ("switch", "grayed"),
    [
        ("fingertip", {"fingertip", "contact", "relaxation"}),
        ("control", {"control", "blister"}),
        ("delay", {"delay"}),
    ],
)
def test_what_is_left_out_is_grayed_with_what_belongs_to_it(switch: str, grayed: set[str], bed: Any) -> None:
    settings = bed.digiclay
    used = {name for name in SECTIONS if in_use(settings, name)}
    setattr(settings, f"use_{switch}", False)
    assert used - {name for name in SECTIONS if in_use(settings, name)} == grayed
