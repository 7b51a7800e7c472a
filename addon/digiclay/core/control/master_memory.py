"""Memory of the virtual master of Method I."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from .travel import Heading

__all__ = ["Master", "Phase"]


class Phase(IntEnum):
    """Phase of the master."""

    IDLE = 0
    SPRING = 1
    SHAPING = 2


class Master(NamedTuple):
    """Memory of the controller.

    Attributes
    ----------
    phase : Phase
    x, y, height : float
        Where the master is, m.
    opening : float
        Of its own valve.
    reference : float
        Surface height at first touch, from which the virtual spring is pressed down, m.
    edge : float
        Height of the surface around the blister, m.
    heading : Heading
        Which way it travels.
    felt : float
        Its height when the finger was last felt, m.
    alone : int
        Control periods since the finger was last felt.
    losses : int
        How often the finger was lost while shaping.
    """

    phase: Phase = Phase.IDLE
    x: float = 0.0
    y: float = 0.0
    height: float = 0.0
    opening: float = 0.0
    reference: float = 0.0
    edge: float = 0.0
    heading: Heading = Heading()
    felt: float = 0.0
    alone: int = 0
    losses: int = 0

    # What changes every period is written out: `_replace` takes nearly twice as long.

    def move_to(self, x: float, y: float, heading: Heading) -> Master:
        """Return the master where it has felt the finger.

        Parameters
        ----------
        x, y : float
            m.
        heading : Heading
        """
        phase, _, _, height, opening, reference, edge, _, felt, _, losses = self
        return Master(phase, x, y, height, opening, reference, edge, heading, felt, 0, losses)

    def lead(self, phase: Phase, height: float, opening: float) -> Master:
        """Return the master after a period, with its valve's opening.

        Parameters
        ----------
        phase : Phase
        height : float
            m.
        opening : float
            Of its valve.
        """
        _, x, y, _, _, reference, edge, heading, felt, alone, losses = self
        felt = height if alone == 0 else felt
        return Master(phase, x, y, height, opening, reference, edge, heading, felt, alone, losses)

    def with_edge(self, edge: float) -> Master:
        """Return the master in a surface of this height."""
        phase, x, y, height, opening, reference, _, heading, felt, alone, losses = self
        return Master(phase, x, y, height, opening, reference, edge, heading, felt, alone, losses)
