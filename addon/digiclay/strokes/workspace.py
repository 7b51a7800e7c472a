"""Heights of the fingertip over the pins at a place of its path. No Blender."""

from dataclasses import dataclass, replace

import numpy as np

from ..core.model.fingertip import Fingertip
from .nominal import Device, find_undersides
from .stroke import Brush, Stroke

#: How much wider than it is the fingertip is taken to be beside pins that are locked.
WIDER = 1.2


@dataclass(frozen=True, eq=False)
class Workspace:
    """Device, control period, s, and height above all pins, m, for a fingertip on its path."""

    device: Device
    period: float
    safe: float

    def find_touch(self, stroke: Stroke, x: float, y: float) -> float:
        """Return how high a fingertip is that descends at a place and first touches a pin, m."""
        # On a slope it touches the pins beside it first, several millimeters above the surface
        # below it.
        assert stroke.standing is not None
        grid, finger = self.device.grid, self.device.finger
        cells = grid.disc(x, y, finger.width)
        square = ((grid.x[cells] - x) ** 2 + (grid.y[cells] - y) ** 2) / finger.width**2
        gap = finger.height * (1.0 - np.sqrt(np.maximum(1.0 - square, 0.0)))
        surface = self.device.find_surface(stroke.standing, x, y)
        return max(surface, float((stroke.standing[cells] - gap).max(initial=0.0)))

    def pass_over_locked(self, stroke: Stroke, x: float, y: float, z: float) -> float:
        """Return a height of the fingertip, m, at which it presses into no locked pin."""
        locked, tip = self.device.locked, self.device.finger
        if locked is None:
            return z
        assert stroke.height is not None
        # A wider one comes up before its side is at a pin that is higher than its middle.
        wide = Fingertip(WIDER * tip.length, WIDER * tip.width, tip.height)
        cells = self.device.grid.disc(x, y, max(wide.length, wide.width))
        cells = cells[locked[cells]]
        sample, image = stroke.samples[stroke.reached], stroke.images[stroke.image]
        under = find_undersides(
            replace(self.device, finger=wide), stroke, image, sample.lean, (x, y), cells
        )
        return max(z, float((stroke.height[cells] - under).max(initial=z)))

    def find_lowest(self, stroke: Stroke, x: float, y: float) -> float:
        """Return how low the fingertip is to be at a place of its path, m."""
        assert stroke.ground is not None
        assert stroke.height is not None
        level = self.device.find_level(stroke, stroke.images[stroke.image], stroke.height)
        top = self.device.find_top(
            stroke, stroke.samples[stroke.reached], (x, y), stroke.ground, level
        )
        # Where the surface is beyond what the stroke forms it goes along on that.
        surface = self.device.find_surface(stroke.ground, x, y)
        low, high = self.device.find_limits(stroke)
        top = min(max(top, min(surface, low)), max(surface, high))
        if stroke.brush is Brush.RAISE and stroke.standing is not None:
            # It rides over what an image before has raised higher.
            top = max(top, self.find_touch(stroke, x, y))
        lowest = max(0.0, top - stroke.tracking.sink) if stroke.tracking else top
        return self.pass_over_locked(stroke, x, y, lowest)
