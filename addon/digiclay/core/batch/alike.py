"""Cells of a batch as one set of cells, and their stepper."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from ..model.contact import LARGEST_EXPONENT
from ..model.interfaces import Stepper
from ..model.physics import Cell, Speeds
from ..model.touch import Touch
from .broadcasting import Floats, together

__all__ = ["Alike", "Extrapolated", "Movement", "Touches", "cell_of_all", "touches"]


#: Cells moved at a time: as many as stay in a core's cache, and few enough for the matrix products to stay
#: on one core (waking a second one takes longer than the product).
PIECE = 2048


class Movement(Protocol):
    """Moves all cells of all runs on by one control period."""

    def advance(self, driven: Floats, under: Floats) -> None:
        """Move a block of cells on, in place.

        Parameters
        ----------
        driven : ndarray (r + q, w, b)
            See `interfaces.Stepper`.
        under : ndarray (p, k, b)
            Undersides of the fingers over the first k cells of each run, m.
        """
        ...


@dataclass(frozen=True, eq=False)
class Alike:
    """The runs' own stepper, where the cells of all runs are alike: it need not know whose they are."""

    stepper: Stepper
    plan: Any

    def advance(self, driven: Floats, under: Floats) -> None:
        """Move a block of cells on, in place; see `Movement`."""
        flat, below = driven.reshape(len(driven), -1), under.reshape(len(under), -1)
        for part in _pieces(0, below.shape[1]):
            self.stepper.bind(self.plan, flat[:, part], part.stop - part.start)(below[:, part])
        for part in _pieces(below.shape[1], flat.shape[1]):
            self.stepper.bind(self.plan, flat[:, part], 0)(below[:, :0])


def _pieces(first: int, end: int) -> Iterator[slice]:
    """Cut some cells into pieces of about one size, none larger than `PIECE`."""
    count = -(-(end - first) // PIECE)
    for i in range(count):
        yield slice(first + (end - first) * i // count, first + (end - first) * (i + 1) // count)


@dataclass(frozen=True, eq=False)
class Extrapolated:
    """Richardson's form of a movement: whole steps against halves, see `steppers.richardson`.

    Attributes
    ----------
    cell : Cell
        Of all runs.
    coarse, fine : Movement
    speeds : Speeds
        Of all runs.
    period : ndarray (b,)
        s.
    """

    cell: Cell
    coarse: Movement
    fine: Movement
    speeds: Speeds
    period: Floats

    def advance(self, driven: Floats, under: Floats) -> None:
        """Move a block of cells on, in place; see `Movement`."""
        coarse, y = driven.copy(), driven[: self.cell.rows]
        lowest, highest = self.speeds.reach(driven[0], under, self.period)
        self.coarse.advance(coarse, under)
        self.fine.advance(driven, under)
        y += (y - coarse[: self.cell.rows]) / 3.0
        np.minimum(np.maximum(y[0], lowest), highest, out=y[0])
        np.minimum(np.maximum(y[0], 0.0), self.cell.actuator.stroke, out=y[0])
        np.maximum(y[self.cell.pulp_rows], 0.0, out=y[self.cell.pulp_rows])


@dataclass(frozen=True, eq=False)
class Touches:
    """From undersides to forces in all runs: contact laws and relaxation, see `touch.force`.

    Attributes
    ----------
    exponent, offset, unit, share : float or ndarray (b,)
        The contact's m, 1/m, and x0, m; b/m, N; f_d.
    rates, shares : ndarray (k, 1, b)
        Of the relaxation's filters, 1/s and 1.
    """

    exponent: Floats | float
    offset: Floats | float
    unit: Floats | float
    share: Floats | float
    rates: Floats
    shares: Floats

    def force(self, height: Floats, under: Floats, filters: Floats) -> Floats:
        """Return the force on each cell, N, shape (n, b), of heights and undersides, m, and filters, N."""
        tension = height - under
        tension -= self.offset
        tension *= self.exponent
        np.maximum(tension, 0.0, out=tension)
        np.minimum(tension, LARGEST_EXPONENT, out=tension)
        np.expm1(tension, tension)
        tension *= self.unit
        tension -= np.add.reduce(self.shares * filters)
        np.maximum(tension, 0.0, out=tension)
        tension *= self.share
        return tension

    def age(self, filters: Floats, time: Floats) -> None:
        """Let filters (k, n, b) decay without contact for `time` seconds, (n, b), in place; exact."""
        filters *= np.exp(-self.rates * time)


def touches(parts: Sequence[Touch]) -> Touches:
    """Put the touch of all runs together."""
    contact = together([part.contact for part in parts])
    shares = np.stack([_shares(part.pulp)[:, None] for part in parts], axis=-1)
    rates = np.stack([_rates(part.pulp)[:, None] for part in parts], axis=-1)
    unit = contact.stiffness / contact.exponent
    return Touches(contact.exponent, contact.offset, unit, contact.share, rates, shares)


def _shares(pulp: Any) -> Floats:
    """Return the filters' shares, shape (k,); none of a pulp that does not relax."""
    return pulp.shares if pulp.rows else np.empty(0)


def _rates(pulp: Any) -> Floats:
    """Return the filters' rates, shape (k,), 1/s; none of a pulp that does not relax."""
    return pulp.rates[:, 0] if pulp.rows else np.empty(0)


def cell_of_all(cells: Sequence[Cell]) -> Cell:
    """Return a cell whose numbers are arrays (b,) where the runs differ; its pulp is that of the first."""
    first = cells[0].touch
    if first is None:
        return together(cells)
    return together([replace(one, touch=replace(one.touch, pulp=first.pulp)) for one in cells if one.touch])
