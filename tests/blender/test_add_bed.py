"""Add > Mesh > Digital Clay: what its redo panel offers, and that the bed is what was asked for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.control.methods import METHODS
from digiclay.core.model.layout import Layout
from digiclay.core.scene.toml_table import PRESETS, resolve
from digiclay.roles import fingertip_of
from digiclay.settings import own_presets, properties
from digiclay.settings.devices import BEDS, make_scene

pytestmark = pytest.mark.usefixtures("extension")


@pytest.fixture
def preset() -> Iterator[str]:
    """A preset of the user's own, and the name it goes by."""
    table = {"control": {"method": "cell_states", "force_setpoint": 0.03}, "valve": {"stroke": 41e-6}}
    own_presets.save("Stiff clay", resolve(table))
    yield "Stiff clay"
    own_presets.remove("Stiff clay")


def add(**chosen: Any) -> Any:
    """Add a bed; return it."""
    assert bpy.ops.mesh.digital_clay_add(**chosen) == {"FINISHED"}
    return bpy.context.object


#: What can be chosen, and the scene file of it.
CHOICES: list[tuple[dict[str, str], dict[str, Any]]] = [
    ({}, {}),
    *(({"preset": name}, {"preset": name}) for name in PRESETS),
    *(({"method": name}, {"control": {"method": name}}) for name in METHODS),
]


def test_a_bed_is_a_scene_files_but_for_the_ground() -> None:
    for number, (chosen, table) in enumerate(CHOICES):
        wanted = resolve(table)
        if wanted.method == "virtual_master":
            wanted = resolve({**table, "control": {"ground": "cell"}})
        made = make_scene(chosen.get("preset", "paper"), Layout(), chosen.get("method", "virtual_master"))
        assert made.with_sections(name=wanted.name) == wanted, chosen
        if number in (0, 2, len(CHOICES) - 1):
            bed = add(**chosen)
            assert properties.scene_of(bed) == wanted.with_sections(name=bed.name), chosen


def test_a_preset_of_the_user_s_own_is_offered_and_taken(preset: str) -> None:
    bed = add(preset=preset, method="cell_states", rows=30)
    scene = properties.scene_of(bed)
    assert (scene.layout.rows, scene.valve.stroke, scene.control.force_setpoint) == (30, 41e-6, 0.03)


def test_another_method_than_the_preset_s_brings_its_own_gains(preset: str) -> None:
    scene = properties.scene_of(add(preset=preset, method="elastic"))
    plain = resolve({"control": {"method": "elastic"}})
    assert (scene.control, scene.blister, scene.valve.stroke) == (plain.control, None, 41e-6)


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (2, 9), (6, 6)])
@pytest.mark.parametrize("method", ["virtual_master", "cell_states"])
def test_a_bed_smaller_than_its_blister_gets_one_that_fits(rows: int, columns: int, method: str) -> None:
    scene = make_scene("paper", Layout(rows=rows, columns=columns), method)
    assert scene.blister.radius <= max(rows, columns) * 3e-3 / 2 * (1 + 1e-9)
    assert scene.blister.flat_radius < scene.blister.radius < scene.blister.edge_radius


@pytest.mark.parametrize("scale", [0.1, 1.0, 2.5])
def test_a_bed_of_any_scale_stands_on_the_cursor_with_its_fingertip_above(scale: float) -> None:
    bpy.context.scene.cursor.location = (1.0, 2.0, 3.0)
    bed = add(rows=6, columns=6, scale=scale)
    assert bpy.context.selected_objects == [bed]
    bpy.context.view_layer.update()
    shown = bed.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    # float32 at 3 units.
    assert min((bed.matrix_world @ point.co).z for point in shown.vertices) == pytest.approx(3.0, abs=1e-5)
    assert bridge.uniform(bed) == pytest.approx(scale, rel=1e-6)
    assert bridge.pose(fingertip_of(bed))[2] > 0.040


def test_the_scale_shown_leaves_the_device_as_it_is() -> None:
    small, large = add(rows=6, columns=6), add(rows=6, columns=6, scale=3.0)
    bpy.context.view_layer.update()
    poses = [bridge.pose(fingertip_of(bed)) for bed in (small, large)]
    # Blender's matrices are float32, here of lengths up to 0.5 units: 0.05 m of the device.
    np.testing.assert_allclose(poses[0], poses[1], rtol=0, atol=1e-7)
    assert properties.scene_of(large).layout == properties.scene_of(small).layout


@pytest.mark.parametrize("name", BEDS)
def test_a_bed_has_the_plan_and_the_fingertip_of_its_kind(name: str) -> None:
    scene, wanted = properties.scene_of(add(bed=name)), BEDS[name]
    assert (scene.layout.rows, scene.layout.columns) == (wanted.rows, wanted.columns)
    assert scene.layout.pitch == pytest.approx(wanted.pitch, rel=1e-12)
    paper = resolve({})
    (tip,), (usual,) = ([finger.fingertip for finger in one.fingers] for one in (scene, paper))
    sizes = [(tip.length, usual.length), (scene.blister.radius, paper.blister.radius)]
    # Properties hold 32 bits; what was written exactly is read exactly.
    assert [size / of_paper for size, of_paper in sizes] == pytest.approx([wanted.share] * 2, rel=1e-9)
    assert scene.actuator.bore <= scene.layout.pitch
    assert (scene.preset, scene.method) == (wanted.preset, wanted.method)


def test_beds_for_a_person_are_made_for_hands_and_one_that_a_script_does_not_name_is_the_paper_s() -> None:
    made = [properties.scene_of(add(**named)) for named in ({}, {"bed": "design"}, {"bed": "fine"})]
    assert [(scene.preset, scene.method) for scene in made] == [
        ("paper", "virtual_master"), ("design", "hybrid"), ("design", "hybrid"),
    ]  # fmt: skip
    plain = properties.scene_of(add(bed="design", method="elastic", preset="fast"))
    assert (plain.preset, plain.method) == ("fast", "elastic")


def test_a_bed_of_a_kind_may_have_another_plan() -> None:
    scene = properties.scene_of(add(bed="design", rows=6, columns=30, pitch=2.7, arrangement="staggered"))
    # The pitch is the number typed, and not its 32 bits.
    assert (scene.layout.rows, scene.layout.columns, scene.layout.pitch) == (6, 30, 2.7e-3)
    assert (scene.layout.arrangement, scene.fingers[0].fingertip.length) == ("staggered", 5e-3)


def test_a_pitch_at_which_cylinders_would_overlap_makes_them_narrower() -> None:
    scene = properties.scene_of(add(rows=6, columns=6, pitch=0.5))
    assert scene.actuator.bore == pytest.approx(2 / 3 * scene.layout.pitch)
    assert properties.scene_of(add(rows=6, columns=6, pitch=2.5)).actuator.bore == 2e-3


def test_a_preset_that_cannot_be_read_is_refused_in_one_line(preset: str) -> None:
    own_presets.path(preset).write_text("valve = 3\n")
    before = len(bpy.data.objects)
    with pytest.raises(RuntimeError, match=r"valve must be a section") as caught:
        bpy.ops.mesh.digital_clay_add(preset=preset)
    assert "Traceback" not in str(caught.value)
    assert len(bpy.data.objects) == before
