"""The closed-form step where the cells' numbers differ from run to run: `steppers.bernoulli`, run by run.

See there for what it does and why it holds. A linear map (o, i) is one of (o, i, b) here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..model.contact import LARGEST_EXPONENT
from ..model.physics import Cell
from ..steppers.bernoulli_plan import MOST_BOW, BernoulliPlan
from ..steppers.closed_form import TINY, crossed, pressed
from ..steppers.near_overflow import Strain, loaded_way
from .broadcasting import Floats, mapped, numbers

__all__ = ["Unlike", "unlike"]


@dataclass(frozen=True, eq=False)
class Unlike:
    """Closed-form step for b runs; see also `steppers.bernoulli_plan`.

    Attributes
    ----------
    cell : Cell
        Of all runs.
    response, path : ndarray (.., b), or without the last axis where all runs have the same
    moves : tuple of ndarray (4, 2 g, b)
        One a step, from its own Gauss points alone.
    nodes : tuple of slice
    weights : ndarray (g, 1, b)
        Divided by the area, s/m².
    lost : tuple of ndarray (1, k + 1, b)
    transition : tuple of ndarray (k + 1, k + 3, b)
    shares : ndarray (s, b)
    laminar : bool
        No unloaded valve is turbulent; the same in all runs.
    exponent, offset, to_load, hard : ndarray (b,)
        `offset` is m x0; `hard` the first of `BernoulliPlan.limits`.
    vast : float
        That of the growth.
    """

    cell: Cell
    response: Floats
    moves: tuple[Floats, ...]
    path: Floats
    nodes: tuple[slice, ...]
    weights: Floats
    lost: tuple[Floats, ...]
    transition: tuple[Floats, ...]
    shares: Floats
    laminar: bool
    exponent: Floats
    offset: Floats
    to_load: Floats
    hard: Floats
    vast: float

    def advance(self, driven: Floats, under: Floats) -> None:
        """Move a block of cells on, in place; see `alike.Movement`.

        Step by step from opening to height: what a step needs of all cells fits into a core's cache.
        """
        cell, k = self.cell, under.shape[1]
        lag, begun = driven[cell.lag_rows], driven[cell.lag_rows.start :].copy()
        lag[:] = mapped(self.response[len(self.response) - len(lag) :], begun)
        height, path, work = (
            driven[0],
            mapped(self.path, under),
            np.empty((cell.pulp_rows.stop + 2, *under.shape[1:])),
        )
        exponent = height[:k] * self.exponent
        exponent -= self.offset
        exponent -= path[2 * len(self.nodes)]
        work[:-3] = driven[cell.pulp_rows, :k]
        _tension(exponent, work[-1])
        for s, own in enumerate(self.nodes):
            openings = mapped(self.response[own], begun)
            # Below the openings' own conductances those with their signs: the sign picks the reservoir.
            conductance = np.empty((2 * len(openings), *openings.shape[1:]))
            size, signed = conductance[: len(openings)], conductance[len(openings) :]
            size[:] = self._unloaded(openings)
            np.copysign(size, openings, signed)
            moves, free = self.moves[s], height[k:]
            if k:
                moved = mapped(moves, conductance[:, :k])
                exponent = self._pressed(s, openings[:, :k], moved, path, exponent, height[:k], work)
            free += mapped(moves[:1], conductance[:, k:])[0]
            np.maximum(free, 0.0, out=free)
            np.minimum(free, cell.actuator.stroke, out=free)
        driven[cell.pulp_rows, :k] = work[:-3]

    def _unloaded(self, openings: Floats) -> Floats:
        """Return the conductance of a valve without load, m³/(s Pa)."""
        flow = self.cell.flow
        if self.laminar:
            conductance: Floats = flow.laminar_conductance(openings)
            return conductance
        return flow.conductance(openings, self.cell.supply.pressure(openings))

    def _pressed(
        self,
        s: int,
        openings: Floats,
        moved: Floats,
        path: Floats,
        exponent: Floats,
        height: Floats,
        work: Floats,
    ) -> Floats:
        """Move the cells under the fingers on by step s, and their pulp with them; return the new exponent.

        Parameters
        ----------
        s : int
        openings : ndarray (g, k, b)
            At the step's Gauss points.
        moved : ndarray (4, k, b)
            What `moves` makes of them.
        path : ndarray (3 s + 1, k, b)
            See `steppers.bernoulli_plan`.
        exponent, height : ndarray (k, b)
            At the step's start, 1 and m; the height is brought up to date.
        work : ndarray (f + 3, k, b)
            The filters, then the tension at the start of a step, on average and at its end; brought up
            to date.
        """
        m, count, (rise, slip, bow, decay) = self.exponent, len(self.nodes), moved
        filters, first, mean, last = work[:-3], work[-3], work[-2], work[-1]
        lift = path[s]
        first[:] = last
        slip -= lift
        bow -= path[count + s]
        decay += TINY
        lost = mapped(self.lost[s], work[:-2])[0]
        relaxed = lost + 1.0
        idle = first <= lost
        stiffness = decay.copy()
        np.putmask(stiffness, idle, TINY)
        push = stiffness * relaxed
        growth = push + slip
        growth += TINY
        end: Floats = exponent + slip
        bent = exponent + bow
        strained = np.maximum(np.maximum(bent, end), exponent) >= self.hard
        strained |= growth >= self.vast
        strained |= bow >= MOST_BOW
        if np.count_nonzero(strained):
            np.putmask(bow, strained, 0.0)
            seen = Strain(
                openings, self.weights[self.nodes[s]], exponent, bow, path[count + s], lift, relaxed, idle
            )
            rise[:], end, mean[:] = loaded_way(self.cell, m, self.to_load, self.shares[s], seen)
            _tension(end, last)
        else:
            relief = pressed(np.exp(bent, bent), growth, stiffness)
            np.divide(relief, stiffness, mean)
            mean -= 1.0
            push -= relief
            end += push
            _tension(end, last)
            crossing = (last <= lost) != idle
            if np.count_nonzero(crossing):
                parts = (values[crossing] for values in (exponent, bow, slip, decay, relaxed))
                push[crossing], mean[crossing] = crossed(*parts)
                end = exponent + slip + push
                _tension(end, last)
            push /= m
            rise += push
        rise += height
        np.maximum(rise, 0.0, out=height)
        np.minimum(height, self.cell.actuator.stroke, out=height)
        stopped = rise != height
        if np.count_nonzero(stopped):
            # The mean found above is that of a pin that no end stop holds.
            end = m * height - self.offset - path[2 * count + s + 1]
            _tension(end, last)
            np.putmask(mean, stopped, 0.5 * (first + last))
        # Where the finger is not touched all through the step the mean is that of no tension.
        np.maximum(mean, 0.0, out=mean)
        # Of a tension that falls steeply a straight line would make a filter that pulls. The last row
        # is the force.
        np.maximum(mapped(self.transition[s], work)[:-1], 0.0, out=filters)
        return end


def unlike(cell: Cell, plans: Sequence[BernoulliPlan]) -> Unlike:
    """Put the closed-form steps of some runs together: of the same nodes, and laminar all or none of them."""
    first, steps = plans[0], range(len(plans[0].nodes))
    return Unlike(
        cell=cell,
        response=_of_all([plan.response for plan in plans]),
        moves=tuple(_of_all([_own_moves(plan, s) for plan in plans]) for s in steps),
        path=_of_all([plan.path for plan in plans]),
        nodes=first.nodes,
        weights=np.stack([plan.weights[:, None] / plan.cell.actuator.area for plan in plans], axis=-1),
        lost=tuple(_of_all([plan.lost[s][None] for plan in plans]) for s in steps),
        transition=tuple(_of_all([plan.transition[s] for plan in plans]) for s in steps),
        shares=np.stack([plan.shares for plan in plans], axis=-1),
        laminar=first.cell.flow.knee > first.cell.supply.largest,
        exponent=numbers([plan.numbers[0] for plan in plans]),
        offset=numbers([plan.numbers[1] for plan in plans]),
        to_load=numbers([plan.to_load for plan in plans]),
        hard=numbers([plan.limits[0] for plan in plans]),
        vast=first.limits[3],
    )


def _own_moves(plan: BernoulliPlan, step: int) -> Floats:
    """Return what one step makes of its own Gauss points, shape (4, 2 g); see `BernoulliPlan.moves`."""
    rows, both = plan.moves[step :: len(plan.nodes)], len(plan.weights)
    own = np.arange(both)[plan.nodes[step]]
    return rows[:, [*own, *(own + both)]]


def _of_all(maps: Sequence[Floats]) -> Floats:
    """Return a map of all runs: (o, i) if they have one and the same, else (o, i, b)."""
    if all(np.array_equal(one, maps[0]) for one in maps):
        return maps[0]
    return np.stack(maps, axis=-1)


def _tension(exponent: Floats, out: Floats) -> None:
    """Work out the elastic force in units of b/m, into `out`; 0 where there is a gap."""
    np.maximum(exponent, 0.0, out=out)
    np.minimum(out, LARGEST_EXPONENT, out=out)
    np.expm1(out, out)
