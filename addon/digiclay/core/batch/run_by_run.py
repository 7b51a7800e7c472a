"""Controllers of a batch as one controller, which is again a `Controller`.

Its memory is a list, one memory a run; instead of a disc it gives a list of discs, or None where no run
asks for one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ..control.runs import BatchControl
from ..model.control_interface import Commands, Controller, Measurement
from ..model.null_parts import Uncontrolled
from .broadcasting import merge_parts


@dataclass(frozen=True, eq=False)
class RunByRun:
    """Asks each run's own controller in turn: right for every method, and as slow as they are.

    What it asks about are the cells that take part in the run; the others get no orders.

    Attributes
    ----------
    controllers : tuple of Controller
    """

    controllers: tuple[Controller, ...]

    def locate(self, memory: list[Any], touched: Measurement) -> tuple[list[Any], list[Any]]:
        """Let each take in its cells."""
        found = [
            controller.locate(known, _take_run(touched, run))
            for run, (controller, known) in enumerate(zip(self.controllers, memory, strict=True))
        ]
        return [known for known, _ in found], [disc for _, disc in found]

    def command(self, memory: list[Any], seen: Measurement) -> tuple[list[Any], Commands]:
        """Let each give its orders."""
        given = [
            controller.command(known, _take_run(seen, run))
            for run, (controller, known) in enumerate(zip(self.controllers, memory, strict=True))
        ]
        targets, modes, commands = seen.target.copy(), seen.mode.copy(), np.zeros(seen.target.shape)
        for run, (_, orders) in enumerate(given):
            own = slice(orders.target.size)
            targets[own, run], modes[own, run], commands[own, run] = orders
        return [known for known, _ in given], Commands(targets, modes, commands)


def join_controllers(controllers: Sequence[Any], *, by_set: bool = False) -> Any:
    """Return one controller for all runs: the method's own where its formulas hold for many at once.

    `by_set`: see `System.by_set`.
    """
    first = controllers[0]
    if isinstance(first, BatchControl) and not by_set:
        merged = merge_parts(controllers)
        parts = {part.name: getattr(merged, part.name) for part in fields(merged)}
        return merged.batch_class(**parts | {"runs": tuple(controllers)})
    return first if isinstance(first, Uncontrolled) else RunByRun(tuple(controllers))


def _take_run(seen: Measurement, run: int) -> Measurement:
    """Return what is measured of one run."""
    own = slice(seen.present[run] if seen.present else None)
    rows: Any = seen[:-1]
    basis, *others = (one[..., own, run] for one in rows)
    return Measurement(np.ascontiguousarray(basis), *others)
