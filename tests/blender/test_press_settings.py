"""Settings of the Press tool: those of each brush, presets, keys, and what strokes get of them."""

import ast
import importlib
import itertools
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.live import handlers
from digiclay.press import brush, brush_presets, tool
from digiclay.press.brush import FINGERS, find_kind
from digiclay.roles import fingertip_of
from digiclay.settings import devices
from digiclay.strokes.stroke import Brush, Combine

from tests.blender.at_hand import done, in_the_view, new_bed

#: Keys of the tool.
KEYMAP = tool.PressTool.bl_keymap
SHIPPED = Path(brush_presets.HOME, "presets", brush_presets.SUBFOLDER)


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
    (folder,) = [Path(path) for path in bpy.utils.preset_paths(brush_presets.SUBFOLDER)][-1:]
    file = next(path for path in (SHIPPED / f"{name}.py", folder / f"{name}.py") if path.is_file())
    bpy.ops.digiclay.press_brush(filepath=str(file))
    assert bpy.types.DIGICLAY_PT_press_presets.bl_label == bpy.path.display_name(file.stem)


@pytest.mark.parametrize("file", sorted(SHIPPED.glob("*.py")), ids=lambda file: file.stem)
def test_each_preset_sets_a_known_finger_and_every_setting(settings, file):
    shown = settings.bl_rna.properties
    wanted = {name: shown[name].default for name in brush_presets.list_settings(settings)}
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
    assert str(SHIPPED) in bpy.utils.preset_paths(brush_presets.SUBFOLDER)
    bpy.context.object.digiclay.size = 40.0
    apply(file.stem)
    assert find_kind(devices.read_finger(bpy.context.object.digiclay)) in FINGERS.values()
    assert {name: getattr(settings, name) for name in wanted} == wanted


#: What a preset that cannot be applied contains, and what is said of it.
SPOILT = [
    ("settings.dept = 3.0", "spoilt.py: a key must be a setting of the Press tool (got 'dept')"),
    ('settings.brush = "RAIS"', "spoilt.py: brush must be a value of that setting (got 'RAIS')"),
    ('settings.brush = "RAISE"\nsettings.depth = "deep"', "depth must be a value"),
    ('settings.brush = "RAISE"\nsettings.depth = 1e9', "depth must be a value"),
    ("settings.depth = -1e999", "depth must be a value of that setting (got -inf)"),
    ("settings.radial = 1000000000", "radial must be a value"),
    ("settings.use_tilt = 1", "use_tilt must be a value"),
    ("settings.former = 'RAISE'", "a key must be a setting of the Press tool (got 'former')"),
    (
        'settings.brush = "RAISE"\nwm.digiclay_finger = (0.0, 1.0, 1.0)',
        "Fingertip.length must be above 0",
    ),
    ("wm.digiclay_finger = (5.0,)", "spoilt.py cannot be read: not enough values"),
    ("wm.digiclay_finger = 5.0", "spoilt.py cannot be read: "),
    ('wm.digiclay_finger = ("a", 1.0, 1.0)', "spoilt.py cannot be read: could not convert"),
    ("settings.depth = open('x')", "spoilt.py cannot be read: malformed"),
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
    assert brush_presets.find_icon(file, settings) == 0
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
        shown = settings.strength, bed.digiclay.size
        assert shown == pytest.approx((strength, size), rel=1e-5), name  # 32 bits
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


#: Brushes whose pictures lie flat, or show two ridges that they change.
FLAT = ("LOWER", "RAISE", "CREASE", "STAMP")


@pytest.mark.parametrize("name", [kind.value for kind in brush.BRUSH_WORDS])
def test_a_picture_shows_what_a_stroke_of_the_brush_leaves(settings, name):
    chosen = brush_presets.read_preset(SHIPPED / "Fingertip_Valley.py", settings)
    picture = brush_presets.draw_picture(chosen | {"brush": name})
    assert picture.shape == (brush_presets.SIDE, brush_presets.SIDE, 4)
    assert ((picture >= 0.0) & (picture <= 1.0)).all()
    corner, middle = (
        picture[2, 2, :3],
        picture[brush_presets.SIDE // 2, brush_presets.SIDE // 2, :3],
    )
    # The stroke goes through the middle, and not through the corner, which has the color of clay.
    assert np.ptp(corner / brush_presets.CLAY) < 1e-9
    assert np.ptp(middle / brush_presets.CLAY) > 0.05 or name not in (*FLAT, "LOCK")
    # Blue is raised and orange is lowered, as in the view.
    hue = np.sign(middle[0] - middle[2])
    assert hue == {"RAISE": -1.0, "STAMP": -1.0}.get(name, hue)
    assert hue == {"LOWER": 1.0, "CREASE": 1.0}.get(name, hue)
    other = brush_presets.draw_picture(chosen | {"brush": "LOWER", "symmetry": "X"})
    assert (np.abs(other - picture).max(axis=2) > 0.05).mean() > 0.05


def test_a_mirrored_preset_has_a_mirrored_picture_wherever_its_center_is(settings):
    chosen = brush_presets.read_preset(SHIPPED / "Mirrored_Halves.py", settings)
    whole = brush_presets.draw_picture(chosen | {"center_x": 90.0, "center_y": -90.0})
    orange = whole[:, :, 0] - whole[:, :, 2] > 0.2
    assert orange.mean() > 0.05
    # A pixel at the border may lie on either side of the threshold.
    assert (orange == orange[:, ::-1]).mean() > 0.98


def size_in_use():
    """Return the size of the fingertip, and of what is drawn of it, mm."""
    bed = bpy.context.object
    return [bed.digiclay.size, 2e3 * bridge.finger_of(fingertip_of(bed)).width]


def test_undo_and_redo_leave_each_brush_what_it_has(settings):
    for name, size in (("RAISE", 24.0), ("LOWER", 10.0), ("RAISE", 24.0)):
        settings.brush = name
        bpy.context.view_layer.update()
        bpy.context.object.digiclay.size = size
        done(f"Stroke of {name}")
    settings.strength = 0.3
    # Undo does not change the brush in hand, and so not its size; its lowest point stays.
    pose = bridge.poses(bpy.context.object)[0]
    for step in (bpy.ops.ed.undo, bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.redo):
        step()
        tool.settle_finger()
        bpy.context.view_layer.update()
        assert bridge.poses(bpy.context.object)[0] == pytest.approx(pose, abs=1e-6)
        assert (settings.brush, settings.strength) == ("RAISE", pytest.approx(0.3))
        assert size_in_use() == pytest.approx([24.0, 24.0], rel=1e-5)  # 32 bits
    settings.brush = "LOWER"
    assert settings.strength == 1.0
    assert size_in_use() == pytest.approx([10.0, 10.0], rel=1e-5)


MODIFIERS = ("ctrl", "shift", "alt", "oskey")


def find_key(kind, held):
    """Return a key with whether each of its modifiers is held."""
    return kind, *(bool(held.get(name)) for name in MODIFIERS)


@pytest.fixture(scope="module")
def blenders_keys():
    """Blender's own keymaps: their entries, operator, event and properties, by name."""
    presets = bpy.utils.resource_path("LOCAL")
    sys.path.append(str(Path(presets, "scripts", "presets", "keyconfig", "keymap_data")))
    try:
        blender_default = importlib.import_module("blender_default")
    finally:
        sys.path.pop()
    maps = blender_default.generate_keymaps(blender_default.Params())
    return {name: content["items"] for name, _, content in maps}


def test_no_key_of_blender_s_in_object_mode_is_taken_outside_the_tool(blenders_keys):
    # What Blender looks through in a 3D view in Object Mode.
    looked = ("Object Mode", "Object Non-modal", "3D View", "3D View Generic", "Window")
    looked += ("Screen Editing",)
    taken = {
        find_key(event["type"], event)
        for name in looked
        for _, event, *_ in blenders_keys.get(name, ())
    }
    # A key with any modifiers is one with each of them.
    keys = {
        (key, *values) if held.get("any") else find_key(key, held)
        for _, _, key, held in handlers.KEYS
        for values in itertools.product([False, True], repeat=len(MODIFIERS))
    }
    assert ("S", False, False, True, False) in taken, "Alt S clears the scale"
    assert taken.isdisjoint(keys)


def test_size_and_strength_have_the_keys_of_sculpt(blenders_keys):
    theirs = {
        dict(more["properties"])["data_path_primary"].rpartition(".")[-1]: find_key(
            event["type"], event
        )
        for operator, event, more in blenders_keys["Sculpt"]
        if operator == "wm.radial_control"
    }
    ours = {operator: find_key(event["type"], event) for operator, event, _ in KEYMAP}
    assert ours["digiclay.press_size"] == theirs["size"]
    assert ours["digiclay.press_strength"] == theirs["strength"]
    assert ours["digiclay.press_depth"] == ("F", True, False, False, False)
    assert (
        len({find_key(event["type"], event) for _, event, _ in KEYMAP if event["type"] in "FEY"})
        == 5
    )


def test_a_saved_preset_brings_back_what_was_set_and_is_removed(settings, tmp_path):
    settings.depth, settings.symmetry, settings.path = 7.5, "XY", "RING"
    bpy.context.object.digiclay.size = 11.0
    bpy.ops.digiclay.press_brush_save(name="Of my own")
    (saved,) = [
        file
        for path in bpy.utils.preset_paths(brush_presets.SUBFOLDER)
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


def test_a_falloff_of_the_tool_is_that_of_its_brush_and_smooth_has_one(settings):
    for own, falloffs in (("DEVICE", ["DEVICE", "SMOOTH"]), ("SPHERE", ["SPHERE", "SMOOTH"])):
        settings.falloff = own  # of the brush in hand, Lower, and of its inverse
        kinds = Brush.RAISE, Brush.SMOOTH, Brush.ERASE
        found = [brush.find_options(settings, kind)["falloff"].name for kind in kinds]
        assert found == [*falloffs, "DEVICE"]


#: Why the user's folder of presets cannot be written, by what stands there.
UNWRITABLE = {
    "a file is where the folder is to be": lambda home: (home / "presets").write_text(""),
    "the preset's file leads to a folder that is missing": lambda home: _lead_away(home),
}


def _lead_away(home):
    folder = home / "presets" / brush_presets.SUBFOLDER
    folder.mkdir(parents=True)
    (folder / "Of_my_own.py").symlink_to(home / "missing" / "Of_my_own.py")


@pytest.mark.parametrize("spoil", UNWRITABLE.values(), ids=UNWRITABLE.keys())
def test_a_preset_that_cannot_be_saved_is_told_of_in_one_line(settings, tmp_path, spoil):
    spoil(tmp_path)
    with pytest.raises(RuntimeError, match=r"The preset could not be saved: .*presets") as caught:
        bpy.ops.digiclay.press_brush_save(name="Of my own")
    assert len(str(caught.value).strip().splitlines()) == 1
    assert len(str(caught.value)) < 400
