"""What strokes of the brushes leave: raised, lowered, leveled and smoothed pins."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from digiclay.core.base.arrays import Floats
from digiclay.core.base.modes import Mode
from digiclay.core.control.methods import METHODS
from digiclay.core.model.fingertip import LEVEL, Fingertip
from digiclay.core.model.layout import Layout
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import snapshot
from digiclay.core.session.live_session import simulate_path
from digiclay.recorded.takes import read_recording
from digiclay.sessions import sculpting
from digiclay.sessions.running import Running
from digiclay.sessions.sculpting import change_stroke, find_device, queue_stroke
from digiclay.settings.devices import BEDS, make_scene
from digiclay.strokes.nominal import find_nominal, find_radius
from digiclay.strokes.stroke import Brush, draw, make_images
from digiclay.strokes.tracking import find_tracking

from tests.assemble import replayed
from tests.hand import go_on, heights, let_go, pin, pose, risen, started
from tests.reliefs import heighten
from tests.strokes import Places, begin_bed, finish, form, queue, relief

pytestmark = pytest.mark.usefixtures("quick_machine")

#: Half the length of a stroke, mm.
HALF = 18.0
ALONG: Places = [(-HALF, 0.0), (HALF, 0.0)]


def begin(**tables: object) -> Running:
    """Return a session of the paper's bed, with other parameters."""
    above = np.array([0.0, 0.0, 46e-3, *LEVEL])
    session, _ = sculpting.begin_session(7, "Bed", resolve(dict(tables)), above)
    return sculpting.advance(session, above, 0.0, 100)


def along(session: Running, y: float = 0.0) -> Floats:
    """Return the heights of the pins that a stroke along x at y, mm, has passed, above rest, mm."""
    row = 12 + round(y / 3.0)
    return relief(session)[row, 12 - round(HALF / 3.0) : 13 + round(HALF / 3.0)]


def trace(way: Places) -> Floats:
    """Return places along a way of straight lines, (k, 2), mm."""
    places = np.array(way)
    return np.concatenate([np.linspace(*ends, 20) for ends in pairwise(places)])


#: A line at 17 degrees, mm, that ends on the bed, and half of its breadth that is level.
SLANTING: Places = [(-19.0, -5.0), (17.0, 6.0)]
CASES = {
    "2 mm deep": (Brush.LOWER, 2.0, {}),
    "4 mm deep": (Brush.LOWER, 4.0, {}),
    "8 mm deep": (Brush.LOWER, 8.0, {}),
    "15 mm deep": (Brush.LOWER, 15.0, {}),
    "15 mm high": (Brush.RAISE, 15.0, {}),
    "by slow valves": (Brush.RAISE, 15.0, {"preset": "viscous"}),
    "by Method II": (Brush.RAISE, 15.0, {"control": {"method": "cell_states"}}),
    "by Method III": (Brush.RAISE, 15.0, {"control": {"method": "hybrid"}}),
    "pressed by Method III": (Brush.LOWER, 8.0, {"control": {"method": "hybrid"}}),
    "off the edge": (Brush.LOWER, 4.0, {"layout": {"rows": 13, "columns": 13}}),
}


@pytest.mark.parametrize("name", CASES)
def test_a_stroke_leaves_its_nominal_surface_and_presses_no_harder_than_a_finger(name: str) -> None:
    brush, amount, tables = CASES[name]
    session = begin(**tables)
    queued = queue(session, SLANTING, brush, amount)
    nominal = find_nominal(queued.strokes[0], find_device(queued), heights(queued)).height
    formed = finish(queued)
    # A pin has arrived within half a micrometer of its height; what its valve still lets through until it
    # is shut is as much again.
    np.testing.assert_allclose(heights(formed), nominal, rtol=0, atol=1e-6)
    sign = 1.0 if brush is Brush.RAISE else -1.0
    assert (sign * relief(formed)).max() == pytest.approx(amount, abs=0.2)
    assert formed.trace.force.max() < 2.0


def test_noisy_sensors_leave_their_noise_in_the_form() -> None:
    session = begin(sensors={"force_noise": "2 mN", "height_noise": "20 um"})
    # Five standard deviations.
    np.testing.assert_allclose(along(form(session, ALONG, Brush.RAISE)), 15.0, rtol=0, atol=0.1)


@pytest.mark.parametrize("brush", [Brush.RAISE, Brush.LOWER, Brush.LEVEL])
@pytest.mark.parametrize("symmetry", ["X", "Y", "XY"])
def test_mirror_images_agree_to_a_micrometer(symmetry: str, brush: Brush) -> None:
    session = queue(begin(), [(-30.0, 2.0), (3.0, 14.0)], brush, 6.0)
    (stroke,) = session.strokes
    session = replace(session, strokes=(replace(stroke, images=make_images(symmetry)),))
    formed = relief(finish(session))
    for axis in (0, 1):
        if "YX"[axis] in symmetry:
            np.testing.assert_allclose(formed, np.flip(formed, axis), rtol=0, atol=1e-3)
    assert brush is Brush.LEVEL or np.ptp(formed) > 5.0


@pytest.mark.parametrize("method", METHODS)
def test_every_method_goes_with_every_size_of_bed(method: str) -> None:
    for bed in BEDS.values():
        made = assemble(make_scene("paper", Layout(15, 15, bed.pitch), method, bed.share))
        assert made.controller is not None


def test_ridges_drawn_in_quick_succession_both_form_and_along_the_edge_too() -> None:
    session = queue(begin(), [(-9.0, -12.0), (9.0, -12.0)], Brush.RAISE)
    done = finish(queue(session, [(-36.0, 36.0), (36.0, 36.0)], Brush.RAISE))
    np.testing.assert_allclose(relief(done)[8, 9:16], 15.0, rtol=0, atol=0.01)
    np.testing.assert_allclose(relief(done)[-1], 15.0, rtol=0, atol=0.01)
    assert len(done.gestures) == 2


def test_at_the_end_of_the_stroke_pins_are_raised_as_far_as_they_go() -> None:
    session = begin(actuator={"stroke": "50 mm"})
    formed = along(form(session, ALONG, Brush.RAISE, 30.0))
    np.testing.assert_allclose(formed, 10.0, rtol=0, atol=0.01)


def test_level_lowers_a_hill_and_raises_a_hollow() -> None:
    session = form(begin(), [(12.0, -9.0), (12.0, 9.0)], Brush.RAISE, 6.0)
    session = form(session, [(-12.0, -9.0), (-12.0, 9.0)], Brush.LOWER, 8.0)
    before = along(session)
    assert (before.max(), before.min()) == (pytest.approx(6.0, abs=0.2), pytest.approx(-8.0, abs=0.2))
    level = form(session, [(-34.0, 0.0), (34.0, 0.0)], Brush.LEVEL)
    np.testing.assert_allclose(along(level), 0.0, rtol=0, atol=0.01)


def test_half_the_strength_levels_half_the_way() -> None:
    session = form(begin(), [(0.0, -24.0), (0.0, 24.0)], Brush.RAISE, 10.0)
    half = form(session, ALONG, Brush.LEVEL, share=0.5)
    assert along(half)[len(along(half)) // 2] == pytest.approx(5.0, abs=0.2)


def test_a_method_without_a_blister_is_told_from_those_that_raise() -> None:
    for method in ("elastic", "plastic", "viscous", "push_pull", "force_display"):
        scene = resolve({"control": {"method": method}})
        assert find_tracking(scene, assemble(scene)) is None, method


def test_a_queued_raise_ends_at_once_when_the_method_has_lost_its_blister_meanwhile() -> None:
    session = queue(begin(control={"method": "elastic"}), ALONG, Brush.RAISE)
    done = finish(session, 1.0)
    assert (done.finished_strokes, np.abs(relief(done)).max()) == (1, 0.0)


def test_level_fills_a_valley_that_it_crosses_by_a_bend() -> None:
    # Under a slanting view the pointer moves aside on the floor of a valley, and back when it comes out.
    way: Places = [(0.0, -24.0), (0.0, -15.0), (-8.0, -5.0), (-8.0, 6.0), (0.0, 14.0), (0.0, 24.0)]
    valley = form(begin_bed("paper", 25, 25), ALONG, Brush.LOWER, 4.0)
    assert along(valley).max() < -3.0
    leveled = relief(form(valley, way, Brush.LEVEL, 4.0))
    bed = valley.system.grid
    apart = np.min([np.hypot(1e3 * bed.x - x, 1e3 * bed.y - y) for x, y in trace(way)], axis=0)
    # Within the flat top of the blister, 6 mm.
    assert np.abs(leveled.ravel()[apart < 6.0]).max() < 0.01


# Smooth


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
        session, 1e-3 * x, 1e-3 * y, 4e-3, make_images(symmetry), Brush.SMOOTH, share
    )
    for part in np.arange(1, 11) / 10:
        at = 1e-3 * (x + part * (to_x - x)), 1e-3 * (y + part * (to_y - y))
        session = change_stroke(session, number, lambda one, a=at: draw(one, *a, 4e-3, share))
    return let_go(session, number)


def test_a_smooth_stroke_takes_down_a_spike_without_a_touch_from_close_above_the_pins() -> None:
    session, above = queue_smooth(spiked((0.0, 0.0)), (-9.0, 0.0), (9.0, 0.0)), []
    while session.strokes:
        session = go_on(session, 1)
        assert not session.state.row(session.system.rows.force).any()
        above.append(session.pose[2] - heights(session).max())
    assert risen(session, 0.0, 0.0) < 0.4 * SPIKE
    assert 0.0 < min(above) < SPIKE
    weaker = finish(queue_smooth(spiked((0.0, 0.0)), (-9.0, 0.0), (9.0, 0.0), 0.1))
    assert risen(session, 0.0, 0.0) + 1e-3 < risen(weaker, 0.0, 0.0) < SPIKE - 1e-3


def test_a_short_stroke_waits_for_its_pins() -> None:
    session, number = queue_stroke(spiked((0.0, 0.0)), 0.0, 0.0, 4e-3, brush=Brush.SMOOTH)
    session = change_stroke(session, number, lambda one: replace(draw(one, 0.0, 0.0, 4e-3), held=False))
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
    session = go_on(queue_smooth(session, (-9.0, 0.0), (9.0, 0.0)), 8)
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
    assert take.orders is not None
    assert replayed(take)


def test_undo_shortens_the_orders_of_a_recording_with_its_path() -> None:
    session = sculpting.set_recording(spiked((0.0, 0.0), (-12.0, 0.0)), True)
    once = finish(queue_smooth(session, (-12.0, -6.0), (-12.0, 6.0)))
    twice = finish(queue_smooth(once, (-3.0, 0.0), (3.0, 0.0)))
    back = finish(queue_smooth(sculpting.rewind(twice), (0.0, -3.0), (0.0, 3.0)))
    keep = back.recording
    assert keep is not None
    start = snapshot.load(back.system, keep.start)
    *_, again = simulate_path(back.system, start, keep.path, keep.orders)
    assert snapshot.dump(back.system, again) == back.snapshot


def test_a_symmetric_stroke_smooths_all_its_images_as_one_gesture() -> None:
    corners = [(-12.0, -12.0), (-12.0, 12.0), (12.0, -12.0), (12.0, 12.0)]
    done = finish(queue_smooth(spiked(*corners), (12.0, 11.0), (12.0, 13.0), symmetry="XY"))
    assert max(risen(done, *corner) for corner in corners) < 0.6 * SPIKE
    assert (done.finished_strokes, len(done.gestures)) == (1, 1)


def test_other_parameters_in_mid_stroke_leave_a_session_that_goes_on() -> None:
    session = go_on(queue_smooth(spiked((0.0, 0.0)), (-9.0, 0.0), (9.0, 0.0)), 8)
    control = replace(session.scene.control, position_gain=300.0)  # type: ignore[type-var]
    session, said = sculpting.change_scene(session, replace(session.scene, control=control))
    assert said == ""
    done = finish(session)
    assert (done.finished_strokes, done.strokes) == (1, ())


@pytest.mark.parametrize(("width", "radius"), [(8e-3, 8e-3), (1e-3, 6e-3)])
def test_the_disc_is_the_fingers_width_and_no_less_than_two_pitches(width: float, radius: float) -> None:
    assert find_radius(Fingertip(width=width), Layout()) == pytest.approx(radius)


@pytest.mark.parametrize("brush", [Brush.RAISE, Brush.LOWER])
@pytest.mark.parametrize("accumulate", [False, True])
def test_an_image_that_begins_on_another_one_is_pressed_into_what_stands_there(brush, accumulate):
    scene = make_scene("design", Layout(30, 30, 1.5e-3), "hybrid", 0.5)
    session, _ = sculpting.begin_session(7, "Bed", scene, np.array([0.0, 0.0, 60e-3, *LEVEL]))
    session = queue(session, [(1.0, 2.0), (15.0, 9.0)], brush, 12.0)
    (stroke,) = session.strokes
    images = make_images("RADIAL", 3)
    session = replace(session, strokes=(replace(stroke, images=images, accumulate=accumulate),))
    # Into the bed as it was before the first image: 10^5 N.
    assert finish(session).trace.force.max() < 1.0
