"""Skin over the formed pins, and the same skin over the former ones."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from .body import NO_PIN
from .formed import Formed
from .skin_mesh import make_skin
from .skins import find_nearest_pin, interpolate_skin, place_points

Indices = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class SurfaceGrid:
    """Points of a skin, row by row.

    Attributes
    ----------
    formed : Formed
        The pins under it.
    parts : int
        Points a pitch.
    position : ndarray (m, 2)
        Points in plan, m.
    height, former : ndarray (m,)
        The skin, and the skin as it was before, m.
    rows, columns : int
        Of points.
    """

    formed: Formed
    parts: int
    position: Floats
    height: Floats
    former: Floats
    rows: int
    columns: int

    @cached_property
    def faces(self) -> Indices:
        """Triangles of the skin, counter-clockwise seen from above."""
        return make_skin(self.position, self.height, self.rows, self.columns)

    @property
    def raised(self) -> Floats:
        """How far each point is above where it was before, m."""
        return self.height - self.former

    @property
    def pins(self) -> Indices:
        """Which point each pin top is, shape (n,)."""
        index = np.arange(self.rows * self.columns, dtype=np.int32).reshape(self.rows, self.columns)
        return index[:: self.parts, :: self.parts].ravel()

    def nearest(self, of_pins: NDArray[Any]) -> NDArray[Any]:
        """Return at each point what is known of the nearest pin."""
        near: NDArray[Any] = of_pins[find_nearest_pin(self.formed, self.parts)]
        return near

    def values(self) -> dict[str, NDArray[np.float64]]:
        """Return height, force and mode at each point: force straight between pins, mode of the nearest."""
        force = interpolate_skin(self.formed, self.formed.force, "bilinear", self.parts, 0.0)
        mode = self.nearest(self.formed.mode).astype(np.float64)
        return {"height": self.height, "force": force, "mode": mode}

    def values_with_base(self, level: float) -> dict[str, NDArray[np.float64]]:
        """Return the same, and after it that of as many points of a base: no force, and no pin's mode."""
        base = {"height": level, "force": 0.0, "mode": float(NO_PIN)}
        count = self.height.size
        return {
            name: np.concatenate([value, np.full(count, base[name])]) for name, value in self.values().items()
        }


def fit_skin(formed: Formed, skin_name: str, parts: int, cap: float) -> SurfaceGrid:
    """Return the skin over formed pins.

    `skin_name`: a key of `skins.SKINS`; `parts`: points a pitch; with 1 every skin is the triangles between
    the pins; `cap`: radius of a pin's flat end, m; of use to the membrane only.
    """
    position = place_points(formed, parts)
    rows, columns = position.shape[:2]
    now, before = (
        interpolate_skin(formed, pins, skin_name, parts, cap) for pins in (formed.height, formed.former)
    )
    return SurfaceGrid(formed, parts, position.reshape(-1, 2), now, before, rows, columns)
