"""The valve follows its command with a first-order lag (equation 9)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .quantity import Parameters, quantity

__all__ = ["ValveLag"]

Floats = NDArray[np.float64]

#: A valve on its way shut and this little open counts as shut: it can let through no more than
#: 1e-18 of a cell's free speed, and a cell with a shut valve need not be integrated.
SHUT = 1e-9

#: Two-point Gauss-Legendre nodes on [0, 1]: averages over a step are exact to cubics.
GAUSS_NODES = (0.5 - math.sqrt(3.0) / 6.0, 0.5 + math.sqrt(3.0) / 6.0)


@dataclass(frozen=True)
class ValveLag(Parameters):
    """``τ_v dK/dt + K = K_com``: exact while the command is held."""

    time_constant: float = quantity(2e-3, "time constant of the valve", unit="s", symbol="τ_v", above=0.0)

    @property
    def rows(self) -> int:
        """State rows a cell needs: its opening."""
        return 1

    def opening(self, own: Floats, command: Floats) -> Floats:
        """Return the opening K, shape (n,)."""
        return own[0]

    def rate(self, own: Floats, command: Floats) -> Floats:
        """Return dK/dt, 1/s (equation 9), shape (1, n), for held commands, shape (n,)."""
        return (command - own) / self.time_constant

    def during(self, own: Floats, command: Floats, step: float) -> tuple[Floats, ...]:
        """Return the openings at the two Gauss points of a step of a held command; exact."""
        away = own[0] - command
        return tuple(command + away * math.exp(-step * node / self.time_constant) for node in GAUSS_NODES)

    def advance(self, own: Floats, command: Floats, step: float) -> None:
        """Move the openings on by `step` seconds of a held command, in place; exact but for `SHUT`."""
        own -= command
        own *= math.exp(-step / self.time_constant)
        own += command
        own[np.abs(own) < SHUT] = 0.0
