"""Ring buffer of a live session: total force, set point, and heights of picked pins."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Floats
from ..base.modes import FORCE_FOLLOW
from ..engine.state import State
from ..engine.system import System
from ..model.control_interface import SetPoint, find_set_point
from ..model.touch import MOST_FORCE, MOST_INDENTATION, find_indentations, is_beyond

#: Most pins whose heights are traced.
PICKED = 6
#: Duration of a trace, s, and its most rows.
SPAN, ROWS = 10.0, 1000


@dataclass(frozen=True, eq=False)
class RecentTrace:
    """Ring buffer of rows: a new row replaces the oldest."""

    every: int
    """Control periods per row."""
    pins: tuple[int, ...]
    """The picked pins, at most `PICKED`."""
    rows: Floats
    """(k, 3 + PICKED + f): Time, s; total force, N; set point, N, or NaN; heights of the picked pins, m, NaN
    for the rest; the forces of several fingers, N. Oldest first."""

    @property
    def time(self) -> Floats:
        """Simulated time of the rows, shape (k,), s."""
        return self.rows[:, 0]

    @property
    def force(self) -> Floats:
        """Total force, shape (k,), N."""
        return self.rows[:, 1]

    @property
    def set_point(self) -> Floats:
        """Set point, shape (k,), N; NaN without one."""
        return self.rows[:, 2]

    @property
    def finger_forces(self) -> Floats:
        """Forces of several fingers, shape (k, f), N; (k, 0) of one."""
        return self.rows[:, 3 + PICKED :]

    @property
    def heights(self) -> Floats:
        """Heights of the picked pins, shape (k, number of pins), m."""
        return self.rows[:, 3 : 3 + len(self.pins)]


def start(period: float, pins: Sequence[int] = (), fingers: int = 1) -> RecentTrace:
    """Return an empty trace; `period`: control period, s; `pins`: whose heights are traced."""
    rows = np.empty((0, 3 + PICKED + (fingers if fingers > 1 else 0)))
    return RecentTrace(max(1, math.ceil(SPAN / period / ROWS)), tuple(pins[:PICKED]), rows)


def pick(trace: RecentTrace, pins: Sequence[int], count: int) -> RecentTrace:
    """Return a trace of other pins, without those that a bed of `count` cells lacks."""
    picked = tuple(pin for pin in pins if 0 <= pin < count)[:PICKED]
    if picked == trace.pins:
        return trace
    rows = trace.rows.copy()
    rows[:, 3 : 3 + PICKED] = np.nan
    for column, pin in enumerate(picked):
        if pin in trace.pins:
            rows[:, 3 + column] = trace.rows[:, 3 + trace.pins.index(pin)]
    return replace(trace, pins=picked, rows=rows)


def measure_total_force(system: System, state: State) -> float:
    """Return the total force on the bed, N."""
    active = state.active
    return float(active.block[system.rows.force, : active.near].sum())


def exceeds_law(system: System, state: State, pose: Floats) -> bool:
    """Return whether a fingertip at a pose (7,) exceeds the range of the contact law, `touch.is_beyond`.

    Of several fingertips only the forces are tested, not the indentations.
    """
    if system.cell.touch is None:
        return False
    if system.fingers > 1:
        return bool(state.finger_forces().max() > MOST_FORCE)
    near, fingertip = state.active.touched, system.cell.touch.fingertip
    force, felt = near.force.sum(), near.force > 0.0
    if force > MOST_FORCE:
        return True
    # Two cheap bounds: the fingertip is above its lowest point, and within a ball that touches it
    # there.
    depth = near.height[felt] - pose[2]
    if depth.max(initial=0.0) > MOST_INDENTATION:
        aside = near.quadratic_basis[1:3, felt].T - pose[:2]
        depth -= (aside**2).sum(axis=1) / (2.0 * fingertip.flattest)
    if depth.max(initial=0.0) <= MOST_INDENTATION:
        return False
    row = {"height": near.height[None], "force": near.force[None], "fingertip": pose[None]}
    row["position"] = system.grid.positions[near.cells]
    return bool(np.any(is_beyond(force, find_indentations(fingertip, row))))


def sample(
    system: System, state: State, set_point: SetPoint | None, pins: Sequence[int]
) -> list[float]:
    """Return a row of a trace for a state; `pins`: whose heights are traced."""
    active = state.active
    heights = [math.nan] * PICKED
    for column, pin in enumerate(pins):
        (at,) = np.nonzero(active.cells == pin)
        heights[column] = float(active.block[0, at[0]] if at.size else state.rows[0, pin])
    wanted = find_set_point(set_point, np.count_nonzero(active.mode == FORCE_FOLLOW))
    row = [
        state.period * system.period,
        measure_total_force(system, state),
        float(wanted),
        *heights,
    ]
    return [*row, *state.finger_forces().tolist()] if system.fingers > 1 else row


def extend(trace: RecentTrace, rows: list[list[float]]) -> RecentTrace:
    """Return the trace with rows of `sample` added; time may have gone back before them."""
    if not rows:
        return trace
    new = np.array(rows)
    old = trace.rows[trace.rows[:, 0] < new[0, 0]]
    return replace(trace, rows=np.concatenate([old, new])[-ROWS:])
