"""Benchmark ``precision``: error against run time, beside SciPy's solvers and a Python loop.

With ``--whole-bed`` also on the paper's bed: there the same solvers, in the same form, and the same
Python loop go through every cell of the bed too. Finding the cells that take part is a part of what a
period of ours does, and told to the peers otherwise.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from digiclay.commands.progress import table
from digiclay.core.base.arrays import Floats
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.plots.figure import empty

from . import peers
from .peers import LOOP
from .problems import PERIOD, PROBLEMS, Problem, Solution, Work, live, problem, run_stepper
from .report import STYLE, Report, Steps, cells, list_records

Settings = dict[str, tuple[float, ...]]

#: Steppers and their steps, s.
OURS: Settings = {
    "bernoulli": (5e-3, 2.5e-3, 1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5, 2.5e-5),
    "richardson": (5e-3, 2.5e-3, 1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5),
    "runge_kutta_4": (1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5),
    "heun": (1e-3, 2.5e-4, 5e-5),
    "euler": (1e-3, 2.5e-4, 5e-5),
}
#: Solvers and their relative tolerances.
TIGHT = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
PEERS: Settings = {"LSODA": TIGHT, "DOP853": (1e-3, 1e-5, 1e-7), "Radau": (1e-3, 1e-5)}
#: Cells taking part from which on Radau is run at one tolerance only: it takes minutes.
MANY = 100
QUICK: Settings = {"bernoulli": (5e-3, 1e-3, 2.5e-4), "richardson": (5e-3, 1e-3, 2.5e-4)}
QUICK_PEERS: Settings = {"LSODA": (1e-3, 1e-5)}
QUICK_PROBLEMS = ("one cell, load step", "pressed and held")
CUT = "session, lift and drag"

#: Of the whole bed: rows and columns, the steppers that are the fastest at some level of error, and solvers.
SIDE = 25
WHOLE: Settings = {
    "bernoulli": (5e-3, 2.5e-3, 1e-3, 5e-4), "richardson": (5e-3, 2.5e-3, 1e-3, 5e-4),
    "runge_kutta_4": (1e-3, 5e-4),
}  # fmt: skip
QUICK_ON_BED: Settings = {"bernoulli": (5e-3, 1e-3), "richardson": (5e-3, 1e-3)}
WHOLE_PEERS: Settings = {"LSODA": TIGHT, "DOP853": (1e-3, 1e-7)}
#: The slowest solver, run once, and not where there are more control periods than `SHORT`.
ONCE: Settings = {"Radau": (1e-3,)}
SHORT = 200
#: Runs of everything but the loop and `ONCE`, by turns; the fastest of each counts.
ROUNDS = 3
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


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Run every method on every problem."""
    names = QUICK_PROBLEMS if arguments.quick else tuple(PROBLEMS)
    steppers, solvers = (QUICK, QUICK_PEERS) if arguments.quick else (OURS, PEERS)
    if peers.missing():
        solvers = {}
        print(peers.missing(), file=sys.stderr)
    work: list[Work] = []
    rows: list[list[str]] = []
    steps.total = len(names) * (len(steppers) + len(solvers) + 2)
    for name in names:
        task = problem(name)
        exact, apart = peers.find_reference(task)
        steps(f"{name}: reference")
        for stepper, sizes in steppers.items():
            work += run_stepper(task, exact, stepper, sizes, 1 if arguments.quick else 3)
            steps(f"{name}: {stepper}")
        for solver, tolerances in solvers.items():
            many = solver == "Radau" and task.taking_part > MANY
            work += peers.run_solver(task, exact, solver, tolerances[:1] if many else tolerances)
            steps(f"{name}: {solver}")
        work.append(peers.run_loop(task, exact))
        steps(f"{name}: loop")
        rows.append(cells("s d .0f .2g", name, task.scene.periods, task.taking_part, apart * 1e12))
    lines = list(_list_lines(work, rows, arguments.quick))
    return Report(lines, *list_records(work), lambda: _draw(work), packages=_list_packages())


def _list_packages() -> tuple[str, ...]:
    return () if peers.missing() else ("scipy",)


def _list_lines(work: list[Work], rows: list[list[str]], quick: bool) -> Iterator[str]:
    """Give the lines of the report."""
    yield "\nThe problems. The reference is SciPy's DOP853 at 1e-12; the last column is how far Richardson's"
    yield f"form at {peers.CHECK * 1e3:g} ms is from it, which includes the error of the latter.\n"
    yield from table(("problem", "control periods", "cells taking part", "apart, pm"), rows)
    yield "\nIntegration alone, under recorded commands; times are CPU times of the whole run.\n"
    yield from list_runs(work)
    yield "\nThe best solver's time over our best stepper's, at an error of height of at most:\n"
    names = dict.fromkeys(one.problem for one in work)
    ratios = [[name, *list_ratios([one for one in work if one.problem == name])] for name in names]
    yield from table(("problem", *RATIOS), ratios)
    yield "\nThe last column is the Python loop, one cell at a time, over the same steps with numpy (1 ms)."
    yield "\nWhat the control period changes, beside the integration: the surface of the session's cut at its"
    yield "end, with live control, against a control period of 1 ms with physics steps of 1 ms.\n"
    yield from table(
        ("control period", "largest difference, mm", "root mean square, mm"), list(_compare_periods())
    )
    fine = 2.5e-4 if quick else 1e-4
    yield "\nLive control with other steppers: the same surface, control period 5 ms, against bernoulli at a"
    yield f"step of {fine * 1e3:g} ms.\n"
    yield from table(("stepper", "step", "largest difference, µm"), list(_compare_steppers(fine)), left=2)


def _form_surface(period: float, step: float, stepper: str = "bernoulli") -> Floats:
    """Return the heights at the end of the session's cut, with live control; times in s."""
    scene = live(CUT, period, step, stepper)
    system = assemble(scene)
    *_, last = periods(system, scene.trajectories(), begin(system), scene.periods)
    return last.row(0)


def _compare_periods() -> Iterator[list[str]]:
    """Give the rows of the table of control periods."""
    exact = _form_surface(1e-3, 1e-3)
    for period in (2e-3, PERIOD, 10e-3):
        apart = (_form_surface(period, 1e-3) - exact) * 1e3
        yield [f"{period * 1e3:g} ms", f"{np.abs(apart).max():.3g}", f"{np.sqrt(np.mean(apart**2)):.3g}"]


def _compare_steppers(fine: float) -> Iterator[list[str]]:
    """Give the rows of the table of steppers under live control; `fine`: step of the reference, s."""
    exact = _form_surface(PERIOD, fine)
    for stepper, step in (("bernoulli", 5e-3), *((name, 1e-3) for name in OURS)):
        with np.errstate(all="ignore"):
            apart = _form_surface(PERIOD, step, stepper) - exact
        yield [stepper, f"{step * 1e3:g} ms", f"{np.abs(apart).max() * 1e6:.3g}"]


@dataclass(frozen=True, eq=False)
class Beside:
    """The runs of one problem: our steppers, peers that are told which cells take part, and others."""

    task: Problem
    mine: list[Work]
    told: list[Work]
    whole: list[Work]

    @property
    def work(self) -> list[Work]:
        """All runs; peers over the whole bed are named so."""
        return [*self.mine, *self.told, *(replace(one, method=one.method + EVERYWHERE) for one in self.whole)]


def measure_whole_bed(arguments: argparse.Namespace, steps: Steps) -> Report | None:
    """Run the problems on the paper's bed."""
    if not arguments.whole_bed:
        return None
    names = [name for name in QUICK_PROBLEMS if PROBLEMS[name][0] > 1]
    settings: tuple[Settings, Settings, Settings, int] = (QUICK_ON_BED, QUICK_PEERS, {}, 1)
    if not arguments.quick:
        names = [name for name in PROBLEMS if PROBLEMS[name][0] > 1]
        settings = WHOLE, WHOLE_PEERS, ONCE, ROUNDS
    steppers, solvers, once, rounds = settings
    if peers.missing():
        solvers, once = {}, {}
    beside, apart = [], []
    steps.total = len(names) * (rounds + 2)
    for name in names:
        task = problem(name, side=SIDE)
        exact, distance = peers.find_reference(task)
        steps(f"{name}: reference")
        slow = once if task.scene.periods <= SHORT else {}
        beside.append(run_beside(task, exact, steppers, solvers, slow, rounds, steps))
        apart.append(distance)
    work = [one for runs in beside for one in runs.work]
    title = (
        "full lines: ours; dashed: peers told which cells\ntake part; dash-dotted: peers over the whole bed"
    )
    return Report(
        list(list_beside(beside, apart, rounds)), *list_records(work), lambda: _draw(work, title),
        "precision_whole_bed", _list_packages(),
    )  # fmt: skip


def spread_everywhere(task: Problem) -> Problem:
    """Return a problem in which every cell may move and be touched in every period."""
    every = np.arange(task.scene.cells)
    return replace(task, sets=[(every, every.size)] * task.scene.periods)


def run_beside(
    task: Problem,
    exact: Solution,
    steppers: Settings,
    solvers: Settings,
    once: Settings,
    rounds: int = ROUNDS,
    steps: Callable[[str], None] = lambda step: None,
) -> Beside:
    """Run our steppers and both forms of the peers on a problem; solvers of `once` over the whole bed alone.

    The errors are those of all cells of the bed; the fastest of the rounds counts.
    """
    whole = spread_everywhere(task)
    turns: list[tuple[list[Work], list[Work], list[Work]]] = []
    for turn in range(rounds):
        mine = [one for name, sizes in steppers.items() for one in run_stepper(task, exact, name, sizes, 1)]
        told, blind = (
            [one for name, limits in solvers.items() for one in peers.run_solver(form, exact, name, limits)]
            for form in (task, whole)
        )
        turns.append((mine, told, blind))
        steps(f"{task.name}: round {turn + 1}")
    mine, told, blind = (_list_fastest(runs) for runs in zip(*turns, strict=True))
    for name, limits in once.items():
        blind += peers.run_solver(whole, exact, name, limits)
    beside = Beside(task, mine, [*told, peers.run_loop(task, exact)], [*blind, peers.run_loop(whole, exact)])
    steps(f"{task.name}: loops")
    return beside


def _list_fastest(runs: Sequence[list[Work]]) -> list[Work]:
    """Return the fastest of the runs with the same setting; they differ in nothing but their time."""
    return [min(same, key=lambda one: one.seconds) for same in zip(*runs, strict=True)]


def list_beside(beside: Sequence[Beside], apart: Sequence[float], rounds: int) -> Iterator[str]:
    """Give the lines of the report; `apart`: distance of two references of each problem, m."""
    yield f"\nPeers over the whole bed: the problems on the paper's bed of {SIDE} x {SIDE}, for all methods."
    yield "Peers are told which cells take part, or go through all of them in the same form ('whole"
    yield "bed'); ours finds them itself. Errors are those of all cells of the bed.\n"
    rows = [
        cells("s d .0f .2g", one.task.name, one.task.scene.cells, one.task.taking_part, distance * 1e12)
        for one, distance in zip(beside, apart, strict=True)
    ]
    yield from table(("problem", "cells of the bed", "cells taking part", "apart, pm"), rows)
    yield f"\nCPU times are the least of {rounds}, run by turns; of 1 for the loops and Radau. Not to take"
    yield "hours, ours is run at few steps, DOP853 at two tolerances and Radau at one: over the whole"
    yield f"bed only, and not in problems of more than {SHORT} periods.\n"
    yield from list_runs([one for runs in beside for one in runs.work])
    yield "\nThe best solver's time over our best stepper's, at an error of height of at most:\n"
    rows = []
    for one in beside:
        rows.append([one.task.name, "told", *list_ratios([*one.mine, *one.told])])
        rows.append(["", "whole bed", *list_ratios([*one.mine, *one.whole])])
    yield from table(("problem", "peers", *RATIOS), rows, left=2)
    yield "\nThe last column is the Python loop, one cell at a time, over the same steps with numpy (1 ms)."


def _find_cheapest(work: list[Work], level: float, *, peer: bool) -> Work | None:
    """Return the fastest run with at most an error of height, m: one of ours, or one of the solvers."""
    fit = [one for one in work if one.peer == peer and one.method != LOOP and one.height_error <= level]
    return min(fit, key=lambda one: one.seconds, default=None)


def best_ratio(work: list[Work], level: float) -> float | None:
    """Return the best solver's time over our best at an error of height, m; None where one is worse."""
    mine, theirs = _find_cheapest(work, level, peer=False), _find_cheapest(work, level, peer=True)
    return theirs.seconds / mine.seconds if mine and theirs else None


def list_ratios(work: list[Work]) -> list[str]:
    """Return a row of ratios for the runs of one problem; the last: the loop to bernoulli at its step."""
    ratios = [best_ratio(work, level) for level in LEVELS]
    loops = [one for one in work if one.method == LOOP]
    same = [one for one in work if one.method == "bernoulli" and loops and one.setting == loops[0].setting]
    ratio = f"{loops[0].seconds / same[0].seconds:.1f}" if same else "-"
    return [*(f"{one:.1f}" if one else "-" for one in ratios), ratio]


def list_runs(work: list[Work]) -> Iterator[str]:
    """Give the table of all runs: a step is in ms, a tolerance a bare number."""
    head = ("problem", "method", "setting", "height error, nm", "force error, µN", "CPU, ms", "evaluations")
    rows, last = [], ""
    for one in work:
        stepped = not one.peer or one.method.startswith(LOOP)
        setting = f"{one.setting * 1e3:g} ms" if stepped else f"{one.setting:g}"
        name = one.problem if one.problem != last else ""
        errors = one.height_error * 1e9, one.force_error * 1e6
        rows.append(
            cells(
                "s s s .3g .3g .3g d", name, one.method, setting, *errors, one.seconds * 1e3, one.evaluations
            )
        )
        last = one.problem
    yield from table(head, rows, left=2)


def _draw(work: Sequence[Work], title: str = "full lines: ours; dashed: peers") -> Any:
    """Draw the work-precision plot, one panel a problem; `title`: of the legend."""
    names = list(dict.fromkeys(one.problem for one in work))
    columns = min(3, len(names))
    rows = -(-(len(names) + 1) // columns)
    with empty(4.4 * columns, 3.7 * rows, STYLE, layout="constrained") as figure:
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        handles: dict[str, Any] = {}
        for panel, name in zip(panels, names, strict=False):
            _draw_problem(panel, [one for one in work if one.problem == name])
            panel.set_title(name)
            handles |= dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True))
        for panel in panels[len(names) :]:
            panel.set_axis_off()
        panels[len(names)].legend(handles.values(), handles, loc="center", ncols=2, title=title)
        return figure


def _draw_problem(panel: Any, work: Sequence[Work]) -> None:
    """Draw one problem: error of height over CPU time."""
    for method, (color, marker, line) in LOOKS.items():
        points = [one for one in work if one.method == method and 0.0 < one.height_error < 2e-3]
        if points:
            panel.loglog(
                [one.seconds * 1e3 for one in points], [one.height_error * 1e6 for one in points], line,
                color=color, marker=marker, markerfacecolor=color if line == "-" else "white",
                markersize=5.5, linewidth=1.5, label=method,
            )  # fmt: skip
    panel.set(xlabel="CPU time, ms", ylabel="largest height error, µm")
