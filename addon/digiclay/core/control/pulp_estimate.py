"""Observer of the pulp: tensions of cells, and undersides over them, from their measured forces.

The relaxation filters ``dz_i/dt = ν_i (T - z_i)`` and ``F = f_d (T - Σ ĉ_i z_i)`` (equations 10 to
14) are solved for the tension T, which is taken as linear in time over a control period. The
equation is linear: there is no iteration.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import TIE, Flags, Floats
from ..model.touch import Touch
from .finger_sections import WHOLE, Whole

#: Expected force from which on a cell counts as touched: a share of the least one that is no noise;
#: and N. At 1 mN cells at the rim are taken whose undersides are known less exactly, and tilted
#: fingertips are lost.
EXPECTED, LEAST = 0.2, 10e-3


class Span(NamedTuple):
    """Change over a time, for a tension that goes linearly from T_0 to T_1.

    ``z_1 = decay z_0 + early T_0 + late T_1``; of T_1 the share ``Σ ĉ_i late_i`` is lost to
    relaxation, `held` is not. `late` (k + 1, 1): what T_1 adds to filters and tension. `remaining`
    (k + 1, k + 1), of filters and tension before: the filters after, but for T_1, and the tension
    lost of it, over `held`.
    """

    remaining: Floats
    late: Floats
    held: float


@dataclass(frozen=True, eq=False)
class PulpEstimate:
    """Inverse of contact law and relaxation over a cell."""

    touch: Touch
    """Contact law and relaxation as known to the controller."""
    period: float
    ahead: float
    """Control period, and time over which forces are predicted, s."""
    floor: float
    """Force below which a reading is no contact, N."""

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
        pulp = self.touch.pulp
        turns = pulp.rates[:, 0] * time
        decay = np.exp(-turns)
        late = 1.0 - (1.0 - decay) / turns
        held = 1.0 - float(pulp.shares @ late)
        remaining = np.column_stack((np.diag(decay), 1.0 - decay - late))
        return Span(
            np.vstack((remaining, pulp.shares @ remaining / held)),
            np.append(late, 1.0)[:, None],
            held,
        )

    def age(self, pulp: Floats, periods: Floats) -> None:
        """Let the pulp over cells relax for their control periods, (m,), without contact, in place."""
        self.touch.pulp.age(pulp[:-1], self.period * periods)
        pulp[-1, periods > 0.0] = 0.0

    def observe(self, pulp: Floats, force: Floats, expected: Floats) -> Flags:
        """Update filters and tensions of cells, in place; return which cells are touched.

        Pulp that is relieved faster than it relaxes is still indented, but carries no force. So a
        cell without a force has the expected tension, at most that at which a force would be
        measured. A cell with an expected force counts as touched even if none is measured, since
        this tells where the fingertip ends; a selection by noisy forces would prefer cells with
        positive noise.

        `pulp` (k + 1, m), filters z and tension T a period before, N; `expected` (m,), tension
        under the predicted fingertip, N.
        """
        span = self.once
        remaining, share = span.remaining.dot(pulp), self.touch.contact.share * span.held
        lost = remaining[-1]
        touched: Flags = expected > lost + max(EXPECTED * self.floor, LEAST) / share
        touched |= force > self.floor
        tension = np.where(touched, np.maximum(force, 0.0), self.floor)
        tension *= 1.0 / share
        tension += lost
        np.minimum(tension, expected, out=tension, where=~touched)
        lost[:] = 0.0
        np.multiply(span.late, tension, out=pulp)
        pulp += remaining
        return touched

    def predict_loss(self, pulp: Floats) -> Floats:
        """Return the tension at which there would be no force at the end of the prediction, (m,), N."""
        return self.later.remaining[-1].dot(pulp)

    def predict_force(self, depth: Floats, lost: Floats) -> Floats:
        """Return the forces at the end of the prediction, N, of indentations then, (..., m), m."""
        force = self.touch.contact.tension(depth)
        force -= lost
        np.maximum(force, 0.0, out=force)
        force *= self.later.held * self.touch.contact.share
        return force

    def find_underside(
        self, height: Floats, tension: Floats, noise: float
    ) -> tuple[Floats, Floats]:
        """Return the undersides over cells, m, and their standard deviations for that of the force, N.

        The indentation is equation 11 solved for x; the stiffness is ``f_d dT/dx = f_d (b + m T)``.
        """
        contact = self.touch.contact
        stiffening = tension * (contact.exponent / contact.stiffness)
        depth: Floats = np.log1p(stiffening)
        depth *= 1.0 / contact.exponent
        if contact.offset:
            depth += contact.offset
        stiffening += 1.0
        return height - depth, (noise / (contact.share * contact.stiffness)) / stiffening


#: Heights of the top that are tried, about a guess, as shares of what pins can reach, 0.5 mm on a
#: level bed.
SHARES = np.array([-1.0, -0.4, -0.15, -0.04, 0.0, 0.04, 0.15, 0.4, 1.0])[:, None]


class Reach(NamedTuple):
    """Heights that the cells near fingertips can have at the time aimed at."""

    edge: Any
    raised: Any
    """Height of the surface around, m, and whether the blister's top is above it, of all cells or (m,)."""
    part: Floats
    """(m,): Profile of the blister, 1 at its top."""
    drop: Floats
    """(m,): How far they may stand below the top, above it in a valley, m; infinite: not led."""
    ends: Floats
    """(2, m): Lowest and highest they can be, m."""

    def form_heights(self, top: Floats | float) -> Floats:
        """Return heights, m, for tops (t, 1) or (t, m), m: the blister's, or nearer to the top where led."""
        heights: Floats = (top - self.edge) * self.part
        heights += self.edge
        return lead_heights(heights, top, self.drop, self.raised)


def lead_heights(heights: Floats, top: Floats | float, drop: Floats, raised: Any) -> Floats:
    """Return heights (m,) or (t, m), m, but no farther from the top than cells may stand; see `Reach`."""
    if isinstance(raised, bool):
        return np.maximum(heights, top - drop) if raised else np.minimum(heights, top + drop)
    return np.where(raised, np.maximum(heights, top - drop), np.minimum(heights, top + drop))


def find_tops(
    wanted: list[float],
    guesses: list[float],
    reach: Reach,
    under: Floats,
    lost: Floats,
    pulp: PulpEstimate,
    sections: Whole = WHOLE,
) -> list[tuple[float, float]]:
    """Return the heights of tops at which the predicted forces add up to forces, m, and their sums, N.

    Where none does, it is the end of the range nearest to it. `guesses`: where tops are sought most
    closely, m; `under` (m,), predicted undersides, m; `lost` (m,), from
    `PulpEstimate.predict_loss`, N.
    """
    highest_part = sections.repeat(sections.reduce(np.maximum, reach.part))
    (level,) = (reach.part >= highest_part - TIE).nonzero()
    lowest, highest = reach.ends.take(level, 1).tolist()
    ranges = []
    for guess, ends in zip(guesses, pairwise(sections.find_bounds(level)), strict=True):
        low, high = min(lowest[slice(*ends)]), max(highest[slice(*ends)])
        ranges.append((low, high, min(max(guess, low), high)))
    low, high, guess = sections.spread(ranges)
    tops = (high - low) * SHARES
    tops += guess
    np.maximum(tops, low, out=tops)
    np.minimum(tops, high, out=tops)
    depths = reach.form_heights(tops)
    least, most = reach.ends
    np.maximum(depths, least, out=depths)
    np.minimum(depths, most, out=depths)
    depths -= under
    forces = sections.reduce(np.add, pulp.predict_force(depths, lost))
    # All cells of a finger have its top.
    tried = sections.reduce(np.maximum, tops)
    results = []
    for force, sums, heights in zip(wanted, forces.T, tried.T, strict=True):
        weakest, *_, strongest = sums.tolist()
        results.append(
            (float(np.interp(force, sums, heights)), min(max(force, weakest), strongest))
        )
    return results
