"""Relief: the top surface of an external shape, sampled at every pin."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from ..base.arrays import Flags, Floats
from ..model.layout import Grid


class Placement(NamedTuple):
    """Transformation of a shape's plan: bed = file * factor + offset; m, and m per file's unit."""

    factor_x: float
    factor_y: float
    x: float
    y: float


class Tops(NamedTuple):
    """Top surface of a shape at the pins of a bed, (n,) each.

    Attributes
    ----------
    value : ndarray (n,)
        In the file's unit; 0 where the shape covers no pin.
    covered : ndarray (n,) of bool
    overhang : ndarray (n,) of bool
        Pins over which another part of the shape lies below the top: it cannot be displayed.
    filled : int
        Pins under small holes, whose values are taken from around.
    """

    value: Floats
    covered: Flags
    overhang: Flags
    filled: int = 0


class Relief(Protocol):
    """Shape in the unit of its file."""

    @property
    def name(self) -> str:
        """Name in messages."""
        ...

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Least x, least y, largest x, largest y of its plan."""
        ...

    @property
    def length(self) -> float | None:
        """Meters in the unit of its plan; None where that has no length, as a picture's pixels."""
        ...

    @property
    def value_length(self) -> float | None:
        """Meters in the unit of its heights; None where they are no lengths, as a picture's."""
        ...

    @property
    def underside(self) -> float | None:
        """Its lowest point; None where there is nothing below the top surface."""
        ...

    def tops(self, grid: Grid, at: Placement) -> Tops:
        """Return its top surface at the pins."""
        ...
