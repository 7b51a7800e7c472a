"""Memory of the virtual master of Method I, and the loss of its fingertip."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

from .travel import Heading


class Phase(IntEnum):
    """Phase of the master."""

    IDLE = 0
    SPRING = 1
    SHAPING = 2


@dataclass(frozen=True)
class LossRule:
    """Rule by which a fingertip that is no longer felt is given up.

    Attributes
    ----------
    period : float
        Control period, s.
    time : float
        Time without force until a loss, s.
    """

    period: float
    time: float

    def is_given_up(self, alone: int) -> bool:
        """Tell whether a fingertip not felt for some control periods has been away for the loss time."""
        return alone * self.period >= self.time * (1.0 - 1e-9)

    def wait(self, memory: Any) -> Any:
        """Count a period without a fingertip in a `Master` or `Follower`; give it up after the loss time."""
        if memory.phase is Phase.IDLE:
            return memory
        if not self.is_given_up(memory.alone):
            return memory._replace(alone=memory.alone + 1)
        lost = memory.phase is Phase.SHAPING
        return memory._replace(phase=Phase.IDLE, losses=memory.losses + lost)


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
        """Return the master where it has felt the finger. `x`, `y`, m."""
        phase, _, _, height, opening, reference, edge, _, felt, _, losses = self
        return Master(phase, x, y, height, opening, reference, edge, heading, felt, 0, losses)

    def lead(self, phase: Phase, height: float, opening: float) -> Master:
        """Return the master after a period, with its valve's opening.

        `height`, m; `opening`: of its valve.
        """
        _, x, y, _, _, reference, edge, heading, felt, alone, losses = self
        felt = height if alone == 0 else felt
        return Master(phase, x, y, height, opening, reference, edge, heading, felt, alone, losses)

    def with_edge(self, edge: float) -> Master:
        """Return the master in a surface of this height."""
        phase, x, y, height, opening, reference, _, heading, felt, alone, losses = self
        return Master(phase, x, y, height, opening, reference, edge, heading, felt, alone, losses)
