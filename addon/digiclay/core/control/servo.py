"""Common parts of the controllers: height control, lock of overloaded cells, one run or a batch.

The cells of one run are arrays (m,), those of a batch of b runs (m, b). A number that differs
between runs is an array (b,), which numpy broadcasts along the last axis.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..base.arrays import TIE, Array, Cells, Constants, Flags, Floats, Modes, any_true
from ..base.errors import ParameterError
from ..base.quantity import BOUNDS, Parameters, list_quantities, quantity
from .methods import ControlParameters


@dataclass(frozen=True, eq=False, repr=False)
class Tracking(ControlParameters):
    """Common part of the tracking methods: height control of cells, direction of the fingertip."""

    position_gain: float = quantity(
        500.0, "proportional gain of height", unit="1/m", symbol="K_p", at_least=0.0
    )
    dead_band: float = quantity(
        10e-6, "height error without a command", unit="m", symbol="δ", at_least=0.0
    )
    travel: float = quantity(
        1.5e-3, "distance traveled that determines the direction", unit="m", symbol="d_t", above=0.0
    )
    behind: float = quantity(
        -0.3,
        "cosine below which a cell lies behind the fingertip",
        symbol="cos_f",
        at_least=-1.0,
        below=0.0,
    )

    def command(self, target: Floats, height: Floats) -> Floats:
        """Return ``K_com = K_p (H_com - H)``, limited to [-1, 1], zero within the dead band.

        The flow is proportional to the square of the opening, so that a cell converges like 1/t,
        and would never be at rest without the dead band.
        """
        gain, band, most, least, none = self._constants[target.shape]
        error = target - height
        command: Floats = error * gain
        np.minimum(command, most, out=command)
        np.maximum(command, least, out=command)
        np.abs(error, error)
        np.putmask(command, error <= band, none)
        return command

    @cached_property
    def _constants(self) -> Constants:
        """Constants of `command`: gain, 1/m; dead band, m; bounds of the command; no command."""
        # An error of whole steps of the sensors may be as large as the dead band, but for rounding.
        return Constants((self.position_gain, self.dead_band * (1.0 + TIE), 1.0, -1.0, 0.0))


def declare_again(owner: type[Parameters], name: str, default: float | None = None) -> Any:
    """Declare a parameter of another class again, with another default if given."""
    field = next(field for field in dataclasses.fields(owner) if field.name == name)
    return dataclasses.field(
        default=field.default if default is None else default, metadata=field.metadata
    )


def check_order(parameters: Parameters, name: str, relation: str, other: str) -> None:
    """Check that a parameter is in a relation of `BOUNDS` to another one with the same unit."""
    value, limit = getattr(parameters, name), getattr(parameters, other)
    if not BOUNDS[relation](value, limit):
        show = list_quantities(parameters)[name].show
        rule = f"must be {relation.replace('_', ' ')} {other}, {show(limit)}"
        raise ParameterError(type(parameters).__name__, name, rule, show(value))


def mark_formed(target: Floats, rest: float | Floats, band: float | Floats) -> Modes:
    """Return HOLD for cells commanded farther from rest than a dead band, m, REST for the others."""
    off = target - rest
    np.abs(off, off)
    # True and False are the codes of these modes.
    return (off > band).view(np.int8)


def lock_overloaded(command: Floats, force: Floats, limit: float | Floats) -> Floats:
    """Lock cells under more force than the high reservoir lifts, N, in place: opening would lower them."""
    overload = force >= limit
    if any_true(overload):
        overload &= command > 0.0
        np.putmask(command, overload, 0.0)
    return command


@dataclass(frozen=True, eq=False)
class BatchControl:
    """Controller whose formulas hold for the cells of one run and for those of a batch.

    The memory of a batch is a list, with one memory per run.
    """

    runs: tuple[Any, ...] = field(default=(), kw_only=True)
    """In a batch the controllers of the runs, with plain numbers; empty in a single run."""

    def find_batch_class(self, count: int) -> type[BatchControl]:
        """Return the class of the controller of a batch of `count` runs, with the same fields."""
        return type(self)


def take_cells(values: Array, cells: Cells) -> Array:
    """Return the values of cells (m[, b]) of a bed, (n,), or of the bed of each run, (n, b)."""
    return values.take(cells) if values.ndim == 1 else np.take_along_axis(values, cells, axis=0)


def sum_weighted(rows: Floats, weights: Floats | Flags) -> Floats:
    """Return the sums ([k][, b]) over cells of rows ([k,] m[, b]) times weights (m[, b]), or a test."""
    if weights.ndim == 1:
        sums: Floats = rows.dot(weights)
    elif rows.shape[-1] == 1:  # the same rows for all runs
        sums = rows[..., 0].dot(weights)
    else:
        sums = np.einsum("...mb,mb->...b", rows, weights)
    return sums
