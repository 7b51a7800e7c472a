"""Benchmark ``peers``: engines on the problems of PinBench, by their adapters."""

import argparse
import importlib.util
import statistics
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from digiclay.commands.progress import table
from digiclay.core.base.errors import DigiclayError

from ..report import Curves, Report, Steps, tabulate
from .problem import Problem, read_problems

ADAPTERS = Path(__file__).parent / "adapters"
NAMES = ("own", "numpy_runge_kutta", "scipy_solvers", "mujoco_force")
#: Problems and settings of a method with --quick.
QUICK, FEW = ("damped_pins", "relaxation_alone"), 2
#: Runs, of which the median counts; processor time from which on one is enough, and from which on
#: the finer settings of a method are left out, s.
REPEATS, LONG, LONGEST = 3, 1.0, 6.0
#: Errors of height and of force at which the fastest are compared, m and N: where pins cannot move,
#: of force.
LEVELS = {
    "height_error": (1e-5, 1e-6, 1e-7, 1e-8, 1e-9),
    "force_error": (1e-3, 1e-4, 1e-5, 1e-6, 1e-7),
}
RUNS = {
    "problem": "problem",
    "method": "method",
    "step, s, or tolerance": "setting",
    "height error, nm": "height_error .3g 1e9",
    "force error, µN": "force_error .3g 1e6",
    "CPU, µs a period": "seconds .4g 1e6",
}


@dataclass(frozen=True)
class Answer:
    """An engine's answer to a problem: SI units, processor time per period."""

    problem: str
    engine: str
    method: str
    setting: str
    height_error: float
    force_error: float
    seconds: float


@dataclass(frozen=True, eq=False)
class Adapter:
    """An engine's file; `prepare` takes a problem, a method and a setting and returns what solves it."""

    name: str
    methods: dict[str, tuple[float, ...]]
    prepare: Callable[..., Any]


def load_adapter(path: Path) -> Adapter:
    """Return the adapter in a file; DigiclayError where it is none."""
    spec = importlib.util.spec_from_file_location(f"{__package__}.adapters.{path.stem}", path)
    try:
        if spec is None or spec.loader is None:
            raise ImportError("it must end with .py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        methods = {str(name): tuple(map(float, given)) for name, given in module.METHODS.items()}
        if not all(methods.values()) or not callable(module.prepare):
            raise ValueError(
                "METHODS must have settings for each method, and prepare must be a function"
            )
        return Adapter(path.stem, methods, module.prepare)
    except Exception as error:
        raise DigiclayError(f"peers: {path} is no adapter: {_describe(error)}") from None


def list_adapters(others: Sequence[str] = ()) -> list[Adapter]:
    """Return all adapters, that of MuJoCo where it is installed, then those of other files."""
    names = [name for name in NAMES if name != "mujoco_force" or importlib.util.find_spec("mujoco")]
    return [
        load_adapter(path)
        for path in (*(ADAPTERS / f"{name}.py" for name in names), *map(Path, others))
    ]


def solve(adapter: Adapter, problem: Problem, method: str, setting: float) -> Answer | None:
    """Return an answer, or None where the engine has no such pins; DigiclayError where it fails."""
    shape = len(problem.judged), 2, problem.pins.size
    try:
        run = adapter.prepare(problem, method, setting)
        if run is None:
            return None
        seconds: list[float] = []
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # what comes out is compared
            while len(seconds) < REPEATS and sum(seconds) < LONG:
                started = time.process_time()
                answer = np.asarray(run(), float)
                seconds.append(time.process_time() - started)
        if answer.shape != shape:
            raise ValueError(f"heights and forces must have the shape {shape}, got {answer.shape}")
    except Exception as error:
        where = f"{adapter.name}, {method} at {setting:g} on {problem.name}"
        raise DigiclayError(f"peers: {where}: {_describe(error)}") from None
    errors = problem.compare(answer[:, 0], answer[:, 1])
    period = statistics.median(seconds) / problem.count
    return Answer(problem.name, adapter.name, method, f"{setting:g}", *errors, period)


def _describe(error: Exception) -> str:
    """Return an error as the end of one line."""
    first = next(iter(str(error).splitlines()), "")
    return f"{type(error).__name__}: {first.rstrip('.')}."


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Run all adapters on all problems, one after another, or make the references again."""
    problems = read_problems()
    if arguments.make_references:
        from . import reference

        for problem in steps.through(list(problems.values()), lambda problem: problem.name):
            reference.write(problem)
        return Report(["The references are written."])
    adapters = list_adapters(arguments.files)
    if arguments.quick:
        problems = {name: problems[name] for name in QUICK}
    answers: list[Answer] = []
    steps.total = len(problems) * sum(len(adapter.methods) for adapter in adapters)
    for problem in problems.values():
        for adapter in adapters:
            for method, settings in adapter.methods.items():
                answers += run_method(
                    adapter, problem, method, settings[:FEW] if arguments.quick else settings
                )
                steps(f"{problem.name}: {method}")
    rows = [asdict(answer) for answer in answers]
    mujoco = [f"mujoco-core {version('mujoco-core')}"] if importlib.util.find_spec("mujoco") else []
    return Report([*mujoco, *list_answers(answers)], rows, draw_curves(answers))


def run_method(
    adapter: Adapter, problem: Problem, method: str, settings: tuple[float, ...]
) -> Iterator[Answer]:
    """Give the answers of a method at settings, coarse to fine, until it takes too long."""
    for setting in settings:
        answer = solve(adapter, problem, method, setting)
        if answer:
            yield answer
        if answer is None or answer.seconds * problem.count > LONGEST:
            return


def draw_curves(answers: Sequence[Answer]) -> Curves:
    """Return the work-precision plot; of forces where no pin moves."""
    panels: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for answer in answers:
        points = panels.setdefault(answer.problem, {}).setdefault(answer.method, [])
        if 0.0 < answer.force_error < 1e3:
            points.append((answer.seconds * 1e6, answer.force_error * 1e6))
    return Curves(panels, "CPU time a period, µs", "largest force error, µN")


def list_answers(answers: Sequence[Answer]) -> Iterator[str]:
    """Give the tables of answers and of the fastest."""
    yield "\nAnswers: largest errors of judged pins; processor time of a run, without set-up, over periods.\n"
    yield from tabulate(map(asdict, answers), RUNS, left=3)
    for quantity, unit, factor in (("height_error", "µm", 1e6), ("force_error", "µN", 1e6)):
        yield f"\nThe fastest method at an error of {quantity.partition('_')[0]} of at most, µs a period;"
        yield "(x) is the time of digiclay's fastest over that of the fastest other engine.\n"
        head = ["problem", *(f"{level * factor:g} {unit}" for level in LEVELS[quantity])]
        rows = [
            [
                name,
                *(
                    compare(
                        [a for a in answers if a.problem == name and getattr(a, quantity) <= level]
                    )
                    for level in LEVELS[quantity]
                ),
            ]
            for name in dict.fromkeys(answer.problem for answer in answers)
        ]
        yield from table(head, rows)


def compare(fit: Sequence[Answer]) -> str:
    """Return the fastest method of answers within an error, and digiclay's time over that of the others."""
    if not fit:
        return "-"
    best = min(fit, key=lambda answer: answer.seconds)
    ours, others = (
        [a.seconds for a in fit if (a.engine == "own") is mine] for mine in (True, False)
    )
    ratio = f" ({min(ours) / min(others):.2f})" if ours and others else ""
    return f"{best.method} {best.seconds * 1e6:.0f}{ratio}"
