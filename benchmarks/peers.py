"""Peers of the steppers: SciPy's solvers and a Python loop over the cells, with every advantage."""

from __future__ import annotations

import math
import time
from bisect import bisect_right
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import DigiclayError
from digiclay.core.engine.simulation import begin
from digiclay.core.model.conduit import OrificeAndConduit
from digiclay.core.model.fingertip import JOIN
from digiclay.core.model.trajectory import Trajectory
from digiclay.core.steppers.bernoulli import POINTS
from digiclay.core.steppers.closed_form import TINY, solve_crossing

from .problems import PERIOD, Problem, Solution, Work, replaying

#: Moves the flat state from one time to another; returns it and the number of evaluations. Arguments: rates,
#: start, state, end, relative tolerance, scale of the state, bands of the Jacobian.
Solver = Callable[[Any, float, Floats, float, float, Floats, int], tuple[Floats, int]]
#: Step of the check of the reference, s.
CHECK = 5e-5
ROOT = math.sqrt(1.0 - JOIN)
#: The method that is no solver: one cell after another, by the closed form; its Gauss points of a whole step.
LOOP, WHOLE = "Python loop", POINTS[-1][1]


def _lsoda(
    rhs: Any, start: float, y: Floats, end: float, tolerance: float, scale: Floats, band: int
) -> tuple[Floats, int]:
    """LSODA through `odeint`: its loop is Fortran, its Jacobian banded."""
    from scipy.integrate import odeint

    states, info = odeint(
        rhs, y, [start, end], tfirst=True, rtol=tolerance, atol=tolerance * scale, ml=band, mu=band,
        tcrit=[end], mxstep=5000, full_output=True,
    )  # fmt: skip
    return states[-1], int(info["nfe"][-1])


def _march(name: str, **options: Any) -> Solver:
    """Return one of SciPy's solver classes."""

    def solve(
        rhs: Any, start: float, y: Floats, end: float, tolerance: float, scale: Floats, band: int
    ) -> tuple[Floats, int]:
        from scipy.integrate import solve_ivp
        from scipy.sparse import identity, kron

        chosen = dict(options)
        if name == "Radau":  # its Jacobian has one block a cell
            rows = band + 1
            chosen["jac_sparsity"] = kron(identity(y.size // rows), np.ones((rows, rows)), format="csc")
        done = solve_ivp(rhs, (start, end), y, name, (end,), rtol=tolerance, atol=tolerance * scale, **chosen)
        if not done.success:
            raise DigiclayError(f"{name} failed at {done.t[-1]:g} s.")
        return done.y[:, -1], int(done.nfev)

    return solve


SOLVERS: dict[str, Solver] = {"LSODA": _lsoda, "DOP853": _march("DOP853"), "Radau": _march("Radau")}


class Finger:
    """A level fingertip's lowest point, in plain Python: three numbers at a time."""

    def __init__(self, path: Trajectory) -> None:
        self.times = path.times.tolist()
        samples = [np.linspace(a, b, 4) for a, b in zip(path.times, path.times[1:], strict=False)]
        # Each piece is a cubic; four values of it give its coefficients.
        power = np.vander(np.linspace(0.0, 1.0, 4), 4, increasing=True)
        self.pieces = [np.linalg.solve(power, path.poses(times)[:, :3]).tolist() for times in samples]

    def __call__(self, t: float) -> tuple[float, float, float]:
        """Return x, y, z, m."""
        i = min(max(bisect_right(self.times, t) - 1, 0), len(self.pieces) - 1)
        s = min(max((t - self.times[i]) / (self.times[i + 1] - self.times[i]), 0.0), 1.0)
        a, b, c, d = self.pieces[i]
        x, y, z = (a[j] + s * (b[j] + s * (c[j] + s * d[j])) for j in range(3))
        return x, y, z


class Line:
    """The physics of one control period's cells, for solvers that take only ``dy/dt = f(t, y)``.

    The state is cell by cell: height, three filters, opening.
    """

    def __init__(self, task: Problem) -> None:
        self.system = replaying(task.scene, task.commands)
        self.finger = Finger(task.scene.section("trajectory").trajectory())
        self.cell: Any = self.system.cell
        touch: Any = self.cell.touch
        self.tip, self.contact, self.pulp = touch.fingertip, touch.contact, touch.pulp
        self.aging = np.exp(-self.pulp.rates[:, 0] * self.system.period)

    def underside(self, t: float, x: Floats, y: Floats) -> Floats:
        """Return the fingertip's underside at `t`, s, over places, (k,), m."""
        at_x, at_y, at_z = self.finger(t)
        inward = 1.0 - ((x - at_x) / self.tip.length) ** 2 - ((y - at_y) / self.tip.width) ** 2
        kept = np.maximum(inward, 1.0 - JOIN)
        under: Floats = at_z + self.tip.height * (1.0 - np.sqrt(kept) - (inward - kept) * (0.5 / ROOT))
        return under

    def rates(self, x: Floats, y: Floats, command: Floats) -> Callable[[float, Floats], Floats]:
        """Return the right-hand side for cells with commands, (n,); the first k, at x, y, may be touched."""
        k, n, cell, contact = x.size, command.size, self.cell, self.contact
        out, weights, speeds = np.zeros((n, 5)), self.pulp.shares, self.pulp.rates[:, 0]
        high, low = cell.supply.high, cell.supply.low
        lag, area = cell.lag.time_constant, cell.actuator.area
        unit, share = contact.stiffness / contact.exponent, contact.share / area
        conductance = cell.flow.conductance

        def rhs(t: float, flat: Floats) -> Floats:
            state = flat.reshape(n, 5)
            opening = state[:, 4]
            drop = np.where(opening > 0.0, high, low)
            if k:
                deep = contact.exponent * (state[:k, 0] - self.underside(t, x, y))
                tension = unit * np.expm1(np.minimum(np.maximum(deep, 0.0), 500.0))
                filters = state[:k, 1:4]
                drop[:k] -= share * np.maximum(tension - filters @ weights, 0.0)
                np.multiply(tension[:, None] - filters, speeds, out[:k, 1:4])
            np.multiply(conductance(opening, drop), drop / area, out[:, 0])
            np.divide(command - opening, lag, out[:, 4])
            return out.ravel().copy()

        return rhs

    def force(self, t: float, state: Floats, x: Floats, y: Floats) -> float:
        """Return the total force on cells the fingertip may touch, N."""
        pulled = self.contact.tension(state[:, 0] - self.underside(t, x, y))
        pulled -= state[:, 1:4] @ self.pulp.shares
        return float(self.contact.share * np.maximum(pulled, 0.0).sum())


def peer(task: Problem, solver: Solver, tolerance: float) -> tuple[Solution, float, int]:
    """Integrate a problem by a solver; return its solution, the CPU time, s, and the evaluations."""
    line = Line(task)
    system, grid = line.system, line.system.grid
    state = begin(system).rows[: system.rows.physics].T.copy()
    cut, dead = system.rows.queue > 1, task.dead_time
    scale = np.array([1e-2, 1.0, 1.0, 1.0, 1.0])  # 10 mm, 1 N, and an open valve
    before, heights, forces, evaluations = np.zeros(grid.count), [], [], 0
    started = time.process_time()
    for row, ((cells, k), command) in enumerate(zip(task.sets, task.commands, strict=True)):
        start, near = row * system.period, cells[:k]
        x, y = grid.x[near], grid.y[near]
        pieces = [(start, start + dead, before), (start + dead, start + system.period, command)]
        for first, last, acting in pieces if cut else pieces[1:]:
            rhs = line.rates(x, y, acting[cells])
            scales = np.tile(scale, cells.size)
            flat, calls = solver(rhs, first, state[cells].ravel(), last, tolerance, scales, 4)
            state[cells] = flat.reshape(-1, 5)
            evaluations += calls
        away = np.ones(grid.count, bool)
        away[near] = False
        state[away, 1:4] *= line.aging
        heights.append(state[:, 0].copy())
        forces.append(line.force(start + system.period, state[near], x, y))
        before = command
    took = time.process_time() - started
    return Solution(np.array(heights), np.array(forces)), took, evaluations


def find_reference(task: Problem) -> tuple[Solution, float]:
    """Return the solution of DOP853 at a tolerance of 1e-12, and how far Richardson's is from it, m."""
    exact = peer(task, _march("DOP853", max_step=1e-3, first_step=1e-5), 1e-12)[0]
    return exact, task.solve("richardson", CHECK).compare(exact)[0]


def run_solver(task: Problem, exact: Solution, name: str, tolerances: tuple[float, ...]) -> Iterator[Work]:
    """Give the points of one of the `SOLVERS`, one a relative tolerance."""
    for tolerance in tolerances:
        solution, took, evaluations = peer(task, SOLVERS[name], tolerance)
        yield Work(task.name, name, tolerance, *solution.compare(exact), took, evaluations, True)


def loop(task: Problem, step: float) -> tuple[Solution, float]:
    """Integrate the cells that take part, one by one, in plain Python at a step, s; also the CPU time, s."""
    line = Line(task)
    system, grid = line.system, line.system.grid
    count, dead, tau = round(system.period / step), task.dead_time, line.cell.lag.time_constant
    scalar = Scalar(line, step)
    state = begin(system).rows[: system.rows.physics].T.tolist()
    aging = line.aging.tolist()
    xs, ys, heights, forces = grid.x.tolist(), grid.y.tolist(), [], []
    old = [0.0] * grid.count
    started = time.process_time()
    for row, (cells, k) in enumerate(task.sets):
        start, new = row * system.period, task.commands[row].tolist()
        poses = [line.finger(start + i * step / 2) for i in range(2 * count + 1)]
        total, touched = 0.0, set(cells[:k].tolist())
        for i in range(grid.count):
            if i not in touched:
                state[i][1:4] = [z * a for z, a in zip(state[i][1:4], aging, strict=True)]
        for i in cells.tolist():
            y, near = state[i], i in touched
            unders = [scalar.underside(pose, xs[i], ys[i]) for pose in poses] if near else []
            for s in range(count):
                command = new[i] if s * step >= dead - 1e-12 else old[i]
                openings = [command + (y[4] - command) * math.exp(-node * step / tau) for node, _ in WHOLE]
                y[4] = command + (y[4] - command) * math.exp(-step / tau)
                scalar.step(y, openings, unders[2 * s : 2 * s + 3])
            if near:
                total += scalar.force(y, unders[-1])
        heights.append([y[0] for y in state])
        forces.append(total)
        old = new
    return Solution(np.array(heights), np.array(forces)), time.process_time() - started


def run_loop(task: Problem, exact: Solution, step: float = 1e-3) -> Work:
    """Return the loop's point: a whole run at one step, s."""
    solution, took = loop(task, step)
    count = task.scene.periods * round(PERIOD / step)
    return Work(task.name, LOOP, step, *solution.compare(exact), took, count, True)


class Scalar:
    """The closed-form step of one cell in Python's own numbers; a state is height, three filters, opening."""

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
        """Return the underside over a cell at `x`, `y`, m, of a fingertip whose lowest point is `pose`."""
        inward = 1.0 - ((x - pose[0]) / self.tip.length) ** 2 - ((y - pose[1]) / self.tip.width) ** 2
        kept = max(inward, 1.0 - JOIN)
        under: float = pose[2] + self.tip.height * (1.0 - math.sqrt(kept) - (inward - kept) * 0.5 / ROOT)
        return under

    def tension(self, height: float, under: float) -> float:
        """Return T in units of b/m; heights of the pin and of the underside over it, m."""
        return math.expm1(min(max(self.m * (height - under), 0.0), 500.0))

    def force(self, y: list[float], under: float) -> float:
        """Return the force on a cell with state `y`, N; `under`: the underside over it, m."""
        relaxed = sum(w * z for w, z in zip(self.weights, y[1:4], strict=True))
        return float(self.share * max(self.unit * self.tension(y[0], under) - relaxed, 0.0))

    def step(self, y: list[float], openings: list[float], unders: list[float]) -> None:
        """Move a cell on by a step, in place, with its openings at the Gauss points of the step.

        `unders`: the underside at start, middle and end of the step, m; empty where it cannot be touched.
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
            crossing = solve_crossing(*(np.array([v]) for v in (exponent, bow, slip, decay, 1.0 + lost)))
            push, mean = float(crossing[0][0]), float(crossing[1][0])
        y[0] = min(max(y[0] + free + push / self.m, 0.0), self.stroke)
        tensions = [self.unit * value for value in (first, max(mean, 0.0), self.tension(y[0], end))]
        work = [*y[1:4], *tensions]
        y[1:4] = [max(sum(a * b for a, b in zip(row, work, strict=True)), 0.0) for row in self.transition]
