"""Benchmark ``precision``: error against run time, beside SciPy's solvers and a Python loop.

With ``--whole-bed`` also on the paper's bed: there the same solvers, in the same form, and the same
Python loop go through every cell of the bed too. Finding the cells that take part is a part of what a
period of ours does, and told to the peers otherwise.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from digiclay.commands.progress import table
from digiclay.core.base.arrays import Floats

from . import peers
from .peers import LOOP
from .problems import PERIOD, PROBLEMS, Problem, Solution, Work, live, problem, run_stepper, solve
from .report import Curves, Report, Row, Steps, tabulate

Settings = Mapping[str, tuple[float, ...]]

#: Relative tolerances of a solver.
TIGHT = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
#: Problems with --quick; and that whose surface is compared under live control.
QUICK, CUT = ("one cell, load step", "pressed and held"), "session, lift and drag"
#: Problems with more than one cell, and the rows and columns of the paper's bed.
SEVERAL, SIDE = tuple(name for name, row in PROBLEMS.items() if row[0] > 1), 25


@dataclass(frozen=True)
class Plan:
    """Plan of the runs."""

    problems: tuple[str, ...]
    steppers: Settings
    solvers: Settings
    """Steps of our steppers, s, and relative tolerances of SciPy's solvers."""
    rounds: int = 1
    """Runs of everything but the loops, by turns, of which the fastest counts."""
    side: int | None = None
    """Rows and columns of the bed on which peers go through all cells too."""


#: Plans of the problems on beds of their own, and on the paper's bed.
OWN = Plan(
    tuple(PROBLEMS),
    {
        "bernoulli": (5e-3, 2.5e-3, 1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5, 2.5e-5),
        "richardson": (5e-3, 2.5e-3, 1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5),
        "runge_kutta_4": (1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5),
        "heun": (1e-3, 2.5e-4, 5e-5),
        "euler": (1e-3, 2.5e-4, 5e-5),
    },
    {"LSODA": TIGHT, "DOP853": (1e-3, 1e-5, 1e-7), "Radau": (1e-3,)},
)
WHOLE = Plan(
    SEVERAL,
    {
        "bernoulli": (5e-3, 2.5e-3, 1e-3, 5e-4), "richardson": (5e-3, 2.5e-3, 1e-3, 5e-4),
        "runge_kutta_4": (1e-3, 5e-4),
    },
    {"LSODA": TIGHT, "DOP853": (1e-3, 1e-7)}, rounds=3, side=SIDE,
)  # fmt: skip
#: Ends the name of a method that goes through all cells.
EVERYWHERE = ", whole bed"

#: Errors of height at which the fastest are compared, m.
LEVELS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
RATIOS = (*(f"{m * 1e6:g} µm" if m > 9e-7 else f"{m * 1e9:g} nm" for m in LEVELS), "loop / ours")
#: Columns of the table of runs.
RUNS = {
    "problem": "problem", "method": "method", "setting": "setting",
    "height error, nm": "height_error .3g 1e9", "force error, µN": "force_error .3g 1e6",
    "CPU, ms": "seconds .3g 1e3", "evaluations": "evaluations d",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Beside:
    """The runs of one problem: our steppers, and peers, whose name says if they go through all cells."""

    task: Problem
    work: list[Work]
    apart: float = 0.0
    """Distance of two references, m."""


def measure(arguments: argparse.Namespace, steps: Steps) -> list[Report]:
    """Run every method on every problem, with ``--whole-bed`` also on the paper's bed."""
    plans = [OWN, WHOLE] if arguments.whole_bed else [OWN]
    if arguments.quick:
        plans = list(map(shorten, plans))
    steps.total = sum(len(plan.problems) * (plan.rounds + 2) for plan in plans)
    reports = []
    for plan in plans:
        beside = [_run_problem(name, plan, steps) for name in plan.problems]
        lines = list(list_beside(beside, plan))
        if not plan.side:
            lines += _list_live(2.5e-4 if arguments.quick else 1e-4)
        work = [run for runs in beside for run in runs.work]
        curves = Curves(
            {runs.task.name: _list_points(runs.work) for runs in beside},
            "CPU time, ms", "largest height error, µm",
        )  # fmt: skip
        name = "precision_whole_bed" if plan.side else ""
        reports.append(Report(lines, [asdict(run) for run in work], curves, name=name))
    return reports


def shorten(plan: Plan) -> Plan:
    """Return the plan of --quick: few problems, steps of our two forms, and tolerances of one solver."""
    problems = tuple(name for name in QUICK if name in plan.problems)
    steppers = dict.fromkeys(("bernoulli", "richardson"), (5e-3, 1e-3, 5e-4))
    return replace(plan, problems=problems, steppers=steppers, solvers={"LSODA": (1e-3, 1e-5)}, rounds=1)


def _list_points(work: Sequence[Work]) -> dict[str, list[tuple[float, float]]]:
    """Return the CPU time, ms, and the height error, µm, of the runs of each method."""
    return {
        method: [
            (run.seconds * 1e3, run.height_error * 1e6)
            for run in work
            if run.method == method and 0.0 < run.height_error < 2e-3
        ]
        for method in dict.fromkeys(run.method for run in work)
    }


def _run_problem(name: str, plan: Plan, steps: Callable[[str], None]) -> Beside:
    """Run the methods of a plan on a problem."""
    task = problem(name, side=plan.side)
    exact, apart = peers.find_reference(task)
    steps(f"{name}: reference")
    return Beside(task, run_beside(task, exact, plan, steps), apart)


def spread_everywhere(task: Problem) -> Problem:
    """Return a problem in which every cell may move and be touched in every period."""
    every = np.arange(task.scene.cells)
    return replace(task, sets=[(every, every.size)] * task.scene.periods)


def run_beside(
    task: Problem, exact: Solution, plan: Plan, steps: Callable[[str], None] = lambda step: None
) -> list[Work]:
    """Run the steppers and the peers of a plan on a problem, the latter in both forms if it has a `side`.

    The errors are those of all cells of the bed; the fastest of the rounds counts.
    """
    forms = {"": task, EVERYWHERE: spread_everywhere(task)} if plan.side else {"": task}
    turns: list[list[Work]] = []
    for turn in range(plan.rounds):
        work = [run for stepper in plan.steppers.items() for run in run_stepper(task, exact, *stepper)]
        for form, spread in forms.items():
            for solver, tolerances in plan.solvers.items():
                runs = peers.run_solver(spread, exact, solver, tolerances)
                work += [replace(run, method=solver + form) for run in runs]
        turns.append(work)
        steps(f"{task.name}: round {turn + 1}")
    # Runs with the same setting differ in nothing but their time.
    fastest = [min(same, key=lambda run: run.seconds) for same in zip(*turns, strict=True)]
    loops = [replace(peers.run_loop(spread, exact), method=LOOP + form) for form, spread in forms.items()]
    steps(f"{task.name}: loops")
    return [*fastest, *loops]


def list_beside(beside: Sequence[Beside], plan: Plan) -> Iterator[str]:
    """Give the lines of the report."""
    if plan.side:
        yield f"\nPeers over the whole bed: the problems on the paper's bed of {plan.side} x {plan.side}, for"
        yield "all methods. Peers are told which cells take part, or go through all of them in the same form"
        yield "('whole bed'); ours finds them itself. Errors are those of all cells of the bed."
    yield "\nThe problems. The reference is SciPy's DOP853 at 1e-12; the last column is how far Richardson's"
    yield f"form at {peers.CHECK * 1e3:g} ms is from it, which includes the error of the latter.\n"
    head = ("problem", "control periods", "cells of the bed", "cells taking part", "apart, pm")
    problems = [
        [task.name, f"{task.scene.periods}", f"{task.scene.cells}", f"{task.taking_part:.0f}", f"{apart:.2g}"]
        for task, apart in ((runs.task, runs.apart * 1e12) for runs in beside)
    ]
    yield from table(head, problems)
    yield "\nIntegration alone, under recorded commands; times are CPU times of the whole run."
    if plan.rounds > 1:
        yield f"They are the least of {plan.rounds}, run by turns; of 1 for the loops. Not to take hours,"
        yield "ours is run at few steps, and DOP853 at two tolerances."
    yield ""
    yield from list_runs([run for runs in beside for run in runs.work])
    yield "\nThe best solver's time over our best stepper's, at an error of height of at most:\n"
    rows = []
    for runs in beside:
        rows.append([runs.task.name, "told", *list_ratios(runs.work)])
        if plan.side:
            rows.append(["", "whole bed", *list_ratios(runs.work, EVERYWHERE)])
    yield from table(("problem", "peers", *RATIOS), rows, left=2)
    yield "\nThe last column is the Python loop, one cell at a time, over the same steps with numpy (1 ms)."


def _list_live(fine: float) -> Iterator[str]:
    """Give the table of control periods under live control, and the stepper's part; `fine`: step, s."""
    yield "\nWhat the control period changes, beside the integration: the surface of the session's cut at its"
    yield "end, with live control, against a control period of 1 ms with physics steps of 1 ms.\n"
    exact, rows = _form_surface(1e-3, 1e-3), []
    for period in (2e-3, PERIOD, 10e-3):
        apart = (_form_surface(period, 1e-3) - exact) * 1e3
        rows.append(
            [f"{period * 1e3:g} ms", f"{np.abs(apart).max():.3g}", f"{np.sqrt(np.mean(apart**2)):.3g}"]
        )
    yield from table(("control period", "largest difference, mm", "root mean square, mm"), rows)
    apart = (_form_surface(PERIOD, 5e-3) - _form_surface(PERIOD, fine)) * 1e6
    yield "\nWith control periods of 5 ms, a step of 5 ms changes the surface by at most"
    yield f"{np.abs(apart).max():.3g} µm against one of {fine * 1e3:g} ms."


def _form_surface(period: float, step: float) -> Floats:
    """Return the heights at the end of the session's cut, with live control; times in s."""
    heights: Floats = solve(live(CUT, period, step)).heights[-1]
    return heights


def _find_cheapest(work: list[Work], level: float, *, peer: bool) -> Work | None:
    """Return the fastest run with at most an error of height, m: one of ours, or one of the solvers."""
    fit = [
        run
        for run in work
        if run.peer == peer and not run.method.startswith(LOOP) and run.height_error <= level
    ]
    return min(fit, key=lambda run: run.seconds, default=None)


def best_ratio(work: list[Work], level: float) -> float | None:
    """Return the best solver's time over our best at an error of height, m; None where one is worse."""
    mine, theirs = _find_cheapest(work, level, peer=False), _find_cheapest(work, level, peer=True)
    return theirs.seconds / mine.seconds if mine and theirs else None


def list_ratios(work: list[Work], form: str = "") -> list[str]:
    """Return a row of ratios of a problem, with the peers of a form; the last: the loop to bernoulli."""
    work = [run for run in work if not run.peer or run.method.endswith(EVERYWHERE) == bool(form)]
    seconds = {(run.method, run.setting): run.seconds for run in work}
    loop = next(run for run in work if run.method.startswith(LOOP))
    ours = seconds.get(("bernoulli", loop.setting))
    ratios = [*(best_ratio(work, level) for level in LEVELS), loop.seconds / ours if ours else None]
    return [f"{ratio:.1f}" if ratio else "-" for ratio in ratios]


def list_runs(work: list[Work]) -> Iterator[str]:
    """Give the table of all runs: a step is in ms, a tolerance a bare number."""
    rows: list[Row] = []
    for last, run in zip([None, *work], work, strict=False):
        stepped = not run.peer or run.method.startswith(LOOP)
        setting = f"{run.setting * 1e3:g} ms" if stepped else f"{run.setting:g}"
        name = "" if last and last.problem == run.problem else run.problem
        rows.append({**asdict(run), "problem": name, "setting": setting})
    yield from tabulate(rows, RUNS, left=2)
