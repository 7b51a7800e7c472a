"""Constants of the closed-form step: maps from openings, fingertip and filters."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..base.arrays import Floats
from ..model.contact import LARGEST_EXPONENT, Contact
from ..model.delay import Queue
from ..model.interfaces import Pulp, Segment
from ..model.null_parts import Unrelaxed
from ..model.physics import Cell
from ..model.supply import Supply
from .closed_form import LARGE, TINY


def _legendre(count: int) -> tuple[tuple[float, float], ...]:
    """Return Gauss-Legendre nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)  # type: ignore[no-untyped-call]
    return tuple(zip((0.5 + 0.5 * nodes).tolist(), (0.5 * weights).tolist(), strict=True))


#: Gauss points, nodes and weights, for a piece that is at most this share of its step: within a step a valve
#: may go all its way, within a short piece it goes less of it.
POINTS = ((0.3, _legendre(2)), (0.6, _legendre(3)), (1.0, _legendre(4)))

#: Largest chord deviation, in 1/m, whose step may be taken for a straight one that lies higher by so much.
#: Out of touch at the start, in the middle and at the end it then leaves no tension on average, as it should:
#: that comes out as at most exp(b) (1 - exp(-3 b)) / (3 b) - 1 of a deviation b, above 0 from 1.54 on.
LARGEST_DEVIATION = 1.5


@dataclass(frozen=True, eq=False)
class BernoulliPlan:
    """Constants of all periods. Heights under the fingertip are in 1/m, tensions in b/m.

    Attributes
    ----------
    cell : Cell
    segments : tuple of Segment
        The s physics steps of a period.
    response : ndarray (g + 1, r)
        From opening and queued commands to the openings at all g Gauss points, and at the end.
    moves : ndarray (4 s, 2 g)
        From conductances at the Gauss points, and the same with the signs of the openings, to
        what each step has: free rise, m; the same and its chord deviation, in 1/m; decay, see `closed_form`.
    path : ndarray (3 s + 1, p)
        From the finger's underside at the period's instants to what each step has, in 1/m: rise
        and its chord deviation; underside at the start, and at the end of the last.
    loaded : ndarray (1 + 3 s, 2 g + p + 1)
        Both together: from conductances, underside and a row of ones to the exponent less m H at the
        start, with its sign changed; then what each step has: slip, chord deviation
        and decay.
    nodes : tuple of slice
        The Gauss points of each step.
    weights : ndarray (g,)
        Their weights, s.
    mean_loss : tuple of ndarray (2, r + 3)
        The relaxation's maps, one a step: from filters, N, force (which does not count), ones, and tension,
        to the tension at which the pulp begins to push, and to one more.
    propagator : tuple of ndarray (r + 1, r + 5)
        From these, and the tension on average and at the end, to the filters and the force at its end, N.
    shares : tuple of float
        Share of the tension that does push, one a step: the rest is lost within it.
    laminar : bool
        No valve without load is turbulent.
    numbers : tuple of float
        The contact's m, 1/m; m x0; 1/m, m; the largest exponent; 0, 1, 1/2 and `TINY`.
    limits : ndarray (5,)
        `closed_form.solve_pressed` holds below all of them: the exponent at the start of a step, at its end
        and with the chord deviation, where every flow is laminar; the growth, where nothing overflows and
        what does not push moves no pin; and the chord deviation, see `LARGEST_DEVIATION`.
    to_load : float
        Pressure that a unit of tension makes, Pa.
    """

    cell: Cell
    segments: tuple[Segment, ...]
    response: Floats
    moves: Floats
    path: Floats
    loaded: Floats
    nodes: tuple[slice, ...]
    weights: Floats
    mean_loss: tuple[Floats, ...]
    propagator: tuple[Floats, ...]
    shares: tuple[float, ...]
    laminar: bool
    numbers: tuple[float, ...]
    limits: Floats
    to_load: float


def make_plan(cell: Cell, queue: Queue, segments: tuple[Segment, ...]) -> BernoulliPlan:
    """Work out once what all periods share.

    `queue`: commands on their way to the valve; `segments`: physics steps of a period.
    """
    times, weights, nodes = _gauss_points(queue, segments)
    end = segments[-1].start + segments[-1].length
    pulp, contact = (cell.touch.pulp, cell.touch.contact) if cell.touch else (Unrelaxed(), Contact())
    to_decay = contact.share * contact.stiffness / cell.actuator.area
    m, supply = contact.exponent, cell.supply
    to_load, unit = to_decay / m, contact.stiffness / m
    shares = tuple(1.0 - pulp.mean_loss_map(part.length)[1] for part in segments)
    steps, deviations = np.zeros((2, len(nodes), len(times)))
    for s, part in enumerate(segments):
        own = nodes[s]
        steps[s, own] = weights[own] / cell.actuator.area
        deviations[s, own] = steps[s, own] * (0.5 - (times[own] - part.start) / part.length)

    widest = float(cell.flow.laminar_conductance(1.0))
    hard = _hard(cell, to_load, to_decay * widest * float(steps.sum(axis=1).max()))

    moves = _moves(supply, steps, m * deviations, to_decay * np.array(shares)[:, None] * steps, m)
    path = m * _path(segments)
    return BernoulliPlan(
        cell,
        segments,
        cell.lag.response(queue, [*times, end]),
        moves,
        path,
        _loaded(moves, path, m * contact.offset),
        nodes,
        weights,
        tuple(_mean_loss(pulp, part.length, unit) for part in segments),
        tuple(_propagator(pulp, part.length, unit, contact.share) for part in segments),
        shares,
        cell.flow.knee > supply.largest,
        (m, m * contact.offset, 1.0 / m, LARGEST_EXPONENT, 0.0, 1.0, 0.5, TINY),
        np.array([hard, hard, hard, 0.5 * LARGE, LARGEST_DEVIATION]),
        to_load,
    )


def _hard(cell: Cell, to_load: float, steepest: float) -> float:
    """Return the exponent from which on some flow may turn turbulent or an exponential overflow.

    `to_load`: pressure that a unit of tension makes, Pa; `steepest`: no step's decay is larger where every
    flow is laminar.
    """
    # How far the load may drive up the drop before some flow could turn turbulent.
    spare = cell.flow.knee - cell.supply.largest
    if spare <= 0.0:
        return -math.inf
    return min(0.5 * LARGE, math.log1p(spare / to_load), math.log(0.5 * LARGE / max(steepest, TINY)))


def _moves(supply: Supply, steps: Floats, deviations: Floats, decay: Floats, exponent: float) -> Floats:
    """Return `BernoulliPlan.moves` from the weights (s, g) of free rise, chord deviation and decay."""
    middle, half = 0.5 * (supply.high + supply.low), 0.5 * (supply.high - supply.low)
    rows = [[middle * part, half * part] for part in (steps, exponent * steps, deviations)]
    return np.block([*rows, [decay, np.zeros_like(decay)]])


def _loaded(moves: Floats, path: Floats, offset: float) -> Floats:
    """Return `BernoulliPlan.loaded` from the other two maps and m x0."""
    count, inputs, instants = len(moves) // 4, moves.shape[1], path.shape[1]
    loaded = np.zeros((1 + 3 * count, inputs + instants + 1))
    loaded[0, inputs:] = *path[2 * count], offset
    for s in range(count):
        slip, deviation, decay = loaded[1 + 3 * s : 4 + 3 * s]
        slip[:-1] = *moves[count + s], *-path[s]
        deviation[:-1] = *moves[2 * count + s], *-path[count + s]
        decay[:inputs], decay[-1] = moves[3 * count + s], TINY
    return loaded


def _path(segments: tuple[Segment, ...]) -> Floats:
    """Return `BernoulliPlan.path`, in m.

    The chord deviation of a path is its mean above the straight line between its ends, here of the parabola
    through start, middle and end.
    """
    count = len(segments)
    path = np.zeros((3 * count + 1, segments[-1].nodes[-1] + 1))
    for s, part in enumerate(segments):
        path[s, list(part.nodes)] = -1.0, 0.0, 1.0
        path[count + s, list(part.nodes)] = -1.0 / 3.0, 2.0 / 3.0, -1.0 / 3.0
        path[2 * count + s, part.nodes[0]] = 1.0
    path[-1, -1] = 1.0
    return path


def _gauss_points(queue: Queue, segments: tuple[Segment, ...]) -> tuple[Floats, Floats, tuple[slice, ...]]:
    """Return Gauss points of all steps: times and weights, s, and which are whose.

    Where the valve goes over to the next command its opening has a kink: a step that holds one
    takes its points on either side of it.
    """
    times: list[float] = []
    weights: list[float] = []
    nodes: list[slice] = []
    for part in segments:
        end = part.start + part.length
        inner = (queue.cut,) if part.start < queue.cut * (1.0 - 1e-9) < end * (1.0 - 2e-9) else ()
        first = len(times)
        for a, b in pairwise((part.start, *inner, end)):
            points = next(points for most, points in POINTS if b - a <= most * part.length * (1.0 + 1e-9))
            times += [a + node * (b - a) for node, _ in points]
            weights += [weight * (b - a) for _, weight in points]
        nodes.append(slice(first, len(times)))
    return np.array(times), np.array(weights), tuple(nodes)


def _mean_loss(pulp: Pulp, step: float, unit: float) -> Floats:
    """Return an entry of `BernoulliPlan.mean_loss`."""
    loss, share = pulp.mean_loss_map(step)
    loss[:-1] /= unit
    loss /= 1.0 - share
    both = np.tile([*loss[:-1], 0.0, 0.0, loss[-1]], (2, 1))
    both[1, -2] = 1.0
    return both


def _propagator(pulp: Pulp, step: float, unit: float, share: float) -> Floats:
    """Return an entry of `BernoulliPlan.propagator`; see also `Pulp.propagator`."""
    filters = pulp.propagator(step)
    filters[:, -3:] *= unit
    last = np.zeros(filters.shape[1])
    last[-1] = unit
    both = np.vstack([filters, share * (last - pulp.relaxed(filters))])
    return np.insert(both, [-3, -3], 0.0, axis=1)
