"""Closed-form step in a Python loop over the cells."""

from __future__ import annotations

import math
import time

import numpy as np
from digiclay.core.engine.simulation import begin
from digiclay.core.model.conduit import OrificeAndConduit
from digiclay.core.model.fingertip import JOIN
from digiclay.core.steppers.bernoulli import POINTS
from digiclay.core.steppers.closed_form import TINY, solve_crossing

from .peers import ROOT, Line
from .problems import PERIOD, Measured, Problem
from .work_precision import LOOP, Work

#: Gauss points of a whole step.
WHOLE = POINTS[-1][1]


def loop(known: Problem, step: float, periods: int) -> tuple[Measured, float]:
    """Integrate the first periods cell by cell in plain Python; return the CPU time, s, too.

    Only the cells that take part by the problem's sets are gone through, as for the solvers.

    `step`: physics step, s.
    """
    line = Line(known)
    system, grid = line.system, line.system.grid
    count, dead = round(system.period / step), known.scene.delay.dead_time if known.scene.delay else 0.0
    tau = line.cell.lag.time_constant
    own = Scalar(line, step)
    state = begin(system).rows[: system.rows.physics].T.tolist()
    aging = [math.exp(-rate * system.period) for rate in own.speeds]
    xs, ys, heights, forces = grid.x.tolist(), grid.y.tolist(), [], []
    nothing = [0.0] * grid.count
    started = time.process_time()
    for row, (cells, k) in enumerate(known.sets[:periods]):
        start = row * system.period
        old, new = known.commands[row - 1].tolist() if row else nothing, known.commands[row].tolist()
        poses = [line.finger(start + i * step / 2) for i in range(2 * count + 1)]
        total, touched = 0.0, set(cells[:k].tolist())
        for i in range(grid.count):
            if i not in touched:
                state[i][1:4] = [z * a for z, a in zip(state[i][1:4], aging, strict=True)]
        for i in cells.tolist():
            y, near = state[i], i in touched
            unders = [own.underside(pose, xs[i], ys[i]) for pose in poses] if near else []
            for s in range(count):
                command = new[i] if s * step >= dead - 1e-12 else old[i]
                openings = [command + (y[4] - command) * math.exp(-node * step / tau) for node, _ in WHOLE]
                y[4] = command + (y[4] - command) * math.exp(-step / tau)
                own.step(y, openings, unders[2 * s : 2 * s + 3])
            if near:
                total += own.force(y, unders[-1])
        heights.append([y[0] for y in state])
        forces.append(total)
    return Measured(np.array(heights), np.array(forces)), time.process_time() - started


def looped(known: Problem, exact: Measured, step: float) -> Work:
    """Return the loop's point: a whole run at one step, s.

    `exact`: its exact solution; `step`: physics step, s.
    """
    found, took = loop(known, step, known.scene.periods)
    height, force = found.against(exact)
    count = known.scene.periods * round(PERIOD / step)
    return Work(known.name, LOOP, step, height, force, took, count, True)


class Scalar:
    """The closed-form step of one cell, in Python's own numbers."""

    def __init__(self, line: Line, step: float) -> None:
        cell, contact, pulp = line.cell, line.contact, line.pulp
        self.tip, self.h = line.tip, step
        self.high, self.low, self.stroke = cell.supply.high, cell.supply.low, cell.actuator.stroke
        flow = cell.flow
        assert isinstance(flow, OrificeAndConduit)
        self.laminar, self.resistance = flow.valve.laminar, flow.resistance
        self.area, self.m = cell.actuator.area, contact.exponent
        self.unit = contact.stiffness / contact.exponent
        self.share = contact.share
        lost, lost_now = pulp.mean_loss_map(step)
        self.speeds, self.weights = pulp.rates[:, 0].tolist(), pulp.shares.tolist()
        self.lost = [*(lost[:-1] / self.unit / (1.0 - lost_now)), lost[-1] / (1.0 - lost_now)]
        self.transition = pulp.propagator(step).tolist()
        self.stiff = contact.share * contact.stiffness / self.area * (1.0 - lost_now)

    def underside(self, pose: tuple[float, float, float], x: float, y: float) -> float:
        """Return the finger's underside over one cell, m.

        `pose` (float, float, float), the finger's lowest point, m; `x`, `y`: place of the cell, m.
        """
        inward = 1.0 - ((x - pose[0]) / self.tip.length) ** 2 - ((y - pose[1]) / self.tip.width) ** 2
        kept = max(inward, 1.0 - JOIN)
        return pose[2] + self.tip.height * (1.0 - math.sqrt(kept) - (inward - kept) * 0.5 / ROOT)

    def tension(self, height: float, under: float) -> float:
        """Return T in units of b/m.

        `height`, `under`: of the pin, and of the finger's underside over it, m.
        """
        return math.expm1(min(max(self.m * (height - under), 0.0), 500.0))

    def force(self, y: list[float], under: float) -> float:
        """Return the force, N.

        `y`: the cell's state: height, m; three filters, N; opening; `under`: the finger's underside over the
        cell, m.
        """
        relaxed = sum(w * z for w, z in zip(self.weights, y[1:4], strict=True))
        return float(self.share * max(self.unit * self.tension(y[0], under) - relaxed, 0.0))

    def step(self, y: list[float], openings: list[float], unders: list[float]) -> None:
        """Move a cell on by a step, in place.

        `y`: the cell's state: height, m; three filters, N; opening; `openings`: the valve's opening at the
        Gauss points of the step; `unders`: the finger's underside at start, middle and end of the step, m;
        empty for a cell it may not touch.
        """
        mobility = free = bow = 0.0
        for (node, weight), opening in zip(WHOLE, openings, strict=True):
            lift = opening * opening
            g = weight * self.h * lift / (1.0 / self.laminar + self.resistance * lift) / self.area
            rise = g * (self.high if opening > 0.0 else self.low)
            mobility += g
            free += rise
            bow += rise * (0.5 - node)
        if not unders:
            y[0] = min(max(y[0] + free, 0.0), self.stroke)
            return
        start, middle, end = unders
        first, exponent = self.tension(y[0], start), self.m * (y[0] - start)
        lost = sum(a * b for a, b in zip(self.lost, [*y[1:4], first], strict=True))
        decay, slip = self.stiff * mobility + TINY, self.m * (free - end + start)
        bow = self.m * (bow - (2.0 * middle - start - end) / 3.0)
        idle = first <= lost
        stiffness = TINY if idle else decay
        growth = stiffness * (1.0 + lost) + slip + TINY
        relief = math.log1p(stiffness * math.exp(exponent + bow) * math.expm1(growth) / growth)
        push, mean = stiffness * (1.0 + lost) - relief, relief / stiffness - 1.0
        if (math.expm1(max(exponent + slip + push, 0.0)) <= lost) != idle:
            told = solve_crossing(*(np.array([v]) for v in (exponent, bow, slip, decay, 1.0 + lost)))
            push, mean = float(told[0][0]), float(told[1][0])
        y[0] = min(max(y[0] + free + push / self.m, 0.0), self.stroke)
        tensions = [self.unit * one for one in (first, max(mean, 0.0), self.tension(y[0], end))]
        work = [*y[1:4], *tensions]
        y[1:4] = [max(sum(a * b for a, b in zip(row, work, strict=True)), 0.0) for row in self.transition]
