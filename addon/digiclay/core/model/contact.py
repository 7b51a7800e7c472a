"""Pulp over one cell: an exponential spring (equation 11)."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.arrays import Constants, Floats
from ..base.quantity import Parameters, quantity, refuse_overrides

#: Largest exponent, far beyond physical stiffness, so that the square of the force is finite.
LARGEST_EXPONENT = 300.0


class ExponentialLaw:
    """Base of the contact laws ``T(x) = (b/m) (exp(m (x - x0)) - 1)``, of any parameters."""

    if TYPE_CHECKING:  # parameters or properties of each law

        @property
        def stiffness(self) -> float:
            """Stiffness at first touch b, N/m."""

        @property
        def exponent(self) -> float:
            """Rate of stiffening m, 1/m."""

        @property
        def offset(self) -> float:
            """Indentation x0 at which force begins, m."""

        @property
        def share(self) -> float:
            """Share f_d of the force that a cell carries."""

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        rule = "the closed form of the step holds for the exponential law only"
        refuse_overrides(cls, ExponentialLaw, ("tension", "_numbers"), rule)

    def tension(self, depth: Floats) -> Floats:
        """Return the elastic force T, N, before the share f_d, of indentations x, m, below 0 in a gap."""
        m, offset, none, most, unit = self._numbers[depth.shape]
        exponent: Floats = depth * m
        exponent -= offset
        np.maximum(exponent, none, out=exponent)
        np.minimum(exponent, most, out=exponent)
        np.expm1(exponent, exponent)
        exponent *= unit
        return exponent

    @cached_property
    def _numbers(self) -> Constants:
        """Constants of `tension`: m, 1/m; m x0; the exponent's bounds; b/m, N."""
        m = self.exponent
        return Constants((m, m * self.offset, 0.0, LARGEST_EXPONENT, self.stiffness / m))


@dataclass(frozen=True, eq=False, repr=False)
class Contact(ExponentialLaw, Parameters):
    """``T(x) = (b/m) (exp(m (x - x0)) - 1)`` for x > x0, else 0; a cell carries the share f_d of it."""

    stiffness: float = quantity(
        250.0, "stiffness at first touch", unit="N/m", symbol="b", above=0.0
    )
    exponent: float = quantity(
        2000.0, "rate of stiffening of the pulp", unit="1/m", symbol="m", above=0.0
    )
    offset: float = quantity(
        0.0, "indentation at which force begins", unit="m", symbol="x0", at_least=0.0
    )
    share: float = quantity(
        0.34,
        "share of a cell in the flat-plate law; unless given, its area over 26.5 mm²",
        symbol="f_d",
        source="D",
        above=0.0,
    )
