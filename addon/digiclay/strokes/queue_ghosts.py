"""Ghosts of a queue of strokes: the nominal surface of each on what those before it leave. No Blender."""

from dataclasses import dataclass, replace

import numpy as np

from ..core.base.arrays import Floats
from .nominal import LIMITS, Device, Nominal, extend, find_nominal
from .stroke import Brush, Stroke

#: Pins come so near to what was expected of the stroke before, m, that the ghosts of those after it
#: stay.
SAME = 0.05e-3


@dataclass(frozen=True, eq=False)
class Ghost:
    """Stroke of a queue, and the nominal surface of it as far as it was drawn."""

    stroke: Stroke
    nominal: Nominal
    #: What it was found with.
    device: Device

    def has_grown(self, stroke: Stroke, before: Floats, device: Device) -> bool:
        """Tell whether the stroke of its number, on pins at heights (n,), m, is this one drawn on."""
        former, last = self.stroke, slice(self.nominal.count - 1, self.nominal.count)
        return (
            former.images == stroke.images
            and former.turn is stroke.turn
            and former.samples[last] == stroke.samples[last]
            and np.array_equal(self.device.shares, device.shares)
            and _is_near(self.nominal.before, before)
            and (not stroke.from_base or _is_near(self.device.base, device.base))
        )


def _is_near(former: Floats | None, now: Floats | None) -> bool:
    """Tell whether heights (n,), m, are as they were, but for less than what ghosts show."""
    if former is None or now is None:
        return former is now
    return float(np.abs(former - now).max()) < SAME


def find_ghosts(
    strokes: tuple[Stroke, ...], device: Device, height: Floats, former: tuple[Ghost, ...] = ()
) -> tuple[Ghost, ...]:
    """Return the ghosts of a queue's strokes that have one, on pins at heights (n,), m.

    The `former` ones, of an earlier look, are drawn on: that takes less time than a whole path.
    """
    ghosts, numbered = list[Ghost](), {ghost.stroke.number: ghost for ghost in former}
    for stroke in strokes:
        if stroke.brush is Brush.SET_BASE:
            device = replace(device, base=height)
        if stroke.brush in LIMITS or stroke.placed:
            before = height if stroke.height is None else stroke.height
            suited, ghost = device.suit(stroke), numbered.get(stroke.number)
            if ghost is None or not ghost.has_grown(stroke, before, device):
                ghost = Ghost(stroke, find_nominal(stroke, suited, before), device)
            nominal = ghost.nominal
            if nominal.count < len(stroke.samples):
                nominal = extend(nominal, stroke, suited)
            ghosts.append(replace(ghost, stroke=stroke, nominal=nominal))
            height = nominal.height
    return tuple(ghosts)
