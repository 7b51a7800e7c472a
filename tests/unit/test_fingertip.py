"""The fingertip's underside: against the ellipsoid itself, cut by rays, in any orientation."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.model.fingertip import JOIN, LEVEL, Fingertip
from scipy.spatial.transform import Rotation

from tests.assemble import under

AXES = np.array([10e-3, 8e-3, 8e-3])
RANDOM = np.random.default_rng(2)
AROUND = np.linspace(0, 2 * np.pi, 12, endpoint=False)


def random_poses(count: int) -> np.ndarray:
    """Return poses in all orientations, (k, 7)."""
    turns = RANDOM.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    return np.column_stack([RANDOM.uniform(-20e-3, 20e-3, (count, 2)), RANDOM.uniform(0, 0.1, count), turns])


def cut(pose: np.ndarray, axes: np.ndarray, x: float, y: float) -> float:
    """Return the lower height at which the vertical cuts (p - c)ᵀ A (p - c) = 1, which SciPy turns."""
    turn = Rotation.from_quat(pose[[4, 5, 6, 3]]).as_matrix()
    squared = turn @ np.diag(axes**2) @ turn.T
    center, a = pose[:3] + squared[:, 2] / np.sqrt(squared[2, 2]), np.linalg.inv(squared)
    dx, dy = x - center[0], y - center[1]
    roots = np.roots(
        [a[2, 2], 2.0 * (a[0, 2] * dx + a[1, 2] * dy),
         a[0, 0] * dx * dx + 2.0 * a[0, 1] * dx * dy + a[1, 1] * dy * dy - 1.0]
    )  # fmt: skip
    assert np.isreal(roots).all()
    return center[2] + roots.real.min()


def within(outline: np.ndarray, square: float, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points (x, y) at a squared reduced radius, in directions `angle`."""
    s_xx, s_xy, s_yy = outline[3:6]
    cos, sin = np.cos(angle), np.sin(angle)
    radius = np.sqrt(square / (s_xx * cos * cos + 2.0 * s_xy * cos * sin + s_yy * sin * sin))
    return outline[0] + radius * cos, outline[1] + radius * sin


@pytest.mark.parametrize("axes", [AXES, np.array([12e-3, 5e-3, 3e-3])], ids=["default", "flat"])
def test_the_underside_is_where_a_vertical_ray_meets_the_ellipsoid(axes: np.ndarray) -> None:
    finger, poses = Fingertip(*axes), random_poses(40)
    for pose, outline in zip(poses, finger.outline(poses), strict=True):
        for square in (0.0, 0.3, 0.8, 0.95):
            x, y = within(outline, square, RANDOM.uniform(0, 2 * np.pi, 3))
            rays = [cut(pose, axes, *point) for point in zip(x, y, strict=True)]
            assert under(outline[None], x, y)[0] == pytest.approx(rays, abs=1e-14)  # rounding of 0.1 m
    # Opposite quaternions are the same finger.
    assert np.array_equal(finger.outline(poses), finger.outline(poses * [1, 1, 1, -1, -1, -1, -1]))
    assert np.isfinite(under(finger.outline(poses), np.array([1.0, -100.0]), np.array([0.0, 100.0]))).all()


def test_the_position_is_the_lowest_point_of_the_underside() -> None:
    poses = random_poses(50)
    for pose, outline in zip(poses, Fingertip().outline(poses), strict=True):
        x, y = (axis.ravel() for axis in np.meshgrid(*(np.linspace(-9e-3, 9e-3, 61) + at for at in pose[:2])))
        assert under(outline[None], x, y).min() >= pose[2] - 1e-15  # rounding
        assert under(outline[None], pose[:1], pose[1:2])[0, 0] == pytest.approx(pose[2], abs=1e-15)
    center = Fingertip().outline(np.array([[1e-3, 2e-3, 50e-3, *LEVEL]]))[0, :3]
    assert center == pytest.approx([1e-3, 2e-3, 58e-3], abs=1e-17)


def test_height_and_slope_are_continuous_at_the_join_and_beyond_it_the_underside_rises_on() -> None:
    for outline in Fingertip().outline(random_poses(20)):
        x, y = within(outline, JOIN, AROUND)
        # Over 2 nm/1000 a slope of 1/sqrt(1 - r²), 5 to 10, moves the underside 2e-11 m.
        inside, before, at, after, outside = (
            under(outline[None], x + offset * np.cos(AROUND), y + offset * np.sin(AROUND))[0]
            for offset in (-1e-12, -1e-9, 0.0, 1e-9, 1e-12)
        )
        assert np.abs(outside - inside).max() < 5e-11
        # Curvature near the rim, some 1e5 1/m, times 1 nm; rounding 1e-17/1e-9.
        assert np.abs(after - at - (at - before)).max() < 1e-3 * np.abs(at - before).max()
        dx, dy = x - outline[0], y - outline[1]
        rays = [under(outline[None], outline[0] + s * dx, outline[1] + s * dy)[0] for s in (1.5, 2, 3, 5)]
        assert np.diff(rays, axis=0).min() > 0.0
