"""A live session makes a scene of its bed's settings when they have changed, in the very next tick."""

import dataclasses

import bpy
import digiclay
import numpy as np
import pytest
from digiclay.core.control.methods import METHODS
from digiclay.core.scene.scene_source import load
from digiclay.core.scene.schema import OPTIONAL, SECTIONS, import_parameters
from digiclay.live import handlers
from digiclay.sessions import running
from digiclay.settings import properties

from tests.blender.at_hand import push_step
from tests.blender.session.live import TICK, exact, move, press, started, undone, waits

#: Set point of the force, N, and where it stands.
DEFAULT, SET_POINT = 0.4, "digiclay.control.virtual_master.force_setpoint"


def set_point():
    """Return the set point that the only session simulates, N."""
    (session,) = running.list_sessions()
    return session.scene.control.force_setpoint


def parameters():
    """Give method, section and name of every parameter; those of a method once a method."""
    for method in METHODS:
        for section in SECTIONS if method == "virtual_master" else ("control",):
            for field in dataclasses.fields(import_parameters(section, method)):
                if len(field.metadata["quantity"].choices) != 1:
                    yield method, section, field.name


def change(group, name):
    """Give a property another value."""
    known, value = group.bl_rna.properties[name], getattr(group, name)
    if known.type == "BOOLEAN":
        other = not value
    elif known.type == "ENUM":
        other = next(item.identifier for item in known.enum_items if item.identifier != value)
    elif known.type == "STRING":
        other = f"{value}, 1"
    else:
        middle = 0.5 * (known.hard_min + known.hard_max)
        other = value + 1 if value + 1 <= known.hard_max else 0.5 * value or middle
    setattr(group, name, other)
    assert getattr(group, name) != value, name


def test_settings_that_stay_are_not_read_again(bed, clock, monkeypatch):
    made = []
    scene_of = properties.scene_of

    def counted(which):
        made.append(which.name)
        return scene_of(which)

    started(bed)
    monkeypatch.setattr(properties, "scene_of", counted)
    assert move(bed, clock, [(0.0, z) for z in np.linspace(46, 37, 20)]) == []
    assert made == []
    bed.digiclay.control.virtual_master.force_setpoint = 0.8
    clock.tick(20)
    assert made == [bed.name]


def test_every_parameter_and_choice_that_is_changed_changes_the_stored_settings(bed):
    settings = bed.digiclay
    for method, section, name in parameters():
        settings.method = method
        before = properties.read_stored_settings(bed)
        change(properties.part_group(settings, section), name)
        assert properties.read_stored_settings(bed) != before, (section, name)
    for name in ("preset", "method", "notes", *(f"use_{part}" for part in OPTIONAL)):
        before = properties.read_stored_settings(bed)
        assert properties.read_stored_settings(bed) == before
        change(settings, name)
        assert properties.read_stored_settings(bed) != before, name


@pytest.mark.parametrize("how", ["animation", "driver"])
def test_a_setting_that_blender_moves_is_simulated_from_the_next_tick(bed, clock, how):
    if how == "animation":
        for frame in (1, 11):
            bed.digiclay.control.virtual_master.force_setpoint = 0.1 * frame
            bed.keyframe_insert(SET_POINT, frame=frame)
    else:
        bed.driver_add(SET_POINT).driver.expression = "0.1 * frame"
    bpy.context.scene.frame_set(1)
    started(bed)
    found = []
    for frame in (2, 5, 6):
        bpy.context.scene.frame_set(frame)
        shown = bed.digiclay.control.virtual_master.force_setpoint
        clock.tick()
        assert set_point() == pytest.approx(shown)
        found.append(set_point())
    assert found[0] < found[1] < found[2]


def test_a_session_whose_settings_change_in_every_tick_keeps_up_with_time(bed, clock):
    started(bed)
    clock.tick()
    before = running.list_sessions()[0].state.period
    for count in range(12):
        bed.digiclay.control.virtual_master.force_setpoint = 0.1 + 0.1 * count
        assert clock.tick() == []
        assert set_point() == pytest.approx(0.1 + 0.1 * count)
    (session,) = running.list_sessions()
    # A control period less where the ticks do not end with one.
    assert session.state.period - before >= 12 * TICK // session.system.period - 1


def test_a_setting_that_undo_puts_back_is_simulated_with_its_state(bed, clock):
    push_step("Add")
    started(bed)
    bed.digiclay.control.virtual_master.force_setpoint = 0.8
    push_step("Set")
    press(bed, clock)
    assert set_point() == pytest.approx(0.8)
    undone(clock)
    assert set_point() == pytest.approx(DEFAULT)
    assert (exact() == 40e-3).all()
    bpy.ops.ed.redo()
    clock.tick(handlers.STALE)
    assert set_point() == pytest.approx(0.8)


def test_a_pin_that_was_moved_aside_stops_the_session_in_the_next_tick(bed, clock):
    started(bed)
    bed.data.vertices[0].co.x += 0.01
    waits(bed, clock, words="differ from the parameters of Layout")


def test_a_session_is_told_by_the_new_name_of_its_bed(bed, clock):
    started(bed)
    name, bed.name = bed.name, "Renamed"
    bpy.data.objects["Cube"].name = name
    clock.tick()
    (session,) = running.list_sessions()
    assert session.name == session.scene.name == "Renamed"


#: Files as of `digiclay fit`: of a finger and of a cell.
FINGER = """description = "Fitted pulp"
[fingertip]
length = 0.012
width = 0.009
height = 0.0085
[contact]
stiffness = 500.123456
exponent = 1751.533
[relaxation]
times = [0.00187009, 0.00307019, 0.004255916]
weights = [0.08546971, 0.6285909, 0.1962111, 0.08972834]
[uncertainty]
keys = ["contact.stiffness"]
logarithms = [true]
covariance = [[0.01]]
"""
CELL = """[actuator]
bore = 0.0021
[valve]
orifice_diameter = 0.0004599788
[delay]
dead_time = 0.001558179
"""


def take_parts(folder, text):
    """Give the bed the parts of a file; return the scene that the file is alone, without its name."""
    path = folder / "fitted.toml"
    path.write_text(text, encoding="utf-8")
    assert bpy.ops.digiclay.preset_parts(filepath=str(path)) == {"FINISHED"}
    return load(path)


def test_a_bed_has_the_parts_of_files_and_its_finger_presses_with_them(bed, clock, tmp_path):
    before = properties.scene_of(bed)
    finger = take_parts(tmp_path, FINGER)
    # The blister follows the finger's width, as when it is resized by hand.
    assert properties.scene_of(bed).blister.radius == pytest.approx(before.blister.radius * 9 / 8)
    cell = take_parts(tmp_path, CELL)
    scene = properties.scene_of(bed)
    for name in SECTIONS:
        wanted = cell if name in ("actuator", "valve", "delay") else before
        wanted = finger if name in ("fingertip", "contact", "relaxation") else wanted
        assert name == "blister" or scene.section(name) == wanted.section(name), name

    bed.digiclay.use_control = False  # so that no valve opens
    started(bed)
    depth = 1.5
    top = 1e3 * scene.actuator.rest_height
    lifted = 1e3 * (scene.section("fingertip").height - 8e-3)  # `move` has the paper's finger
    place = (0.0, top - depth + lifted)
    assert move(bed, clock, [(0.0, 60.0), *[place] * 5]) == []
    elastic = digiclay.force(scene, [0.0, 0.0, (top - depth) * 1e-3]).sum()
    # 32 bits of a Blender unit at most are 30 nm, and the force grows by 0.2 % per um.
    relaxed = pytest.approx(0.08546971 * elastic, rel=1e-4)
    assert running.find(bed).state.finger_forces().tolist() == [relaxed]


#: Contents of a file, and what is said of it.
REFUSED = [
    ("[contact]\nstiffness = -1\n", "contact.stiffness must be"),
    ("[contact]\nstiffnes = 1\n", "contact.stiffnes"),
    ("[contact]\nstiffness = nan\n", "contact.stiffness must be"),
    ("[actuator]\nbore = 0.004\n", "must be at least actuator.bore"),
    ("[control]\nmethod = 'hybrid'\n", "control"),
    ("contact = 3\n", "contact must be"),
    ("stiffness\n", "line 1"),
    (None, "cannot be read"),
]


def test_parts_that_a_bed_cannot_have_are_refused_in_a_line(bed, tmp_path):
    before, path = properties.read_stored_settings(bed), tmp_path / "fitted.toml"
    for text, said in REFUSED:
        path.unlink(missing_ok=True)
        if text is not None:
            path.write_text(text, encoding="utf-8")
        with pytest.raises(RuntimeError) as told:
            bpy.ops.digiclay.preset_parts(filepath=str(path))
        words = str(told.value).removeprefix("Error: ").strip()
        assert said in words
        assert "\n" not in words
        assert len(words) <= 400 + len(str(tmp_path))
        assert properties.read_stored_settings(bed) == before
