"""Orientation of a fingertip that leans with a pen, and of its mirror images. No Blender in here."""

from __future__ import annotations

import math

import numpy as np

from ..core.base.arrays import Floats
from .stroke import Mirror, Stroke

#: How fast the finger turns while it touches, rad/s: as fast as a hand turns a pen, so that tilt read in
#: coarse steps does not jerk it.
TURN = 3.0


def lean_finger(turn: Floats, lean: tuple[float, float]) -> Floats:
    """Return the orientation of a finger that leans over from another orientation.

    `turn` (4,), unit quaternion w, x, y, z of the finger that does not lean; `lean` (float, float), how far
    its top leans towards x and towards y of the bed, rad: the angle is the length.
    """
    angle = math.hypot(*lean)
    if angle == 0.0:
        return turn
    # The axis is level, and square to the direction in which the top goes.
    share = math.sin(0.5 * angle) / angle
    return _multiply(np.array([math.cos(0.5 * angle), -lean[1] * share, lean[0] * share, 0.0]), turn)


def mirror_turn(turn: Floats, mirror: Mirror) -> Floats:
    """Return the orientation of an ellipsoid's mirror image.

    `turn` (4,), unit quaternion w, x, y, z; `mirror` (float, float), factors of x and y, 1 or -1.
    """
    along, across = mirror
    # M R M for M = diag(along, across, 1): the axis of a rotation is mirrored the other way round.
    return np.asarray(turn * [1.0, across, along, along * across])


def turn_toward(turn: Floats, aim: Floats, angle: float) -> Floats:
    """Return an orientation turned towards another, by an angle at most.

    `turn`, `aim` (4,), unit quaternions w, x, y, z; `angle`, rad.
    """
    dot = float(turn @ aim)
    # The two quaternions of an orientation are opposite: the nearer one is meant.
    aim = aim if dot >= 0.0 else -aim
    far = 2.0 * math.atan2(float(np.linalg.norm(aim - abs(dot) * turn)), abs(dot))
    if far <= angle:
        return aim
    part, half = angle / far, 0.5 * far
    between: Floats = (math.sin((1.0 - part) * half) * turn + math.sin(part * half) * aim) / math.sin(half)
    return between / np.linalg.norm(between)


def advance_turn(stroke: Stroke, turn: Floats, clear: bool, period: float) -> Floats:
    """Return the finger's orientation after a control period on a stroke, (4,).

    `stroke`: begun; a finished one leaves the finger as it was before; `turn` (4,), the finger's before;
    `clear`: whether it is above all pins, where it turns at once; `period`, s.
    """
    assert stroke.turn is not None
    if stroke.done:
        return stroke.turn
    leaning = lean_finger(stroke.turn, stroke.samples[stroke.reached].lean)
    aim = mirror_turn(leaning, stroke.mirrors[stroke.image])
    return aim if clear else turn_toward(turn, aim, TURN * period)


def _multiply(first: Floats, second: Floats) -> Floats:
    """Return the rotation of a second quaternion followed by a first one."""
    a, u, b, v = first[0], first[1:], second[0], second[1:]
    return np.concatenate([[a * b - u @ v], a * v + b * u + np.cross(u, v)])
