"""References of PinBench: each judged pin by itself, by DOP853 at a relative tolerance of 2.3e-14."""

import json
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.files.tables import Record

from .problem import FOLDER, Law, Problem

#: The method of the references and that of their check, with relative tolerances.
METHODS = (("DOP853", 2.3e-14), ("RK45", 1e-13))
#: Steps of a period at least: a longer one may miss that the law changes within it.
STEPS = 20


def solve_pin(
    problem: Problem, pin: int, method: str, tolerance: float
) -> Iterator[tuple[float, float]]:
    """Give height, m, and force, N, of a pin at the ends of the judged periods."""
    from scipy.integrate import solve_ivp

    law = Law(problem, np.array([pin]))
    state = law.begin()

    def rates(time: float, values: Floats, segment: int) -> Floats:
        return law.change(time, values.reshape(state.shape), segment).ravel()

    for period in range(problem.count):
        for start, end, segment in law.pieces(period):
            with np.errstate(all="ignore"):  # errors that underflow
                solved = solve_ivp(
                    partial(rates, segment=segment),
                    (start, end),
                    state.ravel(),
                    method,
                    rtol=tolerance,
                    atol=tolerance * 1e-2,
                    max_step=law.period / STEPS,
                )
            if not solved.success:
                raise ArithmeticError(f"no reference at {start:g} s: {solved.message}")
            state = solved.y[:, -1].reshape(state.shape)
            law.stop(state)
        if period + 1 in problem.judged:
            yield float(state[0, 0]), float(law.load(end, state)[1][0])


def solve_pins(problem: Problem, pins: Any, method: str, tolerance: float) -> Floats:
    """Return heights and forces, (2, t, p), of some pins."""
    solved = [list(solve_pin(problem, int(pin), method, tolerance)) for pin in pins]
    return np.array(solved).transpose(2, 1, 0)


def make(problem: Problem) -> Record:
    """Return the reference of a problem, and how far another method is from it."""
    exact = solve_pins(problem, problem.pins, *METHODS[0])
    checked = solve_pins(problem, problem.pins[::4], *METHODS[1])
    apart = np.abs(checked - exact[:, :, ::4]).max(axis=(1, 2)).tolist()
    return {
        "method": f"each pin alone: DOP853, relative tolerance 2.3e-14, {STEPS} steps a period at least",
        "check": "every fourth judged pin: RK45, 1e-13",
        "apart": {"height": apart[0], "force": apart[1]},
        "heights": exact[0].tolist(),
        "forces": exact[1].tolist(),
    }


def write(problem: Problem) -> None:
    """Make the reference of a problem and write it into its file, a key a line."""
    file = {**problem.file, "reference": make(problem)}
    lines = ",\n".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in file.items())
    (FOLDER / f"{problem.name}.json").write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")
