"""Controllers of a batch, and the adapter of controllers for single runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..model.interfaces import Controller, Measurement, Orders
from .beds import Disc
from .broadcasting import numbers

__all__ = ["RunByRun", "StackedController"]


class StackedController(Protocol):
    """A method for b runs at once: `interfaces.Controller` with one axis more, the last, for the runs."""

    def begin(self) -> Any:
        """Return the memory of all runs before the sessions."""
        ...

    def attend(self, memory: Any, touched: Measurement) -> tuple[Any, Disc]:
        """Take in the cells the fingers may touch; return memory and the discs to control."""
        ...

    def command(self, memory: Any, seen: Measurement) -> tuple[Any, Orders]:
        """Return memory and orders for the cells of the discs and all that still move."""
        ...

    def kept(self, memory: Any, runs: NDArray[np.intp]) -> Any:
        """Return the memory of some of the runs."""
        ...

    def of(self, memory: Any, run: int) -> Any:
        """Return the memory of one run as its own controller would have it."""
        ...


@dataclass(frozen=True, eq=False)
class RunByRun:
    """Asks each run's own controller in turn: right for every method, and as slow as they are.

    Attributes
    ----------
    controllers : tuple of Controller
    """

    controllers: tuple[Controller, ...]

    def begin(self) -> list[Any]:
        """Return the memories before the sessions."""
        return [controller.begin() for controller in self.controllers]

    def attend(self, memory: list[Any], touched: Measurement) -> tuple[list[Any], Disc]:
        """Let each take in its cells; see `StackedController`."""
        after, discs = [], []
        for run, (controller, known) in enumerate(zip(self.controllers, memory, strict=True)):
            own, disc = controller.attend(known, _of(touched, run))
            after.append(own)
            discs.append(disc or (0.0, 0.0, -1.0))
        x, y, radius = (numbers(values) for values in zip(*discs, strict=True))
        return after, (x, y, radius)

    def command(self, memory: list[Any], seen: Measurement) -> tuple[list[Any], Orders]:
        """Let each give its orders; see `StackedController`."""
        after, orders = [], []
        for run, (controller, known) in enumerate(zip(self.controllers, memory, strict=True)):
            own, given = controller.command(known, _of(seen, run))
            after.append(own)
            orders.append((given.target, given.mode, given.command))
        target, mode, command = (np.stack(values, axis=-1) for values in zip(*orders, strict=True))
        return after, Orders(target, mode, command)

    def kept(self, memory: list[Any], runs: NDArray[np.intp]) -> list[Any]:
        """Return the memory of some of the runs."""
        return [memory[run] for run in runs.tolist()]

    def of(self, memory: list[Any], run: int) -> Any:
        """Return the memory of one run."""
        return memory[run]


def _of(seen: Measurement, run: int) -> Measurement:
    """Return what is measured of one run."""
    return Measurement(
        np.ascontiguousarray(seen.place[..., run]),
        seen.height[:, run],
        seen.force[:, run],
        seen.target[:, run],
        seen.mode[:, run],
        seen.own[..., run],
    )
