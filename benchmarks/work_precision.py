"""Points of the work-precision plot, run time and error, and their tables."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

from digiclay.commands.progress import table

#: Errors of height at which the fastest are compared, m.
LEVELS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
#: The method that is no solver: one cell after another.
LOOP = "Python loop"


@dataclass(frozen=True)
class Work:
    """A point of the work-precision plot: SI units; `evaluations` of the rates of all cells."""

    problem: str
    method: str
    setting: float
    height_error: float
    force_error: float
    seconds: float
    evaluations: int
    peer: bool


def _shown(level: float) -> str:
    """Write an error level."""
    return f"{level * 1e6:g} µm" if level > 9e-7 else f"{level * 1e9:g} nm"


#: Head of a file of `Work`, and of what `ratios` returns.
COLUMNS = [one.name for one in fields(Work)]
RATIOS = (*(_shown(level) for level in LEVELS), "loop / ours")


def cheapest(work: list[Work], level: float, *, peer: bool) -> Work | None:
    """Return the fastest run with at most an error of height, m: one of ours, or one of the solvers.

    `work`: of one problem; `level`: error of height, m; `peer`: whether a solver is asked for.
    """
    fit = [one for one in work if one.peer == peer and one.method != LOOP and one.height_error <= level]
    return min(fit, key=lambda one: one.seconds, default=None)


def best_ratio(work: list[Work], level: float) -> float | None:
    """Return the best solver's time over our best, at a level of error; None where one does not reach it.

    `work`: of one problem; `level`: error of height, m.
    """
    mine, theirs = cheapest(work, level, peer=False), cheapest(work, level, peer=True)
    return theirs.seconds / mine.seconds if mine and theirs else None


def ratios(work: list[Work]) -> list[str]:
    """Return a row of ratios for the runs of one problem; the last: the loop to bernoulli at its step."""
    found = [best_ratio(work, level) for level in LEVELS]
    loops = [one for one in work if one.method == LOOP]
    same = [one for one in work if one.method == "bernoulli" and loops and one.setting == loops[0].setting]
    ratio = f"{loops[0].seconds / same[0].seconds:.1f}" if same else "-"
    return [*(f"{one:.1f}" if one else "-" for one in found), ratio]


def runs(work: list[Work]) -> Iterator[str]:
    """Give the table of all runs: a step is in ms, a tolerance a bare number."""
    head = ("problem", "method", "setting", "height error, nm", "force error, µN", "CPU, ms", "evaluations")
    rows, last = [], ""
    for one in work:
        steps = not one.peer or one.method.startswith(LOOP)
        rows.append([
            one.problem if one.problem != last else "", one.method,
            f"{one.setting * 1e3:g} ms" if steps else f"{one.setting:g}", f"{one.height_error * 1e9:.3g}",
            f"{one.force_error * 1e6:.3g}", f"{one.seconds * 1e3:.3g}", str(one.evaluations),
        ])  # fmt: skip
        last = one.problem
    yield from table(head, rows, left=2)
