"""The paper's session again, by SciPy: other formulas, other integrator, the recorded commands.

Nothing of the core's physics is used here, only the parameters: valve and conduit are solved
from the conditions of equations 3 to 8, the finger's path is SciPy's Hermite spline, and the
equations are integrated at a tolerance of 1e-6, period by period, over every cell that a
command is on its way to, whose valve is not shut, or that the finger may touch. All others
stand still, and the pulp over them relaxes exponentially.
"""

import math
from types import SimpleNamespace as Numbers

import numpy as np
from digiclay.core.scene.assembly import assemble
from scipy.integrate import DOP853
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from tests.assemble import record, sample

#: A valve open less than this lets through 1e-14 of its full flow: 1 nm in the whole session.
SHUT = 1e-7
#: How far a pin and the finger together come closer in a period, at most, m.
MARGIN = 1e-3


def numbers():
    density, viscosity, orifice, stroke = 855.0, 1.6e-6, 0.5e-3, 30e-6
    laminar = math.pi**2 * orifice**4 / (8.0 * 200.0**2 / 0.18**2 * viscosity * stroke * density)
    turbulent = 0.18 * math.pi * orifice**2 / 4.0 * math.sqrt(2.0 / density)
    weights = np.array([0.08, 0.62, 0.20, 0.10])
    return Numbers(
        area=math.pi * 2e-3**2 / 4.0, high=0.5e5, low=-0.5e5, laminar=laminar, turbulent=turbulent,
        resistance=128.0 * density * viscosity * 10e-3 / (math.pi * 0.8e-3**4), knee=4e4 * viscosity * stroke,
        lag=2e-3, dead_time=1e-3, b=250.0, m=2000.0, share=0.34,
        rates=1.0 / np.array([[4e-3], [70e-3], [1.4]]), weights=weights[1:] / weights.sum(),
        axes=np.array([10e-3, 8e-3, 8e-3]),
    )  # fmt: skip


def flow(p, opening, drop):
    """Return the flow through valve and conduit: laminar, unless that has Re* above 200."""
    squared = opening * opening
    q = p.laminar * squared * drop / (1.0 + p.resistance * p.laminar * squared)
    fast = np.abs(q) > p.knee
    if fast.any():
        # Q |Q| / a² + R Q = ΔP
        a = (p.turbulent * opening[fast]) ** 2
        size = a * (np.sqrt(p.resistance**2 + 4.0 * np.abs(drop[fast]) / a) - p.resistance) / 2.0
        q[fast] = np.copysign(size, drop[fast])
    return q


def spline(trajectory):
    """Return the smooth path of the lowest point: monotone cubics that start and end at rest."""
    slopes = PchipInterpolator(trajectory.times, trajectory.positions).derivative()(
        trajectory.times
    )
    slopes[[0, -1]] = 0.0
    return CubicHermiteSpline(trajectory.times, trajectory.positions, slopes)


def underside(p, position, x, y):
    """Return the height of a level finger's underside, continued with its slope beyond r² = 0.96."""
    square = ((x - position[0]) / p.axes[0]) ** 2 + ((y - position[1]) / p.axes[1]) ** 2
    root = np.sqrt(1.0 - np.minimum(square, 0.96)) - np.maximum(square - 0.96, 0.0) / (
        2.0 * math.sqrt(0.04)
    )
    return position[2] + p.axes[2] * (1.0 - root)


def tension(p, depth):
    return p.b / p.m * (np.exp(p.m * np.maximum(depth, 0.0)) - 1.0)


def integrate(p, curve, system, run):
    """Return heights and forces, shape (t, n), of the recorded commands."""
    x, y, n = system.grid.x, system.grid.y, system.grid.count
    full = np.zeros((5, n))
    full[0] = run.height[0]
    heights, forces = np.empty_like(run.height), np.zeros_like(run.force)
    heights[0] = full[0]
    commands = np.concatenate([np.zeros((1, n)), run.command[:-1]])
    for row, start in enumerate(run.time[:-1]):
        end = run.time[row + 1]
        for first, last, seen in (
            (start, start + p.dead_time, row),
            (start + p.dead_time, end, row + 1),
        ):
            advance(p, curve, x, y, full, commands[seen], first, last)
        heights[row + 1] = full[0]
        depth = full[0] - underside(p, curve(end), x, y)
        forces[row + 1] = p.share * np.maximum(tension(p, depth) - p.weights @ full[2:], 0.0)
    return heights, forces


def advance(p, curve, x, y, full, command, start, end):
    """Integrate the cells that something happens to from `start` to `end`, in place; all others relax."""
    lowest = np.minimum(underside(p, curve(start), x, y), underside(p, curve(end), x, y))
    near = full[0] + MARGIN > lowest
    busy = (command != 0.0) | (np.abs(full[1]) > SHUT)
    cells = np.concatenate([np.flatnonzero(near), np.flatnonzero(busy & ~near)])
    others = np.flatnonzero(~near)
    full[2:, others] *= np.exp(-p.rates * (end - start))
    full[1, ~busy] = 0.0
    if not cells.size:
        return
    k, own = int(near.sum()), command[cells]
    near_x, near_y = x[cells[:k]], y[cells[:k]]

    def rhs(t, flat):
        height, opening, filters = unpack(flat, cells.size, k)
        change = np.empty_like(flat)
        d_height, d_opening, d_filters = unpack(change, cells.size, k)
        drop = np.where(opening > 0.0, p.high, p.low)
        if k:
            pull = tension(p, height[:k] - underside(p, curve(t), near_x, near_y))
            drop[:k] -= p.share * np.maximum(pull - p.weights @ filters, 0.0) / p.area
            d_filters[:] = p.rates * (pull - filters)
        d_height[:] = flow(p, opening, drop) / p.area
        d_opening[:] = (own - opening) / p.lag
        return change

    # The absolute tolerances are some 1e-7 of what each row reaches: 0.1 m, 1, and a newton. A
    # hundredth of both changes the departures below by 4e-13 m and 1e-9 N in the first 4.5 s, of 5
    # µm and 1 mN.
    tolerance = np.concatenate(
        [np.full(cells.size, 1e-8), np.full(cells.size, 1e-7), np.full(3 * k, 1e-7)]
    )
    flat = np.concatenate([full[:2, cells].ravel(), full[2:, cells[:k]].ravel()])
    solver = DOP853(rhs, start, flat, end, rtol=1e-6, atol=tolerance, first_step=end - start)
    while solver.status == "running":
        solver.step()
    assert solver.status == "finished"
    height, opening, filters = unpack(solver.y, cells.size, k)
    full[0, cells], full[1, cells], full[2:, cells[:k]] = height, opening, filters


def unpack(flat, count, near):
    return flat[:count], flat[count : 2 * count], flat[2 * count :].reshape(3, near)


def test_heights_and_forces_agree_with_scipy_over_the_whole_session():
    scene = sample("ridge_mound_valley")
    system, trajectory = assemble(scene), scene.section("trajectory").trajectory()
    run = record(system, trajectory, round(trajectory.duration / system.period))
    # Guards against a session in which nothing happens.
    assert run.height[-1].max() > 60e-3
    assert run.height[-1].min() < 35e-3
    assert (run.force > 0.0).any(axis=0).sum() > 50
    heights, forces = integrate(numbers(), spline(trajectory), system, run)
    # What the project promises at the default step: 5 µm, for a pin's own play is larger, and 1 mN,
    # 1/400 of the force that is asked for.
    assert np.abs(heights - run.height).max() < 5e-6
    assert np.abs(forces - run.force).max() < 1e-3
