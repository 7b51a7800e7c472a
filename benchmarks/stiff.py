"""``python -m benchmarks stiff``: case x stepper x step -> error, or the reason it stopped."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from digiclay.commands.progress import table
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import DivergenceError
from digiclay.core.scene.schema import STEPPERS

from .report import add_kind, kept, made_with, progress
from .stiff_runs import (
    CASES,
    FINE,
    PERIOD,
    ROUGH,
    STEPS,
    Case,
    Outcome,
    calls_of,
    commands_of,
    largest_force,
    live,
    outcome,
    reference,
    replayed,
    strict,
)


def add(kinds: Any) -> None:
    """Add the benchmark."""
    examples = "  python -m benchmarks stiff\n  python -m benchmarks stiff --full --out results\n"
    parser = add_kind(kinds, "stiff", "errors of the steppers in stiff and extreme cases", examples)
    parser.add_argument(
        "--full", action="store_true", help="also the adaptive stepper, which takes longer than all others"
    )
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Run the table and print it."""
    steppers = _steppers(quick=arguments.quick, full=arguments.full)
    started = time.process_time()
    lines: list[list[str]] = []
    figures: list[list[Any]] = []
    costs: list[list[str]] = []
    broken: list[str] = []
    easy = ""
    with progress(arguments, "stiff", len(CASES)) as bar:
        for name, case in CASES.items():
            with strict():
                commands = commands_of(case)
                exact, off = reference(case, commands, ROUGH if arguments.quick else FINE)
                most = largest_force(case, commands)
            for stepper in steppers:
                found = [outcome(case, commands, exact, stepper, step) for step in STEPS]
                lines.append([name if stepper == steppers[0] else "", stepper, *(one.said for one in found)])
                figures += [
                    [name, stepper, step * 1e3, one.error * 1e6, one.estimate * 1e6, one.stopped, off * 1e6]
                    for step, one in zip(STEPS, found, strict=True)
                ]
                if stepper == "bernoulli":
                    broken += _broken(name, case, found, off)
            broken += _broken_live(name, case)
            calls, took = calls_of(case, commands), _took(case, commands)
            easy = easy or f"{calls} {took}"
            base = [float(one) for one in easy.split()]
            costs.append([
                name, f"{most:.2g}", f"{off * 1e6:.1g}", f"{calls:g}", f"{calls / base[0]:.2f}",
                f"{took / base[1]:.2f}", case.why,
            ])  # fmt: skip
            bar(name)
    text = "\n".join(_text(lines, costs, broken, time.process_time() - started))
    print(text)
    head = ("case", "stepper", "step_ms", "error_um", "own_estimate_um", "stopped", "reference_error_um")
    kept(arguments.out, "stiff", text, head, figures)
    return 0


def _steppers(*, quick: bool, full: bool) -> tuple[str, ...]:
    """Return the names of the steppers a table is made of."""
    if quick:
        return ("bernoulli", "euler")
    return tuple(name for name in STEPPERS if full or name != "adaptive")


def _took(case: Case, commands: Floats) -> float:
    """Return the CPU time of the default stepper at 1 ms, s: the least of two."""
    spent = []
    for _ in range(2):
        started = time.process_time()
        replayed(case, commands, "bernoulli", 1e-3, PERIOD)
        spent.append(time.process_time() - started)
    return min(spent)


def _broken(name: str, case: Case, found: list[Outcome], off: float) -> Iterator[str]:
    """Give what the default stepper does not keep of its promises under recorded commands."""
    for step, one in zip(STEPS, found, strict=True):
        if one.stopped:
            yield f"{name}, {step * 1e3:g} ms: {one.stopped}"
    errors = [one.error for one in found]
    if not case.why and any(a > max(b, 10.0 * off, 1e-12) for a, b in pairwise(errors)):
        yield f"{name}: the error does not fall with the step"


def _broken_live(name: str, case: Case) -> Iterator[str]:
    """Give where the default stepper blows up under its own controller."""
    for step in STEPS:
        try:
            with strict():
                live(case, "bernoulli", step)
        except (DivergenceError, FloatingPointError, Warning, AssertionError) as wrong:
            yield f"{name}, live, {step * 1e3:g} ms: {wrong}"


def _text(lines: list[list[str]], costs: list[list[str]], broken: list[str], took: float) -> Iterator[str]:
    """Give the lines of the report."""
    yield made_with()
    yield "\nLargest height error, µm, under recorded commands held for 100 ms, by step; or why it stopped."
    yield f"The control period is {PERIOD * 1e3:g} ms, or the step where that is longer. A mark ! means"
    yield "wrong, and not known from the run's own estimate of its error.\n"
    head = ("case", "stepper", *(f"{step * 1e3:g} ms" for step in STEPS))
    yield from table(head, lines, left=2)
    yield "\nThe default stepper: the largest force on a pin, how far the reference may be off, and what a"
    yield "control period with 1 ms steps costs."
    yield "'times' is over the easy case; a reason marks a case as ill-conditioned: it stays bounded\n"
    head = ("case", "force, N", "reference, µm", "numpy calls", "times", "CPU times", "ill-conditioned")
    yield from table(head, costs)
    runs = 2 * len(CASES) * len(STEPS)
    silent = sum(line[1] != "bernoulli" and "!" in cell for line in lines for cell in line)
    yield f"\nThe other steppers: {silent} runs wrong without knowing it."
    yield f"bernoulli: {runs} runs (replayed and live), {len(broken)} broken promises."
    yield f"All took {took:.0f} s of CPU time."
    yield from (f"  {line}" for line in broken)
