"""Heights ahead of a moving blister, and around one at rest, such that pins arrive in time.

A pin d ahead of the level part must already stand at ``top - d v_free / v`` for a finger at speed v, or it
would block it. Around a finger at rest the same holds for the speed of the drags to be expected: the skirt.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import Floats

#: A finger slower than this has no direction, m/s.
SLOWEST = 1e-3
#: Slope where pins are not led: it puts them below every surface.
STEEP = 1e9


@dataclass(frozen=True)
class LeadProfile:
    """Slopes of the heights around the finger.

    Attributes
    ----------
    level : float
        Radius within which pins are level with the top, m.
    rise, fall : float
        Speeds of free pins that are counted on, m/s.
    skirt : float
        Speed of the drags expected from rest, m/s; 0: no skirt.
    """

    level: float
    rise: float
    fall: float
    skirt: float

    def find_reach(self, height: float, speed: float) -> float:
        """Return the radius within which pins may be led, m.

        `height`: of the top over the surface around, m; negative below; `speed`: of the finger in the plane,
        m/s.
        """
        quickest = max(speed, self.skirt)
        return self.level + abs(height) * quickest / (self.rise if height > 0.0 else self.fall)

    def find_drop(self, distance: Floats, ahead: Floats, speed: float, *, raised: bool) -> Floats:
        """Return how far below the top (above it, in a valley) pins may stand at most, (m,), m.

        `distance` (m,), from the finger, m; `ahead` (m,), how far ahead of it, m; `speed`: of the finger in
        the plane, m/s; `raised`: whether the top is above the surface around it.
        """
        free = self.rise if raised else self.fall
        around = free / self.skirt if self.skirt else STEEP
        forward = free / speed if speed >= SLOWEST else STEEP
        drop: Floats = distance - self.level
        np.maximum(drop, 0.0, out=drop)
        drop *= np.where(ahead > 0.0, forward, around) if forward < around else around
        return drop
