"""High and low reservoir, selected by the sign of the opening."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity


@dataclass(frozen=True)
class Supply(Parameters):
    """Reservoirs at constant gauge pressure, selected by the sign of the opening."""

    high: float = quantity(
        0.5e5, "gauge pressure of the reservoir that raises pins", unit="Pa", symbol="P_high", source="P"
    )
    low: float = quantity(
        -0.5e5, "gauge pressure of the reservoir that lowers pins", unit="Pa", symbol="P_low", source="P"
    )

    def check(self) -> None:
        """The high reservoir must stand above the low one."""
        if not self.high > self.low:
            raise ParameterError(
                "Supply", "high", "must be above Supply.low", f"{self.high:g} Pa, low {self.low:g} Pa"
            )

    @property
    def largest(self) -> float:
        """Size of the larger of the two pressures, Pa."""
        return max(abs(self.high), abs(self.low))

    def pressure(self, opening: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the pressure at the far side of the valve, Pa, for openings K, shape (n,)."""
        return np.where(opening > 0.0, self.high, self.low)
