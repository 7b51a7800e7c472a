"""Closed-form stepper: exact for an exponential spring behind a linear flow resistance.

The valve's opening is known in closed form for a whole period. Over a physics step its conductance,
the force lost to relaxation and the fingertip's speed are frozen at their means, and the remaining
equation is solved exactly (`closed_form`). The step is therefore stable at any length and
stiffness, without iteration, and of second order. The largest error of frozen speeds, that the
paths of a free pin and the finger are curved, is corrected by its mean, the chord deviation. A
valve that changes reservoir within a step is no special case (conductance and drive are averaged at
Gauss points of the exact opening), and contact with a cell begins and ends at the exact instant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..base.arrays import TIE, Constants, Flags, Floats, any_true, apply_map, per_row, prepare_map
from ..model.actuator import Supply
from ..model.contact import LARGEST_EXPONENT, Contact
from ..model.delay import Queue
from ..model.interfaces import Alike, Pulp, Segment
from ..model.null_parts import Unrelaxed
from ..model.physics import Cell
from .closed_form import LARGE, TINY, StepStart, find_loaded_path, solve_crossing, solve_pressed


def _legendre(count: int) -> tuple[tuple[float, float], ...]:
    """Return Gauss-Legendre nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)  # type: ignore[no-untyped-call]
    return tuple(zip((0.5 + 0.5 * nodes).tolist(), (0.5 * weights).tolist(), strict=True))


#: Gauss points, nodes and weights, for a piece of at most this share of its step: a valve may open
#: fully within a step, and only in part within a short piece.
POINTS = ((0.3, _legendre(2)), (0.6, _legendre(3)), (1.0, _legendre(4)))

#: Largest chord deviation, in 1/m, at which a step is replaced by a straight one that is higher by
#: it. A step without contact at its start, middle and end then has no mean tension, as it should:
#: for a deviation b the mean is at most exp(b) (1 - exp(-3 b)) / (3 b) - 1, which is above 0 from b
#: = 1.54 on.
LARGEST_DEVIATION = 1.5


@dataclass(frozen=True, eq=False)
class BernoulliPlan:
    """Constants of all periods. Heights under the fingertip are in 1/m, tensions in b/m."""

    cell: Cell
    segments: tuple[Segment, ...]
    """The s physics steps of a period."""
    response: Floats
    """(g + 1, r): From opening and queued commands to the openings at all g Gauss points, and at the end."""
    moves: Floats
    """(4 s, 2 g): From conductances at the Gauss points, and the same with the signs of the openings, to the
    free rise of each step, m; the same and its chord deviation, in 1/m; its decay, see `closed_form`."""
    path: Floats
    """(3 s + 1, p): From the fingertip's underside at the period's instants to its rise in each step and the
    chord deviation of that, in 1/m; then the underside at the start of each, and at the end of the last."""
    loaded: Floats
    """(1 + 3 s, 2 g + p + 1): Both together: from conductances, underside and a row of ones to m H less the
    exponent at the start; then for each step slip, chord deviation and decay."""
    nodes: tuple[slice, ...]
    """The Gauss points of each step."""
    weights: Floats
    """(g,): Their weights, s."""
    mean_loss: tuple[Floats, ...]
    """(2, r + 3): Maps of the relaxation, one per step: from filters, N, force (with weight 0), ones, and
    tension, to the tension at which the pulp begins to push, and to that plus one."""
    propagator: tuple[Floats, ...]
    """(r + 1, r + 5): From these, and the mean and the final tension, to the filters and the force at its
    end, N."""
    shares: tuple[float, ...]
    """Share of the tension that pushes, one per step: the rest is lost to relaxation within it."""
    laminar: bool
    """Whether the flow of a valve without load is always laminar."""
    numbers: tuple[float, ...]
    """The contact's m, 1/m; m x0; 1/m, m; the largest exponent; 0, 1, 1/2 and `TINY`."""
    limits: Floats
    """(5,): Limits of `closed_form.solve_pressed`: of the exponent at the start of a step, at its end and
    with the chord deviation, so that every flow is laminar; of the growth, so that nothing overflows and a
    finger that does not push moves no pin; and of the chord deviation, see `LARGEST_DEVIATION`."""
    to_load: float
    """Pressure per unit of tension, Pa."""


def _hard(cell: Cell, to_load: float, steepest: float) -> float:
    """Return the exponent above which a flow may be turbulent or an exponential overflow."""
    # Pressure that the load may add to the drop before some flow could become turbulent.
    spare = cell.flow.knee - cell.supply.largest
    if spare <= 0.0:
        return -math.inf
    turbulent = math.log1p(spare / to_load)
    overflow = math.log(0.5 * LARGE / max(steepest, TINY))
    return min(0.5 * LARGE, turbulent, overflow)


def _moves(
    supply: Supply, steps: Floats, deviations: Floats, decay: Floats, exponent: float
) -> Floats:
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

    A chord deviation is the mean above the line between the ends, here of the parabola through the
    middle.
    """
    count = len(segments)
    path = np.zeros((3 * count + 1, segments[-1].nodes[-1] + 1))
    for s, part in enumerate(segments):
        path[s, list(part.nodes)] = -1.0, 0.0, 1.0
        path[count + s, list(part.nodes)] = -1.0 / 3.0, 2.0 / 3.0, -1.0 / 3.0
        path[2 * count + s, part.nodes[0]] = 1.0
    path[-1, -1] = 1.0
    return path


def _gauss_points(
    cuts: tuple[float, ...], segments: tuple[Segment, ...]
) -> tuple[Floats, Floats, tuple[slice, ...]]:
    """Return Gauss points of all steps: times and weights, s, and the slice of each step.

    The opening has a kink where the valve changes to the next command: a step with a kink has
    points on both sides of it.
    """
    times: list[float] = []
    weights: list[float] = []
    nodes: list[slice] = []
    for part in segments:
        end = part.start + part.length
        inner = [cut for cut in cuts if part.start < cut * (1.0 - 1e-9) < end * (1.0 - 2e-9)]
        first = len(times)
        for a, b in pairwise((part.start, *inner, end)):
            points = next(
                points for most, points in POINTS if b - a <= most * part.length * (1.0 + 1e-9)
            )
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
    # A pulp that touches exactly at the start of a step, by the clock or the lattice, makes contact
    # within it.
    both[:, -2] = TIE, 1.0
    return both


def _propagator(pulp: Pulp, step: float, unit: float, share: float) -> Floats:
    """Return an entry of `BernoulliPlan.propagator`; see also `Pulp.propagator`."""
    filters = pulp.propagator(step)
    filters[:, -3:] *= unit
    last = np.zeros(filters.shape[1])
    last[-1] = unit
    both = np.vstack([filters, share * (last - pulp.relaxed(filters))])
    return np.insert(both, [-3, -3], 0.0, axis=1)


def divide_segments(
    segments: tuple[Segment, ...], parts: int
) -> tuple[tuple[Segment, ...], Floats]:
    """Return segments cut into equal parts, and the map from a period's instants to their ends and middles.

    Between its instants a segment's path is the polynomial through them.
    """
    cut: list[Segment] = []
    between = np.zeros((2 * parts * len(segments) + 1, segments[-1].nodes[-1] + 1))
    between[-1, -1] = 1.0
    for number, segment in enumerate(segments):
        count, length = len(segment.nodes), segment.length / parts
        powers = np.arange(count)
        to_powers = np.linalg.inv(np.linspace(0.0, 1.0, count)[:, None] ** powers)
        at = np.arange(2 * parts)[:, None] / (2 * parts)
        rows = slice(2 * parts * number, 2 * parts * (number + 1))
        between[rows, segment.nodes] = at**powers @ to_powers
        for part in range(parts):
            first = 2 * len(cut)
            nodes = first, first + 1, first + 2
            cut.append(Segment(segment.start + part * length, length, nodes))
    return tuple(cut), between


class BernoulliExponential(Alike):
    """Second order, stable at any step and stiffness, without iteration."""

    name = "bernoulli"
    order = 2
    nodes = (0.0, 0.5, 1.0)
    bridges = True

    def plan(self, cell: Cell, queue: Queue, segments: tuple[Segment, ...]) -> BernoulliPlan:
        """Compute once what all periods share."""
        times, weights, nodes = _gauss_points(cell.lag.list_cuts(queue), segments)
        end = segments[-1].start + segments[-1].length
        pulp, contact = (
            (cell.touch.pulp, cell.touch.contact) if cell.touch else (Unrelaxed(), Contact())
        )
        to_decay = contact.share * contact.stiffness / cell.actuator.area
        m, supply = contact.exponent, cell.supply
        to_load, unit = to_decay / m, contact.stiffness / m
        shares = tuple(1.0 - pulp.mean_loss_map(part.length)[1] for part in segments)
        steps, deviations = np.zeros((2, len(nodes), len(times)))
        for s, part in enumerate(segments):
            points = nodes[s]
            steps[s, points] = weights[points] / cell.actuator.area
            deviations[s, points] = steps[s, points] * (
                0.5 - (times[points] - part.start) / part.length
            )
        widest = float(cell.flow.laminar_conductance(1.0))
        hard = _hard(cell, to_load, to_decay * widest * float(steps.sum(axis=1).max()))
        decay = to_decay * np.array(shares)[:, None] * steps
        moves = _moves(supply, steps, m * deviations, decay, m)
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

    def prepare(self, plan: BernoulliPlan, rows: Floats, near: int) -> StepWorkspace:
        """Prepare to move a block of cells; see `interfaces.Stepper`."""
        return StepWorkspace(plan, rows, near)


class StepWorkspace:
    """Movement of a block of cells, period by period: its rows, and working arrays.

    The cells are those of one run, (n,), or of b runs, (n, b), with plans whose numbers and maps
    may differ from run to run. A period overwrites the arrays. Linear maps are bound to the arrays
    of their arguments and results. See `interfaces.Stepper.prepare`; k is short for `near` here.
    """

    def __init__(self, plan: BernoulliPlan, rows: Floats, near: int) -> None:
        cell, k = plan.cell, near
        every, touched = rows.shape[1:], (k, *rows.shape[2:])
        gauss, instants, steps = len(plan.weights), plan.path.shape[1], len(plan.segments)

        def empty(count: int, cells: tuple[int, ...]) -> Floats:
            return np.empty_like(rows, shape=(count, *cells))

        self.plan, self.height, self.near = plan, rows[0], rows[0, :k]
        self.pulp, self.lag = rows[cell.pulp_rows, :k], rows[cell.lag_rows]
        openings = np.zeros_like(rows, shape=(len(plan.response), *every))
        self.opening_after = openings[len(openings) - len(self.lag) :]
        self.opening = cell.lag.join(openings, plan.weights)
        self.gates = openings if cell.lag.rows > 1 else None
        self.open_valves = prepare_map(plan.response, rows[cell.lag_rows.start :], openings)
        # Conductances of the valves, the same with the signs of the openings, underside, and ones.
        inputs = empty(2 * gauss + instants + 1, every)
        inputs[-1] = 1.0
        self.size, self.signed = inputs[:gauss], inputs[gauss : 2 * gauss]
        self.under = inputs[2 * gauss : -1, :k]
        # Results of the maps: the first rows of `BernoulliPlan.moves`, and `loaded`.
        self.free, loaded = empty(steps, every), empty(len(plan.loaded), touched)
        self.rise_freely = prepare_map(plan.moves[:steps], inputs[: 2 * gauss], self.free)
        self.meet_finger = prepare_map(plan.loaded, inputs[:, :k], loaded)
        self.start = loaded[0]
        begins = empty(2, touched)
        self.lost, self.relaxed = begins
        # Arguments of the maps `BernoulliPlan.mean_loss` and `propagator`.
        work = empty(len(self.pulp) + 5, touched)
        work[-5], work[-4] = 0.0, 1.0
        self.filters: Floats = work[:-5]
        self.force: Floats = work[-5]
        self.moved, (self.first, self.mean, self.last) = work[:-4], work[-3:]
        self.propagated = empty(len(self.moved), touched)
        self.steps = tuple(
            (
                rise,
                rise[:k],
                *loaded[1 + 3 * s : 4 + 3 * s],
                prepare_map(plan.mean_loss[s], work[:-2], begins),
                prepare_map(plan.propagator[s], work, self.propagated),
            )
            for s, rise in enumerate(self.free)
        )
        self.constants, self.none = Constants(plan.numbers)[touched], np.zeros_like(self.moved)
        # Quantities that `solve_pressed` requires to be below the limits.
        self.guarded, self.limits = empty(5, touched), empty(5, touched)
        self.limits[:] = per_row(plan.limits, rows.ndim)
        self.exponent, self.end, self.bent, self.growth, self.deviation = self.guarded
        self.stops = Constants((0.0, cell.actuator.stroke))[every]

    def __call__(self, under: Floats) -> Floats:
        """Move the block by one control period, in place; see `interfaces.Movement`."""
        self.open_valves()
        if self.gates is not None:
            self.opening[:] = self.plan.cell.lag.join(self.gates, self.plan.weights)
        self.lag[:] = self.opening_after
        self._conduct()
        self.rise_freely()
        if under.shape[1]:
            self.under[:] = under
            self.meet_finger()
            self._press()
            return self.force
        height, (lowest, highest) = self.height, self.stops
        for rise in self.free:
            rise += height
            np.maximum(rise, lowest, out=height)
            np.minimum(height, highest, out=height)
        return self.force

    def _conduct(self) -> None:
        """Compute the conductances of the valves without load, and what steers them."""
        cell, opening, size = self.plan.cell, self.opening, self.size
        if self.plan.laminar:
            cell.flow.laminar_conductance(opening, size)
        else:
            size[:] = cell.flow.conductance(opening, cell.supply.pressure(opening))
        cell.supply.steer(size, opening, self.signed)

    def _press(self) -> None:
        """Move the block step by step, with the pulp over its first k cells, those under the fingertip."""
        height, near = self.height, self.near
        first, mean, last, lost, relaxed = self.first, self.mean, self.last, self.lost, self.relaxed
        m, offset, per_m, most, zero, one, half, tiny = self.constants
        guarded, exponent, growth = self.guarded, self.exponent, self.growth
        lowest, highest = self.stops
        self.filters[:] = self.pulp
        np.multiply(near, m, exponent)
        exponent -= self.start
        _tension(exponent, zero, most, first)
        end: Floats = exponent
        for s, (rise, risen, slip, deviation, decay, lose, propagate) in enumerate(self.steps):
            if s:
                first[:] = last
                exponent[:] = end
            lose()
            idle = first <= lost
            stiffness = decay.copy()
            np.putmask(stiffness, idle, tiny)
            push = stiffness * relaxed
            np.add(push, slip, growth)
            growth += tiny
            end = np.add(exponent, slip, self.end)
            bent = np.add(exponent, deviation, self.bent)
            self.deviation[:] = deviation
            beyond = guarded >= self.limits
            if any_true(beyond) and any_true(self._find_near_overflow(s, beyond)):
                risen[:], end, mean[:] = self._move_near_overflow(
                    s, beyond, exponent, deviation, idle
                )
                _tension(end, zero, most, last)
                rise += height
            else:
                relief = solve_pressed(np.exp(bent), growth, stiffness)
                np.divide(relief, stiffness, mean)
                mean -= one
                push -= relief
                end += push
                _tension(end, zero, most, last)
                crossing = last <= lost
                crossing ^= idle
                if any_true(crossing):
                    numbers = exponent, deviation, slip, decay, relaxed, idle
                    parts = (values[crossing] for values in numbers)
                    push[crossing], mean[crossing] = solve_crossing(*parts)
                    end = exponent + slip + push
                    _tension(end, zero, most, last)
                push *= per_m
                rise += height
                risen += push
            np.maximum(rise, lowest, out=height)
            np.minimum(height, highest, out=height)
            stopped = risen != near
            if any_true(stopped):
                # The mean above is that of a pin that does not reach an end stop.
                end = near * m - offset - self._seen(2 * len(self.steps) + s + 1)
                _tension(end, zero, most, last)
                np.putmask(mean, stopped, half * (first + last))
            # Without contact during the whole step the mean tension is 0.
            np.maximum(mean, zero, out=mean)
            # With a linear tension that falls steeply a filter would become negative.
            propagate()
            np.maximum(self.propagated, self.none, out=self.moved)
        self.pulp[:] = self.filters

    def _seen(self, row: int) -> Floats:
        """Return the result of a row of the plan's `path` for the fingertip's underside."""
        return apply_map(self.plan.path[row : row + 1], self.under)[0]

    def _find_near_overflow(self, s: int, beyond: Flags) -> Flags:
        """Clear the cells (5, k[, b]) beyond the limits of step s if their limit is that of laminar flow."""
        # A shut valve has no flow: its pin is locked at any load that does not overflow.
        shut = ~self.size[self.plan.nodes[s], : len(self.near)].any(axis=0)
        beyond[:3] &= ~shut | (self.guarded[:3] >= 0.5 * LARGE)
        return beyond

    def _move_near_overflow(
        self, s: int, beyond: Flags, exponent: Floats, deviation: Floats, idle: Flags
    ) -> tuple[Floats, Floats, Floats]:
        """Return the paths over step s, in which some cells exceed the limits of `solve_pressed`."""
        plan, nodes, count = self.plan, self.plan.nodes[s], len(self.steps)
        # The curvature of their path depends on the load, or is too large for its mean.
        deviation[beyond.any(axis=0)] = 0.0
        openings = self.opening[nodes, : len(self.near)]
        weights = per_row(plan.weights[nodes], openings.ndim) / plan.cell.actuator.area
        start = StepStart(
            plan.cell,
            openings,
            plan.cell.supply.pressure(openings),
            weights,
            exponent,
            deviation,
            finger_deviation=self._seen(count + s),
            lift=self._seen(s),
            relaxed=self.relaxed,
            idle=idle,
        )
        return find_loaded_path(plan.numbers[0], plan.to_load, plan.shares[s], start)


def _tension(exponent: Floats, zero: Floats, most: Floats, out: Floats) -> None:
    """Compute the elastic force in units of b/m, into `out`; 0 in a gap."""
    np.maximum(exponent, zero, out=out)
    np.minimum(out, most, out=out)
    np.expm1(out, out)
