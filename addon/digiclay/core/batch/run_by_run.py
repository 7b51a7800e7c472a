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
from .broadcasting import merge_parts

__all__ = ["RunByRun", "join_controllers"]


@dataclass(frozen=True, eq=False)
class RunByRun:
    """Asks each run's own controller in turn: right for every method, and as slow as they are.

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
        orders = zip(*(orders for _, orders in given), strict=True)
        return [known for known, _ in given], Commands(*(np.stack(rows, axis=-1) for rows in orders))


def join_controllers(controllers: Sequence[Any]) -> Any:
    """Return one controller for all runs: the method's own where its formulas hold for many at once."""
    if isinstance(controllers[0], BatchControl):
        merged = merge_parts(controllers)
        parts = {part.name: getattr(merged, part.name) for part in fields(merged)}
        return merged.batch_class(**parts | {"runs": tuple(controllers)})
    return RunByRun(tuple(controllers))


def _take_run(seen: Measurement, run: int) -> Measurement:
    """Return what is measured of one run."""
    rows: list[Any] = [one[..., run] for one in seen]
    rows[0] = np.ascontiguousarray(rows[0])
    return Measurement(*rows)
