"""The wall's clock, the finger's way, the trace, the error monitor and the ticks of a live session."""

from dataclasses import replace
from functools import partial
from itertools import cycle, islice, repeat

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.control.orders import Orders, Verb, place, repeat_order
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.model.control_interface import SetPoint
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import accuracy, recent_trace, snapshot
from digiclay.core.session.accuracy import PAUSE, SHARE, SPREAD, STRETCH
from digiclay.core.session.live_session import (
    Clock,
    Recording,
    clamp_pose,
    count_fitting,
    count_queue,
    find_spare,
    interpolate_path,
    periods_due,
    simulate_path,
    update_cost,
)
from digiclay.core.session.recent_trace import ROWS
from digiclay.sessions import sculpting
from digiclay.sessions.running import last_place
from digiclay.sessions.sculpting import change_stroke, queue_stroke
from digiclay.strokes.stroke import draw, start

from tests import hand
from tests.assemble import assert_near, path, table

PERIOD = 5e-3
SCENE = resolve({"layout": {"rows": 11, "columns": 11}})
SYSTEM = assemble(SCENE)


def looked(times, most=100, clock=None, moments=None):
    """Look at the clock at some times, with moments of an animation; return the periods due each time."""
    clock, counts = clock or Clock(), []
    for time, moment in zip(times, moments or repeat(None), strict=False):
        count, clock = periods_due(clock, time, PERIOD, most, moment)
        counts.append(count)
    return counts, clock


def test_as_much_is_simulated_as_time_goes_by():
    # Nothing at the first look, the rest is kept for the next one; a clock that goes back.
    assert looked([1e6, 1e6 + 0.012, 1e6 + 0.024, 1e6 + 0.026])[0] == [0, 2, 2, 1]
    assert looked([5.0, 4.0, 4.01])[0] == [0, 0, 2]
    times = np.cumsum(np.random.default_rng(1).uniform(0.0, 0.06, 2000)).tolist()
    counts, clock = looked(times)
    # Less than a period is owed at the end, whatever has been rounded on the way.
    assert 0.0 <= times[-1] - times[0] - sum(counts) * PERIOD < PERIOD * 1.001
    assert clock.factor == pytest.approx(1.0, abs=2 * PERIOD)
    assert len(looked(np.arange(0.0, 100.0, 0.01).tolist())[1].ticks) <= 101  # a second of looks
    # More than the most is dropped and not made up for; the time of a pause does not count.
    counts, clock = looked([0.0, 10.0, 10.01], most=20)
    assert (counts, clock.factor) == ([0, 20, 2], pytest.approx(0.011, abs=1e-3))
    assert looked([100.0, 100.01], clock=clock.stopped())[0] == [0, 2]
    # The time of an animation counts, whatever the wall's is; backwards, and until it ends. One that
    # stands is that of another scene.
    times = [0.0, 0.01, 0.5, 0.6, 0.7, 0.71, 1.0, 2.0, 2.98, 3.01, 3.03]
    moments = [None, 7.0, 7.04, 7.04, 6.9, None, *[7.0] * 5]
    assert looked(times, 20, moments=moments)[0] == [0, 2, 8, 0, 20, 2, 20, 0, 0, 6, 4]


def test_a_machine_too_slow_slows_down_instead_of_stalling():
    clock, now, looks = Clock(), 0.0, []
    for _ in range(200):
        count, clock = periods_due(clock, now, PERIOD, 1000)
        took = count * 4 * PERIOD  # a period takes four times as long as it lasts
        clock = update_cost(clock, count, took)
        now += took + 0.02  # drawing
        looks.append(took)
    assert max(looks[5:]) < 0.1
    assert 0.1 < clock.factor < 0.25
    _, clock = looked([0.0])
    # 101 periods have gone by, and each takes five to simulate: 14 take 70, 15 would take 75.
    assert periods_due(update_cost(clock, 1, 5 * PERIOD), 101 * PERIOD, PERIOD, 1000)[0] == 14


@table(
    "drawing, held, spent, between",
    {
        "a graphics card: all of the time but a share for the person": (1e-3, True, 23e-3, 33e-3),
        "a slow one: what is left of the time between two ticks": (15e-3, True, 19e-3, 34e-3),
        "drawing takes all of it: a share of the drawing": (30e-3, True, 15e-3, 45e-3),
        "drawing by software": (0.5, True, 0.25, 0.75),
        "a graphics card, when the hand has let go": (1e-3, False, 30e-3, 33e-3),
        "a slow one: as long as the drawing, 15 pictures a second": (
            1 / 30,
            False,
            1 / 30,
            1 / 15,
        ),
        "software": (0.5, False, 0.5, 1.0),
    },
)
def test_the_periods_of_a_queue_leave_the_window_its_redraws(drawing, held, spent, between):
    interval, clock, now = 1 / 30, Clock(), 0.0
    for _ in range(60):
        spare = find_spare(clock, now, interval, held)
        clock = count_queue(clock, now, 8 * spare, spare)
        gone = max(interval, spare + drawing)
        now += gone
    assert (spare, gone) == pytest.approx((spent, between), rel=0.05)
    assert clock.factor == pytest.approx(8 * spent / between, rel=0.05)


@table(
    "cost, spare, count",
    {
        "never measured": (0.0, 20e-3, 1),
        "as many as fit": (3e-3, 20e-3, 6),
        "one that will end later": (15e-3, 20e-3, 1),
        "slower than a tick": (0.5, 20e-3, 1),
        "no more than are simulated at a time": (1e-6, 20e-3, 16),
        "no time at all": (3e-3, 0.0, 1),
    },
)
def test_the_periods_of_a_queue_fill_its_time(cost, spare, count):
    assert count_fitting(Clock(cost=cost), spare, 16) == count


def test_a_queue_that_waits_for_the_hand_does_not_count():
    clock = count_queue(Clock(seen=0.0), 0.1, 0.5, 0.05)
    assert clock.factor == pytest.approx(5.0)
    waited = count_queue(clock, 60.0, 0.0, 0.0)
    assert waited.factor == clock.factor
    # Nor is the time made up for by a finger that is moved by hand afterwards.
    assert looked([60.012], clock=waited)[0] == [2]


def pose(x=0.0, z=0.05):
    """Return a level finger's pose, m, as that of the only one."""
    return np.array([[x, 0.0, z, *LEVEL]])


def test_the_way_goes_from_where_the_finger_was_to_where_it_is_and_stays_where_one_can_be():
    start, end = pose(), np.array([[0.01, 0.0, 0.03, 0.6, 0.0, 0.8, 0.0]])
    path = interpolate_path(start, end, 7)
    assert path.shape == (8, 1, 7)
    assert np.array_equal(path[0], start)
    assert_near(path[-1], end, 1e-15)
    np.testing.assert_allclose(
        np.diff(path[..., :3], axis=0), [(end - start)[:, :3] / 7] * 7, atol=1e-16
    )
    places = ([0.0, 0.0, -50.0], [1e9, -1e9, 1e9], [0.01] * 3)
    found = [clamp_pose(np.array([*place, *LEVEL]), 0.1)[:3].tolist() for place in places]
    assert found == [[0.0, 0.0, 0.0], [100.0, -100.0, 100.0], [0.01] * 3]


def test_a_recording_keeps_each_surface_once_under_its_own_number_and_drops_what_undo_took_back():
    low, high = np.full(9, 30e-3), np.full(9, 45e-3)
    keep = Recording.begin(b"", 0, pose()[None], 1)
    assert keep.orders is None
    path = np.tile(pose(), (4, 1, 1))
    given = [place(4, low), place(4, low.copy()), None, place(4, high)]
    given.append(Orders(repeat_order(4, Verb.PLACE, 1.0), (low, high)))
    for tick, orders in enumerate(given, 2):
        keep = keep.extend(path, tick, orders)
    np.testing.assert_array_equal(keep.orders.rows[:, 0], np.repeat([0.0, 0.0, 0.0, 1.0, 3.0], 4))
    np.testing.assert_array_equal(keep.surfaces, (low, high, low, high))
    for period, numbers in ((20, 4), (16, 2), (12, 1), (4, 1)):
        cut = keep.cut_at_period(period)
        assert len(cut.surfaces) == numbers
    earlier = keep.cut_at_tick(3, 8)
    assert (len(earlier.surfaces), earlier.count) == (1, 9)
    again = earlier.extend(path, 9, place(4, high))
    assert (again.orders.rows[-1, 0], len(again.surfaces)) == (1.0, 2)


def test_a_trace_has_no_more_than_its_rows_and_goes_back_with_time():
    trace, line = recent_trace.start(PERIOD), [0.0] * 8
    for time in range(5 * ROWS):
        trace = recent_trace.extend(trace, [[float(time), *line]])
    assert (len(trace.rows), trace.time[0]) == (ROWS, 4 * ROWS)
    back = recent_trace.extend(trace, [[4e3 + 2.0, *line]])
    assert back.time.tolist() == [4e3, 4e3 + 1.0, 4e3 + 2.0]
    assert recent_trace.start(1e-4).every * 1e-4 * ROWS >= 10.0  # seconds


def test_a_trace_knows_force_set_point_and_heights_of_picked_pins_one_that_stays_picked_its_past():
    press = path((0, 0, 0, 42), (0.2, 0, 0, 36))
    system = assemble(resolve({}))
    *_, state = periods(system, [press], begin(system), 60)
    middle, corner = 312, 0
    assert np.isin([middle, corner], state.active.cells).tolist() == [True, False]
    trace = recent_trace.pick(recent_trace.start(PERIOD), [middle, corner], system.grid.count)

    def sample(set_point):
        return recent_trace.sample(system, state, set_point, trace.pins)

    trace = recent_trace.extend(trace, [sample(SetPoint(0.4))])
    assert trace.heights.tolist() == [[state.row(0)[middle], state.row(0)[corner]]]
    assert trace.force[0] == pytest.approx(state.row(system.rows.force).sum(), rel=1e-12)
    assert trace.force[0] > 0.1
    assert (trace.time[0], trace.set_point[0]) == (60 * PERIOD, 0.4)
    other = recent_trace.pick(trace, [9, corner, 5000, -1], system.grid.count)
    assert other.pins == (9, corner)
    assert np.isnan(other.heights[0, 0])
    assert other.heights[0, 1] == trace.heights[0, 1]
    per_cell = SetPoint(0.04, per_cell=True)
    state.active.mode[:] = Mode.REST
    assert np.isnan([sample(None)[2], sample(per_cell)[2]]).all()
    state.active.mode[:3] = Mode.FORCE_FOLLOW
    # Rounding.
    assert sample(per_cell)[2] == pytest.approx(0.12, rel=1e-12)


def watched(scene, finger):
    """Follow a path with a monitor; return the last state, and the errors it finds with what is left, m."""
    system, monitor, found = assemble(scene), accuracy.start(scene), []
    start = begin(system)
    monitor = accuracy.begin_stretch(monitor, start)
    for index, state in enumerate(simulate_path(system, start, finger)):
        monitor = accuracy.note(monitor, state, finger[index : index + 2])
        monitor, errors = accuracy.catch_up(monitor, state, 1)
        found += [(errors, np.abs(monitor.carried).max())] if errors else []
    return state, found


def stepped(step):
    return resolve({"layout": {"rows": 11, "columns": 11}, "simulation": {"physics_step": step}})


@pytest.mark.parametrize("ticks", [(3, 3, 4), (1,), (2, 1), (9,)])
def test_no_tick_has_more_of_the_reference_than_a_share_of_its_periods(ticks, monkeypatch):
    done = []
    repeat = accuracy.repeat_period

    def counted(*arguments):
        done.append(tick)
        return repeat(*arguments)

    monkeypatch.setattr(accuracy, "repeat_period", counted)
    monitor, start = accuracy.start(SCENE), begin(SYSTEM)
    finger = interpolate_path(pose(), pose(z=0.038), STRETCH + PAUSE)
    monitor, counts = accuracy.begin_stretch(monitor, start), cycle(ticks)
    states = enumerate(simulate_path(SYSTEM, start, finger))
    sizes = []
    while (period := sum(sizes)) < STRETCH + PAUSE - max(ticks):
        tick = len(sizes)
        sizes.append(next(counts))
        for period, state in islice(states, sizes[-1]):
            monitor = accuracy.note(monitor, state, finger[period : period + 2])
        monitor, _ = accuracy.catch_up(monitor, state, sizes[-1])
    assert len(done) == STRETCH
    for tick, size in enumerate(sizes):
        assert done.count(tick) <= max(1, size // SPREAD)
        # A tick of more periods than the one before takes the longest already.
        assert not (tick and size > sizes[tick - 1] and done.count(tick))
        assert SPREAD * sum(number <= tick for number in done) <= sum(sizes[: tick + 1])


def test_the_monitor_finds_the_error_of_a_stretch_and_a_finer_step_has_smaller_ones():
    # The truth: the same periods at a tenth of the step. The commands differ by what the errors
    # before them changed, so it is no more than the right size that is asked for.
    finger = interpolate_path(pose(z=0.0395), pose(0.004, 0.0375), STRETCH)
    # It moves on, quite differently, while the reference lags behind.
    away = interpolate_path(pose(z=0.039), pose(z=0.05), STRETCH * (SPREAD - 1) - 1)
    whole = np.concatenate([finger, away])
    _, ((found, _),) = watched(stepped("1 ms"), whole)
    _, ((fine, _), *_) = watched(stepped("0.25 ms"), whole)
    ends = []
    for step in ("0.1 ms", "1 ms"):
        system = assemble(stepped(step))
        *_, state = simulate_path(system, begin(system), finger)
        ends.append(state.row(0))
    error = np.abs(ends[0] - ends[1]).max()
    assert 0.3 * error < found.height < 3.0 * error
    assert error > 1e-9
    # Second order: a quarter of the step has a sixteenth of the error, contact events aside.
    assert fine.height < found.height / 8
    assert fine.force < found.force / 8


def test_what_a_stretch_left_wrong_stays_in_the_errors_of_the_session():
    # A tap within the first stretch, then a rest: the pins keep what was wrong when they were left.
    scene = resolve({"layout": {"rows": 11, "columns": 11}, "simulation": {"stepper": "heun"}})
    down, up = (
        interpolate_path(*ends, 8)
        for ends in ((pose(), pose(z=0.037)), (pose(z=0.037), pose(z=0.05)))
    )
    rest = np.repeat(up[-1:], 2 * (STRETCH + PAUSE) + STRETCH * SPREAD, axis=0)
    finger = np.concatenate([down, up[1:], rest])
    _, found = watched(scene, finger)
    (first, left), *_, (last, still) = [(errors.height, carried) for errors, carried in found]
    assert len(found) == 3
    assert first >= SHARE * left > 1e-7
    assert last >= first
    assert still == pytest.approx(left, rel=0.1)


def test_a_monitor_follows_for_a_stretch_now_and_then_and_leaves_the_session_alone():
    count = 2 * (STRETCH + PAUSE) + STRETCH * SPREAD
    finger = interpolate_path(pose(z=0.0395), pose(0.004, 0.0375), count)
    *_, alone = simulate_path(SYSTEM, begin(SYSTEM), finger)
    state, found = watched(SCENE, finger)
    assert len(found) == 3
    assert snapshot.dump(SYSTEM, state) == snapshot.dump(SYSTEM, alone)
    assert recent_trace.measure_total_force(SYSTEM, state) > 0.0
    # A step that cannot be halved has no monitor.
    table = {"simulation": {"control_period": "1 s", "physics_step": "1 ms"}, "control": "absent"}
    assert accuracy.start(resolve(table)) is None


#: A finger in the pins, mm, and how long it has pressed, ticks.
PRESSED, TICKS = 37.0, 20


def pressed():
    """Return a session whose finger presses, and the hand that holds it."""
    mover = hand.Hand()
    return mover.move(hand.started(), [(0.0, z) for z in np.linspace(46.0, PRESSED, TICKS)]), mover


def forked(session):
    """Return the same session with a state of its own: a tick uses it up."""
    return replace(session, state=session.state.copy())


@pytest.mark.usefixtures("quick_machine")
def test_a_move_between_two_ticks_changes_the_commands_of_the_next():
    session, mover = pressed()
    now = mover.now + hand.TICK
    both = [sculpting.advance(forked(session), hand.pose(x, PRESSED), now, 100) for x in (0.0, 2.0)]
    assert both[0].state.period == both[1].state.period > session.state.period
    assert not np.array_equal(*(one.state.row(one.system.rows.target) for one in both))


def test_a_place_drawn_between_two_ticks_changes_the_commands_of_the_next():
    session, number = queue_stroke(hand.started(), start(0, 0.0, 0.0, 4e-3))
    now = 0.0
    # A tick has as much time as it wants: how far it comes must not depend on the machine's load.
    while session.strokes[0].reached < 5 and now < 3.0:
        now += hand.TICK
        session = change_stroke(session, number, partial(draw, x=0.02 * now, y=0.0, depth=4e-3))
        session = sculpting.advance(session, hand.pose(), now, 100, interval=1e3)
    assert session.strokes[0].reached
    now += hand.TICK
    ways = []
    for y in (0.0, 4e-3):
        other = change_stroke(forked(session), number, partial(draw, x=0.02 * now, y=y, depth=4e-3))
        ways.append(sculpting.advance(other, hand.pose(), now, 100, interval=1e3))
    assert ways[1].pose[1] > ways[0].pose[1] == 0.0
    assert not np.array_equal(*(one.state.row(one.system.rows.target) for one in ways))


def test_a_tick_ends_with_a_stroke_since_each_has_an_undo_step():
    session = hand.started()
    for x in (-9e-3, 9e-3):
        session, number = queue_stroke(session, start(0, x, 0.0, 4e-3))
        session = hand.let_go(session, number)
    finished = []
    for now in (1.0, 2.0):
        session = sculpting.advance(session, hand.pose(), now, 1, interval=1e3)
        finished.append(session.finished_strokes)
        assert session.snapshot == snapshot.dump(session.system, session.state)
    assert finished == [1, 2]
    assert (len(session.gestures), last_place(session)) == (2, (9e-3, 0.0))


@pytest.mark.usefixtures("quick_machine")
def test_a_tick_packs_the_state_once_however_many_periods_it_has(monkeypatch):
    packed = []
    dump = snapshot.dump

    def counted(*arguments):
        packed.append(1)
        return dump(*arguments)

    session, mover = pressed()
    monkeypatch.setattr(snapshot, "dump", counted)
    later = sculpting.advance(session, hand.pose(1.0, PRESSED), mover.now + 0.5, 100)
    assert later.state.period - session.state.period == 100
    assert len(packed) == 1
    paused = replace(later, paused=True)
    assert hand.heights(
        sculpting.advance(paused, hand.pose(2.0, PRESSED), mover.now + 1.0, 100)
    ).size
    assert len(packed) == 1
