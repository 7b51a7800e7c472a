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
    """Return one part for all runs; the first one itself if all are equal.

    The parts must be equal by `classify`. A number that differs becomes an array (b,), an array
    gets a last axis, and inner parts are merged likewise. The rules of parameters are not checked
    again.
    """
    first: Any = parts[0]
    names = [field.name for field in fields(first)]
    values = {name: merge_values([getattr(part, name) for part in parts]) for name in names}
    if all(value is getattr(first, name) for name, value in values.items()):
        return parts[0]
    merged: Part = object.__new__(type(first))
    for name, value in values.items():
        object.__setattr__(merged, name, value)
    return merged


def merge_values(values: list[Any]) -> Any:
    """Return one value for all runs; see `merge_parts`."""
    first = values[0]
    if isinstance(first, np.ndarray):
        alike = all(value is first or np.array_equal(value, first) for value in values)
        return first if alike else np.stack(values, axis=-1)
    if is_dataclass(first):
        return merge_parts(values)
    if isinstance(first, tuple):
        merged = tuple(merge_values(list(items)) for items in zip(*values, strict=True))
        return first if all(map(operator.is_, merged, first)) else merged
    return first if all(value is first or value == first for value in values) else np.array(values)


@dataclass(frozen=True, eq=False)
class RunByRun:
    """Calls the controller of each run separately: correct for any method, but not vectorized.

    A controller sees only the cells that are active in its run; the others get no orders.
    """

    controllers: tuple[Controller, ...]

    def locate(self, memory: list[Any], touched: Measurement) -> tuple[list[Any], list[Any]]:
        """Let each controller locate its fingertip."""
        located = [
            controller.locate(memory[run], _take_run(touched, run))
            for run, controller in enumerate(self.controllers)
        ]
        return [after for after, _ in located], [disc for _, disc in located]

    def command(self, memory: list[Any], seen: Measurement) -> tuple[list[Any], Commands]:
        """Let each controller command its cells."""
        after: list[Any] = []
        targets, modes, commands = seen.target.copy(), seen.mode.copy(), np.zeros(seen.target.shape)
        for run, controller in enumerate(self.controllers):
            remembered, orders = controller.command(memory[run], _take_run(seen, run))
            after.append(remembered)
            cells = slice(orders.target.size)
            targets[cells, run], modes[cells, run], commands[cells, run] = orders
        return after, Commands(targets, modes, commands)


def join_controllers(controllers: Sequence[Any], *, by_set: bool = False) -> Any:
    """Return one controller for all runs: the method's if its formulas hold for a batch, else one by one."""
    first = controllers[0]
    if isinstance(first, BatchControl) and not by_set:
        merged = merge_parts(controllers)
        parts = {part.name: getattr(merged, part.name) for part in fields(merged)}
        return merged.find_batch_class(len(controllers))(**parts | {"runs": tuple(controllers)})
    return first if isinstance(first, Uncontrolled) else RunByRun(tuple(controllers))


def _take_run(seen: Measurement, run: int) -> Measurement:
    """Return the measurement of one run."""
    cells = slice(seen.present[run] if seen.present else None)
    arrays: Any = seen[:-3]
    basis, *others = (values[..., cells, run] for values in arrays)
    return Measurement(np.ascontiguousarray(basis), *others)
