"""Orientation of the fingertip along a press stroke, as quaternions w, x, y, z. No Blender."""

import math

import numpy as np

from ..core.base.arrays import TIE, Floats
from .stroke import Image, Place


def lean_finger(turn: Floats, lean: Place) -> Floats:
    """Return an orientation (4,) that leans from `turn` (4,) towards x and y of the bed, rad."""
    angle = math.hypot(*lean)
    if angle == 0.0:
        return turn
    # The axis is level, and square to the direction in which the top goes.
    share = math.sin(0.5 * angle) / angle
    return _multiply(
        np.array([math.cos(0.5 * angle), -lean[1] * share, lean[0] * share, 0.0]), turn
    )


def turn_image(turn: Floats, image: Image) -> Floats:
    """Return the orientation (4,) of an ellipsoid's image, the one of two that is nearer to its own."""
    if image == Image():
        return turn
    if image.mirrors:
        # M R M for M = diag(1, -1, 1): the axis of a rotation is mirrored the other way round.
        turn = turn * [1.0, -1.0, 1.0, -1.0]
    half = 0.5 * math.atan2(image.yx, image.xx)
    turned = _multiply(np.array([math.cos(half), 0.0, 0.0, math.sin(half)]), turn)
    # A half turn about its own axis leaves an ellipsoid as it is.
    other = _multiply(turned, np.array([0.0, 0.0, 0.0, 1.0]))
    return turned if abs(float(turned @ turn)) >= abs(float(other @ turn)) - TIE else other


def turn_toward(turn: Floats, aim: Floats, angle: float) -> Floats:
    """Return an orientation (4,) turned towards another, by an angle, rad, at most."""
    dot = float(turn @ aim)
    # The two quaternions of an orientation are opposite: the nearer one is meant.
    aim = aim if dot >= 0.0 else -aim
    far = 2.0 * math.atan2(float(np.linalg.norm(aim - abs(dot) * turn)), abs(dot))
    if far <= angle:
        return aim
    part, half = angle / far, 0.5 * far
    between: Floats = (
        math.sin((1.0 - part) * half) * turn + math.sin(part * half) * aim
    ) / math.sin(half)
    return between / np.linalg.norm(between)


def _multiply(first: Floats, second: Floats) -> Floats:
    """Return the rotation of a second quaternion followed by a first one."""
    a, b, c, d = first.tolist()
    w, x, y, z = second.tolist()
    return np.array(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y + c * w + d * x - b * z,
            a * z + d * w + b * y - c * x,
        ]
    )
