"""Observer of fingertips: the pulp over their cells, which of them touch, and the fit of each.

Numbers are those of fingers whose cells follow each other; see `finger_sections`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..base.arrays import Cells, Floats
from ..model.control_interface import Measurement
from .finger_estimate import Estimate, FingerFilter
from .finger_sections import WHOLE, Whole
from .led_blister import Follower
from .pulp_estimate import PulpEstimate
from .travel import Heading, update_heading
from .virtual_master import IDLE, SHAPING, LossRule

#: Rows of a cell but for its filters and commanded speeds.
OWN_ROWS = 6


class OwnRows(NamedTuple):
    """Numbers of a cell's state rows."""

    pulp: slice
    tension: int
    """Relaxation of the pulp over it with its tension, N, and that tension."""
    coming: int
    later: int
    residual: int
    """Predicted undersides a period and two from now, m; what the last fit left of the measured one, or 0."""
    lead: int
    """How far its commanded height is from the one it will be left at, m."""
    stamp: int
    speeds: slice
    """Period in which its pulp was last observed, 0: never; commanded speeds, the newest first, m/s."""


def list_rows(filters: int) -> OwnRows:
    """Return the numbers of a cell's rows, of which the first are so many filters."""
    k = filters
    return OwnRows(slice(k + 1), k, k + 1, k + 2, k + 3, k + 4, k + 5, slice(k + OWN_ROWS, None))


#: Noise beyond which the assumed acceleration falls with the noise, N: otherwise the filter would
#: follow a noise of 10 mN to velocities of 40 mm/s.
STEADY = 5e-4


def measure_trust(noise: float) -> float:
    """Return the share to which forces with a noise, N, are followed."""
    return min(STEADY / noise, 1.0)


#: If the force is within this share of the set point, less with noise, and the fingertip no faster
#: than this, m/s, then fit and top are computed only every `EVERY` periods; in between the top
#: moves with the fingertip. Otherwise the force on a few stiff pins would oscillate from period to
#: period, as it does at 2 %.
NEAR, SLOW, EVERY = 0.15, 20e-3, 2
#: Largest distance of a touched cell from the predicted fingertip, in semi-axes; beyond it is a new
#: touch.
JUMP = 1.5
#: Underside of cells without a prediction, m.
AWAY = 1.0


@dataclass(frozen=True, eq=False)
class FingerObserver:
    """Observer of fingertips by the forces and heights of their cells."""

    at: OwnRows
    pulp: PulpEstimate
    finger: FingerFilter
    felt: float
    noise: float
    """Force above which a cell is touched, and standard deviation of forces, N."""
    loss: LossRule
    unknown: tuple[float, ...]
    asked: float
    travel: float
    """Forces predicted when none is; set point, N; distance that determines a direction, m."""

    @cached_property
    def farthest(self) -> float:
        """Distance from the predicted place beyond which a touch is a new one, m."""
        return JUMP * max(self.finger.fingertip.length, self.finger.fingertip.width)

    @cached_property
    def near(self) -> float:
        """Distance from the set point within which a force is near it, N."""
        return NEAR * measure_trust(self.noise) * self.asked

    def observe(
        self, memories: list[Follower], touched: Measurement, sections: Whole
    ) -> list[Follower]:
        """Observe the pulp of the cells that fingertips may touch, and follow or find the fingertips."""
        at, rows, force = self.at, touched.own, touched.force
        period = sections.spread([memory.period for memory in memories])
        late = (period - 1.0) - rows[at.stamp]
        if np.count_nonzero(late):
            self.pulp.age(rows[at.pulp], late * (rows[at.stamp] > 0.0))
            np.putmask(rows[at.later], late, AWAY)
            np.putmask(rows[at.coming], late, AWAY)
        rows[at.stamp] = period
        (felt,) = (force > self.felt).nonzero()
        if memories[0].phase is IDLE:
            self.pulp.observe(rows[at.pulp], force, np.zeros(force.size))
            rows[at.coming] = rows[at.later] = AWAY
            bounds = pairwise(sections.find_bounds(felt))
            return [
                self._find(memory, touched, felt[start:stop]) if stop > start else memory
                for memory, (start, stop) in zip(memories, bounds, strict=True)
            ]
        expected = self.pulp.touch.contact.tension(touched.height - rows[at.coming])
        (here,) = self.pulp.observe(rows[at.pulp], force, expected).nonzero()
        rows[at.coming] = rows[at.later]
        return self._follow(memories, touched, (felt, here), sections)

    def _follow(
        self,
        memories: list[Follower],
        touched: Measurement,
        cells: tuple[Cells, Cells],
        sections: Whole,
    ) -> list[Follower]:
        """Fit the fingertips that are felt, except those that hold; search again for those that have jumped.

        `cells`: those whose force is felt, and those under a predicted fingertip.
        """
        (felt, here), force = cells, touched.force
        counts, bounds = sections.find_bounds(felt), sections.find_bounds(here)
        totals, after, fits = sections.add(force), list(memories), [False] * len(memories)
        for i, memory in enumerate(memories):
            # Forces under the predicted fingertip are felt if their sum exceeds its noise.
            if counts[i] == counts[i + 1] and not self._is_felt(
                force.take(here[bounds[i] : bounds[i + 1]])
            ):
                touched.own[self.at.residual, sections.parts[i]] = 0.0
                after[i] = self.loss.wait(memory)
            elif memory.period % EVERY and self.holds(memory, totals[i]):
                after[i] = memory._replace(alone=0) if memory.alone else memory
            else:
                fits[i] = True
        x, y = touched.quadratic_basis[1:3, felt].tolist() if any(fits) and felt.size else ((), ())
        for i in [i for i, fit in enumerate(fits) if fit]:
            touched.own[self.at.residual, sections.parts[i]] = 0.0
            part = slice(counts[i], counts[i + 1])
            if self._has_jumped(memories[i].estimate, x[part], y[part]):
                lost = memories[i]._replace(losses=memories[i].losses + 1)
                after[i], fits[i] = self._find(lost, touched, felt[part]), False
        here, fingers, sections = sections.pick(here, fits)
        if fingers:
            fitted = self._fit([memories[i] for i in fingers], touched, here, sections)
            for i, memory in zip(fingers, fitted, strict=True):
                after[i] = memory
        return after

    def _is_felt(self, force: Floats) -> bool:
        """Tell whether forces under a predicted fingertip, N, are more than noise."""
        return float(np.add.reduce(force)) > self.felt * math.sqrt(force.size)

    def holds(self, memory: Follower, force: float) -> bool:
        """Tell whether a fingertip is slow and its force, N, near the set point: it is fitted less often."""
        _, _, _, vx, vy, vz, *_ = memory.estimate.mean.tolist()
        return abs(force - self.asked) <= self.near and math.hypot(vx, vy, vz) <= SLOW

    def _has_jumped(self, guess: Estimate, x: Sequence[float], y: Sequence[float]) -> bool:
        """Tell whether cells at x, y, m, are touched, but none within reach of the predicted fingertip."""
        middle = guess.mean.tolist()[:2]
        return bool(x) and not any(
            math.dist(middle, cell) <= self.farthest for cell in zip(x, y, strict=True)
        )

    def _find(self, memory: Follower, touched: Measurement, here: Cells) -> Follower:
        """Begin to follow a fingertip that has touched, at the centroid of its forces (equation 13)."""
        force, basis = touched.force.take(here), touched.quadratic_basis.take(here, 1)
        under, _ = self.pulp.find_underside(
            touched.height.take(here), touched.own[self.at.tension].take(here), self.noise
        )
        rows = np.vstack((basis[:3], under, touched.height.take(here)))
        total, x, y, z, height = rows.dot(force).tolist()
        x, y, height = x / total, y / total, height / total
        follower = Follower(
            phase=SHAPING,
            period=memory.period,
            estimate=self.finger.begin(x, y, z / total),
            top=height,
            edge=height,
            heading=Heading(x, y),
            felt=height,
            losses=memory.losses,
            due=self.unknown,
        )
        return self._fit([follower], touched, here, WHOLE)[0]

    def _fit(
        self, memories: list[Follower], touched: Measurement, here: Cells, sections: Whole
    ) -> list[Follower]:
        """Fit the fingertips to the undersides over the touched cells, in sections."""
        seen, noise = self.pulp.find_underside(
            touched.height.take(here), touched.own[self.at.tension].take(here), self.noise
        )
        noise *= noise
        noise += self.finger.spread.underside**2
        guesses = [memory.estimate for memory in memories]
        basis = touched.quadratic_basis.take(here, 1)
        at = self.finger.measure([guess.mean for guess in guesses], basis, sections)
        estimates, left = self.finger.correct(guesses, at, seen, noise, sections)
        after = []
        for memory, estimate, part in zip(memories, estimates, sections.parts, strict=True):
            x, y, *_ = estimate.mean.tolist()
            if math.dist((x, y), memory.estimate.mean.tolist()[:2]) <= self.farthest:
                heading = update_heading(memory.heading, x, y, self.travel)
                after.append(memory._replace(estimate=estimate, heading=heading, alone=0))
            else:
                # No fingertip is that fast: these are undersides of another one.
                left[part] = 0.0
                after.append(memory._replace(alone=0))
        touched.own[self.at.residual, here] = left
        return after
