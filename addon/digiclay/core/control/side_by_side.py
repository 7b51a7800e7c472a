"""One controller for several fingers or runs: parts merged into arrays, or a controller called for each."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

from ..model.control_interface import Commands, Controller, Measurement
from ..model.null_parts import Uncontrolled
from .servo import BatchControl

Part = TypeVar("Part")


def merge_parts(parts: Sequence[Part]) -> Part:
    """Return a part that stands for those of all runs; the first one itself where all are alike.

    What is the same in all, of one `classify`, stays; a number that is not becomes an array (b,), an array
    gets a last axis, parts within the parts likewise. The rules of parameters are not checked again.
    """
    first: Any = parts[0]
    own = {field.name: merge_values([getattr(one, field.name) for one in parts]) for field in fields(first)}
    if all(value is getattr(first, name) for name, value in own.items()):
        return parts[0]
    part: Any = object.__new__(type(first))
    for name, value in own.items():
        object.__setattr__(part, name, value)
    stands_for_all: Part = part
    return stands_for_all


def merge_values(values: list[Any]) -> Any:
    """Return what stands for a value in all runs."""
    first = values[0]
    if isinstance(first, np.ndarray):
        alike = all(value is first or np.array_equal(value, first) for value in values)
        return first if alike else np.stack(values, axis=-1)
    if is_dataclass(first):
        return merge_parts(values)
    if isinstance(first, tuple):
        own = tuple(merge_values(list(several)) for several in zip(*values, strict=True))
        return first if all(map(operator.is_, own, first)) else own
    return first if all(value is first or value == first for value in values) else np.array(values)


@dataclass(frozen=True, eq=False)
class RunByRun:
    """Calls each run's controller separately; correct for any method, not vectorized.

    What it asks about are the cells that take part in the run; the others get no orders.
    """

    controllers: tuple[Controller, ...]

    def locate(self, memory: list[Any], touched: Measurement) -> tuple[list[Any], list[Any]]:
        """Let each take in its cells."""
        located = [
            controller.locate(own, _take_run(touched, run))
            for run, (controller, own) in enumerate(zip(self.controllers, memory, strict=True))
        ]
        return [own for own, _ in located], [disc for _, disc in located]

    def command(self, memory: list[Any], seen: Measurement) -> tuple[list[Any], Commands]:
        """Let each give its orders."""
        given = [
            controller.command(own, _take_run(seen, run))
            for run, (controller, own) in enumerate(zip(self.controllers, memory, strict=True))
        ]
        targets, modes, commands = seen.target.copy(), seen.mode.copy(), np.zeros(seen.target.shape)
        for run, (_, orders) in enumerate(given):
            own = slice(orders.target.size)
            targets[own, run], modes[own, run], commands[own, run] = orders
        return [own for own, _ in given], Commands(targets, modes, commands)


def join_controllers(controllers: Sequence[Any], *, by_set: bool = False) -> Any:
    """Return one controller for all runs: the method's own where its formulas hold for many at once."""
    first = controllers[0]
    if isinstance(first, BatchControl) and not by_set:
        merged = merge_parts(controllers)
        parts = {part.name: getattr(merged, part.name) for part in fields(merged)}
        return merged.find_batch_class(len(controllers))(**parts | {"runs": tuple(controllers)})
    return first if isinstance(first, Uncontrolled) else RunByRun(tuple(controllers))


def _take_run(seen: Measurement, run: int) -> Measurement:
    """Return what is measured of one run."""
    own = slice(seen.present[run] if seen.present else None)
    rows: Any = seen[:-3]
    basis, *others = (one[..., own, run] for one in rows)
    return Measurement(np.ascontiguousarray(basis), *others)
