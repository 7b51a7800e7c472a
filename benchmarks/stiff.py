"""Benchmark ``stiff``: case x stepper x step -> error, or the reason it stopped."""

import argparse
import copy
import statistics
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import pairwise

import numpy as np
from digiclay.commands.progress import table
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import DivergenceError
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.engine.system import System
from digiclay.core.files.tables import Record, Table
from digiclay.core.model.fingertip import compute_forms, compute_underside
from digiclay.core.model.physics import find_speeds
from digiclay.core.model.trajectory import Trajectory
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import STEPPERS, Scene
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.accuracy import SHARE, reference_settings

from .report import Report, Row, Steps, tabulate
from .session_parts import period_calls, replaying

Path = tuple[tuple[float, float, float], ...]

#: Commands are recorded at this control period and held through it, s: all steps divide it, so that
#: every run is the same problem.
HOLD = 0.1
#: Simulated time, s.
DURATION = 0.5
PRESS = (
    (0.0, 0.0, 0.5e-3), (0.15, 0.0, -2.5e-3), (0.25, 1e-3, -2.5e-3), (0.4, 3e-3, 1.5e-3), (0.5, 3e-3, 3e-3),
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A case."""

    changes: Table = field(default_factory=dict)
    """Sections of a scene file."""
    path: Path = PRESS
    """Waypoints: time, s; x, m; height over the bed at rest, m."""
    why: str = ""
    """What makes it ill-conditioned: a rounding error of its data already moves its solution, or the path is
    no function of time that a step could resolve. Empty where the error must fall with the step."""
    straight: bool = False
    """The waypoints are joined by straight lines."""
    borrowed: bool = False
    factor: float = 1.0
    """The recorded commands are those of the easy case, because this case's own controller sees no need to
    act; and what they are multiplied with."""
    others: tuple[Path, ...] = ()
    """Of further fingers."""


#: A press with a fingertip that then rises, dragged a little; everything at its default.
EASY = "easy"
#: Everything at once.
ALL = "all together"
SHALLOW = ((0.0, 0.0, 0.5e-3), (0.15, 0.0, -0.4e-3), (0.25, 1e-3, -0.4e-3), (0.4, 3e-3, 1.5e-3))
DEEP = (
    (0.0, 0.0, 1e-3),
    (0.12, 0.0, 1e-3),
    (0.16, 0.0, -15e-3),
    (0.3, 1e-3, -15e-3),
    (0.5, 3e-3, 3e-3),
)
JUMP, THROUGH = (
    ((0.0, 0.0, up), (0.1995, 0.0, up), (0.2, 0.0, low), (0.35, 0.0, low), (0.5, 3e-3, 3e-3))
    for up, low in ((48e-3, -2e-3), (2e-3, -60e-3))
)
#: Jumps of 100 mm to and fro within 1, 5, 20 and 50 ms, at a depth of 4 mm: when they begin and
#: end, s, and whether the finger is away then; from the third on if it is there first.
JUMPS = (0.0, 0.05, 0.051, 0.15, 0.155, 0.25, 0.27, 0.35, 0.4, 0.5)
AWAY = (1.0, 1.0, 0.0, 0.0) * 3
#: Fingers beside the first.
BESIDE = tuple(tuple((time, x + far, z) for time, x, z in PRESS) for far in (-4e-3, 3.5e-3))
STILL = ((0.0, 2e-3, -2e-3), (0.5, 2e-3, -2e-3))
BIG_GAINS = {"position_gain": 5e6, "force_gain": 5e4}

#: Beds, and a blister that fits on them.
BED = {
    "layout": {"rows": 5, "columns": 5},
    "blister": {"radius": 6e-3, "edge_radius": 8e-3, "flat_radius": 3e-3},
}
ONE_PIN = {
    "layout": {"rows": 1, "columns": 1},
    "blister": {"radius": 1.4e-3, "edge_radius": 2e-3, "flat_radius": 1e-3},
}


def _jumping(across: float, up: float, first: int = 0) -> Case:
    """Return a case whose finger jumps by so much, m, out of a press or into one."""
    path = tuple(
        (time, across * far, up * far - 4e-3)
        for time, far in zip(JUMPS, AWAY[first:], strict=False)
    )
    return Case(path=path, why="jumps within a step, and e^(m x) = 3000", straight=True)


CASES: dict[str, Case] = {
    EASY: Case(),
    "m x 10": Case({"contact": {"exponent": 2e4}}, path=SHALLOW),
    "m x 10, pressed as deep": Case({"contact": {"exponent": 2e4}}, why="e^(m x) = 1e21"),
    "press to e^(m x) = 1e12": Case(
        path=DEEP, why="forces are differences of 1e9 N", straight=True
    ),
    "tau_v 0.1 ms": Case({"valve_lag": {"time_constant": 1e-4}}),
    "tau_v 0 (absent)": Case({"valve_lag": "absent"}),
    "viscosity x 1000": Case({"fluid": {"viscosity": 1.6e-3}}, borrowed=True),
    "viscosity / 1000": Case({"fluid": {"viscosity": 1.6e-9}}),
    "bore 0.2 mm": Case({"actuator": {"bore": 0.2e-3}}),
    "gains x 1e4": Case({"control": BIG_GAINS}),
    "relaxation rate 1e6 1/s": Case({"relaxation": {"times": [1e-6, 70e-3, 1.4]}}),
    "b x 1e4": Case({"contact": {"stiffness": 2.5e6}}),
    "orifice 2 mm": Case({"valve": {"orifice_diameter": 2e-3}}),
    "c0 = 0": Case({"relaxation": {"weights": [0.0, 0.62, 0.20, 0.10]}}),
    "dead time 0.23 s": Case({"delay": {"dead_time": 0.23}}),
    "finger jumps 50 mm": Case(path=JUMP, why="the jump lasts half a step of 1 ms", straight=True),
    "finger through the bed": Case(
        path=THROUGH, why="e^(m x) = 1e52, within half a step of 1 ms", straight=True
    ),
    "jumps sideways, in first": _jumping(0.1, 0.0),
    "jumps sideways, out first": _jumping(0.1, 0.0, 2),
    "jumps down first": _jumping(0.0, 0.1),
    "jumps up first": _jumping(0.0, 0.1, 2),
    "three fingers, bore 0.2 mm": Case({"actuator": {"bore": 0.2e-3}}, others=BESIDE),
    "three fingers, orifice 2 mm": Case({"valve": {"orifice_diameter": 2e-3}}, others=BESIDE),
    "jumps sideways beside a finger": replace(_jumping(0.1, 0.0), others=(STILL,)),
    "openings of 1e-9": Case(
        {"control": {"position_gain": 1e-6, "force_gain": 1e-8}}, borrowed=True, factor=1e-8
    ),
    "all at the upper end stop": Case({"actuator": {"rest_height": 100e-3}}),
    "all at the lower end stop": Case({"actuator": {"rest_height": 0.0}}, borrowed=True),
    "one pin": Case(ONE_PIN),
}
CASES[ALL] = Case(
    {
        **ONE_PIN,
        "contact": {"exponent": 2e4, "stiffness": 2.5e6},
        "valve_lag": {"time_constant": 1e-4},
        "fluid": {"viscosity": 1.6e-9},
        "actuator": {"bore": 0.2e-3, "rest_height": 100e-3},
        "control": BIG_GAINS,
        "relaxation": {"times": [1e-6, 70e-3, 1.4], "weights": [0.0, 0.62, 0.20, 0.10]},
        "valve": {"orifice_diameter": 2e-3},
        "delay": {"dead_time": 0.23},
    },
    path=THROUGH,
    why="all of the above",
    straight=True,
)


def scene(case: Case, stepper: str, step: float, period: float) -> Scene:
    """Return the scene of a case, without recorder: 5 x 5 pins; physics step and control period, s."""
    sections: Record = {**BED, **copy.deepcopy(dict(case.changes))}
    rest = sections.get("actuator", {}).get("rest_height", 40e-3)
    sections["recorder"] = "absent"
    sections["simulation"] = {
        "stepper": stepper,
        "physics_step": step,
        "control_period": period,
        "duration": DURATION,
    }
    trajectories = [
        {
            "interpolation": "linear" if case.straight else "smooth",
            "waypoints": [{"time": t, "position": [x, 0.0, rest + z]} for t, x, z in path],
        }
        for path in (case.path, *case.others)
    ]
    if case.others:
        sections["finger"] = [{"trajectory": trajectory} for trajectory in trajectories]
    else:
        (sections["trajectory"],) = trajectories
    return resolve(sections, "stiff")


STEPS = (1e-3, 5e-3, 20e-3, 50e-3)
#: Control period of the shorter steps, s; that of the longer ones is the step.
PERIOD = 5e-3
#: Physics step of the reference, by Richardson extrapolation, s.
FINE, ROUGH = 0.2e-3, 0.5e-3
#: Steppers that hold every pin within what its valve and the fingertip can do, by construction.
BOUNDED = ("bernoulli", "richardson", "adaptive")
#: Columns of the table of costs; 'times' is over the easy case.
COSTS = {
    "case": "case",
    "force, N": "force .2g",
    "reference, µm": "off .1g 1e6",
    "numpy calls": "calls g",
    "times": "ratio .2f",
    "ill-conditioned": "why",
}
#: From this height error on, m, a run's own estimate has to show that it is wrong.
WRONG = 1e-4


@dataclass(frozen=True)
class Outcome:
    """Result of a run."""

    error: float
    """Largest height error, m; NaN when it stopped."""
    estimate: float = float("nan")
    """The run's own estimate of its error (see `core.session.accuracy`), m; NaN where it was not asked
    for."""
    stopped: str = ""
    """Reason; empty if it did not stop."""

    @property
    def silent(self) -> bool:
        """Whether the run is wrong and its estimate does not show it."""
        return self.error > WRONG and not self.estimate >= 0.5 * self.error

    @property
    def cell(self) -> str:
        """The cell of the table."""
        return self.stopped or f"{self.error * 1e6:.3g}" + ("!" if self.silent else "")


@contextmanager
def strict() -> Iterator[None]:
    """Make errors of every warning, of overflow, of invalid numbers and of division by zero.

    Underflow is let through: an opening eighty time constants after its command is rightly 0.
    """
    with warnings.catch_warnings(), np.errstate(all="raise", under="ignore"):
        warnings.simplefilter("error")
        yield


def allowed_range(height: Floats, force: Floats, stroke: float) -> str:
    """Return what is wrong with heights, (n,), m, and forces, (n,), N; nothing: an empty text."""
    if not (np.isfinite(height).all() and np.isfinite(force).all()):
        return "not finite"
    if height.min() < 0.0 or height.max() > stroke:
        return "height outside the stroke"
    return "negative force" if force.min() < 0.0 else ""


def _run(
    system: System, trajectories: Sequence[Trajectory], count: int
) -> tuple[Floats, Floats, float]:
    """Return heights and commands, (t, n), and the largest force, N; AssertionError at a broken invariant."""
    rows, heights, commands, most = system.rows, [], [], 0.0
    start = begin(system)
    before, bounded = start.row(0), system.stepper.name in BOUNDED
    for state in periods(system, trajectories, start, count):
        height, force = state.row(0), state.row(rows.force)
        wrong = allowed_range(height, force, system.cell.actuator.stroke)
        assert not wrong, wrong
        within = not bounded or _within_reach(
            system, trajectories, state.period - 1, before, height
        )
        assert within, "a pin where none can be"
        before = height
        heights.append(height)
        commands.append(state.row(rows.command))
        most = max(most, float(force.max()))
    return np.array(heights), np.array(commands), most


def _within_reach(
    system: System, trajectories: Sequence[Trajectory], period: int, before: Floats, after: Floats
) -> bool:
    """Return whether heights, (n,), are within `Speeds.reach` of those a control period before."""
    assert system.cell.touch is not None
    fingertip, times = system.cell.touch.fingertip, period * system.period + system.instants
    places = system.grid.compute_basis(np.arange(system.grid.count))
    outlines = [fingertip.outline(trajectory.poses(times)) for trajectory in trajectories]
    under = np.min(
        [compute_underside(*compute_forms(outline), places) for outline in outlines], axis=0
    )
    lowest, highest = find_speeds(system.cell).reach(before, under, system.period)
    # Rounding: these undersides are computed from other products.
    return bool((after >= lowest - 1e-12).all() and (after <= highest + 1e-12).all())


def period_of(step: float) -> float:
    """Return the control period of a physics step, s."""
    return max(step, PERIOD)


@cache
def commands_of(name: str) -> Floats:
    """Record the commands of a case, (t, n), each of which lasts for `HOLD`."""
    case = CASES[name]
    return (
        case.factor * _run(*_prepare(EASY if case.borrowed else name, "bernoulli", 1e-3, HOLD))[1]
    )


def live(name: str, step: float) -> Floats:
    """Run a case with its controller by the default stepper at a physics step, s; return heights, (t, n)."""
    return _run(*_prepare(name, "bernoulli", step, period_of(step)))[0]


def _prepare(
    name: str, stepper: str, step: float, period: float, *, recorded: bool = False
) -> tuple[System, Sequence[Trajectory], int]:
    """Return a case's system, with its controller or recorded commands, its path, and number of periods."""
    shown = scene(CASES[name], stepper, step, period)
    if recorded:
        system = replaying(shown, np.repeat(commands_of(name), round(HOLD / period), axis=0))
    else:
        system = assemble(shown)
    return system, shown.trajectories(), shown.periods


@cache
def replayed(name: str, stepper: str, step: float, period: float) -> Floats:
    """Integrate a case under commands of `HOLD` each and return the heights, (t, n); step and period, s."""
    return _run(*_prepare(name, stepper, step, period, recorded=True))[0]


def largest_force(name: str) -> float:
    """Return the largest force on a cell at the end of a control period, N."""
    return _run(*_prepare(name, "bernoulli", 1e-3, PERIOD, recorded=True))[2]


def calls_of(name: str, step: float = 1e-3) -> float:
    """Return the numpy calls of a control period of the default stepper, the median over the run."""
    system, trajectories, count = _prepare(name, "bernoulli", step, period_of(step), recorded=True)
    return statistics.median(period_calls(system, trajectories, count // 2)[0])


def reference(name: str, step: float = FINE) -> tuple[Floats, float]:
    """Return the heights of a case every 5 ms, (t, n), and how far they may be off, m."""
    fine = replayed(name, "richardson", step, PERIOD)
    coarse = replayed(name, "richardson", 1e-3 if step < ROUGH else 2 * step, PERIOD)
    # Order 2 is what is left of order 3 across a kink.
    return fine, float(np.abs(fine - coarse).max()) / (24.0 if step < ROUGH else 3.0)


def outcome(name: str, exact: Floats, stepper: str, step: float) -> Outcome:
    """Run one stepper at one step, and compare it with `exact`, (t, n), heights every 5 ms, m."""
    period = period_of(step)
    every = round(period / PERIOD)
    try:
        with strict():
            heights = replayed(name, stepper, step, period)
    except DivergenceError as wrong:
        return Outcome(
            float("nan"), stopped=f"{wrong.quantity} {wrong.value:.2g} at {wrong.time:.3g} s"
        )
    except (FloatingPointError, RuntimeWarning) as wrong:
        return Outcome(float("nan"), stopped=str(wrong).partition(" encountered")[0])
    except AssertionError as wrong:
        return Outcome(float("nan"), stopped=f"INVARIANT: {wrong}")
    error = float(np.abs(heights - exact[every - 1 :: every]).max())
    if error <= WRONG:
        return Outcome(error)
    judge = reference_settings(scene(CASES[name], stepper, step, period).simulation)
    with strict():
        finer = replayed(name, judge.stepper, judge.physics_step, period)
    return Outcome(error, SHARE * float(np.abs(heights - finer).max()))


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Run every case by every stepper at every step."""
    steppers = tuple(name for name in STEPPERS if arguments.full or name != "adaptive")
    if arguments.quick:
        steppers = ("bernoulli", "euler")
    started = time.process_time()
    rows: list[Row] = []
    lines: list[list[str]] = []
    costs: list[Row] = []
    broken: list[str] = []
    for name in steps.through(list(CASES)):
        with strict():
            exact, off = reference(name, ROUGH if arguments.quick else FINE)
            most = largest_force(name)
        for stepper in steppers:
            outcomes = [outcome(name, exact, stepper, step) for step in STEPS]
            lines.append(
                [name if stepper == steppers[0] else "", stepper, *(run.cell for run in outcomes)]
            )
            rows += [
                {
                    "case": name,
                    "stepper": stepper,
                    "step_ms": step * 1e3,
                    "error_um": run.error * 1e6,
                    "own_estimate_um": run.estimate * 1e6,
                    "stopped": run.stopped,
                    "reference_error_um": off * 1e6,
                }
                for step, run in zip(STEPS, outcomes, strict=True)
            ]
            if stepper == "bernoulli":
                broken += _list_broken(name, outcomes, off)
        # The calls of pairs, which several fingers have, are not counted in full.
        calls = float("nan") if CASES[name].others else calls_of(name)
        ratio = calls / (costs[0]["calls"] if costs else calls)
        why = CASES[name].why
        costs.append(
            {"case": name, "force": most, "off": off, "calls": calls, "ratio": ratio, "why": why}
        )
    took = time.process_time() - started
    return Report(list(_list_lines(lines, costs, broken, took)), rows)


def _list_broken(name: str, outcomes: list[Outcome], off: float) -> Iterator[str]:
    """Give which of its promises the default stepper breaks under recorded commands, and under control."""
    for step, run in zip(STEPS, outcomes, strict=True):
        if run.stopped:
            yield f"{name}, {step * 1e3:g} ms: {run.stopped}"
    errors = [run.error for run in outcomes]
    if not CASES[name].why and any(a > max(b, 10.0 * off, 1e-12) for a, b in pairwise(errors)):
        yield f"{name}: the error does not fall with the step"
    for step in STEPS:
        try:
            with strict():
                live(name, step)
        except (DivergenceError, FloatingPointError, Warning, AssertionError) as wrong:
            yield f"{name}, live, {step * 1e3:g} ms: {wrong}"


def _list_lines(
    lines: list[list[str]], costs: list[Row], broken: list[str], took: float
) -> Iterator[str]:
    """Give the lines of the report."""
    yield "\nLargest height error, µm, under recorded commands of 100 ms each, by step; or why it stopped."
    yield f"The control period is {PERIOD * 1e3:g} ms, or the step where that is longer. A mark ! means"
    yield "wrong, and not shown by the run's own estimate of its error.\n"
    head = ("case", "stepper", *(f"{step * 1e3:g} ms" for step in STEPS))
    yield from table(head, lines, left=2)
    yield "\nThe default stepper: the largest force on a pin, how far the reference may be off, and what a"
    yield "control period with 1 ms steps costs."
    yield "'times' is over the easy case; a reason marks a case as ill-conditioned: it stays bounded\n"
    yield from tabulate(costs, COSTS)
    runs = 2 * len(CASES) * len(STEPS)
    silent = sum(line[1] != "bernoulli" and "!" in cell for line in lines for cell in line)
    yield f"\nThe other steppers: {silent} runs wrong without showing it."
    yield f"bernoulli: {runs} runs (replayed and live), {len(broken)} broken promises."
    yield f"All took {took:.0f} s of CPU time."
    yield from (f"  {line}" for line in broken)
