"""Ground of a blister: the surface from which it rises or sinks.

The paper uses one height for all cells, the mean at the edge of the blister. This cuts existing
features: a ridge across another one gets a gap on both sides. With `OwnGround` each cell starts
from its commanded height when the blister reached it, and a cell at the rim of the blister does not
move.

A level blister on a slope moves all cells to one height: behind a climbing fingertip it would raise
pressed cells again, and ahead of it lower the slope. Therefore a sinking blister, whose top is
below the ground of the cells under the fingertip, raises no cell, and lowers no cell by more than
those. Cells raised before stay: a fingertip that climbs out of a valley while filling it sinks into
the far side. On uneven ground cells freeze nearer behind the fingertip, and lowered cells are freed
when they are ahead of it again, since on a slope the fingertip is felt beside its lowest point. On
even ground that would leave a groove with ragged flanks.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.arrays import TIE, Flags, Floats, Modes, any_true
from ..base.modes import EDGE
from ..model.control_interface import Measurement
from ..model.interfaces import Alike
from .blister import Blister, BlisterCells, BlisterRule
from .servo import sum_weighted

#: Least weight of a cell in the ground under the fingertip, N: an untouched blister has a ground,
#: too.
UNTOUCHED = 1e-9
#: How many standard deviations about its mean the ground under the fingertip reaches.
SPREAD = 1.0
#: The ground under the fingertip is uneven when it reaches that far about its mean, as a share of
#: the depth.
UNEVEN = 0.1


class EdgeGround(Alike):
    """One height for all cells, that of the edge (the paper's)."""

    #: State rows a cell needs.
    rows = 0
    #: Distance traveled back that reverses the direction, as a share of the radius of the flat top.
    turning = 0.0

    def find(self, seen: Measurement, edge: Any) -> Any:
        """Return the ground for a height of the surface around the blister, (b,), m."""
        return edge

    def find_profile(
        self,
        blister: Blister,
        distance: Floats,
        inside: Flags,
        ground: Any,
        top: Any,
        seen: Measurement,
    ) -> tuple[Floats, Any]:
        """Return the height of the blister at each cell, m, and which cells sink into uneven ground: none."""
        return blister.interpolate(distance, ground, top), False

    def find_holding(
        self, target: Floats, profile: Floats, ground: Any, top: Any, uneven: Any
    ) -> Flags:
        """Tell which frozen cells keep their command, m: those farther off the ground than the profile, m."""
        holding: Flags = target > profile
        holding ^= top < ground - TIE
        return holding


class OwnGround(Alike):
    """Height of each cell when the blister came over it, in a row of the controller's; see `EdgeGround`."""

    rows = 1
    turning = 1.0

    def find(self, seen: Measurement, edge: Any) -> Any:
        """Return the ground of each cell, (m[, b]), m; see `EdgeGround.find`."""
        ground: Floats = seen.own[0]
        # Their modes are those of the last period: these cells were outside the blister then.
        np.copyto(ground, seen.target, where=seen.mode <= EDGE)
        return ground

    def find_profile(
        self,
        blister: Blister,
        distance: Floats,
        inside: Flags,
        ground: Any,
        top: Any,
        seen: Measurement,
    ) -> tuple[Floats, Any]:
        """Return the height of the blister at each cell, m, and which cells sink into uneven ground.

        `distance` (m[, b]) from the middle of the blister, and `top` (b,), m. The ground under the
        fingertip is its mean and standard deviation, weighted with the forces. A cell above its
        ground does not sink.
        """
        level = blister.interpolate(distance, ground, top)
        weight = np.maximum(seen.force, UNTOUCHED)
        weight *= inside
        whole = np.maximum(weight.sum(axis=0), UNTOUCHED)
        mean = sum_weighted(ground, weight) / whole
        sinks = top < mean - TIE
        if not np.any(sinks):
            return level, False
        off = ground - mean
        off *= off
        reach = SPREAD * np.sqrt(sum_weighted(off, weight) / whole)
        change: Floats = top - ground
        np.maximum(change, np.minimum(top - mean - reach, 0.0), out=change)
        np.minimum(change, np.maximum(top - mean + reach, 0.0), out=change)
        profile = blister.interpolate(distance, ground, ground + change)
        raised = seen.target > ground + TIE
        # What a blister has raised before it sinks stays as far as it is within the level one.
        np.maximum(profile, np.minimum(level, seen.target), out=profile, where=raised)
        uneven = sinks & (reach > UNEVEN * (mean - top))
        return np.where(sinks, profile, level), uneven & ~raised

    def find_holding(
        self, target: Floats, profile: Floats, ground: Any, top: Any, uneven: Any
    ) -> Flags:
        """Tell which frozen cells keep their command; see `EdgeGround.find_holding`."""
        holding: Flags = target > profile
        # What is raised stays when the blister sinks below the ground beside it; and what is
        # lowered by one that sinks into uneven ground is not raised where the ground falls below
        # its top.
        holding ^= uneven | ((top < ground - TIE) & (target <= ground + TIE))
        return holding


#: Grounds by the value of `VirtualMaster.ground`.
GROUNDS: dict[str, EdgeGround | OwnGround] = {"edge": EdgeGround(), "cell": OwnGround()}


def raise_blister(
    rule: BlisterRule,
    ground: EdgeGround | OwnGround,
    cells: BlisterCells,
    seen: Measurement,
    heights: tuple[Any, Any, np.int8 | Modes, bool | Flags],
    mode: Modes,
) -> Floats:
    """Return commanded heights (m[, b]), m, with a blister of `heights`; modes are set in place."""
    # Of surface and top, m; mode of touched cells; whether frozen cells stay that the blister
    # outgrows.
    edge, top, touched_mode, stays = heights
    level = ground.find(seen, edge)
    profile, uneven = ground.find_profile(
        rule.blister, cells.distance, cells.inside, level, top, seen
    )
    frozen = rule.find_frozen(cells, seen, uneven)
    if any_true(frozen):
        # Frozen cells are never called back.
        holding = ground.find_holding(seen.target, profile, level, top, uneven)
        holding |= stays
        holding &= frozen
        np.putmask(profile, holding, seen.target)
    rule.set_modes(mode, cells, seen.force, touched_mode, frozen)
    return np.where(cells.inside, profile, seen.target)
