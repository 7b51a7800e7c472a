"""Adapter: the classical Runge-Kutta method in plain Python, one pin after another."""

import math
from typing import Any

from ..problem import JOIN, ROOT, Law

METHODS = {"Runge-Kutta 4, Python loop": (5e-3, 2.5e-3, 1e-3)}


def prepare(problem: Any, method: str, setting: float) -> Any:
    """Return what integrates a problem once at a step, s."""
    law, judged = Law(problem), problem.pins.tolist()
    x, y, tip, top = law.x.tolist(), law.y.tolist(), law.tip, law.pin["stroke"]
    nu, shares = law.rates.ravel().tolist(), law.shares.tolist()

    def load(state: list[float], pin: int, pose: list[float]) -> tuple[float, float]:
        across, along = (x[pin] - pose[0]) / tip["length"], (y[pin] - pose[1]) / tip["width"]
        inward = 1.0 - across * across - along * along
        kept = max(inward, 1.0 - JOIN)
        under = pose[2] + tip["height"] * (1.0 - math.sqrt(kept) - (inward - kept) * (0.5 / ROOT))
        tension = law.unit * math.expm1(min(max(law.exponent * (state[0] - under), 0.0), 300.0))
        lost = sum(share * z for share, z in zip(shares, state[1:], strict=True))
        return tension, max(tension - lost, 0.0)

    def change(state: list[float], pin: int, pose: list[float], openings: list[float]) -> list[float]:
        tension, force = load(state, pin, pose)
        if law.damping is not None:
            speed = -force / law.damping
        else:
            k = openings[pin % len(openings)]
            drop = (law.high if k > 0.0 else law.low) - force / law.area
            lift, a = law.laminar * k * k, law.turbulent * abs(k)
            root = law.resistance * a + math.sqrt((law.resistance * a) ** 2 + 4.0 * abs(drop)) + 1e-300
            speed = min(lift / (1.0 + law.resistance * lift), 2.0 * a / root) * drop / law.area
        if (state[0] <= 0.0 and speed < 0.0) or (state[0] >= top and speed > 0.0):
            speed = 0.0
        return [speed, *(n * (tension - z) for n, z in zip(nu, state[1:], strict=True))]

    def solve() -> Any:
        states, rows = law.begin().T.tolist(), []
        for period in range(problem.count):
            for start, end, segment in law.pieces(period):
                parts = math.ceil((end - start) / setting - 1e-9)
                h = (end - start) / parts
                for t in (start + h * i for i in range(parts)):
                    at = [(law.pose(s), law.opening(s, segment).tolist()) for s in (t, t + h / 2, t + h)]
                    for pin, s in enumerate(states):
                        a = change(s, pin, *at[0])
                        b = change([v + h / 2 * r for v, r in zip(s, a, strict=True)], pin, *at[1])
                        c = change([v + h / 2 * r for v, r in zip(s, b, strict=True)], pin, *at[1])
                        d = change([v + h * r for v, r in zip(s, c, strict=True)], pin, *at[2])
                        rates = zip(s, a, b, c, d, strict=True)
                        s[:] = [v + h / 6 * (k + 2 * (m + n) + q) for v, k, m, n, q in rates]
                        s[0] = min(max(s[0], 0.0), top)
            if period + 1 in problem.judged:
                forces = [load(states[p], p, law.pose(end))[1] for p in judged]
                rows.append(([states[p][0] for p in judged], forces))
        return rows

    return solve
