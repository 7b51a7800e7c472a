"""Adapter: the classical Runge-Kutta method over all pins at once, in numpy."""

from typing import Any

import numpy as np

from ..problem import Law

METHODS = {"Runge-Kutta 4, numpy": (5e-3, 2.5e-3, 1e-3, 5e-4, 2.5e-4)}


def prepare(problem: Any, method: str, setting: float) -> Any:
    """Return what integrates a problem once at a step, s."""
    law = Law(problem)

    def solve() -> Any:
        y, rows = law.begin(), []
        for period in range(problem.count):
            for start, end, segment in law.pieces(period):
                parts = int(np.ceil((end - start) / setting - 1e-9))
                h = (end - start) / parts
                for t in start + h * np.arange(parts):
                    a = law.change(t, y, segment)
                    b = law.change(t + h / 2, y + h / 2 * a, segment)
                    c = law.change(t + h / 2, y + h / 2 * b, segment)
                    y += h / 6 * (a + 2 * (b + c) + law.change(t + h, y + h * c, segment))
                    law.stop(y)
            if period + 1 in problem.judged:
                rows.append((y[0, problem.pins], law.load(end, y)[1][problem.pins]))
        return rows

    return solve
