"""Memory of Method III."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .finger_estimate import STATES, Estimate
from .master_memory import Master, Phase
from .travel import Heading


class Follower(NamedTuple):
    """Memory of the controller.

    Attributes
    ----------
    phase : Phase
        IDLE or SHAPING.
    period : int
        Control periods so far.
    estimate : Estimate
        The finger.
    top, edge : float
        Heights of the blister's top and of the surface around it, m.
    heading : Heading
        Which way the finger travels.
    trim : float
        Slow correction of the set point, N.
    felt : float
        Top when the finger was last felt, m.
    alone : int
        Control periods since then.
    losses : int
        How often the finger was lost.
    led_x, led_y, led_radius : float
        Disc within which pins may stand where they will not be left, m; a radius of 0: none does.
    due : tuple of float
        Total forces predicted for this and the next periods, N; below 0: none is.
    doubt : float
        Mean square by which those of the last periods were off, N².
    master : Master
        Memory of Method I while it takes over; IDLE: it does not.
    """

    phase: Phase = Phase.IDLE
    period: int = 0
    estimate: Estimate = Estimate(np.zeros(STATES), np.zeros((STATES, STATES)))
    top: float = 0.0
    edge: float = 0.0
    heading: Heading = Heading()
    trim: float = 0.0
    felt: float = 0.0
    alone: int = 0
    losses: int = 0
    led_x: float = 0.0
    led_y: float = 0.0
    led_radius: float = 0.0
    due: tuple[float, ...] = ()
    doubt: float = 0.0
    master: Master = Master()
