"""What a bed begins from: Add > Mesh > Digital Clay, presets of the user's own, samples and scene files."""

import dataclasses
import os
from typing import Any

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.base.errors import OutputError
from digiclay.core.control.methods import METHODS
from digiclay.core.model.layout import Layout
from digiclay.core.scene.scene_source import SAMPLES, find, list_samples, load
from digiclay.core.scene.toml_table import PRESETS, resolve
from digiclay.core.shapes.fitting import list_shapes
from digiclay.operators.add_bed import SceneFiles
from digiclay.recorded import takes
from digiclay.roles import fingertip_of, is_bed
from digiclay.settings import own_presets, properties
from digiclay.settings.devices import BEDS, make_scene

from tests.assemble import replayed
from tests.blender.at_hand import evaluate, new_bed

pytestmark = pytest.mark.usefixtures("extension")


@pytest.fixture
def preset():
    """A preset of the user's own, and the name it goes by."""
    table = {
        "control": {"method": "cell_states", "force_setpoint": 0.03},
        "valve": {"stroke": 41e-6},
    }
    own_presets.save("Stiff clay", resolve(table))
    yield "Stiff clay"
    own_presets.remove("Stiff clay")


def add(**chosen):
    assert bpy.ops.mesh.digital_clay_add(**chosen) == {"FINISHED"}
    return bpy.context.object


#: What can be chosen, and the scene file of it.
CHOICES = [
    ({}, {}),
    *(({"preset": name}, {"preset": name}) for name in PRESETS),
    *(({"method": name}, {"control": {"method": name}}) for name in METHODS),
]


def test_a_bed_is_a_scene_files_but_for_the_ground():
    for number, (chosen, table) in enumerate(CHOICES):
        wanted = resolve(table)
        if wanted.method == "virtual_master":
            wanted = resolve({**table, "control": {"ground": "cell"}})
        made = make_scene(
            chosen.get("preset", "paper"), Layout(), chosen.get("method", "virtual_master")
        )
        assert made.with_sections(name=wanted.name) == wanted, chosen
        if number in (0, 2, len(CHOICES) - 1):
            bed = add(**chosen)
            assert properties.scene_of(bed) == wanted.with_sections(name=bed.name), chosen


def test_a_preset_of_the_user_s_own_is_taken_and_another_method_brings_its_own_gains(preset):
    scene = properties.scene_of(add(preset=preset, method="cell_states", rows=30))
    assert (scene.layout.rows, scene.valve.stroke, scene.control.force_setpoint) == (
        30,
        41e-6,
        0.03,
    )
    scene = properties.scene_of(add(preset=preset, method="elastic"))
    plain = resolve({"control": {"method": "elastic"}})
    assert (scene.control, scene.blister, scene.valve.stroke) == (plain.control, None, 41e-6)


@pytest.mark.parametrize("method", ["cell_states", "hybrid"])
def test_a_preset_of_the_user_s_own_has_its_finger_on_beds_for_smaller_ones(preset, method):
    wanted = load(own_presets.path(preset))
    scene = make_scene(preset, Layout(9, 9, 1.5e-3), method, share=0.5)
    for section in ("fingertip", "relaxation", "valve", "delay"):
        assert scene.section(section) == wanted.section(section), section
    # Its law on the area of the smaller cells.
    assert scene.section("contact").share == pytest.approx(0.34 / 4)
    other = make_scene("paper", Layout(), method)
    assert scene.control == (wanted.control if method == "cell_states" else other.control)


@pytest.mark.parametrize("rows, columns", [(1, 1), (2, 9), (6, 6)])
@pytest.mark.parametrize("method", ["virtual_master", "cell_states"])
def test_a_bed_smaller_than_its_blister_gets_one_that_fits(rows, columns, method):
    bed = add(rows=rows, columns=columns, method="elastic")
    bed.digiclay.chosen_method = method
    for scene in (
        make_scene("paper", Layout(rows=rows, columns=columns), method),
        properties.scene_of(bed),
    ):
        assert scene.blister.radius <= max(rows, columns) * 3e-3 / 2 * (1 + 1e-9)
        assert scene.blister.flat_radius < scene.blister.radius < scene.blister.edge_radius


@pytest.mark.parametrize("scale", [0.1, 1.0, 2.5])
def test_a_bed_of_any_scale_stands_on_the_cursor_with_its_fingertip_above(scale):
    bpy.context.scene.cursor.location = (1.0, 2.0, 3.0)
    bed = add(rows=6, columns=6, scale=scale)
    assert bpy.context.selected_objects == [bed]
    bpy.context.view_layer.update()
    shown = evaluate(bed)
    # float32 at 3 units.
    assert min((bed.matrix_world @ point.co).z for point in shown.vertices) == pytest.approx(
        3.0, abs=1e-5
    )
    assert bridge.uniform(bed) == pytest.approx(scale, rel=1e-6)
    assert bridge.pose(fingertip_of(bed))[2] > 0.040


@pytest.mark.parametrize(
    "system, unit, given, scale, millimeter",
    [
        ("METRIC", 1.0, {}, 1.0, 1e-2),  # ten times its size, as before there was a choice
        ("METRIC", 0.001, {}, 100.0, 1e-3),
        ("METRIC", 0.01, {}, 10.0, 1e-3),
        ("METRIC", 0.001, {"scale": 250.0}, 250.0, 2.5e-3),
        ("METRIC", 1.0, {"scale": -1.0}, 1e-5, 1e-7),
        ("IMPERIAL", 1.0, {}, 1.0, 1e-2),
        ("IMPERIAL", 0.0254, {}, 3.93701, 1e-3),
        ("NONE", 0.001, {}, 1.0, 1e-5),  # Blender scales no lengths without a system of units
        ("METRIC", 1e5, {}, 1e-5, 1e-2),  # nothing smaller can be inverted
    ],
)
def test_a_bed_has_its_true_size_where_a_unit_is_no_meter(system, unit, given, scale, millimeter):
    units = bpy.context.scene.unit_settings
    units.system, units.scale_length = system, unit
    bed = add(rows=2, columns=2, **given)
    assert tuple(bed.scale) == pytest.approx((scale,) * 3, rel=1e-5)
    shown = bpy.context.window_manager.operator_properties_last("mesh.digital_clay_add")
    shown.scale = scale
    assert shown.millimeter * unit == pytest.approx(millimeter, rel=1e-5)


def test_a_sample_has_its_true_size_too():
    bpy.context.scene.unit_settings.scale_length = 0.001
    bpy.ops.digiclay.add_sample(sample="session:tap", take=False)
    assert tuple(bpy.context.object.scale) == pytest.approx((100.0,) * 3, rel=1e-5)


@pytest.mark.parametrize("name", BEDS)
def test_a_bed_has_the_plan_and_the_fingertip_of_its_kind(name):
    bed = add(bed=name)
    scene, wanted = properties.scene_of(bed), BEDS[name]
    assert (scene.layout.rows, scene.layout.columns) == (wanted.rows, wanted.columns)
    assert scene.layout.pitch == pytest.approx(wanted.pitch, rel=1e-12)
    paper = resolve({})
    (tip,), (usual,) = ([finger.fingertip for finger in one.fingers] for one in (scene, paper))
    sizes = [(tip.length, usual.length), (scene.blister.radius, paper.blister.radius)]
    # Properties hold 32 bits; what was written exactly is read exactly.
    assert [size / of_paper for size, of_paper in sizes] == pytest.approx(
        [wanted.share] * 2, rel=1e-9
    )
    assert scene.actuator.bore <= scene.layout.pitch
    assert (scene.preset, scene.method) == (wanted.preset, wanted.method)
    bed.digiclay.chosen_method = "cell_states"  # another method's blister is in proportion too
    other = properties.scene_of(bed).blister
    usual = resolve({"control": {"method": "cell_states"}}).blister
    assert other.radius == pytest.approx(wanted.share * usual.radius, rel=1e-6)  # 32 bits


def test_beds_for_a_person_are_made_for_hands_and_one_that_a_script_does_not_name_is_the_paper_s():
    made = [properties.scene_of(add(**named)) for named in ({}, {"bed": "design"}, {"bed": "fine"})]
    assert [(scene.preset, scene.method) for scene in made] == [
        ("paper", "virtual_master"),
        ("design", "hybrid"),
        ("design", "hybrid"),
    ]
    plain = properties.scene_of(add(bed="design", method="elastic", preset="fast"))
    assert (plain.preset, plain.method) == ("fast", "elastic")


def test_a_pitch_at_which_cylinders_would_overlap_makes_them_narrower():
    scene = properties.scene_of(add(rows=6, columns=6, pitch=0.5))
    assert scene.actuator.bore == pytest.approx(2 / 3 * scene.layout.pitch)
    assert properties.scene_of(add(rows=6, columns=6, pitch=2.5)).actuator.bore == 2e-3


def test_a_preset_that_cannot_be_read_is_refused_in_one_line(preset):
    own_presets.path(preset).write_text("valve = 3\n")
    before = len(bpy.data.objects)
    with pytest.raises(RuntimeError, match=r"valve must be a section") as caught:
        bpy.ops.mesh.digital_clay_add(preset=preset)
    assert "Traceback" not in str(caught.value)
    assert len(bpy.data.objects) == before


@pytest.fixture(autouse=True)
def no_presets():
    yield
    for name in own_presets.names():
        own_presets.remove(name)


@pytest.fixture
def bed():
    return new_bed()


def test_a_saved_preset_is_a_scene_file_of_all_parameters(bed):
    bed.digiclay.valve.stroke = 0.041
    assert bpy.ops.digiclay.preset_save(name="Stiff clay") == {"FINISHED"}
    scene = load(own_presets.path("Stiff clay"))
    assert scene == dataclasses.replace(properties.scene_of(bed), name="Stiff clay")
    bed.digiclay.valve.stroke = 0.05
    bpy.ops.digiclay.preset_save(name="Stiff clay")  # replaces the former
    assert load(own_presets.path("Stiff clay")).valve.stroke == 50e-6
    assert [file.name for file in own_presets.folder().iterdir()] == ["Stiff clay.toml"]
    for name in ("Ärger über Öl", "a b", "v1.2"):
        bpy.ops.digiclay.preset_save(name=name)
        assert bpy.ops.digiclay.preset_apply(preset=name) == {"FINISHED"}
    assert set(own_presets.names()) == {"Stiff clay", "Ärger über Öl", "a b", "v1.2"}


def test_applying_a_preset_sets_everything_but_the_layout(bed):
    table = {
        "layout": {"rows": 30},
        "preset": "viscous",
        "control": {"method": "elastic", "stiffness": 33.0},
    }
    own_presets.save("Rubber", resolve(table))
    assert bpy.ops.digiclay.preset_apply(preset="Rubber") == {"FINISHED"}
    scene, wanted = properties.scene_of(bed), resolve({**table, "layout": {}}, bed.name)
    assert scene == wanted
    assert bed.digiclay.own_preset == "Rubber"


@pytest.mark.parametrize("name", PRESETS)
def test_applying_one_of_the_core_s_presets_changes_what_a_scene_file_would(name, bed):
    assert bpy.ops.digiclay.preset_apply(preset=name) == {"FINISHED"}
    assert properties.scene_of(bed) == resolve(
        {"preset": name, "control": {"ground": "cell"}}, bed.name
    )


@pytest.mark.parametrize(
    "name",
    ["", "  ", "paper", "Viscous", "../up", "a/b", ".hidden", "x" * 61, "a\nb", "what?", "end."],
)
def test_a_name_that_no_preset_can_have_is_refused(name):
    with pytest.raises(OutputError, match=r"^The preset's name must"):
        own_presets.save(name, resolve({}))
    assert own_presets.names() == []


def test_removing_a_preset_leaves_the_bed_its_parameters(bed):
    assert not bpy.ops.digiclay.preset_remove.poll(), "those that come along stay"
    bed.digiclay.valve.stroke = 0.041
    bpy.ops.digiclay.preset_save(name="Mine")
    assert bpy.ops.digiclay.preset_remove() == {"FINISHED"}
    assert own_presets.names() == []
    assert (bed.digiclay.own_preset, properties.scene_of(bed).valve.stroke) == ("", 41e-6)


@pytest.mark.parametrize(
    "content", [None, "", "valve = 3\n", "[valve]\nstroke = nan\n", "import os\n", "\x00"]
)
def test_a_preset_that_was_spoilt_or_is_gone_is_told_of_in_one_line(content, bed):
    before = properties.scene_of(bed)
    own_presets.folder().mkdir(parents=True, exist_ok=True)
    if content is not None:
        own_presets.path("Spoilt").write_text(content)
    if content == "":  # an empty scene file is a whole scene
        assert bpy.ops.digiclay.preset_apply(preset="Spoilt") == {"FINISHED"}
        return
    with pytest.raises(RuntimeError, match=r"Spoilt\.toml") as caught:
        bpy.ops.digiclay.preset_apply(preset="Spoilt")
    assert "Traceback" not in str(caught.value)
    assert properties.scene_of(bed) == before


def test_a_folder_that_cannot_be_made_is_told_of(bed):
    folder = own_presets.folder()
    if folder.exists():
        folder.rmdir()
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.write_text("a file stands in the way")
    try:
        with pytest.raises(OutputError, match=r"^Cannot write .*Mine\.toml"):
            own_presets.save("Mine", properties.scene_of(bed))
    finally:
        os.unlink(folder)


@pytest.mark.parametrize("name", ["ridge_mound_valley", "dome_peaked", list_samples()[-1]])
def test_a_sample_session_opens_as_the_bed_it_describes(name):
    assert bpy.ops.digiclay.add_sample(sample=f"session:{name}", take=False) == {"FINISHED"}
    bed, wanted = bpy.context.object, load(find(name))
    made = properties.scene_of(bed)
    for section in ("layout", "control", "fingertip"):
        assert made.section(section) == wanted.section(section)
    start = wanted.section("trajectory").waypoints[0].position
    # 32 bits of a few tenths of a Blender unit.
    assert np.abs(bridge.pose(fingertip_of(bed))[:3] - start).max() < 1e-7
    # What a scene needs from elsewhere is in the .blend.
    assert (made.shape is None) == (wanted.shape is None)
    assert made.shape is None or made.shape.heights


@pytest.mark.parametrize(
    "name, sculpts", [("shapeshift", False), ("wagner_6x6", True), ("zhu_5x5", True)]
)
def test_a_display_opens_and_one_that_cannot_be_sculpted_says_so(name, sculpts, capfd):
    assert bpy.ops.digiclay.add_sample(sample=f"display:{name}") == {"FINISHED"}
    bed, wanted = bpy.context.object, load(find(name))
    made = properties.scene_of(bed)
    for section in ("layout", "actuator", "valve", "drive", "control"):
        assert getattr(made, section) == getattr(wanted, section), section
    (entry,) = takes.list_takes(bed)
    assert replayed(takes.read(bed, entry.number))
    assert ("cannot be sculpted" in capfd.readouterr().out) != sculpts


@pytest.mark.parametrize("name", ["face", "knot", list_shapes()[-1]])
def test_a_sample_shape_opens_on_a_bed_that_displays_it(name):
    assert bpy.ops.digiclay.add_sample(sample=f"shape:{name}") == {"FINISHED"}
    height = bridge.read_cells(bpy.context.object.data)["height"]
    # The dead band at either end.
    assert np.ptp(height) == pytest.approx(15e-3, abs=21e-6)


@pytest.mark.parametrize("name", ["tap", "dome_peaked"])
def test_a_sample_s_session_is_a_take_that_replays_bit_for_bit(name):
    assert bpy.ops.digiclay.add_sample(sample=f"session:{name}") == {"FINISHED"}
    bed = bpy.context.object
    (entry,) = takes.list_takes(bed)
    assert entry.name == name
    assert entry.seconds == pytest.approx(load(find(name)).simulation.duration, abs=5e-3)
    assert replayed(takes.read(bed, entry.number))


@pytest.mark.parametrize(
    "how", ["EXEC_DEFAULT", "INVOKE_DEFAULT"], ids=["in the dialog", "dropped"]
)
def test_a_scene_file_opens_and_a_session_too_long_to_wait_for_is_left_to_the_command_line(
    tmp_path, how
):
    path = tmp_path / "mein Beet äöü.toml"
    for text, pins in (
        ((SAMPLES / "tap.toml").read_text(), 121),
        ("simulation.duration = 3600", 625),
    ):
        path.write_text(text, encoding="utf-8")
        assert bpy.ops.digiclay.open_scene(how, filepath=str(path)) == {"FINISHED"}
        assert is_bed(bpy.context.object)
        assert len(bpy.context.object.data.vertices) == pins
    assert takes.list_takes(bpy.context.object) == []


@pytest.mark.parametrize(
    "content, said",
    [
        (None, "cannot be read"),
        ("[valve\n", "line 1"),
        ("[layout]\nrows = 0", "layout.rows must be at least 1"),
        ('[shape]\nfile = "nowhere.stl"', "nowhere.stl: there is no such file"),
    ],
)
def test_a_file_that_is_no_scene_is_refused_whole(tmp_path, content, said):
    path = tmp_path / "odd.toml"
    if content is not None:
        path.write_text(content, encoding="utf-8")
    before = len(bpy.data.objects), len(bpy.data.meshes)
    with pytest.raises(RuntimeError, match=said):
        bpy.ops.digiclay.open_scene(filepath=str(path))
    assert (len(bpy.data.objects), len(bpy.data.meshes)) == before


def test_a_scene_file_may_be_dropped_into_a_3d_view_only():
    class Context:
        area: Any = None

    class Area:
        type = "VIEW_3D"

    context = Context()
    assert not SceneFiles.poll_drop(context)
    context.area = Area()
    assert SceneFiles.poll_drop(context)
    context.area.type = "IMAGE_EDITOR"
    assert not SceneFiles.poll_drop(context)
    assert SceneFiles.bl_import_operator == "digiclay.open_scene"
