"""Runs of a batch side by side: each is a column of one set of arrays.

Equal parts are shared; a number that differs between runs becomes an array with one entry per run.
A control period therefore takes as many numpy calls as that of a single run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.arrays import Cells, Flags, Floats
from ..control.side_by_side import join_controllers, merge_parts, merge_values
from ..engine.active_set import Selection
from ..engine.hand_steps import HandStep, rest_hands
from ..engine.state import ActiveSet, State, make_initial_state
from ..engine.system import System
from ..model.interfaces import Movement
from ..model.layout import Discs, join_discs
from ..model.touch import FingerPeriod


class PaddedSelection(Selection):
    """Selection of the active cells of all runs, renewed for all as soon as one run needs it.

    All runs have as many cells as the largest set. Those that fill up a smaller one are idle: to
    integrate them changes nothing.
    """

    margin_pitches = 0.5
    larger, smaller = np.maximum, np.minimum

    def join(self, control: Any) -> Discs | None:
        """Return the controlled discs as arrays."""
        return join_discs(control)

    def pick(
        self, active: ActiveSet, moving: Flags, reach: Discs | None, control: Discs | None
    ) -> tuple[Cells, int]:
        """Return the active cells (w, b), near ones first, and the number of near ones; see `Selection`."""
        wanted = np.zeros((self.grid.count, moving.shape[1]), np.bool_)
        near = np.broadcast_to(self.grid.covered(reach), wanted.shape)
        wanted.reshape(-1)[active.flat] = moving
        wanted |= self.grid.covered(control)
        rank = 2 - near.astype(np.int8)
        rank -= near | wanted
        order = np.argsort(rank.T, axis=1, kind="stable").T
        count, width = (int(np.count_nonzero(some, axis=0).max()) for some in (near, rank < 2))
        return np.ascontiguousarray(order[:width]), count


@dataclass(frozen=True, eq=False)
class OwnSelection(Selection):
    """Selection of the cells that each run has active when alone, for methods that depend on the set.

    Idle cells fill up the smaller sets; they are neither measured nor commanded.
    """

    runs: tuple[Selection, ...]
    """Selection of each run."""

    def update(self, state: State, finger: FingerPeriod | None, control: Any) -> State:
        """Return a state whose active cells are those of each run; see `Selection.update`."""
        active, period, count = state.active, state.period, len(self.runs)
        # Before the first period there are no sets: empty ones are due.
        sets = list(active.runs or [replace(active, cells=np.empty(0, np.intp))] * count)
        windows = (
            np.broadcast_to(finger.window, (6, count)).T.tolist() if finger else [None] * count
        )
        discs = control or [None] * count
        due = [
            run
            for run, selection in enumerate(self.runs)
            if not selection.serves(sets[run], period, windows[run], discs[run])
        ]
        if period < active.until and not due:
            return state
        moving, peak = self.release(state), state.peak.copy()
        for run in due:
            size = sets[run].cells.size
            top = float(active.block[0, :size, run].max(initial=peak[run]))
            peak[run], still = top, moving[:size, run]
            sets[run] = self.runs[run].choose(
                sets[run], period, windows[run], discs[run], still, top
            )
        near, until = max(part.near for part in sets), min(part.until for part in sets)
        cells = _pad(sets, self.grid.count)
        chosen = replace(active, cells=cells, near=near, until=until, runs=tuple(sets))
        return state._replace(peak=peak, active=self.take(state, chosen))


def _pad(sets: Sequence[ActiveSet], count: int) -> Cells:
    """Return the cells (w, b) of all sets, filled up with other cells of the bed, which has `count`."""
    width = max(part.cells.size for part in sets)
    columns = []
    for part in sets:
        others = np.delete(np.arange(count), part.cells)
        columns.append(np.concatenate([part.cells, others])[:width])
    return np.stack(columns, axis=-1)


#: Cells moved at a time: they fit into the cache of a core, and their matrix products run on one
#: core, since to wake a second one takes longer than the product.
PIECE = 2048


#: Cells out of the fingertips' reach are moved in multiples of this number, so that workspaces of
#: few sizes serve for any number.
GROUP = 8


class BatchMovement:
    """Moves one set of cells of b runs, period by period; see `interfaces.Stepper.prepare`."""

    def __init__(self, batch: Batch, rows: Floats, near: int) -> None:
        self._stepper, self._plan = stepper, plan = batch.stepper, batch.plan
        # If the cells of all runs are alike, they are moved as those of one large bed.
        self._alike = alike = plan is batch.systems[0].plan
        # A pin without a fingertip is moved by its valve: the rows of openings and commands.
        self._rows, self._near, self._valves = rows, near, rows[batch.cell.lag_rows.start :, near:]
        beds = self._beds(rows)
        count = near * rows.shape[2] if alike else near
        parts = _pieces(count, 1 if alike else rows.shape[2])
        self._touched = [
            (part, stepper.prepare(plan, beds[:, part], part.stop - part.start)) for part in parts
        ]
        self._others: dict[int, tuple[Floats, Movement]] = {}

    def _beds(self, values: Floats) -> Floats:
        """Return values (r, n, b) for the stepper: (r, n b) if all cells are alike."""
        return values.reshape(len(values), -1) if self._alike else values

    def __call__(self, under: Floats) -> Floats:
        """Move the cells by one control period, in place; return the force on the near ones, (k, b), N."""
        force = np.empty((1, *under.shape[1:]))
        forces, undersides = self._beds(force)[0], self._beds(under)
        for part, move in self._touched:
            forces[part] = move(undersides[:, part])
        # Beyond the fingertips a pin with a shut valve and no queued command rests: squares sum to
        # 0.
        awake = self._near + np.flatnonzero(np.einsum("rwb,rwb->w", self._valves, self._valves))
        for part in _pieces(awake.size, force.shape[2]):
            self._move_others(awake[part], under[:, :0])
        return force[0]

    def _move_others(self, cells: Any, none: Floats) -> None:
        """Move cells out of the fingertips' reach, the same ones in all runs."""
        size = -(-cells.size // GROUP) * GROUP
        if size not in self._others:
            rows = np.zeros((len(self._rows), size, self._rows.shape[2]))
            self._others[size] = rows, self._stepper.prepare(self._plan, self._beds(rows), 0)
        rows, move = self._others[size]
        rows[:, : cells.size] = self._rows[:, cells]
        move(self._beds(none))
        self._rows[:, cells] = rows[:, : cells.size]


def _pieces(count: int, runs: int) -> Iterator[slice]:
    """Cut cells of all runs into pieces of about equal size, each at most `PIECE` over all runs."""
    pieces = -(-count * runs // PIECE)
    for i in range(pieces):
        yield slice(count * i // pieces, count * (i + 1) // pieces)


@dataclass(frozen=True, eq=False)
class Batch(System):
    """Parts and constants of b runs on one layout."""

    systems: tuple[System, ...]
    """System of each run."""

    def prepare(self, active: ActiveSet) -> BatchMovement:
        """Return the movement of an active set of all runs."""
        return BatchMovement(self, active.driven, active.near)


def begin(batch: Batch) -> State:
    """Return the state before the sessions."""
    memory = [system.controller.begin() for system in batch.systems]
    heights = np.array([system.cell.actuator.rest_height for system in batch.systems], np.float64)
    state = make_initial_state(batch.rows, batch.grid.count, heights, memory)
    return state._replace(deflection=rest_hands(batch.hands))


def make_batch(systems: Sequence[System]) -> Batch:
    """Return the batch of systems of one structure."""
    first, cell = systems[0], merge_parts([system.cell for system in systems])
    period, fastest = np.array(
        [(system.period, system.fastest) for system in systems], np.float64
    ).T
    common = first.grid, first.rows, cell, period, fastest
    selections = tuple(system.selection for system in systems)
    steps = zip(*(system.hands for system in systems), strict=True)
    return Batch(
        grid=first.grid,
        cell=cell,
        sensors=merge_values([system.sensors for system in systems]),
        controller=join_controllers([system.controller for system in systems], by_set=first.by_set),
        drive=first.drive,
        stepper=first.stepper,
        plan=merge_parts([system.plan for system in systems]),
        period=period,
        fastest=fastest,
        selection=OwnSelection(*common, selections) if first.by_set else PaddedSelection(*common),
        instants=first.instants,
        rows=first.rows,
        by_set=first.by_set,
        latency=first.latency,
        height_floor=first.height_floor,
        hands=tuple(_join_steps(alike) for alike in steps),
        systems=tuple(systems),
    )


def _join_steps(steps: Sequence[HandStep]) -> HandStep:
    """Return a step of the hands of all runs."""
    constants = zip(*(step.swing for step in steps), strict=True)
    swing = type(steps[0].swing)(*map(np.concatenate, constants))
    return replace(steps[0], system=make_batch([step.system for step in steps]), swing=swing)
