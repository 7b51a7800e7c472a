"""Relaxation of the pulp: quasi-linear viscoelasticity by Prony filters (equations 10, 12 to 14)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arrays import Floats, apply_map, per_row
from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity


@dataclass(frozen=True, eq=False, repr=False)
class Relaxation(Parameters):
    """Reduced relaxation ``G(t) = (c0 + Σ c_i exp(-t/t_i)) / Σ c`` as filters ``dz_i/dt = (T - z_i)/t_i``.

    The force is ``F = T - Σ ĉ_i z_i`` with ``ĉ_i = c_i / Σ c``, which is exactly the
    convolution of equation 10.
    """

    times: tuple[float, ...] = quantity(
        (4e-3, 70e-3, 1.4),
        "relaxation times",
        unit="s",
        symbol="1/ν_i",
        source="Pawluk 1999",
        at_least=1e-9,
    )
    weights: tuple[float, ...] = quantity(
        (0.08, 0.62, 0.20, 0.10),
        "weights c0 (permanent share) to c_k",
        symbol="c_i",
        source="C, Jindrich 2003",
        at_least=0.0,
    )

    def check(self) -> None:
        """Refuse weights that are not one more than times, or all zero."""
        if len(self.weights) != len(self.times) + 1:
            rule = f"must have one value more than times, {len(self.times) + 1}"
            raise ParameterError("Relaxation", "weights", rule, str(len(self.weights)))
        if not sum(self.weights) > 0.0:
            raise ParameterError("Relaxation", "weights", "must not all be 0", str(self.weights))

    @property
    def rows(self) -> int:
        """State rows per cell: one per filter."""
        return len(self.times)

    @cached_property
    def rates(self) -> Floats:
        """Relaxation rates ν_i, shape (k, 1), or (k, b) of differing runs, 1/s."""
        return 1.0 / per_row(np.stack(np.broadcast_arrays(*self.times)), 2)

    @cached_property
    def shares(self) -> Floats:
        """Shares ĉ_i of the filters, shape (k,), or (k, b) of differing runs."""
        weights = np.stack(np.broadcast_arrays(*self.weights))
        return weights[1:] / weights.sum(axis=0)

    def reduced(self, time: Floats) -> Floats:
        """Return G(t) (equation 12); G(0) = 1."""
        decay = np.exp(-np.asarray(time)[..., None] / np.array(self.times))
        return np.asarray(1.0 - self.shares.sum() + decay @ self.shares)

    def relaxed(self, filters: Floats) -> Floats:
        """Return the force lost to relaxation S = Σ ĉ_i z_i, N, shape (n[, b]), of filters z (k, n[, b])."""
        return apply_map(self.shares[None], filters)[0]

    def rate(self, filters: Floats, tension: Floats) -> Floats:
        """Return dz/dt = ν (T - z), N/s (equation 13), of filters z (k, n) under tensions T (n,), N."""
        return self.rates * (tension - filters)

    def mean_loss_map(self, step: float) -> tuple[Floats, float]:
        """Return map and share of a mean loss of force ``map . (z, T_0) + share T``, exact for linear T."""
        turns = self.rates[:, 0] * step
        held = -np.expm1(-turns) / turns
        # For small turns the difference is only rounding error, and its series is used.
        series = turns / 3.0 - turns * turns / 12.0
        share = float(
            self.shares @ np.where(turns < 1e-3, series, 1.0 - 2.0 * (1.0 - held) / turns)
        )
        return np.append(self.shares * held, self.shares @ (1.0 - held) - share), share

    def propagator(self, step: float) -> Floats:
        """Return the map (k, k + 3) from (z; T at start, mean, at end) to new z; exact for linear T."""
        turns = self.rates * step
        fresh = -np.expm1(-turns)
        bend = 1.0 - fresh * (1.0 / turns + 0.5)
        return np.hstack([np.diag(1.0 - fresh[:, 0]), -bend, fresh, bend])

    def age(self, filters: Floats, time: Floats) -> None:
        """Let filters (k, n[, b]) decay without contact for times (n[, b]), s, in place; exact."""
        filters *= np.exp(-per_row(self.rates, filters.ndim) * time)
