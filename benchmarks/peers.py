"""Peers of the steppers: the same problems, solved by SciPy.

The peers get every advantage: rates with few numpy calls, only the cells that take part by the
problem's sets, the banded Jacobian where a solver knows one, and a solver's own Fortran loop where
there is one.
"""

from __future__ import annotations

import math
import time
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import DigiclayError
from digiclay.core.engine.simulation import begin
from digiclay.core.model.fingertip import JOIN
from digiclay.core.model.trajectory import Trajectory

from .problems import Measured, Problem, replaying, solved
from .work_precision import Work

#: Moves the flat state from one time to another; returns it and the number of evaluations.
Solver = Callable[[Any, float, Floats, float, float, Floats, int], tuple[Floats, int]]
#: Step of the check of the reference, s.
CHECK = 5e-5
ROOT = math.sqrt(1.0 - JOIN)


def missing() -> str:
    """Return what to install when SciPy is missing, else nothing."""
    try:
        import scipy.integrate  # noqa: F401
    except ImportError:
        return "SciPy is not installed: run 'pip install scipy' for the comparison with its solvers."
    return ""


def _lsoda(
    rhs: Any, start: float, y: Floats, end: float, tolerance: float, scale: Floats, band: int
) -> tuple[Floats, int]:
    """LSODA through `odeint`: its loop is Fortran, its Jacobian banded."""
    from scipy.integrate import odeint

    found, told = odeint(
        rhs, y, [start, end], tfirst=True, rtol=tolerance, atol=tolerance * scale, ml=band, mu=band,
        tcrit=[end], mxstep=5000, full_output=True,
    )  # fmt: skip
    return found[-1], int(told["nfe"][-1])


def _marched(name: str, **known: Any) -> Solver:
    """Return one of SciPy's solver classes."""

    def solve(
        rhs: Any, start: float, y: Floats, end: float, tolerance: float, scale: Floats, band: int
    ) -> tuple[Floats, int]:
        import scipy.integrate

        own = dict(known)
        if name == "Radau":
            own["jac_sparsity"] = _blocks(y.size, band + 1)
        kind = getattr(scipy.integrate, name)
        solver = kind(rhs, start, y, end, rtol=tolerance, atol=tolerance * scale, **own)
        while solver.status == "running":
            solver.step()
        if solver.status != "finished":
            raise DigiclayError(f"{name} failed at {solver.t:g} s.")
        return solver.y, int(solver.nfev)

    return solve


def _blocks(size: int, rows: int) -> Any:
    """Return the pattern of the Jacobian: one block a cell."""
    from scipy.sparse import identity, kron

    return kron(identity(size // rows), np.ones((rows, rows)), format="csc")


SOLVERS: dict[str, Solver] = {"LSODA": _lsoda, "DOP853": _marched("DOP853"), "Radau": _marched("Radau")}


class Finger:
    """A level finger's lowest point, in plain Python: three numbers at a time."""

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
    """The physics of one control period's cells, for solvers that know only ``dy/dt = f(t, y)``.

    The state is cell by cell: height, three filters, opening.
    """

    def __init__(self, known: Problem) -> None:
        self.system = replaying(known.scene, known.commands)
        self.finger = Finger(known.scene.section("trajectory").trajectory())
        cell = self.system.cell
        assert cell.touch is not None
        self.cell: Any = cell
        self.tip, self.contact = cell.touch.fingertip, cell.touch.contact
        self.pulp: Any = cell.touch.pulp

    def underside(self, t: float, x: Floats, y: Floats) -> Floats:
        """Return the finger's underside, m. `t`, s; `x`, `y` (k,), m."""
        at_x, at_y, at_z = self.finger(t)
        inward = 1.0 - ((x - at_x) / self.tip.length) ** 2 - ((y - at_y) / self.tip.width) ** 2
        kept = np.maximum(inward, 1.0 - JOIN)
        under: Floats = at_z + self.tip.height * (1.0 - np.sqrt(kept) - (inward - kept) * (0.5 / ROOT))
        return under

    def rates(self, x: Floats, y: Floats, command: Floats) -> Callable[[float, Floats], Floats]:
        """Return the right-hand side for some cells, the first of which the finger may touch.

        `x`, `y` (k,), places of the cells the finger may touch, m; `command` (n,), commands of the cells that
        are integrated; the first k are those above.
        """
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


def peer(
    known: Problem, solver: Solver, tolerance: float, periods: int | None = None
) -> tuple[Measured, float, int]:
    """Integrate a problem by one of the `SOLVERS`; return it, the CPU time, s, and the evaluations.

    `tolerance`: relative; `periods`: control periods to integrate; by default all.
    """
    line = Line(known)
    system, grid = line.system, line.system.grid
    state = begin(system).rows[: system.rows.physics].T.copy()
    cut = system.rows.queue > 1
    dead = known.scene.delay.dead_time if known.scene.delay else 0.0
    aging = np.exp(-line.pulp.rates[:, 0] * system.period)
    scale = np.array([1e-2, 1.0, 1.0, 1.0, 1.0])  # 10 mm, 1 N, and an open valve
    nothing, heights, forces, evaluations = np.zeros(grid.count), [], [], 0
    started = time.process_time()
    for row, (cells, k) in enumerate(known.sets[:periods]):
        start, near = row * system.period, cells[:k]
        x, y = grid.x[near], grid.y[near]
        before = known.commands[row - 1] if row else nothing
        pieces = [(start, start + dead, before), (start + dead, start + system.period, known.commands[row])]
        for first, last, seen in pieces if cut else pieces[1:]:
            rhs = line.rates(x, y, seen[cells])
            start_at, scales = state[cells].ravel(), np.tile(scale, cells.size)
            flat, calls = solver(rhs, first, start_at, last, tolerance, scales, 4)
            state[cells] = flat.reshape(-1, 5)
            evaluations += calls
        away = np.ones(grid.count, bool)
        away[near] = False
        state[away, 1:4] *= aging
        heights.append(state[:, 0].copy())
        forces.append(_force(line, start + system.period, state[near], x, y))
    took = time.process_time() - started
    return Measured(np.array(heights), np.array(forces)), took, evaluations


def _force(line: Line, t: float, state: Floats, x: Floats, y: Floats) -> float:
    """Return the total force on cells the finger may touch, N."""
    pulled = line.contact.tension(state[:, 0] - line.underside(t, x, y))
    pulled -= state[:, 1:4] @ line.pulp.shares
    return float(line.contact.share * np.maximum(pulled, 0.0).sum())


def reference(known: Problem) -> Measured:
    """Return the solution at a tolerance of 1e-12."""
    return peer(known, _marched("DOP853", max_step=1e-3, first_step=1e-5), 1e-12)[0]


def reference_and_check(known: Problem) -> tuple[Measured, float]:
    """Return the exact solution and how far Richardson's form, its stand-in without SciPy, is from it, m."""
    simulation = replace(known.scene.simulation, stepper="richardson", physics_step=CHECK)
    other = solved(replace(known.scene, simulation=simulation), known.commands)
    exact = other if missing() else reference(known)
    return exact, other.against(exact)[0]


def points(known: Problem, exact: Measured, name: str, tolerances: tuple[float, ...]) -> Iterator[Work]:
    """Give the points of one solver, one a tolerance.

    `exact`: its exact solution; `name`: key of `SOLVERS`; `tolerances`: relative.
    """
    for tolerance in tolerances:
        found, took, evaluations = peer(known, SOLVERS[name], tolerance)
        height, force = found.against(exact)
        yield Work(known.name, name, tolerance, height, force, took, evaluations, True)
