"""Blister: heights between its top and the surrounding surface, and the cells in, around and behind it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import TIE, Constants, Flags, Floats, Modes
from ..base.modes import BLISTER, EDGE, FROZEN
from ..base.quantity import Parameters, quantity
from ..model.control_interface import Measurement
from ..model.layout import RELATIVE_TOLERANCE
from .servo import check_order
from .travel import measure_offsets


@dataclass(frozen=True, eq=False, repr=False)
class Blister(Parameters):
    """Radius and profile of the blister, and the ring around it that gives the edge height."""

    radius: float = quantity(
        15e-3, "radius of the blister", unit="m", symbol="r_blister", source="P", above=0.0
    )
    edge_radius: float = quantity(
        18.5e-3, "outer radius of the ring of edge cells", unit="m", symbol="r_edge", above=0.0
    )
    flat_radius: float = quantity(
        6e-3, "radius of the flat top", unit="m", symbol="r_flat", at_least=0.0
    )
    profile: str = quantity(
        "cone", "radial profile of the blister", source="P", choices=("cone", "gaussian")
    )
    sigma: float = quantity(
        7e-3, "standard deviation of the Gaussian", unit="m", symbol="σ", above=0.0
    )

    def check(self) -> None:
        """The flat top lies inside the blister, the edge outside."""
        check_order(self, "flat_radius", "below", "radius")
        check_order(self, "edge_radius", "above", "radius")

    def evaluate_profile(self, distance: Floats) -> Floats:
        """Return the profile p(r), 1 at the center, for distances r inside the blister, m."""
        return self.interpolate(distance, 0.0, 1.0)

    def interpolate(self, distance: Floats, edge: Any, top: Any) -> Floats:
        """Return heights ``edge + p(r) (top - edge)``, m, at distances (m[, b]), m, from the middle."""
        if self.profile == "gaussian":
            height: Floats = np.exp(distance * distance * (-0.5 / self.sigma**2))
            slope, start = top - edge, edge
        else:
            (flat,) = self._flat[distance.shape]
            height = np.maximum(distance, flat)
            slope = (edge - top) / (self.radius - self.flat_radius)
            start = top - slope * self.flat_radius
        height *= slope
        height += start
        return height

    @cached_property
    def _flat(self) -> Constants:
        """The radius of the flat top, m."""
        return Constants((self.flat_radius,))


#: Share of the flat top's radius within which no cell freezes while the blister sinks into uneven
#: ground.
HELD = 0.4
#: A frozen cell is freed when its cosine is less negative than this share of the limit at which
#: cells freeze.
FREED = 0.3
CODES = Constants((EDGE, BLISTER, FROZEN), np.int8)


class BlisterCells(NamedTuple):
    """Cells about the middle of a blister, (m[, b]): distance and lead, m; within it, in the ring around."""

    distance: Floats
    ahead: Floats
    inside: Flags
    ring: Flags


@dataclass(frozen=True, eq=False)
class BlisterRule:
    """Rule that divides the cells of a blister into those inside, on the edge, touched and frozen."""

    blister: Blister
    behind: Any
    """(b,): Cosine below which a cell lies behind the fingertip."""
    release: Any
    felt: Any
    """(b,): Forces that release a frozen cell, and above which a cell is touched, N."""

    def divide(self, pose: tuple[Any, Any, Any, Any], basis: Floats) -> BlisterCells:
        """Return the cells about the middle of a blister: x, y, m, and its direction, a unit vector, (b,)."""
        distance, ahead = measure_offsets(*pose, basis)
        _, radius, edge_radius, *_ = self._limits[distance.shape]
        inside = distance <= radius
        ring = distance <= edge_radius
        ring ^= inside
        return BlisterCells(distance, ahead, inside, ring)

    def find_edge(self, cells: BlisterCells) -> Flags:
        """Return the cells that give the surface's height: those ahead, for the finished ridge is no edge."""
        facing: Flags = cells.ahead >= self._limits[cells.ahead.shape][0]
        facing &= cells.ring
        return facing

    def find_frozen(self, cells: BlisterCells, seen: Measurement, uneven: Any = False) -> Flags:
        """Return the frozen cells: those left behind now or before, except pressed ones.

        `uneven` (m[, b]): cells that sink into uneven ground. They freeze nearer to the fingertip,
        and are freed when they are ahead of it again.
        """
        *_, flat_radius, behind, release, _ = self._limits[cells.distance.shape]
        limit = behind * cells.distance
        limit -= TIE
        frozen: Flags = cells.ahead < limit
        froze = seen.mode == CODES[seen.mode.shape][2]
        if uneven is not False and np.any(uneven):
            flat_radius = np.where(uneven, HELD, 1.0) * flat_radius
            froze &= (cells.ahead < FREED * limit) | ~np.asarray(uneven)
        frozen &= cells.distance > flat_radius
        frozen |= froze
        frozen &= cells.inside
        frozen &= seen.force < release
        return frozen

    def set_modes(
        self, mode: Modes, cells: BlisterCells, force: Floats, touched_mode: Any, frozen: Flags
    ) -> None:
        """Set the modes of the blister's cells, (m[, b]), in place; `touched_mode` (b,)."""
        edge, formed, froze = CODES[mode.shape]
        touched = force > self._limits[force.shape][-1]
        touched &= cells.inside
        np.putmask(mode, cells.inside, formed)
        np.copyto(mode, touched_mode, "unsafe", touched)
        np.putmask(mode, cells.ring, edge)
        np.putmask(mode, frozen, froze)

    @cached_property
    def _limits(self) -> Constants:
        """How far ahead; radii of blister, edge and flat top, m, a billionth wider; a cosine; forces, N."""
        blister = self.blister
        wider = (
            radius * (1.0 + RELATIVE_TOLERANCE)
            for radius in (blister.radius, blister.edge_radius, blister.flat_radius)
        )
        return Constants((-TIE, *wider, self.behind, self.release, self.felt + TIE))
