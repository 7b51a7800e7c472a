"""Active set of a batch: `core.engine.active_set` with an axis for the runs.

The set is made anew for all runs together, as soon as it no longer does for one of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..base.modes import Mode
from ..engine.state import Rows
from ..model.layout import Grid
from ..model.physics import Cell
from .beds import NO_DISC, Beds, Cells, Disc, Gathered
from .broadcasting import Floats

__all__ = ["Gathering", "reach", "taken_along", "taking_part"]

Flags = NDArray[np.bool_]
#: Control periods after which the set is made anew, without the cells that have come to rest.
KEPT = 32
#: How much farther than it must the set goes, in pitches, so that it does for some periods.
MARGIN = 0.5


@dataclass(frozen=True, eq=False)
class Gathering:
    """Criteria of active cells.

    Attributes
    ----------
    grid : Grid
    rows : Rows
    cell : Cell
    period : ndarray (b,)
        Control period, s.
    rise : ndarray (b,)
        No pin rises farther in a period, m.
    """

    grid: Grid
    rows: Rows
    cell: Cell
    period: Floats
    rise: Floats


def reach(window: Floats, peak: Floats) -> Disc:
    """Return the discs beyond which no finger touches a pin.

    Parameters
    ----------
    window : ndarray (6, b) or (6, 1)
        See `touch.Window`.
    peak : ndarray (b,)
        No pin top is higher than this, m; see `fingertip.reach`.
    """
    x, y, spread, base, tilt, bend = window
    square = tilt * tilt + 2.0 * bend * (peak - base)
    radius = (tilt + np.sqrt(np.maximum(square, 0.0))) / bend + spread
    return x, y, np.where(square > 0.0, radius, -1.0)


def taking_part(known: Gathering, beds: Beds, window: Floats | None, control: Disc) -> Gathered:
    """Return the cells that can change in the coming period, taken out of the beds.

    Parameters
    ----------
    known : Gathering
    beds : Beds
        Its arrays are used up.
    window : ndarray (6, b) or (6, 1), or None
        Of the fingers' ways through the period.
    control : Disc
        What the controllers will command.
    """
    held, grid = beds.gathered, known.grid
    near = NO_DISC if window is None else reach(window, held.peak)
    if beds.period < held.until and _inside(near, held.reach) and _inside(control, held.control):
        return held
    moving = _put_back(known, beds)
    peak = np.minimum(beds.rows[0].max(axis=0) + KEPT * known.rise, known.cell.actuator.stroke)
    margin = MARGIN * grid.layout.pitch
    near = _wider(NO_DISC if window is None else reach(window, peak), margin)
    control = _wider(control, margin)
    touched, wanted = _cells(grid, near), moving
    wanted |= _cells(grid, control)
    cells, count = _ordered(np.broadcast_to(touched, wanted.shape), wanted)
    place = grid.place(cells.ravel()).reshape(6, *cells.shape)
    return _taken(
        known,
        beds,
        Gathered(cells, count, held.block, held.mode, place, near, control, peak, beds.period + KEPT),
    )


def taken_along(known: Gathering, beds: Beds, chosen: Gathered) -> Gathered:
    """Return the cells that other beds have chosen, taken out of these; their arrays are used up.

    Parameters
    ----------
    known : Gathering
    beds : Beds
    chosen : Gathered
        Of the other beds.
    """
    _put_back(known, beds)
    return _taken(known, beds, chosen)


def _taken(known: Gathering, beds: Beds, chosen: Gathered) -> Gathered:
    """Return a set with the rows and modes that these beds have there; the pulp over it is aged."""
    near, taken = chosen.near, chosen.flat
    block = beds.rows.reshape(known.rows.count, -1).take(taken, axis=1)
    block[known.rows.force, near:] = 0.0
    if near and known.cell.touch:
        waited = beds.period * known.period - beds.aged.take(taken[:near])
        known.cell.touch.pulp.age(block[known.cell.pulp_rows, :near], waited)
    return replace(chosen, block=block, mode=beds.modes.take(taken))


def _put_back(known: Gathering, beds: Beds) -> Flags:
    """Put the gathered cells back; return which cells still move, shape (n, b)."""
    held, taken, cell = beds.gathered, beds.gathered.flat, known.cell
    cell.lag.settle(held.block[cell.lag_rows])
    beds.rows.reshape(known.rows.count, -1)[:, taken] = held.block
    beds.modes.reshape(-1)[taken] = held.mode
    beds.aged.reshape(-1)[taken[: held.near]] = beds.period * known.period
    busy = held.block[cell.lag_rows.start : known.rows.target].any(axis=0)
    busy |= held.block[known.rows.force] > 0.0
    busy |= held.mode > Mode.HOLD
    moving = np.zeros(beds.modes.shape, np.bool_)
    moving.reshape(-1)[taken] = busy
    return moving


def _ordered(touched: Flags, wanted: Flags) -> tuple[Cells, int]:
    """Return the active cells (w, b), the touched ones first, and the number of touched ones."""
    rank = 2 - touched.astype(np.int8)
    rank -= touched | wanted
    order = np.argsort(rank.T, axis=1, kind="stable").T
    near = int(np.count_nonzero(touched, axis=0).max())
    return np.ascontiguousarray(order[: int(np.count_nonzero(rank < 2, axis=0).max())]), near


def _cells(grid: Grid, disc: Disc) -> Flags:
    """Return which cells are in the discs, shape (n, b)."""
    x, y, radius = disc
    square = (grid.x[:, None] - x) ** 2
    square += (grid.y[:, None] - y) ** 2
    return square <= np.where(radius < 0.0, -1.0, radius * radius)


def _wider(disc: Disc, margin: float) -> Disc:
    """Return discs with a larger radius; where there is none, none."""
    x, y, radius = disc
    return x, y, np.where(radius < 0.0, -1.0, radius + margin)


def _inside(inner: Disc, outer: Disc) -> bool:
    """Return whether every disc lies inside that other."""
    (x, y, radius), (other_x, other_y, limit) = inner, outer
    held = np.hypot(x - other_x, y - other_y) + radius <= limit
    held |= radius < 0.0
    return bool(held.all())
