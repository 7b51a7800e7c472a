"""Interfaces of the parts between fingertip and pins, as protocols.

A place holds either the real part or a stand-in from `absent` that owns no state and
computes nothing. Parts hold parameters only: state is handed in and handed back.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from .delay import Queue

__all__ = [
    "Commands",
    "Controller",
    "Flow",
    "Lag",
    "Measurement",
    "Movement",
    "Pulp",
    "Segment",
    "Sensors",
    "Stepper",
    "Truth",
]

Floats = NDArray[np.float64]
#: Moves a block of cells on by one control period, in place. It takes the underside of the finger over the
#: first k cells at the period's instants, (p, k), m, and returns the force on them at the end, (k,), N. Of
#: the cells of b runs all arrays have one axis more, the last.
Movement = Callable[[Floats], Floats]


class Flow(Protocol):
    """Flow law of the valve, with or without a conduit, from opening and pressure drop."""

    @property
    def knee(self) -> float: ...

    def laminar_conductance(self, opening: Any, out: Floats | None = None) -> Any: ...

    def conductance(self, opening: Floats, drop: Floats) -> Floats: ...

    def flow(self, opening: Floats, drop: Floats) -> Floats: ...


class Lag(Protocol):
    """Response of the valve's opening to its command; `own` are its state rows, shape (rows, n)."""

    @property
    def rows(self) -> int: ...

    def opening(self, own: Floats, command: Floats) -> Floats:
        """Return the opening K, shape (n,).

        Parameters
        ----------
        own : ndarray (rows, n)
        command : ndarray (n,)
        """
        ...

    def rate(self, own: Floats, command: Floats) -> Floats:
        """Return the rates of change of `own`, 1/s.

        Parameters
        ----------
        own : ndarray (rows, n)
        command : ndarray (n,)
        """
        ...

    def response(self, queue: Queue, times: Sequence[float]) -> Floats: ...

    def settle(self, own: Floats) -> None: ...


class Pulp(Protocol):
    """Relaxation of the pulp; `own` are its state rows, shape (rows, k)."""

    @property
    def rows(self) -> int: ...

    def relaxed(self, own: Floats) -> Any: ...

    def rate(self, own: Floats, tension: Floats) -> Floats: ...

    def mean_loss_map(self, step: float) -> tuple[Floats, float]: ...

    def propagator(self, step: float) -> Floats: ...

    def age(self, own: Floats, time: Floats) -> None: ...


class Sensors(Protocol):
    """Measured forces and heights for the controller; `own` are their state rows."""

    @property
    def rows(self) -> int: ...

    def measure(self, own: Floats, truth: Truth) -> tuple[Floats, Floats]:
        """Return measured forces, N, and heights, m, shape (m,); `own`, (rows, m), stays as it is.

        Parameters
        ----------
        own : ndarray (rows, m)
        truth : Truth
        """
        ...

    def update(self, own: Floats, truth: Truth) -> None:
        """Bring `own` up to date, in place, with what there is at the end of a period.

        Parameters
        ----------
        own : ndarray (rows, m)
        truth : Truth
        """
        ...


class Truth(NamedTuple):
    """True quantities of some cells between two control periods.

    Attributes
    ----------
    cells : ndarray of int (m,)
    period : int
        Number of control periods done.
    force, height : ndarray (m,)
        N, m.
    command : ndarray (m,)
        Valve command of the period before.
    """

    cells: NDArray[np.intp]
    period: int
    force: Floats
    height: Floats
    command: Floats


class Stepper(Protocol):
    """Integration of a block of cells over one control period."""

    @property
    def name(self) -> str: ...

    @property
    def order(self) -> int: ...

    @property
    def nodes(self) -> tuple[float, ...]:
        """When, in shares of a physics step, the finger's pose is needed."""
        ...

    @property
    def bridges(self) -> bool:
        """Whether a step may hold the instant at which a lagging valve goes over to the next command."""
        ...

    def plan(self, cell: Any, queue: Queue, segments: tuple[Segment, ...]) -> Any:
        """Work out once what all periods share.

        Parameters
        ----------
        cell : physics.Cell
        queue : Queue
            Commands on their way to the valve.
        segments : tuple of Segment
            Physics steps of a period.
        """
        ...

    def prepare(self, plan: Any, rows: Floats, near: int) -> Movement:
        """Prepare to move a block of cells on, as often as its set of cells serves.

        Parameters
        ----------
        plan : object
            From `plan`; with the numbers of all runs for cells of many.
        rows : ndarray (r + q, n) or (r + q, n, b)
            State rows, see `physics.Cell`, then the commands of the queue, oldest first.
        near : int
            Number k of cells, the first, that the finger may touch.
        """
        ...


@dataclass(frozen=True)
class Segment:
    """One physics step of a control period.

    Attributes
    ----------
    start, length : float
        Time into the period, and length, s.
    nodes : tuple of int
        Which of the period's instants the stepper needs.
    """

    start: float
    length: float
    nodes: tuple[int, ...]


class Measurement(NamedTuple):
    """Measured quantities of some cells.

    Attributes
    ----------
    quadratic_basis : ndarray (6, m)
        Rows 1, x, y, x², x y, y² of where they are, m.
    height, force : ndarray (m,)
        As measured, m and N.
    target : ndarray (m,)
        Height they are commanded to, m.
    mode : ndarray (m,) of int8
    own : ndarray (rows, m)
        What the controller remembers of each cell; brought up to date in place.
    cells : ndarray of int (m,)
        Their numbers in the bed.
    """

    quadratic_basis: Floats
    height: Floats
    force: Floats
    target: Floats
    mode: NDArray[np.int8]
    own: Floats
    cells: NDArray[np.intp]


class Commands(NamedTuple):
    """Output of a controller, (m,) each: targets, m; modes; valve commands."""

    target: Floats
    mode: NDArray[np.int8]
    command: Floats


class Controller(Protocol):
    """Control method with its parameters; its memory is an argument and a result."""

    @property
    def name(self) -> str: ...

    @property
    def rows(self) -> int:
        """State rows a cell needs."""
        ...

    def begin(self) -> Any:
        """Return the memory before a session."""
        ...

    def locate(self, memory: Any, touched: Measurement) -> tuple[Any, tuple[float, float, float] | None]:
        """Take in the cells the finger may touch; return memory and the disc x, y, radius to control.

        Parameters
        ----------
        memory : object
            From `begin`, or the period before.
        touched : Measurement
            Of the cells the finger may touch.
        """
        ...

    def command(self, memory: Any, seen: Measurement) -> tuple[Any, Commands]:
        """Return memory and orders for the cells of the disc and all that still move.

        Parameters
        ----------
        memory : object
            From `locate`.
        seen : Measurement
            Of the cells to command.
        """
        ...
