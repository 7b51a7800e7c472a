"""Measurements of cells, for tests of one control period."""

import numpy as np
from digiclay.core.base.modes import Mode
from digiclay.core.model.control_interface import Measurement

from tests.assemble import make_basis


def measure(x, y, force=0.0, height=40e-3, mode=Mode.REST, rows=0):
    """Return a measurement of cells at places, m, at their commanded heights, m, under forces, N.

    `rows`: number of the controller's state rows, all 0.
    """
    heights, command = np.full(x.size, height), np.zeros(x.size)
    return Measurement(
        make_basis(x, y),
        heights,
        np.full(x.size, force),
        heights.copy(),
        np.full(x.size, mode, np.int8),
        np.zeros((rows, x.size)),
        np.arange(x.size),
        command,
    )
