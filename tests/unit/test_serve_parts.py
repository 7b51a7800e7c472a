"""The server without a process: options, deadlines, session, take, token, lease."""

import socket
from dataclasses import replace
from time import thread_time

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.core.base.errors import OutputError
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import snapshot
from digiclay.core.session.take import from_bytes, make_take, replay

from digiclay_serve import real_time_loop, serve_command
from digiclay_serve.doors import Order, make_slot, open_slot, pack_order, unpack_order
from digiclay_serve.protocol import (
    LIMITS,
    VARIABLE,
    Flag,
    Limits,
    choose_token,
    is_token,
    pack_frame,
    unpack_frame,
)
from digiclay_serve.real_time_loop import Schedule, TimeCounts, run_session
from digiclay_serve.served_session import (
    PartWriter,
    aim,
    begin_session,
    follow,
    join_parts,
    lacks_pose,
    make_frame,
    record,
    reset,
)
from digiclay_serve.tracked_fingers import PARKED
from tests.assemble import over_middle, sample
from tests.scene_files import left
from tests.timeouts import wait_until

PERIOD = 1e-3
SMALL = {
    "layout": {"rows": 7, "columns": 7},
    "blister": {"radius": 5e-3, "edge_radius": 8e-3, "flat_radius": 2e-3},
}
WAIT = {"waypoints": over_middle((0.0, 0.05), (1.0, 0.05))}
STILL = resolve({**SMALL, "trajectory": WAIT})


def pose(height):
    """Return the poses of one level fingertip over the middle."""
    return np.array([[0.0, 0.0, height, *LEVEL]])


DOWN = pose(0.038)


def test_a_period_is_due_from_its_beginning_once_and_the_oldest_late_ones_are_left_out():
    schedule, counts = Schedule(10.0, PERIOD, 5), []
    for now in (9.9995, 10.0, 10.0004, 10.001, 10.0035):
        counts.append(schedule.take_due(now)[0])
    assert counts == [0, 1, 0, 1, 2]
    assert schedule.begins == pytest.approx(10.004)
    schedule = Schedule(10.0, PERIOD, 5)
    count, begins = schedule.take_due(10.0085)
    assert (count, schedule.planned, schedule.left_out) == (5, 9, 4)
    # All that have begun are judged, those left out as well.
    assert begins == pytest.approx(10.0 + PERIOD * np.arange(9))


class Clock:
    """Time that goes on by a millisecond whenever it is read, and by what is waited: nobody is late."""

    now = 10.0
    thread_time = staticmethod(thread_time)

    def perf_counter(self):
        """Return the time, s."""
        self.now += 1e-3
        return self.now


@pytest.fixture
def clock(monkeypatch):
    """The clock by which sessions run."""
    clock = Clock()
    monkeypatch.setattr(real_time_loop, "time", clock)
    return clock


class Asked:
    """Doors whose clients ask for another pose at each look, or for none, over some periods."""

    def __init__(self, clock, *, restless):
        self.clock, self.restless, self.order = clock, restless, Order()
        #: Periods simulated, and when their frame was shown, s.
        self.shown = []

    def read_order(self):
        """Return the newest order."""
        if self.restless:
            self.order = self.order._replace(number=self.order.number + 1)
        return self.order

    def wait(self, time):
        """Wait for an order: the restless have one at once."""
        self.clock.now += 0.0 if self.restless else time

    def show(self, frame):
        """Note a frame."""
        self.shown.append((unpack_frame(frame).period, self.clock.now))

    def stopped(self):
        """Return whether it is over."""
        return self.shown[-1][0] >= 7


LONG = 0.1


@pytest.mark.parametrize("restless", [True, False])
def test_a_new_pose_begins_its_period_early_by_one(restless, clock):
    session = begin_session(
        resolve({**SMALL, "trajectory": WAIT, "simulation": {"control_period": LONG}})
    )
    doors = Asked(clock, restless=restless)
    _, figures = run_session(session, doors, None, 1.0, doors.stopped, print)
    (_, before), *shown = doors.shown
    assert (figures["periods"], figures["left_out"], len(shown)) == (7, 0, 7)
    # To within the readings of the clock in a period.
    begun = [time - before for _, time in shown]
    expected = [max(0, period - 1 - restless) * LONG for period, _ in shown]
    assert begun == pytest.approx(expected, abs=0.02)
    # Judged from its own beginning: what begins early has no time to spare.
    assert figures["elapsed"]["p50"] > 0.0


def test_each_take_has_its_simulated_time_and_errors_or_why_there_are_none(clock, tmp_path):
    doors, session = Asked(clock, restless=False), begin_session(STILL)
    with PartWriter(tmp_path / "out") as writer:
        run_session(session, doors, writer, 1.0, doors.stopped, print)
        assert len(writer.finish()) == 1
    simulated = pytest.approx(doors.shown[-1][0] * session.system.period)
    assert writer.efforts == {1: {"simulated": simulated, "errors_absent": "not yet"}}


def test_frames_and_report_have_the_errors_since_the_last_reset():
    session = begin_session(STILL)
    told = [make_frame(session).errors]
    for number in range(1, 120):
        targets = pose(max(0.036, 0.041 - number * 2e-4))
        session = follow(session, targets, number, 1)
        told.append(make_frame(session).errors)
    assert told[0] is None
    assert 1e-9 < told[-1][0] < 1e-4
    assert unpack_frame(pack_frame(make_frame(session))).errors == told[-1]
    fresh = reset(session)
    assert (make_frame(fresh).errors, fresh.monitor is None) == (None, False)


def test_shares_of_times_are_those_of_the_sorted_times():
    times = np.random.default_rng(3).exponential(3e-4, 5000)
    counts = TimeCounts(1e-5)
    assert counts.find_share(0.5) == 0.0
    for time in times:
        counts.count(time)
    for share in (0.5, 0.99, 0.999):
        wanted = np.quantile(times, share, method="inverted_cdf")
        assert counts.find_share(share) == pytest.approx(wanted, abs=1e-5)
    assert counts.describe()["longest"] == times.max()
    late = counts.count_above(PERIOD)
    assert late == np.count_nonzero(times >= PERIOD)
    for _ in range(5000):
        counts.count(7.0)  # longer than all bins
    assert (counts.find_share(0.9), counts.count_above(PERIOD)) == (7.0, late + 5000)


def pressed(session, count=20):
    """Press the fingertip down, a period at a time."""
    for _ in range(count):
        session = follow(session, DOWN, 3, 1)
    return session


@pytest.mark.parametrize(
    "most, height, flags", [(2.0, 0.039, 4), (2.0, 0.03, 7), (500.0, 0.03, 7), (0.1, 0.039, 6)]
)
def test_no_frame_has_more_force_than_the_ceiling(most, height, flags):
    session, seen = begin_session(STILL, replace(LIMITS, force=most)), 0
    for _ in range(30):
        session = follow(session, pose(height), 3, 1)
        frame = make_frame(session)
        seen |= frame.flags
        assert frame.total_force == pytest.approx(frame.forces.sum(), rel=1e-5)  # 32 bits
        assert (frame.total_force >= most) == bool(frame.flags & Flag.FORCE_LIMITED)
        assert frame.total_force <= most
    assert (seen, frame.pose[2]) == (flags, height)


#: Time since a pose, s, and whether its fingertip lifts.
@pytest.mark.parametrize("silence, lifts", [(0.29, False), (0.31, True)])
def test_the_fingertip_of_a_client_that_is_silent_lifts(silence, lifts):
    session, order = begin_session(STILL, replace(LIMITS, silence=0.3)), Order(pose=tuple(DOWN[0]))
    assert lacks_pose(session, Order(), 0.0)  # none has come
    assert lacks_pose(session, order, silence) == lifts
    for _ in range(40):  # down at 0.25 m/s
        session = follow(session, aim(session, order, 1)[1], 3, 1)
    assert session.state.finger_forces().sum() > 0.1
    for _ in range(40):
        session = follow(session, aim(session, order, 1, silence)[1], 3, 1)
    assert (session.poses[0, 2] > session.state.row(0).max()) == lifts
    assert (session.state.finger_forces().sum() == 0.0) == lifts


def test_the_ceiling_is_each_fingers():
    bed = resolve({**SMALL, "layout": {"rows": 7, "columns": 15}, "trajectory": WAIT})
    session = begin_session(replace(bed, fingers=3 * bed.fingers), replace(LIMITS, force=0.2))
    assert session.poses[:, 2].tolist() == [0.05, PARKED, PARKED]
    lowest = np.array([[-0.015, 0.0, 0.0385], [0.015, 0.0, 0.0395], [0.0, 0.0, PARKED]])
    for _ in range(60):
        session = follow(session, np.hstack([lowest, np.eye(4)[[0, 0, 0]]]), 3, 1, 0.045)
        frame = make_frame(session)
        each = [force for _, force, _ in frame.fingers]
        assert max(each) <= 0.2 * (1.0 + 1e-12)  # rounding
        assert (
            frame.total_force
            == pytest.approx(sum(each))
            == pytest.approx(frame.forces.sum(), rel=1e-5)
        )
        assert each[2] == 0.0
    assert frame.flags & Flag.FORCE_LIMITED
    assert each[0] == pytest.approx(0.2)
    assert 0.0 < each[1] < 0.2
    assert [pose[2] for *_, pose in frame.fingers] == lowest[:, 2].tolist()


@pytest.mark.parametrize(
    "place, turn, way, count",
    [
        ([0.0, 0.0, 0.062], [*LEVEL], 0.012, 1),
        ([0.003, 0.004, 0.05], [*LEVEL], 0.005, 1),
        ([0.0, 0.0, 0.05], [0.0, 0.0, 0.0, 1.0], 0.02 * np.pi, 3),  # by 180°, of points 20 mm apart
    ],
)
def test_the_fingertip_has_a_largest_speed(place, turn, way, count):
    session, turns, each = begin_session(STILL, Limits(speed=0.1)), 0, 0.1 * 5e-3 * count
    while turns == 0 or session.behind:
        before = session.poses[0, :3]
        session, turns = follow(session, np.array([place + turn]), 3, count), turns + 1
        assert np.linalg.norm(session.poses[0, :3] - before) <= each * (1.0 + 1e-9)  # rounding
    assert (session.poses[0].tolist(), turns) == (place + turn, np.ceil(way / each - 1e-9))


def test_a_session_that_diverges_goes_back_and_does_not_go_there_again():
    words = "simulation.stepper=euler simulation.control_period=0.05 simulation.physics_step=0.05"
    scene = sample("slow_press", *words.split(), "layout.rows=11", "layout.columns=11")
    session = record(begin_session(scene), 1000)
    high = session.poses
    for _ in range(15):  # a state is kept in between
        session = follow(session, high, 1, 1)
    deep = pose(0.03)
    for _ in range(100):
        session = session if session.diverged else follow(session, deep, 2, 1)
    assert session.diverged == 1
    assert session.state.period == session.kept.period == 10
    assert session.recording.count == 11
    after = follow(session, deep, 2, 1)
    assert (after.diverged, after.poses.tolist(), after.state.period) == (1, high.tolist(), 11)
    assert follow(after, high + DOWN / 1e3, 3, 1).poses.tolist() != high.tolist()


def recorded():
    """Return a session that is recorded."""
    return record(begin_session(STILL), 10)


def taken(session):
    """Return what a session has recorded."""
    take = make_take(session.scene, session.recording, snapshot.dump(session.system, session.state))
    return take


def test_parts_of_a_take_are_joined_to_what_is_replayed_bit_for_bit(tmp_path):
    session = recorded()
    with PartWriter(tmp_path / "out") as writer:
        for _ in range(3):
            session = pressed(session, 10)
            writer.put(taken(session))
            session = record(session, 10)
        end = snapshot.dump(session.system, session.state)
        writer.end_session()
        part = taken(pressed(record(reset(session), 10), 5))
        writer.put(part)
        written = writer.finish()
    assert [path.name for path in written] == ["take_001.npz", "take_002.npz"]
    assert left(tmp_path / "out") == ["take_001.npz", "take_002.npz"]
    take = from_bytes(written[0].read_bytes())
    assert (take.periods, take.end, take.poses.shape) == (30, end, (31, 1, 7))
    *_, last = replay(take)
    assert snapshot.dump(session.system, last) == end
    with pytest.raises(OutputError, match="must follow each other"):
        join_parts([part, part])


def test_a_disk_that_fails_ends_the_take_and_keeps_what_it_has(tmp_path):
    take, blocked = taken(pressed(recorded(), 3)), tmp_path / "take_001_part_00002.npz"
    with PartWriter(tmp_path) as writer:
        writer.put(take)
        wait_until(lambda: list(tmp_path.glob("*_part_00001.npz")))
        blocked.mkdir()
        writer.put(take)
        wait_until(lambda: writer.failure)
        writer.put(take)
        blocked.rmdir()
        (path,) = writer.finish()
    assert "take ends here: Cannot write" in writer.failure
    assert from_bytes(path.read_bytes()).periods == 3


def test_the_first_part_replaces_the_takes_in_a_folder_and_nothing_else(tmp_path):
    held = ["mine.npz", "take_001_part_00007.npz", "take_004.npz"]
    for name in held:
        (tmp_path / name).write_text("old", encoding="utf-8")
    with (
        pytest.raises(OutputError, match="replace the take in it with --overwrite"),
        PartWriter(tmp_path),
    ):
        pass
    for part in (None, taken(pressed(recorded(), 3))):
        assert left(tmp_path) == held
        with PartWriter(tmp_path, overwrite=True) as writer:
            if part:
                writer.put(part)
            assert len(writer.finish()) == bool(part)
    assert left(tmp_path) == ["mine.npz", "take_001.npz"]


def test_a_slot_gives_the_newest_value_once_and_none_that_is_being_written():
    slot, path = make_slot(16)
    other = open_slot(path)
    assert other.read() is None
    for value in (b"a" * 16, b"b" * 16):
        slot.write(value)
    assert (other.read(), other.read()) == (b"b" * 16, None)
    with pytest.raises(ValueError, match="must have 16 bytes"):
        slot.write(b"c")
    slot.write(b"a" * 16)
    content = path.read_bytes()
    for place, changed in ((0, 1), (16, 1)):  # the number is odd; the value is another one
        torn = bytearray(content)
        torn[place] ^= changed
        with path.open("r+b") as file:
            file.write(torn)
        assert other.read() is None
    path.unlink()
    for order in (Order(), Order((1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0), 2**32 - 1, 5)):
        assert unpack_order(pack_order(order)) == order


def test_a_token_comes_from_the_option_the_environment_or_chance(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    first, made = choose_token(None)
    assert made
    assert first != choose_token(None)[0]
    monkeypatch.setenv(VARIABLE, "from-the-environment")
    assert choose_token(None) == ("from-the-environment", False)
    assert choose_token("from-the-option") == ("from-the-option", False)


def test_only_the_same_token_is_the_right_one_and_one_that_is_none_is_refused_and_not_shown():
    wrong = ("", "a-token-of-test", "a-token-of-testss", None, 7, b"a-token-of-tests", "\ud800")
    assert [is_token(one, "a-token-of-tests") for one in ("a-token-of-tests", *wrong)] == [True] + [
        False
    ] * 7
    for token in ("", "short", "with a space", "x" * 129, "umlaut-ä-ä-ä"):
        with pytest.raises(OutputError, match=r"--token must have 8 to 128") as caught:
            choose_token(token)
        assert not token or token not in str(caught.value)


FEW_PINS = ["--set", "layout.rows=3", "--set", "layout.columns=3", "--set", "control=absent"]


@pytest.mark.parametrize(
    "words, message",
    [
        ("--rate 0", "must be from 1 to 1000 Hz"),
        ("--rate 1e9", "must be from 1 to 1000 Hz"),
        ("--port 65536", "must be a whole number from 0 to 65535"),
        ("--osc-port x", "must be a whole number from 0 to 65535"),
        ("--token short", "--token must have 8 to 128"),
        ("--token -short", "--token must have 8 to 128"),
        ("--fingers 0", "must be a whole number from 1 to 32"),
        ("--fingers 33", "must be a whole number from 1 to 32"),
        ("--lift 0", "must be from 1 to 10000 ms"),
        ("--clutch nan", "must be from 0 to 1000 mm"),
        ("--filter -1", "must be from 0 to 1000 Hz"),
        ("--coupling x", "must be from 0 to 1000 N/mm"),
        ("--most-force 0", "must be from 0.001 to 1000 N"),
        ("--most-speed inf", "must be from 1 to 10000 mm/s"),
        ("--part 0", "must be from 0.1 to 600 s"),
        ("--seconds inf", "must be from 0 to 1e+09 s"),
        ("--tokn x", "Did you mean --token (not --tokn)?"),
        ("--report missing/report.json --out .", "contains something other"),
        ("missing.toml", "missing.toml"),
    ],
)
def test_a_wrong_option_is_refused_in_one_line(words, message, here, refused):
    refused(["serve", "--seconds", "0", *words.split()], message)
    assert left(here) == []


def test_a_report_makes_its_folder(here):
    ports = ("--port", "0", "--osc-port", "0")
    options = ("--seconds", "0", "--report", "new/report.json", "--quiet")
    assert main(["serve", *FEW_PINS, *ports, *options]) == 0
    assert (here / "new" / "report.json").is_file()


def test_what_cannot_be_opened_is_told_in_a_line(here, refused):
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        command = ["serve", *FEW_PINS, "--osc-port", "0", "--port", port, "--out", "take"]
        refused(command, f"Port {port} of 127.0.0.1 cannot be opened: ")
    assert left(here) == []


@pytest.mark.parametrize("late, share", [(1, "0.5 %"), (200, "100 %")])
def test_the_summary_gives_the_share_of_late_periods_in_plain_digits(late, share):
    shares = {"p50": 0.0, "p99": 0.0, "p99.9": 0.0, "longest": 0.0}
    figures = {"elapsed": shares, "period": 1e-3, "periods": 200, "missed": late, "left_out": 0}
    first = next(serve_command._summary({**figures, "counts": {}, "flagged": {}}))
    assert f"{late} late ({share})" in first
