"""Interface of the control methods: measurements of cells, their commands, and the controller."""

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Cells, Floats
from .layout import Disc, Discs

NONE: Floats = np.empty(0)
#: What a controller remembers from one period to the next; each method has a type of its own.
Memory: TypeAlias = Any


class Measurement(NamedTuple):
    """Measured quantities of cells."""

    quadratic_basis: Floats
    """(6, m): Rows 1, x, y, x², x y, y² of their positions, m."""
    height: Floats
    force: Floats
    """(m,): As measured, m and N."""
    target: Floats
    """(m,): Commanded heights, m."""
    mode: NDArray[np.int8]
    """(m,)."""
    own: Floats
    """(rows, m): The controller's state rows of each cell, updated in place. With several fingers of all
    active cells, which begin with these m."""
    cells: NDArray[np.intp]
    """(m,): Their numbers in the bed."""
    command: Floats = NONE
    """(m,): Valve commands of the previous period, 1."""
    sensed: Floats = NONE
    """(rows, m): The sensors' state rows of each cell."""
    present: tuple[int, ...] = ()
    """In a batch, how many of the cells, from the first on, take part in each run; empty: all."""
    discs: Discs | None = None
    """With several fingers, x, y and radius, m, (f,) each, of the discs of their active cells."""
    pressing: Floats | None = None
    """(f, m): With several fingers, the force of each, N; it only names new fingers, see `pin_division`."""


class Commands(NamedTuple):
    """Output of a controller, (m,) each: targets, m; modes; valve commands."""

    target: Floats
    mode: NDArray[np.int8]
    command: Floats

    @property
    def queued(self) -> tuple[Floats, ...]:
        """What is queued of it in a control period."""
        return (self.command,)

    def take(self, entries: Cells) -> "Commands":
        """Return some of them, by their numbers in a row."""
        return Commands(
            self.target.take(entries), self.mode.take(entries), self.command.take(entries)
        )


def count_losses(memory: Memory) -> int | None:
    """Return how often the fingertip was lost; None: the method does not count it."""
    return getattr(memory, "losses", None)


class Controller(Protocol):
    """Control method with its parameters; its memory is an argument and a result."""

    @property
    def rows(self) -> int:
        """State rows per cell."""

    def begin(self) -> Memory:
        """Return the memory before a session."""

    def locate(self, memory: Memory, touched: Measurement) -> tuple[Memory, Disc | None]:
        """Take the cells that the fingertip may touch; return memory and the disc x, y, radius to control."""

    def command(self, memory: Memory, seen: Measurement) -> tuple[Memory, Commands]:
        """Return memory and commands for the cells of the disc and all that still move."""


@dataclass(frozen=True)
class SetPoint:
    """Set point of the total force."""

    force: float
    """F_ref, N."""
    per_cell: bool = False
    """Whether it applies to each cell that follows the fingertip, and not to their sum."""

    def total(self, following: ArrayLike) -> Floats:
        """Return the set point of n following cells, N: F_ref, or per cell n F_ref, NaN at n = 0."""
        count = np.asarray(following, dtype=np.float64)
        if not self.per_cell:
            return np.full(count.shape, self.force)
        return np.where(count > 0.0, self.force * count, np.nan)


def find_set_point(set_point: SetPoint | None, following: ArrayLike) -> Floats:
    """Return the `SetPoint.total` of following cells, N; NaN for a method without a set point."""
    return np.full(np.shape(following), np.nan) if set_point is None else set_point.total(following)
