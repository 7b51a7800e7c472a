"""Strokes that smooth: the finger touches nothing, the pins arrive, and a stroke is one gesture of many."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.layout import Layout
from digiclay.core.session import snapshot
from digiclay.core.session.live_session import simulate_path
from digiclay.recorded.takes import read_recording
from digiclay.sessions import sculpting
from digiclay.sessions.running import Running
from digiclay.sessions.sculpting import change_stroke, queue_stroke
from digiclay.strokes.stroke import SYMMETRIES, Brush, draw
from digiclay.strokes.sweep import find_radius

from tests.assemble import replayed
from tests.hand import finish, go_on, heights, let_go, pin, pose, risen, started
from tests.reliefs import heighten, measure_roughness

pytestmark = pytest.mark.usefixtures("quick_machine")

SPIKE = 8e-3


def spiked(*places: tuple[float, float]) -> Running:
    """Return a session of a bed with single pins that stand out, at places in mm."""
    session = started()
    system, relief = session.system, np.zeros(session.system.grid.count)
    for x, y in places:
        relief[pin(session, x, y)] = SPIKE
    return sculpting.restore(session, snapshot.dump(system, heighten(system, relief)), pose(z=60.0))


def queue_smooth(
    session: Running, start: tuple[float, float], end: tuple[float, float], share: float = 1.0,
    symmetry: str = "NONE",
) -> Running:  # fmt: skip
    """Queue a stroke of half a second from place to place, mm."""
    (x, y), (to_x, to_y) = start, end
    session, number = queue_stroke(
        session, 1e-3 * x, 1e-3 * y, 4e-3, SYMMETRIES[symmetry], Brush.SMOOTH, share
    )
    for part in np.arange(1, 11) / 10:
        at = 1e-3 * (x + part * (to_x - x)), 1e-3 * (y + part * (to_y - y))
        session = change_stroke(
            session, number, lambda one, p=part, a=at: draw(one, 0.5 * p, *a, 4e-3, share)
        )
    return let_go(session, number)


def test_a_smooth_stroke_takes_down_a_spike_without_a_touch_from_close_above_the_pins() -> None:
    session, above = queue_smooth(spiked((0.0, 0.0)), (-9.0, 0.0), (9.0, 0.0)), []
    while session.strokes:
        session = go_on(session, 1)
        assert not session.state.row(session.system.rows.force).any()
        above.append(session.pose[2] - heights(session).max())
    assert risen(session, 0.0, 0.0) < 0.4 * SPIKE
    assert 0.0 < above[11] < SPIKE
    weaker = finish(queue_smooth(spiked((0.0, 0.0)), (-9.0, 0.0), (9.0, 0.0), 0.1))
    assert risen(session, 0.0, 0.0) + 1e-3 < risen(weaker, 0.0, 0.0) < SPIKE - 1e-3


def test_a_short_stroke_waits_for_its_pins() -> None:
    session, number = queue_stroke(spiked((0.0, 0.0)), 0.0, 0.0, 4e-3, brush=Brush.SMOOTH)
    session = change_stroke(session, number, lambda one: replace(draw(one, 0.1, 0.0, 0.0, 4e-3), held=False))
    done = finish(session)
    assert risen(done, 0.0, 0.0) < SPIKE - 2e-3
    assert not (done.state.mode() == Mode.BLISTER).any()
    # All have arrived: nothing moves on.
    assert np.abs(heights(go_on(done, 10)) - heights(done)).max() < 10e-6


def test_strokes_that_press_and_smooth_are_queued_behind_each_other() -> None:
    session = spiked((-12.0, 0.0))
    session, number = queue_stroke(session, 12e-3, 0.0, 4e-3)
    session = let_go(session, number)
    session = queue_smooth(session, (-12.0, -6.0), (-12.0, 6.0))
    session, number = queue_stroke(session, 12e-3, 12e-3, 4e-3)
    session = let_go(session, number)
    done = finish(session)
    assert (done.finished_strokes, len(done.gestures)) == (3, 3)
    assert max(risen(done, 12.0, 0.0), risen(done, 12.0, 12.0)) < -2e-3
    assert risen(done, -12.0, 0.0) < 0.5 * SPIKE


def test_a_stroke_taken_back_in_its_middle_leaves_the_bed_as_before() -> None:
    session = spiked((0.0, 0.0))
    before = heights(session)
    session = go_on(queue_smooth(session, (-9.0, 0.0), (9.0, 0.0)), 15)
    assert risen(session, 0.0, 0.0) < SPIKE - 1e-3
    back = sculpting.withdraw_stroke(session)
    np.testing.assert_array_equal(heights(back), before)
    # No order is left behind.
    np.testing.assert_array_equal(heights(go_on(back, 10)), before)


def test_a_recording_of_smooth_strokes_is_a_take_that_replays_bit_for_bit() -> None:
    session = sculpting.set_recording(spiked((0.0, 0.0)), True)
    session = finish(queue_smooth(session, (-9.0, 0.0), (9.0, 0.0)))
    take = read_recording(session)
    assert take is not None
    assert take.smoothing is not None
    assert replayed(take)


def test_undo_shortens_the_orders_of_a_recording_with_its_path() -> None:
    session = sculpting.set_recording(spiked((0.0, 0.0), (-12.0, 0.0)), True)
    once = finish(queue_smooth(session, (-12.0, -6.0), (-12.0, 6.0)))
    twice = finish(queue_smooth(once, (-3.0, 0.0), (3.0, 0.0)))
    back = finish(queue_smooth(sculpting.rewind(twice), (0.0, -3.0), (0.0, 3.0)))
    keep = back.recording
    assert keep is not None
    start = snapshot.load(back.system, keep.start)
    *_, again = simulate_path(back.system, start, keep.path, keep.smoothing)
    assert snapshot.dump(back.system, again) == back.snapshot


def test_a_symmetric_stroke_smooths_all_its_images_as_one_gesture() -> None:
    corners = [(-12.0, -12.0), (-12.0, 12.0), (12.0, -12.0), (12.0, 12.0)]
    done = finish(queue_smooth(spiked(*corners), (12.0, 11.0), (12.0, 13.0), symmetry="XY"))
    assert max(risen(done, *corner) for corner in corners) < 0.6 * SPIKE
    assert (done.finished_strokes, len(done.gestures)) == (1, 1)


def test_a_place_that_is_held_is_smoothed_on_and_on() -> None:
    session, number = queue_stroke(spiked((0.0, 0.0)), 0.0, 0.0, 4e-3, brush=Brush.SMOOTH)
    rough = []
    for moment in (0.3, 0.6, 1.2):
        session = change_stroke(session, number, lambda one, m=moment: replace(one, known=m))
        session = go_on(session, 12)
        rough.append(measure_roughness(session.system.grid, heights(session)))
    assert np.diff(rough).max() < 0.0
    assert session.strokes


def test_other_parameters_in_mid_stroke_leave_a_session_that_goes_on() -> None:
    session = go_on(queue_smooth(spiked((0.0, 0.0)), (-9.0, 0.0), (9.0, 0.0)), 15)
    control = replace(session.scene.control, position_gain=300.0)  # type: ignore[type-var]
    session, said = sculpting.change_scene(session, replace(session.scene, control=control))
    assert said == ""
    done = finish(session)
    assert (done.finished_strokes, done.strokes) == (1, ())


@pytest.mark.parametrize(("width", "radius"), [(8e-3, 8e-3), (1e-3, 6e-3)])
def test_the_disc_is_the_fingers_width_and_no_less_than_two_pitches(width: float, radius: float) -> None:
    assert find_radius(Fingertip(width=width), Layout()) == pytest.approx(radius)
