"""A fingertip that leans with a pen: its orientation, on the way and on the mirror images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.model.fingertip import LEVEL, Fingertip, make_matrices
from digiclay.sessions import sculpting
from digiclay.sessions.stroke_queue import drop_strokes, find_stroke, queue_stroke
from digiclay.strokes.motion import TURN, follow, lean_finger, mirror_turn, turn_toward
from digiclay.strokes.stroke import SYMMETRIES, draw, start

from tests.hand import TICK, started
from tests.unit.test_stroke import AT, CELLS, HEIGHT, PERIOD, path, pressed

UPRIGHT = np.array(LEVEL)
#: A quarter of a right angle about the vertical: a finger that points between the rows.
TWISTED = np.array([np.cos(np.pi / 16), 0.0, 0.0, np.sin(np.pi / 16)])


def matrix(turn: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of a quaternion."""
    return make_matrices(turn[None])[0]


@pytest.mark.parametrize("lean", [(0.5, 0.0), (0.0, 0.5), (-0.3, 0.4)])
def test_the_top_of_the_finger_goes_where_it_leans_by_the_angle(lean: tuple[float, float]) -> None:
    top = matrix(lean_finger(UPRIGHT, lean))[:, 2]
    angle = np.hypot(*lean)
    np.testing.assert_allclose(top[:2], np.array(lean) / angle * np.sin(angle), atol=1e-12)


def test_a_finger_that_does_not_lean_keeps_its_orientation_bit_for_bit() -> None:
    np.testing.assert_array_equal(lean_finger(TWISTED, (0.0, 0.0)), TWISTED)


@pytest.mark.parametrize("mirror", SYMMETRIES["XY"])
def test_a_mirrored_orientation_is_that_of_the_ellipsoids_mirror_image(mirror: tuple[float, float]) -> None:
    turn, flip = lean_finger(TWISTED, (0.4, -0.2)), np.diag([*mirror, 1.0])
    np.testing.assert_allclose(matrix(mirror_turn(turn, mirror)), flip @ matrix(turn) @ flip, atol=1e-12)


def test_a_turn_ends_at_its_aim_and_is_no_faster_than_its_angle() -> None:
    aim, turn, angles = -lean_finger(UPRIGHT, (0.5, 0.0)), UPRIGHT, []
    for _ in range(6):
        before, turn = turn, turn_toward(turn, aim, 0.1)
        angles.append(2.0 * np.arccos(min(1.0, abs(before @ turn))))
    np.testing.assert_allclose(angles, [0.1] * 5 + [0.0], atol=1e-7)
    np.testing.assert_allclose(matrix(turn), matrix(aim), atol=1e-12)


@pytest.mark.parametrize("symmetry", ["NONE", "XY"])
def test_the_finger_leans_with_the_pen_on_each_image_and_ends_as_it_began(symmetry: str) -> None:
    stroke = start(1, 0.0, 0.005, 4e-3, SYMMETRIES[symmetry], lean=(0.4, 0.2))
    for part in np.arange(1, 21) / 20:
        stroke = draw(stroke, part, part * 0.02, 0.005, 4e-3, lean=(0.4, 0.2))
    at = np.array([*AT[:3], *TWISTED])
    stroke, poses = path(replace(stroke, held=False, known=1.0), at)
    assert stroke.done
    np.testing.assert_array_equal(poses[-1, 3:], TWISTED)
    for mirror in SYMMETRIES[symmetry]:
        wanted = mirror_turn(lean_finger(TWISTED, (0.4, 0.2)), mirror)
        down = pressed(poses)
        side = down[(down[:, :2] * mirror > 1e-6).all(1)]
        assert len(side) > 20
        np.testing.assert_allclose(side[:, 3:], np.broadcast_to(wanted, (len(side), 4)), atol=1e-9)


def test_a_pen_that_is_jerked_turns_the_pressed_finger_no_faster_than_a_hand() -> None:
    stroke = draw(start(1, 0.0, 0.0, 4e-3), 1.0, 0.02, 0.0, 4e-3, lean=(0.8, 0.0))
    _, poses = follow(replace(stroke, held=False), CELLS, HEIGHT, Fingertip(), AT, 4000, PERIOD, 0.0)
    down = pressed(poses)
    turned = 2.0 * np.arccos(np.clip(np.abs((down[1:, 3:] * down[:-1, 3:]).sum(1)), 0.0, 1.0))
    assert 0.5 * TURN * PERIOD < turned.max() <= TURN * PERIOD * (1.0 + 1e-6)


def test_a_stroke_that_is_dropped_leaves_a_finger_that_does_not_lean() -> None:
    session, number = queue_stroke(started(), 0.0, 0.0, 4e-3, lean=(0.5, 0.0))
    before = session.pose[3:].copy()
    for step in range(1, 30):
        session = sculpting.advance(session, session.pose, step * TICK, 100)
    assert find_stroke(session, number) is not None
    assert abs(session.pose[3:] @ before) < 0.99
    np.testing.assert_array_equal(drop_strokes(session).pose[3:], before)
