"""Force observer: force on a pin from its height and its commands alone."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..base.arrays import Floats, apply_map
from .control_interface import Measurement
from .delay import Queue
from .interfaces import Sensors
from .physics import Cell

#: Root mean square opening in a control period below which a valve counts as shut: through it
#: next to nothing flows, whatever the load, so the motion says nothing of the force.
SHUT = 0.05
#: Nodes of the averages over each stretch of a held command: the opening decays exponentially in it.
NODES = 6
#: Rounds by which the conductance is settled; where the flow is laminar one would do. In the
#: turbulent branch each round halves the logarithm of the error, and the last period's force is near.
ROUNDS = 6


@dataclass(frozen=True, eq=False)
class ValveObserver(Sensors):
    """Force observer from the law of the valve.

    In a control period a pin moves by ``A ΔH = ∫ α(K) (P_s(K) - F/A) dt``, where α is the
    conductance of valve and conduit. The opening K is known from the commands, so
    ``F = A (<α P_s> - A ΔH/T) / <α>``: the mean force of the period, weighted with α. It is
    not below 0, for a fingertip cannot pull. Where the valve is shut, or the pin is at an end
    stop, the motion says nothing, and the last estimate is held.
    """

    inner: Sensors
    """Without state; its heights are used, its forces are not."""
    cell: Cell
    period: float
    """Control period, s."""
    length: int
    """Commands on their way to the valve."""
    response: Floats
    """(nodes + 1, s): Opening at the nodes of a period, then at its end, from the lag's rows and the
    commands."""
    weights: Floats
    """(nodes,): Of the nodes; their sum is 1."""
    doubt: float = 0.0
    """How far the difference of two heights may be off, m: an estimate that is no larger than what this comes
    to is none."""

    @property
    def rows(self) -> int:
        """State rows: estimate, periods known (0: none), the height then, opening, commands on their way."""
        return 3 + self.cell.lag.rows + self.length

    def measure(self, seen: Measurement, period: int) -> tuple[Floats, Floats]:
        """Return the estimated forces, and the heights as the inner sensors read them."""
        return seen.sensed[0], self.inner.measure(seen, period)[1]

    def note(self, seen: Measurement, period: int) -> None:
        """Follow the valve through the period, and estimate the force where it was open."""
        own = seen.sensed
        # The reading before this one, made again: the cell has not changed while it took no part.
        former = np.where(own[1] > 0.0, own[2], self.cell.actuator.rest_height)
        _, before = self.inner.measure(seen._replace(height=former), period - 1)
        _, after = self.inner.measure(seen, period)
        commands, lag = own[3 + self.cell.lag.rows :], own[3 : 3 + self.cell.lag.rows]
        commands[:-1] = commands[1:]
        commands[-1] = seen.command
        opening = apply_map(self.response, own[3:])
        own[0] = self._estimate(opening[:-1], before, after, own[0])
        if lag.shape[0]:
            lag[:] = opening[-1]
            self.cell.lag.settle(lag)
        own[1], own[2] = period + 1, seen.height

    def _estimate(self, opening: Floats, before: Floats, after: Floats, last: Floats) -> Floats:
        """Return the forces, N, from openings (nodes, m[, b]) and the heights before and after, m."""
        actuator = self.cell.actuator
        moving = self._average(opening**2) > SHUT**2
        moving &= (after > 0.0) & (after < actuator.stroke)
        flow = actuator.area * (after - before) / self.period
        pressure, force = self.cell.supply.pressure(opening), last
        for _ in range(ROUNDS):
            conductance = self.cell.flow.conductance(opening, pressure - force / actuator.area)
            open_for = np.where(moving, self._average(conductance), 1.0)
            estimate = actuator.area * (self._average(conductance * pressure) - flow) / open_for
            least = actuator.area**2 * self.doubt / self.period / open_for
            force = np.where(moving, np.where(estimate > least, estimate, 0.0), last)
        return force

    def _average(self, values: Floats) -> Floats:
        """Return the mean over a period of values at the nodes."""
        mean: Floats = apply_map(self.weights[None], values)[0]
        return mean


def make_valve_observer(
    inner: Sensors, cell: Cell, line: Queue, period: float, doubt: float = 0.0
) -> ValveObserver:
    """Make an observer for cells whose commands go through `line`; `period`, s; `doubt`, m."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)  # type: ignore[no-untyped-call]
    edges = (0.0, line.cut, period) if line.cut else (0.0, period)
    times: list[float] = []
    shares: list[float] = []
    for start, end in pairwise(edges):
        times += (start + (end - start) * 0.5 * (1.0 + nodes)).tolist()
        shares += ((end - start) / period * 0.5 * weights).tolist()
    response = cell.lag.response(line, [*times, period])
    return ValveObserver(inner, cell, period, line.length, response, np.array(shares), doubt)
