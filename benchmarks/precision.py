"""Benchmark ``precision``: error against run time, beside SciPy's solvers and a Python loop.

With ``--whole-bed`` also on the paper's bed: there the same solvers, in the same form, and the same
Python loop go through every cell of the bed too. Finding the cells that take part is a part of what a
period of ours does, and told to the peers otherwise.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from digiclay.commands.progress import table
from digiclay.core.base.arrays import Floats

from . import peers
from .peers import LOOP
from .problems import PERIOD, PROBLEMS, Problem, Solution, Work, live, problem, run_stepper, solve
from .report import Report, Row, Steps, tabulate

Settings = Mapping[str, tuple[float, ...]]

#: Relative tolerances of a solver.
TIGHT = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
#: Problems with --quick; and that whose surface is compared under live control.
QUICK, CUT = ("one cell, load step", "pressed and held"), "session, lift and drag"
#: Problems with more than one cell, and the rows and columns of the paper's bed.
SEVERAL, SIDE = tuple(name for name, row in PROBLEMS.items() if row[0] > 1), 25
#: Cells taking part from which on Radau is run at one tolerance only: it takes minutes.
MANY = 100
#: Control periods up to which a solver that is run once goes over the whole bed.
SHORT = 200


@dataclass(frozen=True)
class Plan:
    """Plan of the runs."""

    problems: tuple[str, ...]
    steppers: Settings
    solvers: Settings
    """Steps of our steppers, s, and relative tolerances of SciPy's solvers."""
    once: Settings = field(default_factory=dict)
    """Solvers that are run once, over the whole bed alone."""
    rounds: int = 1
    repeats: int = 1
    """Runs of everything but the loops and `once`, by turns, of which the fastest counts; and runs of a
    stepper in each of them, of which the median counts."""
    side: int | None = None
    """Rows and columns of the bed on which peers go through all cells too."""


#: Plans of the problems on beds of their own, and on the paper's bed, in full and with --quick.
OWN = (
    Plan(
        tuple(PROBLEMS),
        {
            "bernoulli": (5e-3, 2.5e-3, 1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5, 2.5e-5),
            "richardson": (5e-3, 2.5e-3, 1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5),
            "runge_kutta_4": (1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5),
            "heun": (1e-3, 2.5e-4, 5e-5),
            "euler": (1e-3, 2.5e-4, 5e-5),
        },
        {"LSODA": TIGHT, "DOP853": (1e-3, 1e-5, 1e-7), "Radau": (1e-3, 1e-5)}, repeats=3,
    ),
    Plan(
        QUICK, {"bernoulli": (5e-3, 1e-3, 2.5e-4), "richardson": (5e-3, 1e-3, 2.5e-4)},
        {"LSODA": (1e-3, 1e-5)},
    ),
)  # fmt: skip
WHOLE = (
    Plan(
        SEVERAL,
        {
            "bernoulli": (5e-3, 2.5e-3, 1e-3, 5e-4), "richardson": (5e-3, 2.5e-3, 1e-3, 5e-4),
            "runge_kutta_4": (1e-3, 5e-4),
        },
        {"LSODA": TIGHT, "DOP853": (1e-3, 1e-7)}, {"Radau": (1e-3,)}, rounds=3, side=SIDE,
    ),
    Plan(
        QUICK[1:], {"bernoulli": (5e-3, 1e-3), "richardson": (5e-3, 1e-3)}, {"LSODA": (1e-3, 1e-5)},
        side=SIDE,
    ),
)  # fmt: skip
#: Ends the name of a method that goes through all cells.
EVERYWHERE = ", whole bed"

#: Errors of height at which the fastest are compared, m.
LEVELS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
RATIOS = (*(f"{m * 1e6:g} µm" if m > 9e-7 else f"{m * 1e9:g} nm" for m in LEVELS), "loop / ours")
#: Color, marker and line style of each method: ours are filled and drawn through, peers are open and dashed.
LOOKS: dict[str, tuple[str, str, str]] = {
    "bernoulli": ("#0072B2", "o", "-"), "richardson": ("#009E73", "s", "-"),
    "runge_kutta_4": ("#CC79A7", "D", "-"), "heun": ("#E69F00", "^", "-"), "euler": ("#56B4E9", "v", "-"),
    "LSODA": ("#D55E00", "o", "--"), "DOP853": ("#222222", "s", "--"), "Radau": ("#8A6D00", "D", "--"),
    LOOP: ("#777777", "X", ":"),
    "LSODA, whole bed": ("#D55E00", "P", "-."), "DOP853, whole bed": ("#222222", "p", "-."),
    "Radau, whole bed": ("#8A6D00", "d", "-."), f"{LOOP}, whole bed": ("#777777", "*", ":"),
}  # fmt: skip
#: Columns of the table of runs.
RUNS = {
    "problem": "problem", "method": "method", "setting": "setting",
    "height error, nm": "height_error .3g 1e9", "force error, µN": "force_error .3g 1e6",
    "CPU, ms": "seconds .3g 1e3", "evaluations": "evaluations d",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Beside:
    """The runs of one problem: our steppers, peers that are told which cells take part, and others."""

    task: Problem
    mine: list[Work]
    told: list[Work]
    whole: list[Work]
    apart: float = 0.0
    """Distance of two references, m."""

    @property
    def work(self) -> list[Work]:
        """All runs; peers over the whole bed are named so."""
        return [*self.mine, *self.told, *(replace(run, method=run.method + EVERYWHERE) for run in self.whole)]


def measure(arguments: argparse.Namespace, steps: Steps) -> list[Report]:
    """Run every method on every problem, with ``--whole-bed`` also on the paper's bed."""
    if peers.missing():
        print(peers.missing(), file=sys.stderr)
    plans = [some[arguments.quick] for some in ((OWN, WHOLE) if arguments.whole_bed else (OWN,))]
    steps.total = sum(len(plan.problems) * (plan.rounds + 2) for plan in plans)
    reports = []
    for plan in plans:
        beside = [_run_problem(name, plan, steps) for name in plan.problems]
        lines = list(list_beside(beside, plan))
        title = "full lines: ours; dashed: peers"
        if plan.side:
            title += " told which cells\ntake part; dash-dotted: peers over the whole bed"
        else:
            lines += _list_live(2.5e-4 if arguments.quick else 1e-4)
        work = [run for runs in beside for run in runs.work]
        columns = min(3, len(beside))
        reports.append(
            Report(
                list(lines), [asdict(run) for run in work], _make_draw(work, columns, title),
                (4.4 * columns, 3.7 * -(-(len(beside) + 1) // columns)),
                "precision_whole_bed" if plan.side else "", () if peers.missing() else ("scipy",),
            )
        )  # fmt: skip
    return reports


def _run_problem(name: str, plan: Plan, steps: Callable[[str], None]) -> Beside:
    """Run the methods of a plan on a problem."""
    task = problem(name, side=plan.side)
    exact, apart = peers.find_reference(task)
    steps(f"{name}: reference")
    if peers.missing():
        plan = replace(plan, solvers={}, once={})
    elif task.taking_part > MANY and "Radau" in plan.solvers:
        plan = replace(plan, solvers={**plan.solvers, "Radau": plan.solvers["Radau"][:1]})
    if task.scene.periods > SHORT:
        plan = replace(plan, once={})
    return replace(run_beside(task, exact, plan, steps), apart=apart)


def spread_everywhere(task: Problem) -> Problem:
    """Return a problem in which every cell may move and be touched in every period."""
    every = np.arange(task.scene.cells)
    return replace(task, sets=[(every, every.size)] * task.scene.periods)


def run_beside(
    task: Problem, exact: Solution, plan: Plan, steps: Callable[[str], None] = lambda step: None
) -> Beside:
    """Run the steppers and the peers of a plan on a problem, the latter in both forms if it has a `side`.

    The errors are those of all cells of the bed; the fastest of the rounds counts.
    """
    forms = [task, spread_everywhere(task)] if plan.side else [task]
    turns: list[list[list[Work]]] = []
    for turn in range(plan.rounds):
        mine = [
            run
            for name, sizes in plan.steppers.items()
            for run in run_stepper(task, exact, name, sizes, plan.repeats)
        ]
        theirs = [
            [run for solver in plan.solvers.items() for run in peers.run_solver(form, exact, *solver)]
            for form in forms
        ]
        turns.append([mine, *theirs])
        steps(f"{task.name}: round {turn + 1}")
    # Runs with the same setting differ in nothing but their time.
    mine, *theirs = (
        [min(same, key=lambda run: run.seconds) for same in zip(*runs, strict=True)]
        for runs in zip(*turns, strict=True)
    )
    for name, limits in plan.once.items():
        theirs[-1] += peers.run_solver(forms[-1], exact, name, limits)
    told, *whole = ([*runs, peers.run_loop(form, exact)] for runs, form in zip(theirs, forms, strict=True))
    steps(f"{task.name}: loops")
    return Beside(task, mine, told, whole[0] if whole else [])


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
        yield f"They are the least of {plan.rounds}, run by turns; of 1 for the loops and Radau. Not to take"
        yield "hours, ours is run at few steps, DOP853 at two tolerances and Radau at one: over the whole"
        yield f"bed only, and not in problems of more than {SHORT} periods."
    yield ""
    yield from list_runs([run for runs in beside for run in runs.work])
    yield "\nThe best solver's time over our best stepper's, at an error of height of at most:\n"
    rows = []
    for runs in beside:
        rows.append([runs.task.name, "told", *list_ratios([*runs.mine, *runs.told])])
        if runs.whole:
            rows.append(["", "whole bed", *list_ratios([*runs.mine, *runs.whole])])
    yield from table(("problem", "peers", *RATIOS), rows, left=2)
    yield "\nThe last column is the Python loop, one cell at a time, over the same steps with numpy (1 ms)."


def _list_live(fine: float) -> Iterator[str]:
    """Give the tables of control periods and of steppers under live control; `fine`: reference's step, s."""
    yield "\nWhat the control period changes, beside the integration: the surface of the session's cut at its"
    yield "end, with live control, against a control period of 1 ms with physics steps of 1 ms.\n"
    exact, rows = _form_surface(1e-3, 1e-3), []
    for period in (2e-3, PERIOD, 10e-3):
        apart = (_form_surface(period, 1e-3) - exact) * 1e3
        rows.append(
            [f"{period * 1e3:g} ms", f"{np.abs(apart).max():.3g}", f"{np.sqrt(np.mean(apart**2)):.3g}"]
        )
    yield from table(("control period", "largest difference, mm", "root mean square, mm"), rows)
    yield "\nLive control with other steppers: the same surface, control period 5 ms, against bernoulli at a"
    yield f"step of {fine * 1e3:g} ms.\n"
    exact, rows = _form_surface(PERIOD, fine), []
    for stepper, step in (("bernoulli", 5e-3), *((name, 1e-3) for name in OWN[0].steppers)):
        with np.errstate(all="ignore"):
            apart = _form_surface(PERIOD, step, stepper) - exact
        rows.append([stepper, f"{step * 1e3:g} ms", f"{np.abs(apart).max() * 1e6:.3g}"])
    yield from table(("stepper", "step", "largest difference, µm"), rows, left=2)


def _form_surface(period: float, step: float, stepper: str = "bernoulli") -> Floats:
    """Return the heights at the end of the session's cut, with live control; times in s."""
    heights: Floats = solve(live(CUT, period, step, stepper)).heights[-1]
    return heights


def _find_cheapest(work: list[Work], level: float, *, peer: bool) -> Work | None:
    """Return the fastest run with at most an error of height, m: one of ours, or one of the solvers."""
    fit = [run for run in work if run.peer == peer and run.method != LOOP and run.height_error <= level]
    return min(fit, key=lambda run: run.seconds, default=None)


def best_ratio(work: list[Work], level: float) -> float | None:
    """Return the best solver's time over our best at an error of height, m; None where one is worse."""
    mine, theirs = _find_cheapest(work, level, peer=False), _find_cheapest(work, level, peer=True)
    return theirs.seconds / mine.seconds if mine and theirs else None


def list_ratios(work: list[Work]) -> list[str]:
    """Return a row of ratios for the runs of one problem; the last: the loop to bernoulli at its step."""
    seconds = {(run.method, run.setting): run.seconds for run in work}
    loops = [(run.seconds, seconds.get(("bernoulli", run.setting))) for run in work if run.method == LOOP]
    ratios = [best_ratio(work, level) for level in LEVELS]
    ratios += [loop / ours if ours else None for loop, ours in loops]
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


def _make_draw(work: Sequence[Work], columns: int, title: str) -> Callable[[Any], None]:
    """Return what draws the work-precision plot, one panel a problem; `title`: of the legend."""
    names = list(dict.fromkeys(run.problem for run in work))

    def draw(figure: Any) -> None:
        panels = figure.subplots(-(-(len(names) + 1) // columns), columns, squeeze=False).ravel()
        handles: dict[str, Any] = {}
        for panel, name in zip(panels, names, strict=False):
            _draw_problem(panel, [run for run in work if run.problem == name])
            panel.set_title(name)
            handles |= dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True))
        for panel in panels[len(names) :]:
            panel.set_axis_off()
        panels[len(names)].legend(handles.values(), handles, loc="center", ncols=2, title=title)

    return draw


def _draw_problem(panel: Any, work: Sequence[Work]) -> None:
    """Draw one problem: error of height over CPU time."""
    for method, (color, marker, line) in LOOKS.items():
        points = [run for run in work if run.method == method and 0.0 < run.height_error < 2e-3]
        if points:
            panel.loglog(
                [run.seconds * 1e3 for run in points], [run.height_error * 1e6 for run in points], line,
                color=color, marker=marker, markerfacecolor=color if line == "-" else "white",
                markersize=5.5, linewidth=1.5, label=method,
            )  # fmt: skip
    panel.set(xlabel="CPU time, ms", ylabel="largest height error, µm")
