"""The Press tool: where the mouse points, size and presets of the brush, and strokes that a script plays."""

import ast
import importlib
import sys
from pathlib import Path

import bpy
import digiclay
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.base.errors import DigiclayError
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.layout import make_grid
from digiclay.core.scene.assembly import assemble
from digiclay.live import beds, handlers
from digiclay.operators.press_adjust import AdjustStrength, BrushMenu
from digiclay.press import aim, brush, tool
from digiclay.press.brush import FINGERS, find_kind
from digiclay.roles import fingertip_of
from digiclay.sessions import running
from digiclay.settings import devices, properties
from digiclay.strokes.stroke import Brush, Combine

from tests.assemble import assert_near
from tests.blender.at_hand import in_the_view, new_bed

#: How much larger the bed is than it is added: it then fills a good part of the factory file's
#: view.
LARGER = 8.0


def tools():
    """Return our tools in the toolbar of the 3D view in Object Mode, down through its groups."""
    from bl_ui.space_toolsystem_toolbar import VIEW3D_PT_tools_active

    found, left = [], list(VIEW3D_PT_tools_active._tools["OBJECT"])
    while left:
        tool = left.pop()
        if isinstance(tool, list | tuple) and not hasattr(tool, "idname"):
            left += tool
        elif tool is not None and tool.idname.startswith("digiclay"):
            found.append(tool.idname)
    return found


@pytest.fixture
def bed(extension):
    """A staggered bed whose pins all have heights of their own, turned, moved and scaled uniformly."""
    made = new_bed(rows=12, columns=15, arrangement="staggered")
    made.scale = (LARGER,) * 3
    made.rotation_euler = (0.1, -0.2, 0.5)
    cells, height = aim.read_surface(made)
    bridge.write_cells(made.data, cells.positions, height + 0.0003 * np.sin(np.arange(cells.count)))
    bpy.context.view_layer.update()
    return made


@pytest.fixture
def context(bed):
    with in_the_view():
        yield bpy.context


def test_blender_reads_the_icon_of_the_tool():
    # As Blender's toolbar does: the name with the ending of its format.
    handle = bpy.app.icons.new_triangles_from_file(f"{tool.PressTool.bl_icon}.dat")
    assert handle > 0
    bpy.app.icons.release(handle)


def test_the_tool_comes_and_goes_with_the_extension():
    assert tools() == []
    for _ in range(2):
        digiclay.register()
        assert tools() == [tool.PressTool.bl_idname]
        digiclay.unregister()
        assert tools() == []


def test_a_pixel_on_the_top_of_a_pin_points_at_that_pin(bed, context):
    cells, height = aim.read_surface(bed)
    tops = np.column_stack([cells.positions, height])
    pixels = bridge.project(context, bed, tops)
    met = [aim.find_target(context, tuple(xy)) for xy in pixels]
    assert all(found is not None and found.bed == bed for found in met)
    near = np.array([found.point for found in met])
    # A pin may hide another; whatever is met lies in front of the top that was asked for, on the
    # same ray.
    eye = np.array(
        bed.matrix_world.inverted() @ context.region_data.view_matrix.inverted().translation
    )
    eye /= bridge.SCALE
    visible = np.array([found.pin for found in met]) == np.arange(cells.count)
    assert visible.sum() > 0.9 * cells.count
    # Blender's matrices are float32, at a distance of 2 m of the device.
    assert_near(near[visible], tops[visible], 2e-6)
    closer = np.linalg.norm(near - eye, axis=1) <= np.linalg.norm(tops - eye, axis=1) + 2e-6
    assert closer.all()


def test_a_place_in_the_view_agrees_with_blenders_own_projection(bed, context):
    from bpy_extras.view3d_utils import location_3d_to_region_2d
    from mathutils import Vector

    place = np.array([[0.01, -0.02, 0.045]])
    world = bed.matrix_world @ Vector(place[0] * bridge.SCALE)
    theirs = location_3d_to_region_2d(context.region, context.region_data, world)
    # A thousandth of a pixel: theirs is reckoned in float32.
    assert_near(bridge.project(context, bed, place)[0], theirs, 1e-2)
    # What lies behind the eye is nowhere on the screen.
    eye = np.array(
        bed.matrix_world.inverted() @ context.region_data.view_matrix.inverted().translation
    )
    assert np.isnan(bridge.project(context, bed, 1.5 * eye[None] / bridge.SCALE)).all()


def test_a_hidden_or_unevenly_scaled_bed_is_looked_through_and_says_why(bed, context):
    cells, height = aim.read_surface(bed)
    middle = np.array([[0.0, 0.0, float(height.max())]])
    xy = tuple(bridge.project(context, bed, middle)[0])
    assert aim.find_target(context, (0.0, 0.0)) is None
    assert aim.find_target(context, xy) is not None
    assert bpy.ops.digiclay.press.poll()
    bed.hide_set(True)
    assert not bpy.ops.digiclay.press.poll()
    assert aim.find_target(context, xy) is None
    bed.hide_set(False)
    bed.scale.z *= 1.2
    bpy.context.view_layer.update()
    assert aim.find_target(context, xy) is None
    with pytest.raises(DigiclayError, match="the same along x, y and z"):
        aim.hit_point(context, bed, cells, height, xy)


def test_without_a_session_the_surface_is_what_is_drawn(bed):
    cells, height = aim.read_surface(bed)
    wanted = make_grid(properties.scene_of(bed).layout)
    np.testing.assert_array_equal(cells.positions, wanted.positions)
    np.testing.assert_array_equal(height, bridge.read_cells(bed.data)["height"])


def test_the_patch_lies_on_the_pins_about_the_mouse_as_wide_as_the_finger_pressed_in(bed):
    cells, _ = aim.read_surface(bed)
    rim = tool.touch_outline(bed, cells.layout, np.array([0.002, 0.001]), 4e-3)
    finger = bridge.finger_of(fingertip_of(bed))
    # Pressed in by half its height of 8 mm, an ellipsoid is cut at sqrt(3)/2 of its width.
    across = np.ptp(rim, axis=0) / 2
    np.testing.assert_allclose(
        across, np.sqrt(0.75) * np.array([finger.length, finger.width]), rtol=1e-6
    )
    assert_near(rim.mean(axis=0), [0.002, 0.001], 1e-9)


def test_the_text_beside_the_cursor_names_brush_and_height_or_depth_with_its_unit():
    finger = Fingertip()
    assert brush.describe_brush(finger, Brush.RAISE, 15e-3) == "Size 16 mm   Raise, height 15 mm"
    assert (
        brush.describe_brush(finger, Brush.LOWER, 4e-3, 0.5)
        == "Size 16 mm   Lower, depth 4 mm × 50 %"
    )
    assert brush.describe_brush(finger, Brush.LEVEL, 4e-3) == "Size 16 mm   Level 100 %"
    assert brush.describe_brush(finger, Brush.SMOOTH, 4e-3, 0.8) == "Size 16 mm   Smooth 80 %"
    assert brush.describe_brush(finger, Brush.UNLOCK, 4e-3) == "Size 16 mm   Unlock"
    assert brush.describe_brush(finger, Brush.STAMP, 4e-3) == "Size 16 mm   Stamp, height 4 mm"
    assert [one for one in Brush if brush.amount_name(one) == "height"] == [
        Brush.RAISE,
        Brush.STAMP,
        Brush.CREST,
    ]


@pytest.fixture
def paper(extension):
    made = new_bed()
    bpy.context.view_layer.update()
    return made


def lengths(paper):
    """Return size of the fingertip, then radius, edge and flat radius of the blister, mm."""
    scene = properties.scene_of(paper)
    blister = scene.blister
    width = 2.0 * scene.fingers[0].fingertip.width
    lengths = (width, blister.radius, blister.edge_radius, blister.flat_radius)
    return tuple(round(1e3 * length, 4) for length in lengths)


@pytest.mark.parametrize(
    "follows, size, wanted",
    [
        (True, 8.0, (8.0, 7.5, 9.25, 3.0)), (False, 8.0, (8.0, 15.0, 18.5, 6.0)),
        (False, 60.0, (60.0, 15.0, 18.5, 6.0)),
    ],
)  # fmt: skip
def test_the_ellipsoid_follows_the_size_and_the_blister_unless_it_is_set_by_itself(
    paper, follows, size, wanted
):
    before = bridge.pose(fingertip_of(paper))
    paper.digiclay.blister_follows = follows
    paper.digiclay.size = size
    assert lengths(paper) == wanted
    bpy.context.view_layer.update()
    finger, half = bridge.finger_of(fingertip_of(paper)), size * 0.5e-3
    assert (finger.length, finger.width, finger.height) == pytest.approx(
        (1.25 * half, half, half), rel=1e-6
    )
    # The lowest point stays: a larger finger does not press.
    assert_near(bridge.pose(fingertip_of(paper)), before, 1e-7)


@pytest.mark.parametrize("name, usual", [("length", 20.0), ("width", 16.0), ("height", 16.0)])
def test_the_panel_shows_whole_widths_and_stores_semi_axes(paper, name, usual):
    group, lowest = paper.digiclay.fingertip, bridge.pose(fingertip_of(paper))
    assert getattr(group, f"whole_{name}") == usual
    setattr(group, f"whole_{name}", 12.6)
    bpy.context.view_layer.update()
    (finger,) = properties.scene_of(paper).fingers
    assert getattr(finger.fingertip, name) == 6.3e-3
    assert paper.digiclay.size == pytest.approx(12.6 if name == "width" else 16.0)
    assert_near(bridge.pose(fingertip_of(paper)), lowest, 1e-7)
    assert group.bl_rna.properties[f"whole_{name}"].description.endswith(f"by default {usual:g} mm")


@pytest.mark.parametrize(
    "typed, share",
    [
        ("0.5", 0.5),
        (".25", 0.25),
        ("1", 1.0),
        ("50", 0.5),
        ("50 %", 0.5),
        ("0.5%", 5e-3),
        ("2*0.3", 0.6),
    ],
)
def test_a_strength_is_typed_as_a_share_or_in_per_cent(typed, share):
    assert AdjustStrength.parse(None, typed) == pytest.approx(share, rel=1e-9)


def test_a_blister_that_the_bed_limits_is_the_same_again_with_the_size_before(paper):
    paper.digiclay.size = 100.0
    # Half the bed's longer side; a wider blister is no valid scene.
    assert lengths(paper)[:2] == (100.0, 37.5)
    paper.digiclay.size = 80.0
    assert lengths(paper)[1] == 37.5
    paper.digiclay.size = 16.0
    assert lengths(paper) == pytest.approx((16.0, 15.0, 18.5, 6.0), rel=1e-5)


@pytest.mark.parametrize("asked, got", [(-5.0, 1.0), (0.0, 1.0), (1e9, 200.0)])
def test_a_size_stays_within_what_a_finger_can_have(paper, asked, got):
    devices.set_size(paper.digiclay, 1e-3 * asked)
    assert lengths(paper)[0] == pytest.approx(got, rel=1e-6)


def test_the_bracket_keys_scale_it_and_undo_brings_it_back_and_without_a_fingertip_they_do_nothing(
    paper,
):
    bpy.ops.ed.undo_push(message="Add")
    bpy.ops.digiclay.press_scale("EXEC_DEFAULT", True, scalar=1.5)
    assert lengths(bpy.context.object)[0] == pytest.approx(24.0)
    bpy.ops.ed.undo()
    assert lengths(bpy.context.object)[0] == pytest.approx(16.0)
    bpy.data.objects.remove(fingertip_of(bpy.context.object))
    assert not bpy.ops.digiclay.press_scale.poll()


@pytest.mark.parametrize("kind", list(FINGERS))
def test_each_preset_finger_can_be_simulated_and_is_undone_in_one_step(paper, kind):
    bpy.ops.ed.undo_push(message="Add")
    paper.digiclay.size = 30.0
    bpy.ops.ed.undo_push(message="Size")
    bpy.ops.digiclay.press_finger("EXEC_DEFAULT", True, kind=kind)
    scene = properties.scene_of(bpy.context.object)
    assert find_kind(scene.fingers[0].fingertip) is FINGERS[kind]
    assert scene.blister.radius == pytest.approx(
        min(37.5e-3, 15 / 8 * FINGERS[kind].finger.width), rel=1e-5
    )
    assemble(scene)
    bpy.ops.ed.undo()
    assert lengths(bpy.context.object)[0] == pytest.approx(30.0)


SHIPPED = Path(brush.HOME, "presets", brush.SUBFOLDER)


@pytest.fixture
def settings(extension, tmp_path, monkeypatch):
    """The settings of the tool in hand, over a bed; the user's own presets are in a folder of their own."""
    monkeypatch.setenv("BLENDER_USER_SCRIPTS", str(tmp_path))
    new_bed()
    with in_the_view():
        bpy.ops.wm.tool_set_by_id(name=brush.TOOL)
        yield brush.tool_settings(bpy.context)


def apply(name):
    """Apply a preset as its entry in the menu does."""
    (folder,) = [Path(path) for path in bpy.utils.preset_paths(brush.SUBFOLDER)][-1:]
    file = next(path for path in (SHIPPED / f"{name}.py", folder / f"{name}.py") if path.is_file())
    bpy.ops.digiclay.press_brush(filepath=str(file))
    assert BrushMenu.bl_label == bpy.path.display_name(file.stem)


@pytest.mark.parametrize("file", sorted(SHIPPED.glob("*.py")), ids=lambda file: file.stem)
def test_each_preset_sets_a_known_finger_and_every_setting(settings, file):
    shown = settings.bl_rna.properties
    wanted = {name: shown[name].default for name in brush.list_settings(settings)}
    lines = [
        line.split(" = ") for line in file.read_text().splitlines() if line.startswith("settings.")
    ]
    wanted |= {name.removeprefix("settings."): ast.literal_eval(value) for name, value in lines}
    settings.brush, settings.depth, settings.height, settings.strength = "LEVEL", 9.0, 9.0, 0.5
    settings.symmetry, settings.path, settings.stabilizer, settings.pressure_curve = (
        "XY",
        "LINE",
        9.0,
        "SOFT",
    )
    settings.use_pressure = settings.use_tilt = False
    assert str(SHIPPED) in bpy.utils.preset_paths(brush.SUBFOLDER)
    bpy.context.object.digiclay.size = 40.0
    apply(file.stem)
    assert find_kind(devices.read_finger(bpy.context.object.digiclay)) in FINGERS.values()
    assert {name: getattr(settings, name) for name in wanted} == wanted


#: What a preset that cannot be applied contains, and what is said of it.
SPOILT = [
    ("settings.dept = 3.0", "spoilt.py: a key must be a setting of the Press tool (got 'dept')"),
    ('settings.brush = "RAIS"', "brush must be a value of that setting (got 'RAIS')"),
    ('settings.brush = "RAISE"\nsettings.depth = "deep"', "depth must be a value"),
    ('settings.brush = "RAISE"\nwm.digiclay_finger = (0.0, 1.0, 1.0)', "digiclay_finger must be"),
    ("wm.digiclay_finger = (5.0,)", "digiclay_finger must be"),
    ("settings.depth = open('x')", "spoilt.py cannot be read: malformed"),
    ("settings.depth = nan", "spoilt.py cannot be read: malformed"),
    ("settings.depth = ", "spoilt.py cannot be read: invalid syntax"),
    ("\x00", "spoilt.py cannot be read: source code"),
    (None, "spoilt.py cannot be read"),
]


@pytest.mark.parametrize("content, said", SPOILT, ids=[str(row[0]) for row in SPOILT])
def test_a_preset_that_cannot_be_applied_is_told_of_in_one_line_and_changes_nothing(
    settings, tmp_path, content, said
):
    settings.depth, settings.symmetry, settings.strength = 7.5, "XY", 0.3
    names = {*settings.bl_rna.properties.keys()} - {"rna_type"}
    before = {name: getattr(settings, name) for name in names}
    file = tmp_path / "spoilt.py"
    if content is not None:
        file.write_text(content)
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.digiclay.press_brush(filepath=str(file))
    line = str(caught.value).strip()
    assert said in line
    assert len(line.splitlines()) == 1
    assert len(line) < 400
    assert {name: getattr(settings, name) for name in names} == before
    assert bpy.context.object.digiclay.size == pytest.approx(16.0, rel=1e-6)  # 32 bits


#: Brush, its strength, and the size of its fingertip, mm, chosen one after the other.
CHOSEN = [("LOWER", 0.3, 12.0), ("RAISE", 0.8, 24.0), ("SMOOTH", 0.1, 40.0)]


def test_each_brush_has_a_strength_and_a_fingertip_of_its_own(settings):
    bed = bpy.context.object
    for name, strength, size in CHOSEN:
        settings.brush = name
        assert settings.strength == 1.0, f"{name} has not been set"
        settings.strength, bed.digiclay.size = strength, size
    finger = devices.read_finger(bed.digiclay)
    for name, strength, size in (*CHOSEN, *CHOSEN):
        settings.brush = name
        shown = settings.strength, bed.digiclay.size, lengths(bed)[0]
        assert shown == pytest.approx((strength, size, size), rel=1e-5), name  # 32 bits
        assert bridge.finger_of(fingertip_of(bed)).width == pytest.approx(5e-4 * size, rel=1e-5)
        # Shift smooths with the strength of Smooth, Ctrl inverts with that of the brush.
        assert brush.read_own(settings, "strength", Brush.SMOOTH) == pytest.approx(0.1)
        for kind in (Brush(name), Brush(name).inverse):
            assert brush.read_own(settings, "strength", kind) == pytest.approx(strength)
    # The form comes back bit for bit, the blister but for the rounding of 32 bits.
    assert devices.read_finger(bed.digiclay) == finger
    settings.brush = "LEVEL"  # not used yet: its fingertip is the present one
    assert (settings.strength, bed.digiclay.size) == (1.0, pytest.approx(40.0))


def test_a_bed_that_comes_into_use_later_gets_the_fingertip_of_the_brush_when_it_is_pressed(
    settings,
):
    first = bpy.context.object
    settings.brush = "RAISE"
    first.digiclay.size = 24.0
    bpy.ops.mesh.digital_clay_add(rows=6, columns=6)
    other = bpy.context.object
    other.digiclay.size = 10.0
    settings.brush = "LOWER"
    assert [bed.digiclay.size for bed in (first, other)] == pytest.approx([24.0, 10.0])
    brush.take_finger(bpy.context, first)
    assert first.digiclay.size == pytest.approx(16.0)
    settings.brush = "RAISE"
    brush.take_finger(bpy.context, first)
    assert first.digiclay.size == pytest.approx(24.0)


def test_a_file_keeps_what_each_brush_has(extension, tmp_path):
    new_bed()
    with in_the_view():
        bpy.ops.wm.tool_set_by_id(name=brush.TOOL)
        settings = brush.tool_settings(bpy.context)
        for name, strength, size in CHOSEN:
            settings.brush = name
            settings.strength, bpy.context.object.digiclay.size = strength, size
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "brushes.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "brushes.blend"))
    with in_the_view():
        opened = brush.tool_settings(bpy.context)
        for name, strength, size in CHOSEN:
            opened.brush = name
            shown = opened.strength, bpy.context.object.digiclay.size
            assert shown == pytest.approx((strength, size), rel=1e-5), name  # 32 bits


def test_no_key_of_blender_s_in_object_mode_is_taken_outside_the_tool():
    presets = bpy.utils.resource_path("LOCAL")
    sys.path.append(str(Path(presets, "scripts", "presets", "keyconfig", "keymap_data")))
    try:
        blender_default = importlib.import_module("blender_default")
    finally:
        sys.path.pop()
    # What Blender looks through in a 3D view in Object Mode.
    looked = (
        "Object Mode",
        "Object Non-modal",
        "3D View",
        "3D View Generic",
        "Window",
        "Screen Editing",
    )
    taken = {
        (event["type"], *(bool(event.get(key)) for key in ("ctrl", "shift", "alt", "oskey")))
        for name, _, content in blender_default.generate_keymaps(blender_default.Params())
        if name in looked
        for _, event, *_ in content["items"]
    }
    keys = [
        (key, *(bool(held.get(name)) for name in ("ctrl", "shift", "alt", "oskey")))
        for _, _, key, held in handlers.KEYS
    ]
    assert ("S", False, False, True, False) in taken, "Alt S clears the scale"
    assert taken.isdisjoint(keys)


def test_a_saved_preset_brings_back_what_was_set_and_is_removed(settings, tmp_path):
    settings.depth, settings.symmetry, settings.path = 7.5, "XY", "RING"
    bpy.context.object.digiclay.size = 11.0
    bpy.ops.digiclay.press_brush_save(name="Of my own")
    (saved,) = [
        file
        for path in bpy.utils.preset_paths(brush.SUBFOLDER)
        for file in Path(path).glob("Of_my_own.py")
    ]
    assert saved.is_relative_to(tmp_path)
    settings.depth, settings.symmetry, settings.path = 2.0, "NONE", "FREE"
    bpy.context.object.digiclay.size = 30.0
    bpy.ops.digiclay.press_brush(filepath=str(saved))
    assert (settings.depth, settings.symmetry, settings.path) == (7.5, "XY", "RING")
    assert bpy.context.object.digiclay.size == pytest.approx(11.0, abs=1e-3)
    bpy.ops.digiclay.press_brush_save(name="Of_my_own", remove_name=True)
    assert not saved.exists()
    bpy.ops.wm.tool_set_by_id(name="builtin.select_box")
    assert not bpy.ops.digiclay.press_brush.poll()


@pytest.mark.parametrize(
    "kind, values, combine, limits",
    [
        (Brush.RAISE, {}, Combine.HIGHEST, None),
        (Brush.LOWER, {}, Combine.LOWEST, None),
        (Brush.RAISE, {"accumulate": True}, Combine.USUAL, None),
        (Brush.RAISE, {"combine": "LOWEST"}, Combine.HIGHEST, None),
        (Brush.LEVEL, {}, Combine.USUAL, None),
        (Brush.IMPRINT, {"combine": "REPLACE"}, Combine.REPLACE, None),
        (Brush.SMOOTH, {"combine": "ADD"}, Combine.USUAL, None),
        (Brush.STAMP, {"use_limit": True}, Combine.USUAL, (-10e-3, 10e-3)),
        (
            Brush.LOWER,
            {"use_limit": True, "limit_low": 5.0, "limit_high": -2.0},
            Combine.LOWEST,
            (-2e-3, 5e-3),
        ),
    ],
)
def test_a_stroke_combines_and_is_limited_as_the_tool_is_set(
    settings, kind, values, combine, limits
):
    for name, value in values.items():
        setattr(settings, name, value)
    options = brush.find_options(settings, kind)
    assert options["combine"] is combine
    assert options.get("limits") == (limits and pytest.approx(limits))


PRESS = "[[stroke]]\ndepth = 0.003\nwidth = 0.012\nmoves = [[0, -0.006, 0], [0.2, 0.006, 0]]\n"


@pytest.fixture
def small(extension):
    return new_bed(rows=9, columns=11)


def depths(small):
    """Return how far the pins drawn are below rest, mm."""
    return 40.0 - 1e3 * bridge.read_cells(small.data)["height"].reshape(9, 11)


def test_strokes_are_formed_and_kept_by_the_bed(small, tmp_path):
    file = tmp_path / "press.toml"
    file.write_text(PRESS, encoding="utf-8")
    assert bpy.ops.digiclay.play_strokes(filepath=str(file)) == {"FINISHED"}
    assert depths(small)[4, 5] > 1.5
    assert running.find(small) is None
    assert beds.read_snapshot(small) is not None
    # Its fingertip is above the bed again, of its own size.
    assert bridge.finger_of(fingertip_of(small)).width == pytest.approx(8e-3)
    assert bridge.pose(fingertip_of(small))[2] > 40e-3


@pytest.mark.parametrize("kind, deepest", [("crease", (2.8, 3.1)), ("flatten", (-0.1, 0.1))])
def test_creases_are_cut_and_flattened_without_a_touch(small, tmp_path, kind, deepest):
    file, crease = tmp_path / "press.toml", f'{PRESS}brush = "crease"\n'
    more = f'{PRESS}brush = "{kind}"\nfalloff = "constant"\n' if kind == "flatten" else ""
    file.write_text(f"{crease}{more}", encoding="utf-8")
    assert bpy.ops.digiclay.play_strokes(filepath=str(file)) == {"FINISHED"}
    low, high = deepest
    row = depths(small)[4, 4:7]
    assert low < row.max() - (row.min() if kind == "flatten" else 0.0) < high


def test_a_falloff_of_the_tool_is_that_of_its_brush_and_smooth_has_one(settings):
    kinds = Brush.RAISE, Brush.SMOOTH, Brush.ERASE
    assert [brush.find_falloff(settings, kind).name for kind in kinds] == [
        "DEVICE",
        "SMOOTH",
        "DEVICE",
    ]
    settings.falloff = "SPHERE"  # of the brush in hand, Lower, and of its inverse
    assert [brush.find_falloff(settings, kind).name for kind in kinds] == [
        "SPHERE",
        "SMOOTH",
        "DEVICE",
    ]


@pytest.mark.parametrize(
    "text, said",
    [
        ("[[stroke", "line 1"),
        (f'{PRESS}falloff = "bent"\n', "falloff must be one of"),
        (f'{PRESS}falloff = "root"\n', r"Stroke 1 \(lower\) needs a method with a blister"),
        (f"{PRESS}wide = 3", "known key"),
        (f'{PRESS}{PRESS}brush = "raise"\n', r"Stroke 2 \(raise\) needs a method with a blister"),
    ],
)
def test_strokes_that_cannot_be_read_or_formed_leave_the_bed_as_it_was(small, tmp_path, text, said):
    small.digiclay.method = "elastic"
    file = tmp_path / "wrong.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(RuntimeError, match=said) as caught:
        bpy.ops.digiclay.play_strokes(filepath=str(file))
    assert "Traceback" not in str(caught.value)
    assert np.abs(depths(small)).max() < 1e-3
    assert running.find(small) is None
