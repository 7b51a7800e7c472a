"""Force observer: force on a pin from only its height and its commands."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..base.arrays import Floats, apply_map
from .control_interface import Measurement
from .delay import Queue
from .interfaces import Sensors
from .physics import Cell

#: Root mean square opening in a control period below which a valve counts as shut: its flow is so
#: small under any load that the motion does not tell the force.
SHUT = 0.05
#: Nodes of the averages over each stretch of a held command: the opening decays exponentially in
#: it.
NODES = 6
#: Rounds in which the conductance converges; one is enough for laminar flow. For turbulent flow
#: each round halves the logarithm of the error, and the force of the last period is a good start.
ROUNDS = 6


@dataclass(frozen=True, eq=False)
class ValveObserver(Sensors):
    """Force observer from the law of the valve.

    In a control period a pin moves by ``A ΔH = ∫ α(K) (P_s(K) - F/A) dt``, where α is the
    conductance of valve and conduit. The opening K is known from the commands, so
    ``F = A (<α P_s> - A ΔH/T) / <α>``: the mean force of the period, weighted with α. It is
    not below 0, since a fingertip cannot pull. Where the valve is shut, or the pin is at an end
    stop, the motion does not tell the force, and the last estimate is held.
    """

    inner: Sensors
    """Without state; only its heights are used."""
    cell: Cell
    period: float
    """Control period, s."""
    length: int
    """Queued commands."""
    response: Floats
    """(nodes + 1, s): Map from the lag's rows and the commands to the opening at the nodes of a period and at
    its end."""
    weights: Floats
    """(nodes,): Of the nodes; their sum is 1."""
    doubt: float = 0.0
    """Error of the difference of two heights, m; estimates below the force that it corresponds to are 0."""

    @property
    def rows(self) -> int:
        """State rows: estimate, last period + 1 (0: none), height then, opening, queued commands."""
        return 3 + self.cell.lag.rows + self.length

    def measure(self, seen: Measurement, period: int) -> tuple[Floats, Floats]:
        """Return the estimated forces, and the heights as the inner sensors read them."""
        return seen.sensed[0], self.inner.measure(seen, period)[1]

    def note(self, seen: Measurement, period: int) -> None:
        """Compute the opening in the period, and estimate the force where the valve was open."""
        rows = seen.sensed
        # The previous reading, repeated: an idle cell has not changed since.
        former = np.where(rows[1] > 0.0, rows[2], self.cell.actuator.rest_height)
        _, before = self.inner.measure(seen._replace(height=former), period - 1)
        _, after = self.inner.measure(seen, period)
        commands, lag = rows[3 + self.cell.lag.rows :], rows[3 : 3 + self.cell.lag.rows]
        commands[:-1] = commands[1:]
        commands[-1] = seen.command
        opening = apply_map(self.response, rows[3:])
        rows[0] = self._estimate(opening[:-1], before, after, rows[0])
        if lag.shape[0]:
            lag[:] = opening[-1]
            self.cell.lag.settle(lag)
        rows[1], rows[2] = period + 1, seen.height

    def _estimate(self, opening: Floats, before: Floats, after: Floats, last: Floats) -> Floats:
        """Return the forces, N, from openings (nodes, m[, b]) and the heights before and after, m."""
        actuator = self.cell.actuator
        moving = self._average(opening**2) > (SHUT**2 if self.cell.supply.locks else -1.0)
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
        return apply_map(self.weights[None], values)[0]


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
