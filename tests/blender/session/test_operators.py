"""The operators of a session, when they decline, and what is selected and modal meanwhile."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.base.errors import DigiclayError
from digiclay.live import beds, loop, tick
from digiclay.operators.action import clear_status, show_status
from digiclay.operators.session_loop import LoopMixin
from digiclay.press import ghost
from digiclay.roles import fingertip_of
from digiclay.sessions import running
from digiclay.sessions.sculpting import change_stroke
from digiclay.strokes.stroke import lay_path, start

from tests.assemble import assert_near
from tests.blender.at_hand import activate
from tests.blender.session.live import FLOAT32, exact, move, press, queue, shown, started
from tests.hand import let_go


def test_rewinding_puts_bed_and_fingertip_back(bed, clock):
    started(bed)
    press(bed, clock, -6.0, lifted=22)
    formed = exact(bed)
    press(bed, clock, 6.0)
    assert bpy.ops.digiclay.session_rewind() == {"FINISHED"}
    assert_near(exact(bed), formed, 1e-5)  # pins were still coming to rest
    assert_near(shown(bed), exact(bed), FLOAT32)
    assert bridge.pose(fingertip_of(bed))[2] > 45e-3
    assert bpy.ops.digiclay.session_rewind() == {"FINISHED"}
    assert (exact(bed) == 40e-3).all()
    assert not bpy.ops.digiclay.session_rewind.poll()


def test_within_one_press_backspace_goes_back_gesture_by_gesture(bed, clock):
    bed.location = (30.0, -70.0, 10.0)  # there 32 bits put the finger a little beside
    started(bed)
    move(bed, clock, [(-6.0, z) for z in np.linspace(46, 38, 10)] + [(-6.0, 38.0)] * 20)
    move(bed, clock, [(x, 38.0) for x in np.linspace(-6, 6, 10)])
    for left in (1, 0):
        assert bpy.ops.digiclay.session_rewind() == {"FINISHED"}
        clock.tick(3)
        assert len(running.find(bed).gestures) == left
    assert (exact(bed) == 40e-3).all()


@pytest.mark.parametrize("live", [True, False])
def test_reset_brings_the_bed_to_rest_with_a_session_or_without(bed, clock, live):
    assert not bpy.ops.digiclay.session_reset.poll()
    started(bed)
    move(bed, clock, [(0.0, 38.0)] * 20)
    if not live:
        tick.stop(bed.session_uid)
    assert bpy.ops.digiclay.session_reset() == {"FINISHED"}
    assert_near(shown(bed), 40e-3, FLOAT32)
    assert (exact(bed) == 40e-3).all()
    bpy.context.view_layer.update()
    assert bridge.pose(fingertip_of(bed))[2] > 45e-3


def test_a_single_step_pauses_and_is_one_control_period(bed, clock):
    started(bed)
    clock.tick(5)
    before = running.find(bed).state.period
    bpy.ops.digiclay.session_step()
    clock.tick(5)
    assert (running.find(bed).state.period, running.find(bed).paused) == (before + 1, True)


def test_the_session_of_a_bed_that_is_not_active_is_found_while_it_is_the_only_one(bed):
    started(bed)
    activate(bpy.data.objects["Cube"])
    assert bpy.ops.digiclay.session_pause() == {"FINISHED"}
    assert running.find(bed).paused


def test_a_session_does_not_start_on_settings_that_do_not_fit(bed):
    bed.digiclay.layout.columns = 14
    with pytest.raises(DigiclayError, match="169 pins"):
        tick.start(bpy.context, bed)
    assert running.list_sessions() == ()


def test_a_bed_of_another_view_layer_is_left_alone(bed):
    for collection in bed.users_collection:
        collection.objects.unlink(bed)
    beds.deselect(bed)  # Blender raises an error for an object the view layer does not have
    assert bed.name in bpy.data.objects


@pytest.mark.parametrize(
    "case, wanted",
    [("selected before", ["Digital Clay"]), ("not selected before", []), ("another is active", []),
     ("another was selected meanwhile", ["Cube"])],
)  # fmt: skip
def test_after_the_session_the_active_bed_is_selected_as_before(bed, case, wanted):
    cube = bpy.data.objects["Cube"]
    bed.select_set(case != "not selected before")
    beds.deselect(bed)
    assert (bed.select_get(), bpy.context.object) == (False, bed)
    if case == "another is active":
        activate(cube)
    cube.select_set(case == "another was selected meanwhile")
    beds.select_active(frozenset({bed.session_uid}))
    assert [thing.name for thing in bpy.context.selected_objects] == wanted


def test_a_fault_in_the_modal_part_ends_the_sessions_in_order(bed, monkeypatch):
    class Drive(LoopMixin):
        token, newer, report = 0, frozenset(), staticmethod(lambda level, words: said.append(words))

    said = []
    started(bed)
    monkeypatch.setattr(tick, "tick", lambda context, now: {}["now"])
    assert Drive().modal(bpy.context, SimpleNamespace(type="TIMER", value="NOTHING")) == {
        "CANCELLED"
    }
    assert running.list_sessions() == ()
    assert said == ["Error in the extension: KeyError: 'now'"]
    assert running.last_message() == f"The session of Digital Clay ended: {said[0]}"


def test_without_a_session_nothing_goes_on_and_blender_lists_modal_operators():
    assert not bpy.ops.digiclay.session_go_on.poll()
    # The session looks them up in every version that is supported.
    assert "modal_operators" in bpy.types.Window.bl_rna.properties


@pytest.mark.usefixtures("machine")
def test_a_script_finishes_strokes_at_once_and_what_was_in_haste_is_shown(bed, clock):
    started(bed)
    across = [(-3e-3, 0.0), (3e-3, 0.0)]
    for number in (1, 2):
        assert bpy.ops.digiclay.finish_strokes.poll() == (number > 1)
        queue(bed, start(0, -3e-3, 0.0, 4e-3))
        assert bpy.ops.digiclay.finish_strokes.poll() == (number > 1)  # the hand still draws
        running.put(change_stroke(running.find(bed), number, partial(lay_path, points=across)))
    running.put(change_stroke(running.find(bed), 1, partial(replace, held=True)))
    loop.LOOP.in_haste = True
    clock.until(lambda: running.find(bed).state.row(0).min() < 37e-3)
    assert shown(bed).min() > 39.9e-3
    tick.end_haste(bpy.context)
    assert_near(shown(bed), running.find(bed).state.row(0), FLOAT32)
    running.put(let_go(running.find(bed), 1))
    assert bpy.ops.digiclay.finish_strokes() == {"FINISHED"}
    assert running.find(bed).strokes == ()
    assert exact(bed).min() < 37e-3
    assert_near(shown(bed), exact(bed), FLOAT32)


def test_the_ghost_is_there_with_the_queue_and_goes_with_it(bed, clock):
    started(bed)
    assert ghost.find_surface(running.find(bed)) is None
    ghost.plan(bed.session_uid, start(0, 0.0, 0.0, 4e-3))
    assert ghost.find_surface(running.find(bed)).min() == pytest.approx(36e-3, abs=1e-6)
    ghost.plan(bed.session_uid, None)
    queue(bed, start(0, 0.0, 0.0, 4e-3))
    surface = ghost.find_surface(running.find(bed))
    assert surface.min() == pytest.approx(36e-3, abs=1e-6)
    way = surface - shown(bed)
    colors = ghost.find_colors(ghost.find_light(running.find(bed).scene.layout, surface), way)
    assert (colors[:, 3] > 0.0).tolist() == (way != 0.0).tolist()
    # Orange, and none where pins stay.
    assert colors[way < -1e-3, 0].min() > colors[way < -1e-3, 2].max() == 0.0
    running.put(let_go(running.find(bed), 1))
    assert bpy.ops.digiclay.finish_strokes() == {"FINISHED"}
    assert ghost.find_surface(running.find(bed)) is None


def test_words_in_the_status_bar_leave_what_else_is_drawn_there():
    from bl_ui.space_statusbar import STATUSBAR_HT_header as bar

    before = bar.draw
    show_status(bpy.context, "Radius 5 mm")
    clear_status()
    # Blender's own function would draw from then on as at the first call: without the keys of a
    # session.
    assert bar.draw is before
    assert not hasattr(bar, "_draw_orig")
