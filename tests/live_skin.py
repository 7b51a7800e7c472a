"""Heights of the live skin by numpy, to compare with those of Blender's geometry nodes."""

import numpy as np


def interpolate(lattice, height, kind):
    """Return the heights of a skin, as the geometry nodes of a bed work them out, m."""
    for step in (lattice.along, lattice.across):
        before, after = height - height[step.previous], height[step.following] - height
        value, weights = (
            np.column_stack([height, before + after, after - before]),
            step.weights[kind],
        )
        height = (value[step.low] * weights.low + value[step.high] * weights.high).sum(axis=1)
    return height
