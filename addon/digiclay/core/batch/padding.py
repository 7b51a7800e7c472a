"""Active set of a batch: `core.engine.active_set` with an axis for the runs.

The set is made anew for all runs together, as soon as it no longer does for one of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.arrays import Cells, Flags, Floats
from ..engine.active_set import KEPT, Selection
from ..engine.state import ActiveSet, State
from ..model.layout import Grid

#: A disc of every bed: x, y and radius, (b,) each, m; a radius below 0 means no cells.
Disc = tuple[Floats, Floats, Floats]
NO_DISC: Disc = (np.zeros(1), np.zeros(1), np.full(1, -1.0))
#: How much farther than it must the set goes, in pitches, so that it does for some periods.
MARGIN = 0.5


def compute_reach(window: Floats, peak: Floats) -> Disc:
    """Return the discs beyond which no finger touches a pin.

    `window` (6, b) or (6, 1), see `touch.Window`; `peak` (b,), no pin top is higher than this, m; see
    `fingertip.compute_reach`.
    """
    x, y, spread, base, tilt, bend = window
    square = tilt * tilt + 2.0 * bend * (peak - base)
    radius = (tilt + np.sqrt(np.maximum(square, 0.0))) / bend + spread
    return x, y, np.where(square > 0.0, radius, -1.0)


class PaddedSelection(Selection):
    """Selection of the active cells of many sessions, as many of each.

    Where fewer are active than in another run, others make up the number. They could as well be
    left out, so it does no harm that they are not.
    """

    def update(self, state: State, finger: Any, control: Any) -> State:
        """Return a state whose active cells are all that can change in the coming period.

        `state`: its arrays are used up; `finger` fingers.FingersPeriod or None; `control` (float, float,
        float), disc x, y, radius that each controller will command, m.
        """
        held, grid, discs = state.active, self.grid, join_discs(control)
        near = NO_DISC if finger is None else compute_reach(finger.window, held.peak)
        if state.period < held.until and _inside(near, held.reach) and _inside(discs, held.control):
            return state
        wanted = np.zeros(state.modes.shape, np.bool_)
        wanted.reshape(-1)[held.flat] = self.release(state)
        top = state.rows[0].max(axis=0)
        peak = np.minimum(top + KEPT * (self.period * self.fastest), self.cell.actuator.stroke)
        margin = MARGIN * grid.layout.pitch
        near = _wider(NO_DISC if finger is None else compute_reach(finger.window, peak), margin)
        discs = _wider(discs, margin)
        wanted |= _cells(grid, discs)
        cells, count = _ordered(np.broadcast_to(_cells(grid, near), wanted.shape), wanted)
        chosen = replace(
            held,
            cells=cells,
            near=count,
            quadratic_basis=grid.compute_basis(cells.ravel()).reshape(6, *cells.shape),
            reach=near,
            control=discs,
            peak=peak,
            until=state.period + KEPT,
        )
        return state._replace(peak=top, active=self.take(state, chosen))


@dataclass(frozen=True, eq=False)
class OwnSelection(Selection):
    """Selection of the cells that are active in each session alone, for sessions that depend on them.

    Where fewer are active than in another run, others make up the number; of these nothing is measured
    and nothing is commanded.

    Attributes
    ----------
    runs : tuple of Selection
        The sessions' own.
    """

    runs: tuple[Selection, ...]

    def update(self, state: State, finger: Any, control: Any) -> State:
        """Return a state whose active cells are those of each session; see `PaddedSelection.update`."""
        held, period, runs = state.active, state.period, range(len(self.runs))
        # Before the first period there are no sets; those are as good as outlived.
        own = list(held.own or (replace(held, cells=np.empty(0, np.intp)) for _ in runs))
        windows = _split_window(finger, len(runs))
        discs = control or [None for _ in runs]
        due = [run for run in runs if not self.runs[run].holds(own[run], period, windows[run], discs[run])]
        if period < held.until and not due:
            return state
        busy, peak = self.release(state), state.peak.copy()
        for run in due:
            cells = own[run].cells
            heights, moving = held.block[0, : cells.size, run], cells[busy[: cells.size, run]]
            top = peak[run] = max([float(peak[run]), *heights.tolist()])
            own[run] = self.runs[run].choose(own[run], period, windows[run], discs[run], moving, top)
        cells = _pad(own, self.grid.count)
        chosen = replace(
            held,
            cells=cells,
            near=max(one.near for one in own),
            quadratic_basis=self.grid.compute_basis(cells.ravel()).reshape(6, *cells.shape),
            until=min(one.until for one in own),
            own=tuple(own),
        )
        return state._replace(peak=peak, active=self.take(state, chosen))


def _split_window(finger: Any, runs: int) -> list[Any]:
    """Return each run's own `touch.Window`; None where there is no finger."""
    if finger is None:
        return [None] * runs
    return [tuple(window) for window in np.broadcast_to(finger.window, (6, runs)).T.tolist()]


def _pad(own: Sequence[ActiveSet], count: int) -> Cells:
    """Return the cells (w, b) of all sets, with as many others of the `count` behind them as it takes."""
    width = max(one.cells.size for one in own)
    others = np.ones((len(own), count), np.bool_)
    columns = []
    for one, free in zip(own, others, strict=True):
        free[one.cells] = False
        columns.append(np.concatenate([one.cells, np.flatnonzero(free)[: width - one.cells.size]]))
    return np.stack(columns, axis=-1)


def join_discs(discs: Sequence[tuple[float, float, float] | None] | None) -> Disc:
    """Return the discs x, y, radius of all runs, m, as arrays (b,); a negative radius where there is none."""
    if discs is None:
        return NO_DISC
    x, y, radius = zip(*((0.0, 0.0, -1.0) if disc is None else disc for disc in discs), strict=True)
    return np.array(x), np.array(y), np.array(radius)


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
