"""Adapter: solvers of SciPy over all pins at once, restarted where a command changes."""

from typing import Any

import numpy as np

from ..problem import Law

#: Of SciPy's six solvers these are the fastest (benchmarks/README.md).
METHODS = dict.fromkeys(("SciPy LSODA", "SciPy RK45", "SciPy RK23"), (1e-3, 1e-5, 1e-7, 1e-9))


def prepare(problem: Any, method: str, setting: float) -> Any:
    """Return what integrates a problem once at a relative tolerance."""
    from scipy.integrate import odeint, solve_ivp

    law = Law(problem)
    shape = law.begin().shape
    scale = np.ones(shape).T
    scale[:, 0] = 1e-2
    name, absolute = method.split()[1], setting * scale.ravel()
    band = shape[0] - 1

    def solve() -> Any:
        y, rows = law.begin().T.ravel(), []  # pin by pin: the Jacobian is banded
        for period in range(problem.count):
            for start, end, segment in law.pieces(period):

                def rates(t: float, y: Any, segment: int = segment) -> Any:
                    return law.change(t, y.reshape(-1, shape[0]).T, segment).T.ravel()

                if name == "LSODA":
                    y = odeint(
                        rates,
                        y,
                        [start, end],
                        tfirst=True,
                        rtol=setting,
                        atol=absolute,
                        ml=band,
                        mu=band,
                        tcrit=[end],
                        mxstep=50000,
                    )[-1]
                else:
                    y = solve_ivp(
                        rates, (start, end), y, name, (end,), rtol=setting, atol=absolute
                    ).y[:, -1]
                law.stop(y.reshape(-1, shape[0]).T)
            if period + 1 in problem.judged:
                state = y.reshape(-1, shape[0]).T
                rows.append((state[0, problem.pins], law.load(end, state)[1][problem.pins]))
        return rows

    return solve
