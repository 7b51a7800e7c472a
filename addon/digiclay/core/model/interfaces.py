"""Interfaces of the parts between fingertip and pins, as protocols.

A part implements its interface, and so does a null part from `null_parts`, which has no state rows
and computes nothing. Parts hold only parameters: state is an argument and a result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from ..base.arrays import Floats
from .actuator import Supply
from .control_interface import Commands, Measurement
from .delay import Queue

#: Moves a block of cells by one control period, in place. It takes the underside of the fingertip
#: over the first k cells at the period's instants, (p, k), m, and returns the force on them at the
#: end, (k,), N. For b runs all arrays have another axis, the last.
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

    def source(self, supply: Supply) -> Supply:
        """Return the pressures that drive the flow: those of the reservoirs, unless it has its own."""
        return supply


class Lag(Protocol):
    """Response of the valve's opening to its command; `rows` are its state rows, (r, n)."""

    @property
    def rows(self) -> int: ...

    def opening(self, rows: Floats, command: Floats) -> Floats:
        """Return the opening K (n,) for a command (n,)."""

    def rate(self, rows: Floats, command: Floats) -> Floats:
        """Return the rates of change of the rows, 1/s, for a command (n,)."""

    def response(self, queue: Queue, times: Sequence[float]) -> Floats:
        """Return the linear map from its rows and queued commands to the openings at times of a period, s."""

    def settle(self, rows: Floats) -> None: ...

    def list_cuts(self, queue: Queue) -> tuple[float, ...]:
        """Return when the valve changes to the next command in a period, s."""
        return (queue.cut,)

    def join(self, raw: Floats, steps: Floats) -> Floats:
        """Return the openings in steps, s, from the product of `response` with the rows."""
        return raw[: len(steps)]


class Pulp(Protocol):
    """Relaxation of the pulp; `filters` are its state rows, (rows, k)."""

    @property
    def rates(self) -> Floats:
        """Rates of the filters, shape (rows, 1), 1/s."""

    @property
    def shares(self) -> Floats:
        """Shares of the force that the filters finally take, shape (rows,)."""

    @property
    def rows(self) -> int: ...

    def relaxed(self, filters: Floats) -> Any: ...

    def rate(self, filters: Floats, tension: Floats) -> Floats:
        """Return the rates of change of the filters, N/s; `tension` (k,): elastic force, N."""

    def mean_loss_map(self, step: float) -> tuple[Floats, float]: ...

    def propagator(self, step: float) -> Floats: ...

    def age(self, filters: Floats, time: Floats) -> None:
        """Let the filters decay without tension for times (k,), s, in place."""


class Sensors(Protocol):
    """Measured forces and heights for the controller; `period`: control periods so far."""

    @property
    def rows(self) -> int: ...

    def measure(self, seen: Measurement, period: int) -> tuple[Floats, Floats]:
        """Return measured forces, N, and heights, m, (m,); does not change `seen.sensed`."""

    def read(self, seen: Measurement, period: int) -> Measurement:
        """Return the cells with measured forces and heights."""
        force, height = self.measure(seen, period)
        return seen._replace(force=force, height=height)

    def note(self, seen: Measurement, period: int) -> None:
        """Update `seen.sensed`, in place, at the end of a period."""


class Drive(Protocol):
    """Valves between a controller's commands and the cells; its state is an argument and a result."""

    @property
    def sets(self) -> list[str | int]:
        """Axis of its lines, and number of their sets: a stored state of others begins anew."""

    def begin(self) -> Any:
        """Return the state before a session."""

    def serve(
        self, state: Any, period: int, seen: Measurement, orders: Commands
    ) -> tuple[Any, Commands]:
        """Return the state and the commands that act in a control period."""


class Stepper(Protocol):
    """Integration of a block of cells over one control period."""

    @property
    def name(self) -> str: ...

    @property
    def order(self) -> int: ...

    @property
    def nodes(self) -> tuple[float, ...]:
        """Instants, in shares of a physics step, at which the fingertip's pose is needed."""

    @property
    def bridges(self) -> bool:
        """Whether a step may contain the instant at which a lagging valve changes to the next command."""

    def plan(self, cell: Any, queue: Queue, segments: tuple[Segment, ...]) -> Any:
        """Compute once what all periods share, for a `physics.Cell` and the physics steps of a period."""

    def prepare(self, plan: Any, rows: Floats, near: int) -> Movement:
        """Return the movement of cells, of which the fingertip may touch the first `near`.

        Rows (r + q, n[, b]) are those of `physics.Cell`, then the commands of the queue, oldest
        first.
        """


@dataclass(frozen=True)
class Alike:
    """Part without parameters: all of a class are equal."""


@dataclass(frozen=True, eq=False)
class Segment:
    """One physics step of a control period."""

    start: float
    length: float
    """Time into the period, and length, s."""
    nodes: tuple[int, ...]
    """Indices of the period's instants that the stepper needs."""
