"""Force to height: the one height of the blister's top at which predicted forces add up to a force.

Heights of the cells follow from that of the top, and are limited to what pins can reach in time; forces
follow from heights, undersides and relaxation. The sum grows with the top, so one table of it is enough.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base.arrays import Floats
from .pulp_estimate import PulpEstimate

#: Heights of the top that are tried, about a guess, as shares of what pins can reach, 0.5 mm on a level bed.
SHARES = np.array([-1.0, -0.4, -0.15, -0.04, 0.0, 0.04, 0.15, 0.4, 1.0])


class Reach(NamedTuple):
    """Range of the cells near the finger until the heights aimed at.

    Attributes
    ----------
    part : ndarray (m,)
        Profile of the blister, 1 at its top.
    drop : ndarray (m,)
        How far they may stand below the top, above it in a valley, m; infinite: not led.
    ends : ndarray (2, m)
        Lowest and highest they can be, m.
    """

    part: Floats
    drop: Floats
    ends: Floats


def form_heights(top: Floats | float, edge: float, part: Floats, drop: Floats, *, raised: bool) -> Floats:
    """Return heights of cells for a top: the blister's, or nearer to the top where they are led, m.

    `top` (t, 1), m; `edge`: height of the surface around, m; `part`, `drop` (m,), see `Reach`; `raised`:
    whether the top is above the surface around it.
    """
    heights: Floats = (top - edge) * part
    heights += edge
    return lead_heights(heights, top, drop, raised=raised)


def lead_heights(heights: Floats, top: Floats | float, drop: Floats, *, raised: bool) -> Floats:
    """Return heights, but no farther from the top than cells may stand that are led, m.

    `heights` (m,) or (t, m), m; `top` (t, 1), m; `drop` (m,), see `Reach`; `raised`: whether the top is above
    the surface around it.
    """
    return np.maximum(heights, top - drop) if raised else np.minimum(heights, top + drop)


def find_top(
    wanted: float,
    guess: float,
    edge: float,
    reach: Reach,
    under: Floats,
    lost: Floats,
    pulp: PulpEstimate,
    *,
    raised: bool,
) -> tuple[float, float]:
    """Return the height of the top at which the predicted forces add up to a force, m, and their sum, N.

    Where none does, it is the end of the range nearest to it.

    `wanted`, N; `guess`: where it is looked for most closely, m; `edge`: height of the surface around, m;
    `under` (m,), predicted undersides of the finger, m; `lost` (m,), from `PulpEstimate.predict_loss`, N;
    `raised`: whether the top is above the surface around it.
    """
    (level,) = (reach.part >= reach.part.max()).nonzero()
    lowest, highest = reach.ends.take(level, 1).tolist()
    low, high = min(lowest), max(highest)
    tops = (high - low) * SHARES
    tops += min(max(guess, low), high)
    np.maximum(tops, low, out=tops)
    np.minimum(tops, high, out=tops)
    depths = form_heights(tops[:, None], edge, reach.part, reach.drop, raised=raised)
    np.maximum(depths, reach.ends[0], out=depths)
    np.minimum(depths, reach.ends[1], out=depths)
    depths -= under
    forces = np.add.reduce(pulp.predict_force(depths, lost), axis=1)
    least, *_, most = forces.tolist()
    return float(np.interp(wanted, forces, tops)), min(max(wanted, least), most)
