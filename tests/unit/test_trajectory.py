"""The finger's path: through its waypoints, without overshoot, without a jump in speed."""

import numpy as np
import pytest
from digiclay.core.model.trajectory import Trajectory, interpolate_poses, make_level
from scipy.spatial.transform import Rotation, Slerp

RANDOM = np.random.default_rng(3)
TIMES = np.cumsum(RANDOM.uniform(0.05, 2.0, 12))
POSITIONS = RANDOM.uniform(-30e-3, 30e-3, (12, 3))
TURNS = Rotation.random(12, random_state=4).as_quat()[:, [3, 0, 1, 2]]
SMOOTH = Trajectory(TIMES, POSITIONS, TURNS)
LINEAR = Trajectory(TIMES, POSITIONS, TURNS, "linear")


@pytest.mark.parametrize("path", [SMOOTH, LINEAR], ids=["smooth", "linear"])
def test_the_path_passes_its_waypoints_and_stays_between_them(path):
    assert path.duration == TIMES[-1]
    there = path.poses(TIMES)
    assert there[:, :3] == pytest.approx(POSITIONS, abs=1e-17)
    along = np.abs(np.einsum("ij,ij->i", there[:, 3:], TURNS))  # q and -q are one
    assert along == pytest.approx(1.0, abs=1e-14)
    for piece in range(11):
        poses = path.poses(np.linspace(TIMES[piece], TIMES[piece + 1], 200))
        ends = POSITIONS[piece : piece + 2]
        assert np.all(poses[:, :3] >= ends.min(axis=0) - 1e-16)  # rounding
        assert np.all(poses[:, :3] <= ends.max(axis=0) + 1e-16)
        assert np.linalg.norm(poses[:, 3:], axis=1) == pytest.approx(1.0, abs=1e-15)
    if path is LINEAR:
        middle = path.poses(0.5 * (TIMES[1:] + TIMES[:-1]))[:, :3]
        assert middle == pytest.approx(0.5 * (POSITIONS[1:] + POSITIONS[:-1]), abs=1e-16)
    before_and_after = path.poses(np.array([-5.0, 1e9]))
    assert before_and_after[:, :3] == pytest.approx(POSITIONS[[0, -1]], abs=1e-17)


def test_the_smooth_path_has_one_velocity_on_both_sides_of_a_waypoint_and_none_at_its_ends():
    dt = 1e-6
    before, at, after = (SMOOTH.poses(TIMES + side)[:, :3] for side in (-dt, 0.0, dt))
    # One-sided differences: acceleration, up to 100 m/s², times dt; rounding 1e-17/1e-6.
    assert np.abs(after - 2.0 * at + before)[1:-1].max() / dt < 2e-4
    assert max(np.abs(after - at)[0].max(), np.abs(at - before)[-1].max()) < 1e-9


@pytest.mark.parametrize(
    "times, heights, at, wanted",
    [
        ([0, 1, 2, 3], [1, 2, 2, 3], np.linspace(1, 2, 50), 2.0),  # through equal values it stays
        ([0, 1], [0, 3], 0.5, 1.5),  # of two waypoints it is half way at half time
        ([1], [3], [0, 9], 3.0),  # at a single one it stays
    ],
)
def test_the_smooth_path_of_few_waypoints(times, heights, at, wanted):
    places = np.array(heights, float)[:, None] * [0.0, 0.0, 1.0]
    poses = make_level(np.array(times, float), places).poses(np.atleast_1d(at).astype(float))
    assert poses[:, 2] == pytest.approx(wanted, abs=1e-15)


def test_the_finger_turns_along_the_shortest_arc_at_constant_rate_by_quaternions_of_any_length():
    # SciPy's slerp goes the short way about as well.
    times = np.linspace(TIMES[0], TIMES[-1], 300)
    slerp = Slerp(TIMES, Rotation.from_quat(TURNS[:, [1, 2, 3, 0]]))(times)
    ours = Rotation.from_quat(SMOOTH.poses(times)[:, [4, 5, 6, 3]])
    assert (slerp.inv() * ours).magnitude().max() < 1e-7  # arccos near 1 keeps half of the digits
    turns = np.array([TURNS[0], -2.0 * TURNS[0]])
    poses = Trajectory(np.array([0.0, 1.0]), np.zeros((2, 3)), turns).poses(np.linspace(0, 1, 20))
    assert np.abs(poses[:, 3:] @ TURNS[0]) == pytest.approx(1.0, abs=1e-15)
    ends = np.column_stack([POSITIONS, TURNS])[:2]
    ways = interpolate_poses(ends[:, None], np.array([0.0, 1.0]))[0, :, 0]
    assert ways[:, :3] == pytest.approx(ends[:, :3], abs=1e-17)
    assert np.abs(np.einsum("ij,ij->i", ways[:, 3:], ends[:, 3:])) == pytest.approx(1.0, abs=1e-14)
