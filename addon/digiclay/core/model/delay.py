"""Dead time between controller and valve, at its exact value (the t - t_d of equation 9)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..base.arrays import TINY
from ..base.quantity import Parameters, quantity


@dataclass(frozen=True, eq=False, repr=False)
class Delay(Parameters):
    """Dead time: a command acts `dead_time` after its issue."""

    dead_time: float = quantity(1e-3, "dead time", unit="s", symbol="t_d", at_least=0.0)


@dataclass(frozen=True, eq=False)
class Queue:
    """Queued commands, and the instant of the next one within a period.

    The queue holds the last `length` commands, oldest first, the newest pushed at the
    start of the period. Until `cut` the valve sees the oldest; after it, the next.
    """

    length: int = 1
    """Number of commands, at least 1."""
    cut: float = 0.0
    """Time into the period at which the valve changes to the next command, s; 0 when the dead time is a whole
    number of periods, and the valve sees the oldest in all of the period; below 0: the next in all."""

    def seen(self, time: float) -> int:
        """Return the index of the command that the valve sees at a time into the period, s."""
        return 1 if self.cut != 0.0 and time >= self.cut * (1.0 - 1e-12) else 0

    def start_at(self, time: float) -> Queue:
        """Return the queue of the part of a period from a time on, s."""
        if self.cut == 0.0:
            return self
        return replace(self, cut=self.cut - time if time < self.cut * (1.0 - 1e-12) else -TINY)


def split_delay(delay: Delay, period: float) -> Queue:
    """Split a dead time into whole control periods and the cut inside one. `period`: control period, s."""
    whole = int(delay.dead_time / period + 1e-9)
    cut = delay.dead_time - whole * period
    if cut < 1e-9 * period:
        return Queue(whole + 1)
    return Queue(whole + 2, cut)
