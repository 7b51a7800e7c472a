"""Interfaces of the parts between fingertip and pins, as protocols.

An interface is implemented by the part and by a null part from `null_parts`, which has no state rows and
computes nothing. Parts hold parameters only: state is an argument and a result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from ..base.arrays import Floats
from .control_interface import Measurement
from .delay import Queue

#: Moves a block of cells on by one control period, in place. It takes the underside of the fingertip over the
#: first k cells at the period's instants, (p, k), m, and returns the force on them at the end, (k,), N. Of
#: the cells of b runs all arrays have one axis more, the last.
Movement = Callable[[Floats], Floats]


class Flow(Protocol):
    """Flow law of the valve, with or without a conduit, from opening and pressure drop."""

    @property
    def knee(self) -> float: ...

    def laminar_conductance(self, opening: Any, out: Floats | None = None) -> Any:
        """Return flow over drop in laminar flow, m3/s/Pa, of openings K, in the array `out` if given."""

    def conductance(self, opening: Floats, drop: Floats) -> Floats:
        """Return flow over drop, m3/s/Pa. `opening`: valve opening K; `drop`: pressure drop, Pa."""

    def flow(self, opening: Floats, drop: Floats) -> Floats:
        """Return the flow into the cylinder with the sign of `drop`, m3/s, of openings K under drops, Pa."""
        return self.conductance(opening, drop) * drop


class Lag(Protocol):
    """Response of the valve's opening to its command; `own` are its state rows, shape (rows, n)."""

    @property
    def rows(self) -> int: ...

    def opening(self, own: Floats, command: Floats) -> Floats:
        """Return the opening K, shape (n,). `own` (rows, n); `command` (n,)."""

    def rate(self, own: Floats, command: Floats) -> Floats:
        """Return the rates of change of `own`, 1/s. `own` (rows, n); `command` (n,)."""

    def response(self, queue: Queue, times: Sequence[float]) -> Floats:
        """Return the linear map from own rows and queued commands to the openings at times of a period, s."""

    def settle(self, own: Floats) -> None: ...


class Pulp(Protocol):
    """Relaxation of the pulp; `own` are its state rows, shape (rows, k)."""

    @property
    def rates(self) -> Floats:
        """Rates of the filters, shape (rows, 1), 1/s."""

    @property
    def shares(self) -> Floats:
        """Shares of the force that the filters take in the end, shape (rows,)."""

    @property
    def rows(self) -> int: ...

    def relaxed(self, own: Floats) -> Any: ...

    def rate(self, own: Floats, tension: Floats) -> Floats:
        """Return the rates of change of `own`, N/s. `own` (rows, k); `tension` (k,), elastic force, N."""

    def mean_loss_map(self, step: float) -> tuple[Floats, float]: ...

    def propagator(self, step: float) -> Floats: ...

    def age(self, own: Floats, time: Floats) -> None:
        """Let `own` decay without tension, in place. `own` (rows, k); `time` (k,), s."""


class Sensors(Protocol):
    """Measured forces and heights for the controller, of cells as they are after so many control periods."""

    @property
    def rows(self) -> int: ...

    def measure(self, seen: Measurement, period: int) -> tuple[Floats, Floats]:
        """Return measured forces, N, and heights, m, shape (m,); `seen.sensed` stays as it is."""

    def read(self, seen: Measurement, period: int) -> Measurement:
        """Return cells with measured forces and heights."""
        force, height = self.measure(seen, period)
        return seen._replace(force=force, height=height)

    def note(self, seen: Measurement, period: int) -> None:
        """Bring `seen.sensed` up to date, in place, at the end of a period."""


class Stepper(Protocol):
    """Integration of a block of cells over one control period."""

    @property
    def name(self) -> str: ...

    @property
    def order(self) -> int: ...

    @property
    def nodes(self) -> tuple[float, ...]:
        """When, in shares of a physics step, the fingertip's pose is needed."""

    @property
    def bridges(self) -> bool:
        """Whether a step may hold the instant at which a lagging valve goes over to the next command."""

    def plan(self, cell: Any, queue: Queue, segments: tuple[Segment, ...]) -> Any:
        """Compute once what all periods share, for a `physics.Cell` and the physics steps of a period."""

    def prepare(self, plan: Any, rows: Floats, near: int) -> Movement:
        """Prepare to move cells, of which the fingertip may touch the first k, as often as their set serves.

        Rows (r + q, n[, b]) are those of `physics.Cell`, then the commands of the queue, oldest first.
        """


class Alike:
    """Part without parameters: all of one class are equal."""

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other)

    def __hash__(self) -> int:
        return hash(type(self))


@dataclass(frozen=True, eq=False)
class Segment:
    """One physics step of a control period."""

    start: float
    length: float
    """Time into the period, and length, s."""
    nodes: tuple[int, ...]
    """Which of the period's instants the stepper needs."""
