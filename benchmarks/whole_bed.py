"""Precision problems on the paper's bed, with peers that integrate all cells.

Finding those cells is a part of what a period of ours does. Here the same solvers, in the same form, and
the same Python loop go through every cell of the bed instead; nothing else is taken from them.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np
from digiclay.commands.progress import table

from . import peers, plots
from .problems import Measured, Problem, ours, problem
from .python_loop import looped
from .report import kept, made_with, progress
from .work_precision import COLUMNS, RATIOS, Work, ratios, runs

Settings = dict[str, tuple[float, ...]]

#: Rows and columns of the paper's bed.
SIDE = 25
#: Steppers and their steps, s: those that are the fastest at some level of error.
OURS: Settings = {
    "bernoulli": (5e-3, 2.5e-3, 1e-3, 5e-4),
    "richardson": (5e-3, 2.5e-3, 1e-3, 5e-4),
    "runge_kutta_4": (1e-3, 5e-4),
}
#: Solvers and their relative tolerances.
PEERS: Settings = {"LSODA": (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8), "DOP853": (1e-3, 1e-7)}
#: The slowest solver, run once, and not where there are more control periods than `SHORT`.
ONCE: Settings = {"Radau": (1e-3,)}
SHORT = 200
QUICK: Settings = {"bernoulli": (5e-3, 1e-3), "richardson": (5e-3, 1e-3)}
QUICK_PEERS: Settings = {"LSODA": (1e-3, 1e-5)}
#: Runs of everything but the loop and `ONCE`, by turns; the fastest of each counts.
ROUNDS = 3
#: What the name of a method that goes through all cells ends in.
EVERYWHERE = ", whole bed"
#: What the plot says of its lines.
LINES = "full lines: ours; dashed: peers told which cells\ntake part; dash-dotted: peers over the whole bed"


@dataclass(frozen=True, eq=False)
class Beside:
    """The runs of one problem, with a peer's own name in both its forms.

    Attributes
    ----------
    told : list of Work
        Peers that know which cells take part.
    whole : list of Work
        Peers that go through the whole bed.
    """

    known: Problem
    mine: list[Work]
    told: list[Work]
    whole: list[Work]

    @property
    def work(self) -> list[Work]:
        """All runs; the name of a peer over the whole bed says so."""
        return [*self.mine, *self.told, *(replace(one, method=one.method + EVERYWHERE) for one in self.whole)]


def carry_out(arguments: argparse.Namespace, names: Sequence[str]) -> None:
    """Run some problems, and print the tables. `arguments`: of `precision`; `names`: keys of `PROBLEMS`."""
    own, others, once, rounds = (
        (QUICK, QUICK_PEERS, {}, 1) if arguments.quick else (OURS, PEERS, ONCE, ROUNDS)
    )
    if peers.missing():
        others, once = {}, {}
    found, apart = [], []
    with progress(arguments, "whole bed", len(names) * (rounds + 2)) as bar:
        for name in names:
            known = problem(name, side=SIDE)
            exact, off = peers.reference_and_check(known)
            bar(f"{name}: reference")
            slow = once if known.scene.periods <= SHORT else {}
            found.append(beside(known, exact, own, others, slow, rounds, bar))
            apart.append(off)
    text = "\n".join(report(found, apart, rounds))
    print(f"\n{text}")
    work = [one for each in found for one in each.work]
    made = made_with() if peers.missing() else made_with("scipy")
    kept(arguments.out, "precision_whole_bed", f"{made}\n\n{text}", COLUMNS, [astuple(one) for one in work])
    if arguments.out:
        plots.draw_precision(work, arguments.out / "precision_whole_bed.png", LINES)


def everywhere(known: Problem) -> Problem:
    """Return a problem of which all that is known is that every cell may move and be touched."""
    cells = np.arange(known.scene.cells)
    return replace(known, sets=[(cells, cells.size)] * known.scene.periods)


def beside(
    known: Problem,
    exact: Measured,
    own: Settings,
    others: Settings,
    once: Settings,
    rounds: int = ROUNDS,
    done: Callable[[str], None] = lambda doing: None,
) -> Beside:
    """Run our steppers and both forms of the peers on a problem.

    `exact`: its exact solution: the errors are those of all cells of the bed; `own`, `others`: our steppers
    with their steps, s; the solvers with their tolerances; `once`: solvers run over the whole bed only, and
    once; `rounds`: runs of `own` and `others`; the fastest counts; `done`: told of each piece of the work: a
    piece a round, and one more.
    """
    whole = everywhere(known)
    turns: list[tuple[list[Work], list[Work], list[Work]]] = []
    for turn in range(rounds):
        mine = [one for name, steps in own.items() for one in ours(known, exact, name, steps, 1)]
        told, blind = (
            [
                one
                for name, tolerances in others.items()
                for one in peers.points(form, exact, name, tolerances)
            ]
            for form in (known, whole)
        )
        turns.append((mine, told, blind))
        done(f"{known.name}: round {turn + 1}")
    mine, told, blind = (_fastest(runs) for runs in zip(*turns, strict=True))
    for name, tolerances in once.items():
        blind += peers.points(whole, exact, name, tolerances)
    step = 1e-3
    found = Beside(known, mine, [*told, looped(known, exact, step)], [*blind, looped(whole, exact, step)])
    done(f"{known.name}: loops")
    return found


def _fastest(runs: Sequence[list[Work]]) -> list[Work]:
    """Return the fastest of the runs with the same setting; they differ in nothing but their time."""
    return [min(same, key=lambda one: one.seconds) for same in zip(*runs, strict=True)]


def report(found: Sequence[Beside], apart: Sequence[float], rounds: int) -> Iterator[str]:
    """Give the lines of the report; `apart` is how far two references are from each other, m.

    `apart`: of each problem, how far two references are from each other, m; `rounds`: runs of each setting;
    the fastest counted.
    """
    yield f"Peers over the whole bed: the problems on the paper's bed of {SIDE} x {SIDE}, for all methods."
    yield "Peers are told which cells take part, or go through all of them in the same form ('whole"
    yield "bed'); ours finds them itself. Errors are those of all cells of the bed.\n"
    rows = [
        [one.known.name, str(one.known.scene.cells), f"{one.known.taking_part:.0f}", f"{off * 1e12:.2g}"]
        for one, off in zip(found, apart, strict=True)
    ]
    yield from table(("problem", "cells of the bed", "cells taking part", "apart, pm"), rows)
    yield f"\nCPU times are the least of {rounds}, run by turns; of 1 for the loops and Radau. Not to take"
    yield "hours, ours is run at few steps, DOP853 at two tolerances and Radau at one: over the whole"
    yield f"bed only, and not in problems of more than {SHORT} periods.\n"
    yield from runs([one for each in found for one in each.work])
    yield "\nThe best solver's time over our best stepper's, at an error of height of at most:\n"
    rows = []
    for one in found:
        rows.append([one.known.name, "told", *ratios([*one.mine, *one.told])])
        rows.append(["", "whole bed", *ratios([*one.mine, *one.whole])])
    yield from table(("problem", "peers", *RATIOS), rows, left=2)
    yield "\nThe last column is the Python loop, one cell at a time, over the same steps with numpy (1 ms)."
