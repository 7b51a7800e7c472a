"""The finger's path: through its waypoints, without overshoot, without a jump in speed."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.trajectory import Trajectory, interpolate_poses, make_level
from scipy.spatial.transform import Rotation

RANDOM = np.random.default_rng(3)
TIMES = np.cumsum(RANDOM.uniform(0.05, 2.0, 12))
POSITIONS = RANDOM.uniform(-30e-3, 30e-3, (12, 3))
TURNS = Rotation.random(12, random_state=4).as_quat()[:, [3, 0, 1, 2]]
SMOOTH = Trajectory(TIMES, POSITIONS, TURNS)
LINEAR = Trajectory(TIMES, POSITIONS, TURNS, "linear")


@pytest.mark.parametrize("path", [SMOOTH, LINEAR], ids=["smooth", "linear"])
def test_the_path_passes_its_waypoints(path: Trajectory) -> None:
    assert path.poses(TIMES)[:, :3] == pytest.approx(POSITIONS, abs=1e-17)


@pytest.mark.parametrize("path", [SMOOTH, LINEAR], ids=["smooth", "linear"])
def test_the_finger_has_its_orientation_at_the_waypoints(path: Trajectory) -> None:
    along = np.abs(np.einsum("ij,ij->i", path.poses(TIMES)[:, 3:], TURNS))  # q and -q are one
    assert along == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("path", [SMOOTH, LINEAR], ids=["smooth", "linear"])
def test_no_coordinate_leaves_the_range_of_its_two_waypoints(path: Trajectory) -> None:
    for piece in range(11):
        at = path.poses(np.linspace(TIMES[piece], TIMES[piece + 1], 200))[:, :3]
        ends = POSITIONS[piece : piece + 2]
        assert np.all(at >= ends.min(axis=0) - 1e-16)  # rounding
        assert np.all(at <= ends.max(axis=0) + 1e-16)


def test_the_smooth_path_has_one_velocity_on_both_sides_of_a_waypoint() -> None:
    dt = 1e-6
    before = (SMOOTH.poses(TIMES)[:, :3] - SMOOTH.poses(TIMES - dt)[:, :3])[1:-1] / dt
    after = (SMOOTH.poses(TIMES + dt)[:, :3] - SMOOTH.poses(TIMES)[:, :3])[1:-1] / dt
    # One-sided differences: acceleration, up to 100 m/s², times dt; rounding 1e-17/1e-6.
    assert np.abs(after - before).max() < 2e-4


def test_the_smooth_path_starts_and_ends_at_rest() -> None:
    ends = SMOOTH.poses(TIMES[[0, -1]])[:, :3]
    nearby = SMOOTH.poses(TIMES[[0, -1]] + [1e-6, -1e-6])[:, :3]
    assert np.abs(nearby - ends).max() < 1e-9  # acceleration, up to 100 m/s², times (1 µs)²/2


def test_a_smooth_path_through_equal_values_stays() -> None:
    path = make_level(
        np.array([0.0, 1.0, 2.0, 3.0]), np.array([[0, 0, 1], [0, 0, 2], [0, 0, 2], [0, 0, 3]]) * 1e-2
    )
    assert np.ptp(path.poses(np.linspace(1, 2, 50))[:, 2]) == 0.0


def test_the_linear_path_is_straight() -> None:
    middle = 0.5 * (TIMES[1:] + TIMES[:-1])
    assert LINEAR.poses(middle)[:, :3] == pytest.approx(0.5 * (POSITIONS[1:] + POSITIONS[:-1]), abs=1e-16)


def test_a_smooth_path_of_two_waypoints_is_half_way_at_half_time() -> None:
    path = make_level(np.array([0.0, 1.0]), np.array([[0, 0, 0], [1, 2, 3.0]]))
    assert path.poses(np.array([0.5]))[0, :3] == pytest.approx([0.5, 1.0, 1.5], abs=1e-15)


def test_the_finger_waits_before_the_first_and_after_the_last_waypoint() -> None:
    poses = SMOOTH.poses(np.array([-5.0, 1e9]))
    assert poses[:, :3] == pytest.approx(POSITIONS[[0, -1]], abs=1e-17)


@pytest.mark.parametrize("path", [SMOOTH, LINEAR], ids=["smooth", "linear"])
def test_orientations_have_unit_length(path: Trajectory) -> None:
    poses = path.poses(np.linspace(TIMES[0], TIMES[-1], 500))
    assert np.linalg.norm(poses[:, 3:], axis=1) == pytest.approx(1.0, abs=1e-15)


def test_the_finger_turns_along_the_shortest_arc_at_constant_rate() -> None:
    # SciPy's slerp goes the short way about as well.
    from scipy.spatial.transform import Slerp

    times = np.linspace(TIMES[0], TIMES[-1], 300)
    slerp = Slerp(TIMES, Rotation.from_quat(TURNS[:, [1, 2, 3, 0]]))(times)
    ours = Rotation.from_quat(SMOOTH.poses(times)[:, [4, 5, 6, 3]])
    assert (slerp.inv() * ours).magnitude().max() < 1e-7  # arccos near 1 keeps half of the digits


def test_a_quaternion_and_its_opposite_are_no_way_apart() -> None:
    turns = np.array([TURNS[0], -TURNS[0]])
    poses = Trajectory(np.array([0.0, 1.0]), np.zeros((2, 3)), turns).poses(np.linspace(0, 1, 20))
    assert np.abs(poses[:, 3:] @ TURNS[0]) == pytest.approx(1.0, abs=1e-15)


def test_orientations_need_not_be_given_at_unit_length() -> None:
    path = Trajectory(np.array([0.0]), np.zeros((1, 3)), np.array([[2.0, 0, 0, 0]]))
    assert path.poses(np.array([0.0]))[0, 3:].tolist() == [1.0, 0.0, 0.0, 0.0]


def test_a_single_waypoint_is_a_finger_that_stays() -> None:
    path = make_level(np.array([1.0]), np.array([[1e-3, 2e-3, 3e-3]]))
    assert path.poses(np.array([0.0, 9.0]))[:, :3].tolist() == [[1e-3, 2e-3, 3e-3]] * 2


def test_the_duration_is_the_time_of_the_last_waypoint() -> None:
    assert SMOOTH.duration == TIMES[-1]


def test_the_way_between_two_poses_starts_and_ends_there() -> None:
    start, end = (np.concatenate([POSITIONS[i], TURNS[i]]) for i in (0, 1))
    ways = interpolate_poses(np.array([start, end])[:, None], np.array([0.0, 1.0]))[0, :, 0]
    assert ways[:, :3] == pytest.approx(np.array([start[:3], end[:3]]), abs=1e-17)
    assert np.abs(np.einsum("ij,ij->i", ways[:, 3:], [start[3:], end[3:]])) == pytest.approx(1.0, abs=1e-14)


def test_times_that_fall_back_are_refused() -> None:
    with pytest.raises(
        ParameterError, match=r"^Trajectory\.times must increase from waypoint to waypoint .*waypoint 3"
    ):
        make_level(np.array([0.0, 1.0, 1.0]), np.zeros((3, 3)))


def test_a_path_without_waypoints_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"^Trajectory\.waypoints must have at least one waypoint"):
        make_level(np.empty(0), np.empty((0, 3)))


def test_a_position_that_is_not_finite_is_refused() -> None:
    with pytest.raises(
        ParameterError, match=r"^Trajectory\.positions must be finite numbers \(got nan at waypoint 2\)\.$"
    ):
        make_level(np.array([0.0, 1.0]), np.array([[0, 0, 0], [0, np.nan, 0]]))


def test_a_quaternion_of_no_length_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"^Trajectory\.orientations must have a length above 0"):
        Trajectory(np.array([0.0]), np.zeros((1, 3)), np.zeros((1, 4)))


def test_an_unknown_interpolation_is_refused() -> None:
    with pytest.raises(
        ParameterError, match=r"^Trajectory\.interpolation must be one of smooth, linear \(got 'cubic'\)\.$"
    ):
        make_level(np.array([0.0]), np.zeros((1, 3)), "cubic")
