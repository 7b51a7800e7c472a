"""Ground of a blister: the surface from which it rises or sinks.

The paper takes one height for all cells, the mean at the blister's edge. What is formed inside is then cut:
a ridge across another one has a gap on either side. With a ground of its own a cell goes from the height that
it was commanded to when the blister came over it, and one at the blister's rim stays where it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.modes import Mode
from ..model.control_interface import Measurement

__all__ = ["GROUNDS", "EdgeGround", "OwnGround"]

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class EdgeGround:
    """One height for all cells, that of the edge (the paper's)."""

    rows = 0

    def find(self, seen: Measurement, edge: Any) -> Any:
        """Return the ground, m.

        Parameters
        ----------
        seen : Measurement
        edge : float or ndarray (b,)
            Height of the surface around the blister, m.
        """
        return edge

    def find_kept(self, target: Floats, profile: Floats, ground: Any, top: Any) -> Flags:
        """Tell which frozen cells keep their command: those farther off the ground than the profile.

        Parameters
        ----------
        target, profile : ndarray (m,) or (m, b)
            Commanded heights, and those of the blister, m.
        ground : float or ndarray (b,)
            See `find`, m.
        top : float or ndarray (b,)
            Height of the blister's top, m.
        """
        kept: Flags = target > profile
        kept ^= top < ground
        return kept


@dataclass(frozen=True)
class OwnGround:
    """Height of each cell when the blister came over it, in a row of the controller's."""

    rows = 1

    def find(self, seen: Measurement, edge: Any) -> Any:
        """Return the ground of each cell, m; see `EdgeGround.find`.

        Parameters
        ----------
        seen : Measurement
        edge : float or ndarray (b,)
        """
        own: Floats = seen.own[0]
        # Their modes are those of the last period: these cells were outside the blister then.
        np.copyto(own, seen.target, where=seen.mode <= Mode.EDGE)
        return own

    def find_kept(self, target: Floats, profile: Floats, ground: Any, top: Any) -> Flags:
        """Tell which frozen cells keep their command; see `EdgeGround.find_kept`.

        Parameters
        ----------
        target, profile, ground : ndarray (m,) or (m, b)
            m.
        top : float or ndarray (b,)
            m.
        """
        kept: Flags = target > profile
        # What is raised stays when the blister sinks below the ground beside it.
        kept ^= (top < ground) & (target <= ground)
        return kept


#: Grounds by the value of `VirtualMaster.ground`.
GROUNDS: dict[str, EdgeGround | OwnGround] = {"edge": EdgeGround(), "cell": OwnGround()}
