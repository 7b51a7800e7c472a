"""Beds with a relief of pins that stand still, and strokes that smooth it, for tests."""

import numpy as np
from digiclay.core.base.modes import Mode
from digiclay.core.control.exchange import make_exchange
from digiclay.core.control.orders import ORDER, Orders, Verb
from digiclay.core.engine.simulation import begin
from digiclay.core.model.fingertip import LEVEL


def make_spike_and_ridge(grid):
    """Return a relief over the bed at rest, (n,), m: a pin 10 mm high, and a ridge of 6 mm beside it."""
    relief = 6e-3 * np.exp(-(((grid.y + 9e-3) / 4e-3) ** 2))
    relief[grid.at(np.array([0.0]), np.array([0.0]))] += 10e-3
    return relief


def heighten(system, relief):
    """Return the state of a bed whose pins stand still at a relief (n,), m above rest."""
    state = begin(system)
    height = system.cell.actuator.rest_height + relief
    state.rows[0] = state.rows[system.rows.target] = height
    state.modes[:] = np.where(np.abs(relief) > 1e-6, Mode.HOLD, Mode.REST)
    return state._replace(peak=float(height.max()))


def make_orders(
    periods,
    start,
    end,
    y,
    radius,
    settle=60,
    verb=Verb.AVERAGE,
):
    """Return the orders of a stroke along a row, m, at full strength, and of a wait (control periods)."""
    rows = np.zeros((periods + settle, ORDER))
    rows[:periods, 0] = np.linspace(start, end, periods)
    rows[periods:, 0] = end
    rows[:, 1:3], rows[:periods, 3], rows[:, 4] = (y, radius), 1.0, verb
    return Orders(rows)


def stay_away(periods):
    """Return the path of a finger that meets nothing, (t + 1, 1, 7)."""
    return np.tile([0.0, 0.0, 0.2, *LEVEL], (periods + 1, 1, 1))


def measure_roughness(grid, height):
    """Return the rms of how far the pins are off the mean of their neighbors, m; exact but for a factor."""
    cells = np.arange(grid.count)
    # Ten times what the exchange of so short a time moves.
    off = make_exchange(grid, 1e-6, 1e-3).even_out(cells, height) - height
    return float(np.sqrt(np.mean(off**2)))
