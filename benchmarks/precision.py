"""``python -m benchmarks precision``: error against run time, beside SciPy's solvers and a Python loop."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import astuple
from typing import Any

import numpy as np
from digiclay.commands.progress import table
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from numpy.typing import NDArray

from . import peers, plots, whole_bed
from .problems import PERIOD, PROBLEMS, live, ours, problem
from .python_loop import looped
from .report import add_kind, kept, made_with, progress
from .work_precision import COLUMNS, RATIOS, Work, ratios, runs

#: Steppers and their steps, s.
OURS = {
    "bernoulli": (5e-3, 2.5e-3, 1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5, 2.5e-5),
    "richardson": (5e-3, 2.5e-3, 1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5),
    "runge_kutta_4": (1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5),
    "heun": (1e-3, 2.5e-4, 5e-5),
    "euler": (1e-3, 2.5e-4, 5e-5),
}
#: Solvers and their relative tolerances.
PEERS = {
    "LSODA": (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8),
    "DOP853": (1e-3, 1e-5, 1e-7),
    "Radau": (1e-3, 1e-5),
}
#: Cells taking part from which on Radau is run at one tolerance only: it takes minutes.
MANY = 100
QUICK = {"bernoulli": (5e-3, 1e-3, 2.5e-4), "richardson": (5e-3, 1e-3, 2.5e-4)}
QUICK_PEERS = {"LSODA": (1e-3, 1e-5)}
QUICK_PROBLEMS = ("one cell, load step", "pressed and held")
CUT = "session, lift and drag"


def add(kinds: Any) -> None:
    """Add the benchmark."""
    examples = "  python -m benchmarks precision --quick\n  python -m benchmarks precision --out results\n"
    examples += "  python -m benchmarks precision --whole-bed --out results\n"
    parser = add_kind(kinds, "precision", "error against run time, beside SciPy's solvers", examples)
    parser.add_argument(
        "--whole-bed",
        action="store_true",
        help="also peers that integrate all cells, on the paper's bed (11 minutes more)",
    )
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Run every method on every problem, and print the tables."""
    names = QUICK_PROBLEMS if arguments.quick else tuple(PROBLEMS)
    own, others = (QUICK, QUICK_PEERS) if arguments.quick else (OURS, PEERS)
    if peers.missing():
        others = {}
        print(peers.missing(), file=sys.stderr)
    work: list[Work] = []
    checked: list[list[str]] = []
    with progress(arguments, "precision", len(names) * (len(own) + len(others) + 2)) as bar:
        for name in names:
            known = problem(name)
            exact, apart = peers.reference_and_check(known)
            bar(f"{name}: reference")
            for stepper, steps in own.items():
                work += ours(known, exact, stepper, steps, 1 if arguments.quick else 3)
                bar(f"{name}: {stepper}")
            for solver, tolerances in others.items():
                many = solver == "Radau" and known.taking_part > MANY
                work += peers.points(known, exact, solver, tolerances[:1] if many else tolerances)
                bar(f"{name}: {solver}")
            work.append(looped(known, exact, 1e-3))
            bar(f"{name}: loop")
            checked.append(
                [name, str(known.scene.periods), f"{known.taking_part:.0f}", f"{apart * 1e12:.2g}"]
            )
    text = "\n".join(_text(work, checked, names, arguments.quick))
    print(text)
    kept(arguments.out, "precision", text, COLUMNS, [astuple(one) for one in work])
    if arguments.out:
        plots.draw_precision(work, arguments.out / "precision.png")
    if arguments.whole_bed:
        whole_bed.carry_out(arguments, [name for name in names if PROBLEMS[name][0] > 1])
    return 0


def _text(work: list[Work], checked: list[list[str]], names: tuple[str, ...], quick: bool) -> Iterator[str]:
    """Give the lines of the report."""
    yield made_with() if peers.missing() else made_with("scipy")
    yield "\nThe problems. The reference is SciPy's DOP853 at 1e-12; the last column is how far Richardson's"
    yield f"form at {peers.CHECK * 1e3:g} ms is from it, which includes the error of the latter.\n"
    yield from table(("problem", "control periods", "cells taking part", "apart, pm"), checked)
    yield "\nIntegration alone, under recorded commands; times are CPU times of the whole run.\n"
    yield from runs(work)
    yield "\nThe best solver's time over our best stepper's, at an error of height of at most:\n"
    rows = [[name, *ratios([one for one in work if one.problem == name])] for name in names]
    yield from table(("problem", *RATIOS), rows)
    yield "\nThe last column is the Python loop, one cell at a time, over the same steps with numpy (1 ms)."
    yield "\nWhat the control period changes, beside the integration: the surface of the session's cut at its"
    yield "end, with live control, against a control period of 1 ms with physics steps of 1 ms.\n"
    yield from table(("control period", "largest difference, mm", "root mean square, mm"), list(_periods()))
    yield "\nLive control with other steppers: the same surface, control period 5 ms, against bernoulli at a"
    yield f"step of {0.25 if quick else 0.1:g} ms.\n"
    yield from table(("stepper", "step", "largest difference, µm"), list(_live(quick)), left=2)


def _surface(period: float, step: float, stepper: str = "bernoulli") -> NDArray[np.float64]:
    """Return the heights at the end of the session's cut, with live control."""
    scene = live(CUT, period, step, stepper)
    system = assemble(scene)
    for state in periods(system, scene.trajectories(), begin(system), scene.periods):
        heights = state.row(0)
    return heights


def _periods() -> Iterator[list[str]]:
    """Give the rows of the table of control periods."""
    exact = _surface(1e-3, 1e-3)
    for period in (2e-3, PERIOD, 10e-3):
        apart = (_surface(period, 1e-3) - exact) * 1e3
        yield [f"{period * 1e3:g} ms", f"{np.abs(apart).max():.3g}", f"{np.sqrt(np.mean(apart**2)):.3g}"]


def _live(quick: bool) -> Iterator[list[str]]:
    """Give the rows of the table of steppers under live control."""
    exact = _surface(PERIOD, 2.5e-4 if quick else 1e-4)
    for stepper, step in (("bernoulli", 5e-3), *((name, 1e-3) for name in OURS)):
        with np.errstate(all="ignore"):
            apart = _surface(PERIOD, step, stepper) - exact
        yield [stepper, f"{step * 1e3:g} ms", f"{np.abs(apart).max() * 1e6:.3g}"]
