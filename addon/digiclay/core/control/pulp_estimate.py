"""Observer of the pulp: tensions, indentations and stiffnesses of cells from their measured forces.

The relaxation filters ``dz_i/dt = ν_i (T - z_i)`` and ``F = f_d (T - Σ ĉ_i z_i)`` (equations 10 to 14) are
solved for the tension T, which is taken as linear in time over a control period. The equation is linear:
there is no iteration.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..model.touch import Touch

__all__ = ["PulpEstimate", "Span"]

Floats = NDArray[np.float64]


class Span(NamedTuple):
    """Change of the filters over a time, for a tension that goes linearly from T_0 to T_1.

    ``z_1 = decay z_0 + early T_0 + late T_1``

    Attributes
    ----------
    decay, early, late : ndarray (k, 1)
    loss : float
        Share of T_1 that is lost to relaxation, ``Σ ĉ_i late_i``.
    """

    decay: Floats
    early: Floats
    late: Floats
    loss: float


@dataclass(frozen=True, eq=False)
class PulpEstimate:
    """Inverse of contact law and relaxation over a cell.

    Attributes
    ----------
    touch : Touch
        Contact law and relaxation as known to the controller.
    period : float
        Control period, s.
    ahead : float
        Time over which forces are predicted, s.
    floor : float
        Force below which a reading is no contact, N.
    """

    touch: Touch
    period: float
    ahead: float
    floor: float

    @property
    def filters(self) -> int:
        """Number of filters of a cell, k."""
        return self.touch.pulp.rows

    @cached_property
    def once(self) -> Span:
        """Change over a control period."""
        return self._span(self.period)

    @cached_property
    def later(self) -> Span:
        """Change over the time of the prediction."""
        return self._span(self.ahead)

    def _span(self, time: float) -> Span:
        """Return the change over a time, s."""
        turns = self.touch.pulp.rates * time
        decay = np.exp(-turns)
        late = 1.0 - (1.0 - decay) / turns
        return Span(decay, 1.0 - decay - late, late, float(self.touch.pulp.shares @ late[:, 0]))

    def age(self, filters: Floats, tension: Floats, periods: Floats) -> None:
        """Let the pulp over cells without contact relax, in place; cells with 0 periods stay.

        Parameters
        ----------
        filters : ndarray (k, m)
            z, N.
        tension : ndarray (m,)
            T, N.
        periods : ndarray (m,)
            Control periods without contact.
        """
        self.touch.pulp.age(filters, self.period * periods)
        tension[periods > 0.0] = 0.0

    def observe(self, filters: Floats, tension: Floats, force: Floats, expected: Floats) -> None:
        """Bring filters and tensions of cells up to date, in place.

        Pulp that is relieved faster than it relaxes is still indented, and carries no force. So the tension
        of a cell without a force is the expected one, at most the one at which a force would be measured.

        Parameters
        ----------
        filters : ndarray (k, m)
            z a period before, N.
        tension : ndarray (m,)
            T a period before, N.
        force : ndarray (m,)
            Measured, N.
        expected : ndarray (m,)
            Tension under the predicted fingertip, N.
        """
        span = self.once
        kept = self._keep(span, filters, tension)
        lost = self.touch.pulp.shares.dot(kept)
        found = np.maximum(force, self.floor)
        found *= 1.0 / self.touch.contact.share
        found += lost
        found *= 1.0 / (1.0 - span.loss)
        np.copyto(found, np.minimum(found, expected), where=force <= self.floor)
        tension[:] = found
        np.multiply(span.late, found, out=filters)
        filters += kept

    def _keep(self, span: Span, filters: Floats, tension: Floats) -> Floats:
        """Return the filters at the end of a time without the share of the last tension, (k, m), N."""
        kept = span.decay * filters
        kept += span.early * tension
        return kept

    def predict_loss(self, filters: Floats, tension: Floats) -> Floats:
        """Return the tension lost at the end of the prediction, but for the share of that tension, (m,), N.

        Parameters
        ----------
        filters : ndarray (k, m)
            N.
        tension : ndarray (m,)
            N.
        """
        lost: Floats = self.touch.pulp.shares.dot(self._keep(self.later, filters, tension))
        return lost

    def predict_force(self, depth: Floats, lost: Floats) -> Floats:
        """Return the forces at the end of the prediction, N.

        Parameters
        ----------
        depth : ndarray (..., m)
            Indentations then, m.
        lost : ndarray (m,)
            From `predict_loss`, N.
        """
        force = self.touch.contact.tension(depth)
        force *= 1.0 - self.later.loss
        force -= lost
        np.maximum(force, 0.0, out=force)
        force *= self.touch.contact.share
        return force

    def find_indentation(self, tension: Floats) -> Floats:
        """Return indentations, m, at tensions (m,), N: equation 11 solved for x."""
        contact = self.touch.contact
        depth: Floats = np.log1p(tension * (contact.exponent / contact.stiffness))
        depth *= 1.0 / contact.exponent
        depth += contact.offset
        return depth

    def find_stiffness(self, tension: Floats) -> Floats:
        """Return the stiffness of contacts, N/m, at tensions (m,), N: ``f_d dT/dx = f_d (b + m T)``."""
        contact = self.touch.contact
        return contact.share * (contact.stiffness + contact.exponent * tension)
