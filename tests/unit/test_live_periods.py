"""The wall's clock, the finger's way, the trace and the error monitor of a live session."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.model.control_interface import SetPoint
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.trajectory import interpolate_poses
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import recent_trace, snapshot
from digiclay.core.session.live_session import (
    Clock,
    clamp_pose,
    interpolate_path,
    periods_due,
    simulate_path,
    update_cost,
)
from digiclay.core.session.recent_trace import ROWS
from numpy.typing import NDArray

from tests.assemble import path

Floats = NDArray[np.float64]
PERIOD = 5e-3
SCENE = resolve({"layout": {"rows": 11, "columns": 11}})
SYSTEM = assemble(SCENE)


def looked(times: list[float], most: int = 100, clock: Clock | None = None) -> tuple[list[int], Clock]:
    """Look at the clock at some times; return the periods due each time."""
    clock, counts = clock or Clock(), []
    for time in times:
        count, clock = periods_due(clock, time, PERIOD, most)
        counts.append(count)
    return counts, clock


@pytest.mark.parametrize(
    ("times", "counts"),
    [
        pytest.param([1e6], [0], id="nothing at the first look"),
        pytest.param([0.0, 0.012, 0.024, 0.026], [0, 2, 2, 1], id="the rest is kept for the next look"),
        pytest.param([5.0, 4.0, 4.01], [0, 0, 2], id="a clock that goes back"),
    ],
)
def test_whole_periods_are_due(times: list[float], counts: list[int]) -> None:
    assert looked(times)[0] == counts


def test_as_much_is_simulated_as_time_goes_by() -> None:
    times = np.cumsum(np.random.default_rng(1).uniform(0.0, 0.06, 2000)).tolist()
    counts, clock = looked(times)
    # Less than a period is owed at the end, whatever has been rounded on the way.
    assert 0.0 <= times[-1] - times[0] - sum(counts) * PERIOD < PERIOD * 1.001
    assert clock.factor == pytest.approx(1.0, abs=2 * PERIOD)
    assert len(looked(np.arange(0.0, 100.0, 0.01).tolist())[1].ticks) <= 101  # a second of looks
    # More than the most is dropped and not made up for; the time of a pause does not count.
    counts, clock = looked([0.0, 10.0, 10.01], most=20)
    assert (counts, clock.factor) == ([0, 20, 2], pytest.approx(0.011, abs=1e-3))
    _, clock = looked([0.0, 0.02])
    assert looked([100.0, 100.01], clock=clock.stopped())[0] == [0, 2]


def test_a_machine_too_slow_slows_down_instead_of_stalling() -> None:
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


def pose(x: float = 0.0, z: float = 0.05) -> Floats:
    """Return a level finger's pose, m, as that of the only one."""
    return np.array([[x, 0.0, z, *LEVEL]])


def test_the_way_begins_where_the_finger_was_and_ends_where_it_is() -> None:
    start, end = pose(), np.array([[0.01, 0.0, 0.03, 0.6, 0.0, 0.8, 0.0]])
    path = interpolate_path(start, end, 7)
    assert path.shape == (8, 1, 7)
    assert np.array_equal(path[0], start)
    np.testing.assert_allclose(path[-1], end, rtol=0, atol=1e-15)
    np.testing.assert_allclose(np.diff(path[..., :3], axis=0), [(end - start)[:, :3] / 7] * 7, atol=1e-16)
    # Several ways together are those one by one.
    poses = np.random.default_rng(2).normal(size=(40, 2, 7))
    poses[..., 3:] /= np.linalg.norm(poses[..., 3:], axis=-1)[..., None]
    parts = np.array([0.0, 0.2, 0.21, 0.7, 1.0])
    alone = [interpolate_poses(np.array(pair), parts)[0] for pair in pairwise(poses)]
    assert np.array_equal(interpolate_poses(poses, parts), alone)


def test_a_path_gives_the_same_states_however_many_periods_are_done_at_a_time() -> None:
    drag = interpolate_path(pose(z=0.035), pose(0.01, 0.035), 50)
    poses = np.concatenate([interpolate_path(pose(), pose(z=0.035), 40), drag[1:]])
    *_, together = simulate_path(SYSTEM, begin(SYSTEM), poses)
    state = begin(SYSTEM)
    for first in range(0, 90, 7):
        *_, state = simulate_path(SYSTEM, state, poses[first : first + 8])
    assert snapshot.dump(SYSTEM, state) == snapshot.dump(SYSTEM, together)


def test_a_finger_stays_where_a_finger_can_be() -> None:
    (at,) = pose()
    for given, wanted in (
        ([0.0, 0.0, -50.0], [0.0, 0.0, 0.0]), ([1e9, -1e9, 1e9], [100.0, -100.0, 100.0]),
        ([0.01, 0.02, 0.03], [0.01, 0.02, 0.03]),
    ):  # fmt: skip
        at[:3] = given
        assert clamp_pose(at, 0.1)[:3].tolist() == wanted


def test_a_trace_never_holds_more_than_its_rows_and_time_that_goes_back_takes_it_along() -> None:
    trace, line = recent_trace.start(PERIOD), [0.0] * 8
    for time in range(5 * ROWS):
        trace = recent_trace.extend(trace, [[float(time), *line]])
    assert (len(trace.rows), trace.time[0]) == (ROWS, 4 * ROWS)
    assert recent_trace.start(1e-4).every * 1e-4 * ROWS >= 10.0  # seconds
    trace = recent_trace.extend(recent_trace.start(PERIOD), [[float(time), *line] for time in range(10)])
    assert recent_trace.extend(trace, [[4.0] + [1.0] * 8]).time.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_a_trace_knows_force_set_point_and_heights_of_picked_pins() -> None:
    press = path((0, 0, 0, 42), (0.2, 0, 0, 36))
    system = assemble(resolve({}))
    *_, state = periods(system, [press], begin(system), 60)
    middle, corner = 312, 0
    assert np.isin([middle, corner], state.active.cells).tolist() == [True, False]
    trace = recent_trace.pick(recent_trace.start(PERIOD), [middle, corner], system.grid.count)
    trace = recent_trace.extend(trace, [recent_trace.sample(system, state, SetPoint(0.4), trace.pins)])
    assert trace.heights.tolist() == [[state.row(0)[middle], state.row(0)[corner]]]
    assert trace.force[0] == pytest.approx(state.row(system.rows.force).sum(), rel=1e-12)
    assert trace.force[0] > 0.1
    assert (trace.time[0], trace.set_point[0]) == (60 * PERIOD, 0.4)


def test_a_set_point_of_each_cell_is_traced_as_their_number_changes() -> None:
    press = path((0, 0, 0, 41), (0.05, 0, 0, 38))
    *_, state = periods(SYSTEM, [press], begin(SYSTEM), 10)
    held, asked = state.active, SetPoint(0.04, per_cell=True)
    held.mode[:] = Mode.REST
    assert np.isnan(recent_trace.sample(SYSTEM, state, None, ())[2])
    assert np.isnan(recent_trace.sample(SYSTEM, state, asked, ())[2])
    held.mode[:3] = Mode.FORCE_FOLLOW
    assert recent_trace.sample(SYSTEM, state, asked, ())[2] == pytest.approx(0.12, rel=1e-12)  # rounding


def test_a_pin_that_stays_picked_keeps_its_past() -> None:
    trace = recent_trace.pick(recent_trace.start(PERIOD), [3, 4], 121)
    trace = recent_trace.extend(
        trace, [recent_trace.sample(SYSTEM, begin(SYSTEM), SetPoint(0.4), trace.pins)]
    )
    other = recent_trace.pick(trace, [9, 4, 500, -1], 121)
    assert other.pins == (9, 4)
    assert np.isnan(other.heights[0, 0])
    assert other.heights[0, 1] == trace.heights[0, 1]
