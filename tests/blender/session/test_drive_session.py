"""A live session on a bed with a matrix drive: pins wait, it shows, and a take is replayed and baked."""

import bpy
import numpy as np
from digiclay.bridge import linear
from digiclay.core.base.modes import COLORS, WAITING
from digiclay.core.engine.simulation import begin
from digiclay.core.session import snapshot
from digiclay.core.session.take import play, replay
from digiclay.device import view
from digiclay.device.instant import find_ellipsoids
from digiclay.live import beds
from digiclay.overlay import views
from digiclay.recorded import bake, takes
from digiclay.sessions import running

from tests.blender.at_hand import read_overlay
from tests.blender.session.live import exact, move, press, record, started


def count_marked(bed):
    """Return how many pins Blender draws in the color of those that wait."""
    graph = bpy.context.evaluated_depsgraph_get()
    materials = [
        each.object.material_slots[0].material
        for each in graph.object_instances
        if each.is_instance and each.parent.original == bed and each.object.material_slots
    ]
    marked = linear(WAITING)
    return sum(np.allclose(m.diffuse_color, marked, atol=1e-6) for m in materials if m)


def test_a_session_serves_lines_says_how_many_wait_and_its_take_is_replayed_bit_for_bit(bed, clock):
    settings = bed.digiclay
    settings.use_drive, settings.drive.sections, settings.drive.slot = True, 2, 20.0
    started(bed)
    record(bed)
    assert move(bed, clock, [(0.0, z) for z in np.linspace(46, 37, 8)]) == []
    session = running.find(bed)
    now = session.state.addressing
    assert count_marked(bed) == now.waiting.size > 0
    told = views.read_session(bed, session, COLORS)
    assert told.drive == (2, 13, now.waiting.size)
    written = {"2 of 13 lines addressed", f"{now.waiting.size} pins wait"}
    assert written <= set(read_overlay(told))
    press(bed, clock)
    take = takes.read_recording(running.find(bed))
    *_, state = replay(take)
    assert snapshot.dump(session.system, state) == take.end == beds.read_snapshot(bed)
    np.testing.assert_array_equal(state.row(0), exact(bed))
    view.show_state(bed, session.system, begin(session.system))
    assert count_marked(bed) == 0


def test_a_bake_marks_in_each_frame_the_pins_that_wait_then_and_none_when_colored_alike(bed, clock):
    bed.digiclay.use_drive, bed.digiclay.drive.sections, bed.digiclay.drive.slot = True, 2, 20.0
    started(bed)
    record(bed)
    press(bed, clock)
    take = takes.read_recording(running.find(bed))
    counts = [state.addressing.waiting.size for _, state in play(take)]
    *_, moments = bake.simulate_frames(take, 40.0)
    shown = [counts[period] for period in bake.frame_periods(take, 40.0)]
    bake.apply(bed, moments, 1, find_ellipsoids(take.scene), [1])
    seen = []
    for frame in range(1, len(shown) + 1):
        bpy.context.scene.frame_set(frame)
        seen.append(count_marked(bed))
    assert (seen, max(shown) > 0) == (shown, True)
    view.color_by(bed, "neutral")
    assert count_marked(bed) == 0


def test_a_bed_with_a_valve_per_pin_has_neither_mark_nor_attribute(bed, clock):
    started(bed)
    press(bed, clock)
    assert (count_marked(bed), "waiting" in bed.data.attributes) == (0, False)
