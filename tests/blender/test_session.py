"""A live session in Blender's data: it follows the fingertip, and undo, files and copies carry its state."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import bpy
import digiclay
import numpy as np
import pytest
from digiclay import bed_state, bridge, handlers, properties, running, sculpting, tick, view
from digiclay.core import live
from digiclay.core.assembly import assemble
from digiclay.core.errors import DigiclayError
from digiclay.core.keeping import packed, unpacked
from digiclay.core.simulation import begin

#: Attributes are float32: 24 bits of at most 0.1 m, drawn ten times as large.
FLOAT32 = 0.1 * 2.0**-23
TICK = 1 / 30


@pytest.fixture(autouse=True)
def quick_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out no control period: what a test forms must not depend on who else uses the machine."""
    monkeypatch.setattr(live, "SHARE", 1e9)


@pytest.fixture(autouse=True)
def extension(factory_file: None) -> Iterator[None]:
    """Enable the extension, watch undo and loading as a session does, and take all back."""
    digiclay.register()
    handlers.watch()
    yield
    digiclay.unregister()


@pytest.fixture
def bed() -> Any:
    """A small bed in the open scene."""
    bpy.ops.mesh.digital_clay_add(rows=13, columns=13)
    return bpy.context.object


class Clock:
    """Ticks as the window's timer does."""

    now = 0.0

    def tick(self, count: int = 1) -> list[tick.Note]:
        """Tick some times; return what there is to tell."""
        notes = []
        for _ in range(count):
            self.now += TICK
            bpy.context.view_layer.update()
            notes += tick.tick(bpy.context, self.now)
        return notes


@pytest.fixture
def clock() -> Clock:
    """The wall's clock of a test."""
    return Clock()


def started(bed: Any) -> None:
    """Start a session; there must be nothing to tell."""
    assert tick.start(bpy.context, bed) == []


def move(bed: Any, clock: Clock, places: Iterable[tuple[float, float]]) -> list[tick.Note]:
    """Move the fingertip through places x, z of its lowest point, in mm, tick by tick."""
    notes = []
    for x, z in places:
        # The semi-axis upwards is 8 mm: the empty is the ellipsoid's centre.
        view.fingertip_of(bed).location = np.array([x, 0.0, z + 8.0]) * 1e-3 * bridge.SCALE
        notes += clock.tick()
    return notes


def press(bed: Any, clock: Clock, x: float = 0.0) -> None:
    """Press at a place and lift off."""
    down = [(x, z) for z in np.linspace(46, 37, 8)]
    assert move(bed, clock, [*down, *[(x, 37.0)] * 8, *down[::-1], *[(x, 46.0)] * 20]) == []


def exact(bed: Any) -> np.ndarray:
    """Return the pin tops the bed keeps, exactly, m."""
    system = assemble(properties.scene_of(bed))
    kept = bed_state.kept(bed)
    return (begin(system) if kept is None else unpacked(system, kept)).row(0)


def shown(bed: Any) -> np.ndarray:
    """Return the pin tops drawn, m."""
    return bridge.read_cells(bed.data)["height"]


def test_the_bed_forms_while_the_fingertip_moves(bed: Any, clock: Clock) -> None:
    started(bed)
    lowest = []
    for z in np.linspace(46, 37, 8):
        move(bed, clock, [(0.0, z)])
        lowest.append(shown(bed).min())
    assert lowest[0] == pytest.approx(40e-3, abs=FLOAT32)
    assert (np.diff(lowest)[-2:] < 0).all()  # it touches at 40 mm, three ticks before the end


def test_the_bed_keeps_and_shows_what_the_session_is(bed: Any, clock: Clock) -> None:
    started(bed)
    press(bed, clock)
    session = running.of(bed)
    assert session is not None
    assert bed_state.kept(bed) == packed(session.system, session.state)
    assert np.array_equal(bed_state.pose(bed), session.pose)
    np.testing.assert_allclose(shown(bed), exact(bed), rtol=0, atol=FLOAT32)
    assert exact(bed).min() < 39e-3


def drive(tip: Any, how: str) -> None:
    """Have the fingertip pressed down between the frames 1 and 20, by other means than by hand."""
    low, high = 0.45, 0.54
    if how == "animation":
        for frame, z in ((1, high), (20, low)):
            tip.location.z = z
            tip.keyframe_insert("location", index=2, frame=frame)
    elif how == "driver":
        curve = tip.driver_add("location", 2)
        curve.driver.expression = f"{high} - frame / 20 * {high - low}"
    else:
        other = bpy.data.objects.new("Other", None)
        bpy.context.collection.objects.link(other)
        other.location.z = high
        other.keyframe_insert("location", index=2, frame=1)
        other.location.z = low
        other.keyframe_insert("location", index=2, frame=20)
        constraint = tip.constraints.new("COPY_LOCATION")
        constraint.target = other
        bpy.context.view_layer.objects.active.location.z = 0.0


@pytest.mark.parametrize("how", ["animation", "driver", "constraint"])
def test_the_bed_follows_a_fingertip_moved_by_other_means(bed: Any, clock: Clock, how: str) -> None:
    tip = view.fingertip_of(bed)
    drive(tip, how)
    bpy.context.scene.frame_set(1)
    started(bed)
    for frame in range(1, 21):
        bpy.context.scene.frame_set(frame)
        clock.tick()
    clock.tick(5)
    assert exact(bed).min() < 39e-3


def test_a_turned_moved_and_scaled_bed_forms_like_one_that_is_not(bed: Any, clock: Clock) -> None:
    started(bed)
    press(bed, clock)
    straight = exact(bed)
    bpy.ops.mesh.digital_clay_add(rows=13, columns=13)
    other = bpy.context.object
    other.location, other.rotation_euler, other.scale = (3.0, -2.0, 1.0), (0.4, 0.0, 0.7), (2.0, 2.0, 2.0)
    started(other)
    press(other, clock)
    # The matrices are float32: some 1e-7 of 3 units, at 0.1 m a unit; the clocks start a tick apart.
    np.testing.assert_allclose(exact(other), straight, rtol=0, atol=2e-5)


def test_several_beds_go_on_at_once_each_with_its_own_fingertip(bed: Any, clock: Clock) -> None:
    bpy.ops.mesh.digital_clay_add(rows=9, columns=11)
    other = bpy.context.object
    started(bed)
    started(other)
    press(other, clock)
    assert (exact(bed) == 40e-3).all()
    assert exact(other).min() < 39e-3
    assert len(running.all()) == 2


def undone(clock: Clock, times: int = 1) -> None:
    """Undo, and let the sessions take it up."""
    for _ in range(times):
        bpy.ops.ed.undo()
    clock.tick(handlers.STALE)


def only_bed() -> Any:
    """Return the bed, fetched anew: undo invalidates all references."""
    (found,) = [thing for thing in bpy.context.scene.objects if view.is_bed(thing)]
    return found


def test_undo_takes_back_one_gesture_exactly_and_the_session_goes_on(bed: Any, clock: Clock) -> None:
    started(bed)
    bpy.ops.ed.undo_push(message="Start")
    press(bed, clock, -6.0)
    bpy.ops.ed.undo_push(message="First")
    first = bed_state.kept(bed)
    press(bed, clock, 6.0)
    bpy.ops.ed.undo_push(message="Second")
    second = bed_state.kept(bed)
    undone(clock)
    session = running.of(only_bed())
    assert session is not None
    assert packed(session.system, session.state) == first
    assert session.pose[0] == pytest.approx(-6e-3, abs=FLOAT32)  # the finger has not come from elsewhere
    np.testing.assert_allclose(shown(only_bed()), exact(only_bed()), rtol=0, atol=FLOAT32)
    undone(clock)
    assert (exact(only_bed()) == 40e-3).all()
    bpy.ops.ed.redo()
    bpy.ops.ed.redo()
    clock.tick(handlers.STALE)
    assert bed_state.kept(only_bed()) == second
    press(only_bed(), clock)
    assert exact(only_bed())[6 * 13 + 6] < 39e-3


def test_undo_takes_back_what_was_formed_after_a_gesture_in_a_pause(bed: Any, clock: Clock) -> None:
    # Both steps hold the same heights, and what has been formed since is in neither.
    started(bed)
    clock.tick(3)
    bpy.ops.digiclay.session_pause()
    clock.tick()
    bpy.ops.ed.undo_push(message="Start")
    clock.tick()
    move(bed, clock, [(0.0, 38.0)])
    bpy.ops.ed.undo_push(message="Moved in the pause")
    bpy.ops.digiclay.session_pause()
    clock.tick(20)
    assert exact(bed).min() < 39.8e-3
    undone(clock)
    assert (exact(only_bed()) == 40e-3).all()


def test_undo_to_before_the_bed_was_there_ends_the_session_with_a_message(clock: Clock) -> None:
    bpy.ops.ed.undo_push(message="Nothing")
    bpy.ops.mesh.digital_clay_add(rows=13, columns=13)
    bpy.ops.ed.undo_push(message="Bed")
    tick.start(bpy.context, bpy.context.object)
    bpy.ops.ed.undo()
    notes = clock.tick()
    assert [note.level for note in notes] == ["WARNING"]
    assert "was deleted" in notes[0].words
    assert running.all() == ()


def reloaded(tmp_path: Path) -> Any:
    """Save the file and open it again; return the bed."""
    path = str(tmp_path / "session.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    return only_bed()


def test_a_file_saved_in_mid_session_goes_on_bit_for_bit(bed: Any, clock: Clock, tmp_path: Path) -> None:
    started(bed)
    move(bed, clock, [(0.0, 38.0)] * 10)
    kept, periods = bed_state.kept(bed), running.of(bed).state.period
    bed = reloaded(tmp_path)
    assert running.all() == ()
    assert "another file was loaded" in running.said()
    started(bed)
    session = running.of(bed)
    assert packed(session.system, session.state) == kept
    assert session.state.period == periods


def test_a_crash_recovered_file_has_the_state_of_the_last_tick(
    bed: Any, clock: Clock, tmp_path: Path
) -> None:
    # What Blender saves by itself is the open file as it stands, without asking anybody.
    started(bed)
    move(bed, clock, [(0.0, 38.0)] * 10)
    kept = bed_state.kept(bed)
    path = str(tmp_path / "recovery.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    move(bed, clock, [(0.0, 46.0)] * 10)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert bed_state.kept(only_bed()) == kept


def test_a_duplicate_carries_its_own_state_and_gets_a_fingertip(bed: Any, clock: Clock) -> None:
    started(bed)
    press(bed, clock)
    kept = bed_state.kept(bed)
    bpy.ops.object.duplicate()
    copy = bpy.context.object
    assert copy != bed
    assert running.of(copy) is None
    notes = tick.start(bpy.context, copy)
    assert ["new fingertip" in note.words for note in notes] == [True]
    assert bed_state.kept(copy) == kept
    press(copy, clock, 6.0)
    assert np.abs(exact(copy) - exact(bed)).max() > 1e-3


def test_a_linked_duplicate_gets_pins_of_its_own(bed: Any, clock: Clock) -> None:
    bpy.ops.object.duplicate(linked=True)
    copy = bpy.context.object
    assert copy.data == bed.data
    notes = tick.start(bpy.context, copy)
    assert any("pins of its own" in note.words for note in notes)
    press(copy, clock)
    np.testing.assert_allclose(shown(bed), 40e-3, rtol=0, atol=FLOAT32)


def test_an_appended_bed_carries_its_state(bed: Any, clock: Clock, tmp_path: Path) -> None:
    started(bed)
    press(bed, clock)
    kept, name = bed_state.kept(bed), bed.name
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path) as (_, wanted):
        wanted.objects = [name]
    bpy.context.collection.objects.link(wanted.objects[0])
    appended = only_bed()
    notes = tick.start(bpy.context, appended)
    session = running.of(appended)
    assert packed(session.system, session.state) == kept
    assert all(note.level == "INFO" for note in notes)


@pytest.mark.parametrize("junk", [b"", b"nothing", "a text", 7, [1.0, 2.0]])
def test_a_state_somebody_has_broken_begins_at_rest_with_a_message(bed: Any, junk: Any) -> None:
    bed[bed_state.STATE] = junk
    bed[bed_state.POSE] = junk
    bed[bed_state.MOMENT] = "x"
    notes = tick.start(bpy.context, bed)
    assert [note.level for note in notes] == ["WARNING"]
    assert (exact(bed) == 40e-3).all()


def test_a_method_that_is_changed_in_mid_session_takes_over_with_the_heights(bed: Any, clock: Clock) -> None:
    started(bed)
    press(bed, clock)
    before = exact(bed)
    bed.digiclay.method = "plastic"
    notes = clock.tick(tick.LOOK)
    assert ["heights were taken up" in note.words for note in notes] == [True]
    np.testing.assert_allclose(exact(bed), before, rtol=0, atol=1e-5)  # pins were still coming to rest
    assert running.of(bed).scene.method == "plastic"


def test_a_parameter_that_is_changed_in_mid_session_takes_effect(bed: Any, clock: Clock) -> None:
    started(bed)
    bed.digiclay.control.virtual_master.force_setpoint = 0.8
    assert clock.tick(tick.LOOK) == []
    assert running.of(bed).scene.set_point == 0.8


def waits(bed: Any, clock: Clock, *, words: str) -> None:
    """Check that the session waits, says why once, and stands still."""
    notes = clock.tick(3)
    assert [note.level for note in notes] == ["WARNING"]
    assert words in notes[0].words
    session = running.all()[0]
    assert words in session.waits
    period = session.state.period
    assert clock.tick(3) == []
    assert running.all()[0].state.period == period


def goes_on(clock: Clock) -> None:
    """Check that the session says that it goes on, and does."""
    period = running.all()[0].state.period
    notes = clock.tick(handlers.STALE + 3)
    assert ["goes on" in note.words for note in notes] == [True]
    assert running.all()[0].state.period > period


def test_a_session_waits_for_a_deleted_fingertip_and_goes_on_with_undo(bed: Any, clock: Clock) -> None:
    started(bed)
    press(bed, clock)
    bpy.ops.ed.undo_push(message="Formed")
    clock.tick()
    bpy.data.objects.remove(view.fingertip_of(bed))
    bpy.ops.ed.undo_push(message="Deleted")
    waits(bed, clock, words="fingertip is deleted")
    bpy.ops.ed.undo()
    goes_on(clock)


def test_a_session_waits_while_its_scene_is_not_shown(bed: Any, clock: Clock) -> None:
    started(bed)
    home = bpy.context.window.scene
    bpy.context.window.scene = bpy.data.scenes.new("Other")
    waits(bed, clock, words="no window shows its scene")
    bpy.context.window.scene = home
    goes_on(clock)


def test_a_session_waits_while_the_bed_is_edited(bed: Any, clock: Clock) -> None:
    started(bed)
    bpy.ops.object.mode_set(mode="EDIT")
    waits(bed, clock, words="back to Object Mode")
    bpy.ops.object.mode_set(mode="OBJECT")
    goes_on(clock)


def test_a_session_waits_while_its_pins_are_edited_through_another_bed(bed: Any, clock: Clock) -> None:
    started(bed)
    bpy.ops.object.duplicate(linked=True)
    bpy.ops.object.mode_set(mode="EDIT")
    assert bed.mode == "OBJECT"
    waits(bed, clock, words="back to Object Mode")
    bpy.ops.object.mode_set(mode="OBJECT")
    goes_on(clock)


@pytest.mark.parametrize("name", ["session_rewind", "session_reset"])
def test_a_bed_that_is_edited_is_not_written(bed: Any, clock: Clock, name: str) -> None:
    started(bed)
    press(bed, clock)
    bpy.ops.object.mode_set(mode="EDIT")
    assert not getattr(bpy.ops.digiclay, name).poll()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert getattr(bpy.ops.digiclay, name).poll()


def test_a_session_waits_while_pins_are_missing(bed: Any, clock: Clock) -> None:
    started(bed)
    bed.data.vertices.add(1)
    waits(bed, clock, words="170 pins now instead of 169")


def test_a_session_waits_for_a_mesh_that_has_lost_its_attributes(bed: Any, clock: Clock) -> None:
    started(bed)
    bed.data.attributes.remove(bed.data.attributes["mode"])
    waits(bed, clock, words="no longer that of its pins")


def test_a_session_waits_while_the_bed_is_scaled_unevenly(bed: Any, clock: Clock) -> None:
    started(bed)
    bed.scale = (1.0, 2.0, 1.0)
    waits(bed, clock, words="must be the same along x, y and z")
    bed.scale = (1.0, 1.0, 1.0)
    goes_on(clock)


def test_a_session_waits_while_the_pins_are_not_those_of_the_layout(bed: Any, clock: Clock) -> None:
    started(bed)
    bed.digiclay.layout.rows = 14
    clock.tick(tick.LOOK)
    assert "169 pins" in running.of(bed).waits
    bed.digiclay.layout.rows = 13
    goes_on(clock)


def test_a_session_waits_for_a_fingertip_scaled_to_nothing(bed: Any, clock: Clock) -> None:
    started(bed)
    view.fingertip_of(bed).scale = (0.0, 0.0, 0.0)
    waits(bed, clock, words="scaled to nothing")


def test_a_deleted_bed_ends_its_session_with_a_message(bed: Any, clock: Clock) -> None:
    started(bed)
    bpy.ops.object.delete()
    notes = clock.tick()
    assert [note.level for note in notes] == ["WARNING"]
    assert running.all() == ()


def test_a_deleted_scene_ends_the_session_with_a_message(bed: Any, clock: Clock) -> None:
    started(bed)
    gone, other = bpy.context.window.scene, bpy.data.scenes.new("Other")
    bpy.context.window.scene = other
    bpy.data.scenes.remove(gone)
    assert ["was deleted" in note.words for note in clock.tick()] == [True]
    assert running.all() == ()


def test_disabling_the_extension_ends_the_session_and_leaves_the_state(bed: Any, clock: Clock) -> None:
    started(bed)
    press(bed, clock)
    kept = bed_state.kept(bed)
    digiclay.unregister()
    try:
        assert running.all() == ()
        assert bed_state.kept(bed) == kept
        assert handlers.take_up not in bpy.app.handlers.undo_post
    finally:
        digiclay.register()


def test_rewinding_puts_bed_and_fingertip_back(bed: Any, clock: Clock) -> None:
    started(bed)
    press(bed, clock, -6.0)
    formed = exact(bed)
    press(bed, clock, 6.0)
    assert bpy.ops.digiclay.session_rewind() == {"FINISHED"}
    np.testing.assert_allclose(exact(bed), formed, rtol=0, atol=1e-5)  # pins were still coming to rest
    np.testing.assert_allclose(shown(bed), exact(bed), rtol=0, atol=FLOAT32)
    assert bridge.pose(view.fingertip_of(bed))[2] > 45e-3
    assert bpy.ops.digiclay.session_rewind() == {"FINISHED"}
    assert (exact(bed) == 40e-3).all()
    assert not bpy.ops.digiclay.session_rewind.poll()


@pytest.mark.parametrize("live", [True, False])
def test_reset_brings_the_bed_to_rest_with_a_session_or_without(bed: Any, clock: Clock, live: bool) -> None:
    assert not bpy.ops.digiclay.session_reset.poll()
    started(bed)
    move(bed, clock, [(0.0, 38.0)] * 20)
    if not live:
        tick.stop(bed.session_uid)
    assert bpy.ops.digiclay.session_reset() == {"FINISHED"}
    np.testing.assert_allclose(shown(bed), 40e-3, rtol=0, atol=FLOAT32)
    assert (exact(bed) == 40e-3).all()
    bpy.context.view_layer.update()
    assert bridge.pose(view.fingertip_of(bed))[2] > 45e-3


def test_a_single_step_pauses_and_is_one_control_period(bed: Any, clock: Clock) -> None:
    started(bed)
    clock.tick(5)
    before = running.of(bed).state.period
    bpy.ops.digiclay.session_step()
    clock.tick(5)
    assert (running.of(bed).state.period, running.of(bed).paused) == (before + 1, True)


def test_the_session_of_a_bed_that_is_not_active_is_found_while_it_is_the_only_one(bed: Any) -> None:
    started(bed)
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    assert bpy.ops.digiclay.session_pause() == {"FINISHED"}
    assert running.of(bed).paused


@pytest.mark.parametrize("name", ["session_pause", "session_step", "session_rewind", "session_stop"])
def test_without_a_session_the_operators_decline(bed: Any, name: str) -> None:
    assert not getattr(bpy.ops.digiclay, name).poll()


def test_a_live_session_declines_without_a_window_or_a_bed(bed: Any) -> None:
    assert not bpy.ops.digiclay.session.poll()  # this is Blender without a window
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    assert not bpy.ops.digiclay.session.poll()


def test_a_session_does_not_start_on_settings_that_do_not_fit(bed: Any) -> None:
    bed.digiclay.layout.columns = 14
    with pytest.raises(DigiclayError, match="169 pins"):
        tick.start(bpy.context, bed)
    assert running.all() == ()


def test_a_bed_nothing_moves_on_is_not_drawn_anew(bed: Any, clock: Clock) -> None:
    started(bed)
    clock.tick(40)
    bed.data.vertices[0].co.z = 9.0
    clock.tick(5)
    assert bed.data.vertices[0].co.z == 9.0
    move(bed, clock, [(0.0, 38.0)] * 2)
    assert bed.data.vertices[0].co.z < 1.0


def test_recorded_poses_are_those_of_the_fingertip(bed: Any, clock: Clock) -> None:
    started(bed)
    clock.tick(2)
    running.put(sculpting.recording(running.of(bed), True))
    move(bed, clock, [(0.0, 46.0), (3.0, 45.0), (6.0, 40.0)])
    path = running.of(bed).path
    np.testing.assert_allclose(path[-1], [6e-3, 0, 40e-3, 1, 0, 0, 0], rtol=0, atol=FLOAT32)
    assert len(path) == pytest.approx(1 + 3 * TICK / 5e-3, abs=1)


def test_a_recording_that_undo_has_left_ends_with_a_message(bed: Any, clock: Clock) -> None:
    started(bed)
    bpy.ops.ed.undo_push(message="Start")
    press(bed, clock)
    bpy.ops.ed.undo_push(message="Press")
    running.put(sculpting.recording(running.of(bed), True))
    clock.tick(3)
    bpy.ops.ed.undo()
    assert ["recording ended" in note.words for note in clock.tick(handlers.STALE)] == [True]
    assert running.of(only_bed()).path is None
