"""Hand between a finger's intended path and its fingertip, which gives way to the force of the pins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..base.arrays import Floats
from ..base.quantity import Parameters, quantity

#: Deflections, m, and speeds, m/s, below which a hand is at rest; speed of an intended path, m/s,
#: above which it is not a hand that moves, but one that begins elsewhere, at rest.
AT_REST, JUMP = 1e-15, 10.0


@dataclass(frozen=True, eq=False, repr=False)
class Hand(Parameters):
    """``M d²x/dt² + D (dx/dt - dy/dt) + K (x - y) = F``: x height of the fingertip, y intended, F force.

    It gives way vertically: pins push up, and nothing in the model pushes a fingertip aside.
    """

    mass: float = quantity(
        5e-3,
        "effective mass of the hand at the fingertip",
        unit="kg",
        symbol="M",
        source="C, Hajian 1997",
        above=0.0,
        at_most=10.0,
    )
    damping: float = quantity(
        3.0,
        "damping of the hand",
        unit="N s/m",
        symbol="D",
        source="C, Hajian 1997",
        at_least=0.0,
        at_most=1e4,
    )
    stiffness: float = quantity(
        300.0,
        "stiffness of the hand",
        unit="N/m",
        symbol="K",
        source="C, Hajian 1997",
        at_least=1.0,
        at_most=1e6,
    )


class Deflection(NamedTuple):
    """How far hands have given way, (c,): one of each finger, or of each run of a batch."""

    rise: Floats
    """Height of the fingertip above its intended one, m."""
    speed: Floats
    """Vertical speed of the fingertip, m/s."""
    climbed: Floats
    gained: Floats
    """Changes of the fingertip's height, m, and speed, m/s, in the last step."""
    force: Floats
    """Force on the fingertip, N."""


class Swing(NamedTuple):
    """Constants of a step of hands by BDF2: of second order, and stable at any mass and stiffness."""

    time: Floats
    """s; this and the following are (c,)."""
    memory: Floats
    """Share of the changes in the last step that goes on."""
    lasting: Floats
    """Time t for which the rates at the end count, s."""
    mass: Floats
    damping: Floats
    pull: Floats
    """``M``, ``D t`` and ``K t`` over ``M + D t + K t²``."""
    push: Floats
    """t over the same, s/kg; 0 of a path that is prescribed."""

    def rest(self) -> Deflection:
        """Return the deflection at rest, without force."""
        return Deflection(*np.zeros((5, self.time.size)))

    def move(self, before: Deflection, path: Floats, force: Floats) -> tuple[Deflection, Floats]:
        """Return the deflection after the step, and rises at the instants of the `path` (p, c), m.

        `path`: intended heights at evenly spaced instants, m; `force` (c,): at the end, N.
        """
        # Slope of the intended path at its end, per step: of the parabola through three instants.
        part = 1.0 / (len(path) - 1)
        chord, last = path[-1] - path[0], path[-1] - path[-2]
        slope = chord if part == 1.0 else (last / part - part * chord) / (1.0 - part)
        # BDF2: a share of the changes in the last step goes on; the rest follows from the rates at the end.
        going = self.memory * before.climbed
        speed = self.mass * (before.speed + self.memory * before.gained)
        speed += self.damping * slope / self.time
        speed += self.pull * (chord - before.rise - going) + self.push * force
        climbed = going + self.lasting * speed
        gained, rise = speed - before.speed, before.rise + climbed - chord
        after = Deflection(rise, speed, climbed, gained, force)
        still = (np.abs(after) < AT_REST) | (np.abs(chord) > JUMP * self.time)
        after = Deflection(*np.where(still, 0.0, after))
        # Between both ends the heights are parabolas: the fingertip's, less the intended one.
        bend = np.where(self.push > 0.0, 0.5 * self.time * gained - (slope - chord), 0.0)
        at = np.linspace(0.0, 1.0, len(path))[:, None]
        return after, before.rise + at * (after.rise - before.rise) + at * (at - 1.0) * bend


def make_swing(hands: Sequence[Hand | None], time: float, last: float) -> Swing:
    """Return the constants of a step of a time after another, s, of some fingers; None: path prescribed."""
    ratio = time / last
    lasting = time * (1.0 + ratio) / (1.0 + 2.0 * ratio)
    memory = ratio**2 / (1.0 + 2.0 * ratio)

    def list_constants(hand: Hand | None) -> list[float]:
        if hand is None:
            return [time, memory, lasting, 0.0, 0.0, 1.0 / lasting, 0.0]
        whole = hand.mass + lasting * (hand.damping + hand.stiffness * lasting)
        terms = hand.mass, hand.damping * lasting, hand.stiffness * lasting, lasting
        return [time, memory, lasting, *(term / whole for term in terms)]

    return Swing(*np.array([list_constants(hand) for hand in hands]).T)
