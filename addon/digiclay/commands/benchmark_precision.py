"""``digiclay benchmark precision``: error against run time, beside SciPy's solvers and a Python loop."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import astuple, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.assembly import assemble
from ..core.simulation import begin, periods
from ..plots import benchmarks
from . import benchmark_peers as peers
from .benchmark_loop import loop
from .benchmark_problems import PERIOD, PROBLEMS, Measured, Problem, Work, live, ours, problem, solved
from .benchmark_report import add_kind, kept, made_with, progress
from .tables import table

__all__ = ["LEVELS", "OURS", "PEERS", "add", "best_ratio", "cheapest"]

#: Errors of height at which the fastest are compared, m.
LEVELS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
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
#: Step of the check of the reference, s.
CHECK = 5e-5
CUT = "session, lift and drag"


def add(kinds: Any) -> None:
    """Add the benchmark."""
    examples = "  digiclay benchmark precision --quick\n  digiclay benchmark precision --out results\n"
    parser = add_kind(kinds, "precision", "error against run time, beside SciPy's solvers", examples)
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
            exact, line = _reference(known)
            bar(f"{name}: reference")
            for stepper, steps in own.items():
                work += ours(known, exact, stepper, steps, 1 if arguments.quick else 3)
                bar(f"{name}: {stepper}")
            for solver, tolerances in others.items():
                many = solver == "Radau" and line[1] > MANY
                work += peers.points(known, exact, solver, tolerances[:1] if many else tolerances)
                bar(f"{name}: {solver}")
            one, took = loop(known, 1e-3, known.scene.periods)
            height, force = one.against(exact)
            work.append(Work(name, "Python loop", 1e-3, height, force, took, 5 * known.scene.periods, True))
            bar(f"{name}: loop")
            checked.append([name, str(known.scene.periods), f"{line[1]:.0f}", f"{line[0] * 1e12:.2g}"])
    text = "\n".join(_text(work, checked, names, arguments.quick))
    print(text)
    kept(arguments.out, "precision", text, [one.name for one in fields(Work)], [astuple(one) for one in work])
    if arguments.out:
        benchmarks.precision(work, arguments.out / "precision.png")
    return 0


def _reference(known: Problem) -> tuple[Measured, tuple[float, float]]:
    """Return the exact solution, what is known of its error, m, and how many cells take part."""
    cells = float(np.mean([one.size for one, _ in known.sets]))
    simulation = replace(known.scene.simulation, stepper="richardson", physics_step=CHECK)
    other = solved(replace(known.scene, simulation=simulation), known.commands)
    exact = other if peers.missing() else peers.reference(known)
    return exact, (other.against(exact)[0], cells)


def cheapest(work: list[Work], level: float, *, peer: bool, loops: bool = False) -> Work | None:
    """Return the fastest run with at most an error of height, m: one of ours, or one of the solvers."""
    fit = [
        one
        for one in work
        if one.peer == peer and (one.method == "Python loop") == loops and one.height_error <= level
    ]
    return min(fit, key=lambda one: one.seconds, default=None)


def best_ratio(work: list[Work], level: float) -> float | None:
    """Return the best solver's time over our best, at a level of error; None where one does not reach it."""
    mine, theirs = cheapest(work, level, peer=False), cheapest(work, level, peer=True)
    return theirs.seconds / mine.seconds if mine and theirs else None


def _text(work: list[Work], checked: list[list[str]], names: tuple[str, ...], quick: bool) -> Iterator[str]:
    """Give the lines of the report."""
    yield made_with() if peers.missing() else made_with("scipy")
    yield "\nThe problems. The reference is SciPy's DOP853 at 1e-12; the last column is how far Richardson's"
    yield f"form at {CHECK * 1e3:g} ms is from it, which includes the error of the latter.\n"
    yield from table(("problem", "control periods", "cells taking part", "apart, pm"), checked)
    yield "\nIntegration alone, under recorded commands; times are CPU times of the whole run.\n"
    head = ("problem", "method", "setting", "height error, nm", "force error, µN", "CPU, ms", "evaluations")
    rows, last = [], ""
    for one in work:
        setting = f"{one.setting:g}" if one.method in PEERS else f"{one.setting * 1e3:g} ms"
        rows.append([
            one.problem if one.problem != last else "", one.method, setting, f"{one.height_error * 1e9:.3g}",
            f"{one.force_error * 1e6:.3g}", f"{one.seconds * 1e3:.3g}", str(one.evaluations),
        ])  # fmt: skip
        last = one.problem
    yield from table(head, rows, left=2)
    yield "\nThe best solver's time over our best stepper's, at an error of height of at most:\n"
    head = ("problem", *(_shown(level) for level in LEVELS), "loop / ours")
    yield from table(head, list(_ratios(work, names)))
    yield "\nThe last column is the Python loop, one cell at a time, over the same steps with numpy (1 ms)."
    yield "\nWhat the control period changes, beside the integration: the surface of the session's cut at its"
    yield "end, with live control, against a control period of 1 ms with physics steps of 1 ms.\n"
    yield from table(("control period", "largest difference, mm", "root mean square, mm"), list(_periods()))
    yield "\nLive control with other steppers: the same surface, control period 5 ms, against bernoulli at a"
    yield f"step of {0.25 if quick else 0.1:g} ms.\n"
    yield from table(("stepper", "step", "largest difference, µm"), list(_live(quick)), left=2)


def _shown(level: float) -> str:
    """Write an error level."""
    return f"{level * 1e6:g} µm" if level > 9e-7 else f"{level * 1e9:g} nm"


def _ratios(work: list[Work], names: tuple[str, ...]) -> Iterator[list[str]]:
    """Give the rows of the table of ratios."""
    for name in names:
        own = [one for one in work if one.problem == name]
        found = [best_ratio(own, level) for level in LEVELS]
        loops = [one for one in own if one.method == "Python loop"]
        same = [one for one in own if one.method == "bernoulli" and one.setting == 1e-3]
        ratio = f"{loops[0].seconds / same[0].seconds:.1f}" if loops and same else "-"
        yield [name, *(f"{one:.1f}" if one else "-" for one in found), ratio]


def _surface(period: float, step: float, stepper: str = "bernoulli") -> NDArray[np.float64]:
    """Return the heights at the end of the session's cut, with live control."""
    scene = live(CUT, period, step, stepper)
    system = assemble(scene)
    for state in periods(system, scene.trajectory.trajectory(), begin(system), scene.periods):
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
