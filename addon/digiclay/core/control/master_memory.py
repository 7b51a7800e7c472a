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
        kept = self.height, self.opening, self.reference, self.edge
        return Master(self.phase, x, y, *kept, heading, self.felt, 0, self.losses)

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
        felt = height if self.alone == 0 else self.felt
        place, kept = (self.x, self.y), (self.reference, self.edge)
        return Master(phase, *place, height, opening, *kept, self.heading, felt, self.alone, self.losses)

    def with_edge(self, edge: float) -> Master:
        """Return the master in a surface of this height."""
        kept = self.phase, self.x, self.y, self.height, self.opening, self.reference
        return Master(*kept, edge, self.heading, self.felt, self.alone, self.losses)
