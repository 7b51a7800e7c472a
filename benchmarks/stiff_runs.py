"""Runs of the stiff cases: recorded commands, references, and evaluation."""

from __future__ import annotations

import statistics
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import DivergenceError
from digiclay.core.control.replay import Replay
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.engine.system import System
from digiclay.core.model.fingertip import compute_forms, compute_underside, require_one
from digiclay.core.model.physics import find_speeds
from digiclay.core.model.trajectory import Trajectory
from digiclay.core.scene.assembly import assemble
from digiclay.core.session.accuracy import SHARE, reference_settings

from .numpy_calls import period_calls
from .stiff_cases import CASES, EASY, HOLD, Case, scene

Integrate = Callable[[str, float, float], Floats]

STEPS = (1e-3, 5e-3, 20e-3, 50e-3)
#: Control period of the shorter steps, s; that of the longer ones is the step.
PERIOD = 5e-3
#: Physics step of the reference, by Richardson extrapolation, s.
FINE, ROUGH = 0.2e-3, 0.5e-3
#: Steppers that hold every pin within what its valve and the finger can do, by construction.
BOUNDED = ("bernoulli", "richardson", "adaptive")
#: From this height error on, m, a run has to know by itself that it is wrong.
WRONG = 1e-4


@dataclass(frozen=True)
class Outcome:
    """Result of a run.

    Attributes
    ----------
    error : float
        Largest height error, m; NaN when it stopped.
    estimate : float
        What the run itself says of its error (see `core.session.accuracy`), m; NaN where it was not asked.
    stopped : str
        Why it did, else empty.
    """

    error: float
    estimate: float = float("nan")
    stopped: str = ""

    @property
    def silent(self) -> bool:
        """Whether the run is wrong and does not know it."""
        return self.error > WRONG and not self.estimate >= 0.5 * self.error

    @property
    def said(self) -> str:
        """What the table says."""
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
    """Return what is wrong with the heights and forces of a period; nothing: an empty text.

    `height` (n,), m; `force` (n,), N; `stroke`, m.
    """
    if not (np.isfinite(height).all() and np.isfinite(force).all()):
        return "not finite"
    if height.min() < 0.0 or height.max() > stroke:
        return "height outside the stroke"
    return "negative force" if force.min() < 0.0 else ""


def _played(system: System, trajectories: Sequence[Trajectory], count: int) -> tuple[Floats, Floats, float]:
    """Run; return heights and commands, (t, n), and the largest force, N.

    Raises AssertionError when an invariant breaks.
    """
    rows, heights, commands, most = system.rows, [], [], 0.0
    start = begin(system)
    before, bounded = start.row(0), system.stepper.name in BOUNDED
    for state in periods(system, trajectories, start, count):
        height, force = state.row(0), state.row(rows.force)
        wrong = allowed_range(height, force, system.cell.actuator.stroke)
        if (
            bounded
            and not wrong
            and not _within_reach(system, trajectories, state.period - 1, before, height)
        ):
            wrong = "a pin where none can be"
        assert not wrong, wrong
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
    poses = require_one(trajectories).poses(period * system.period + system.instants)
    places = system.grid.compute_basis(np.arange(system.grid.count))
    under = compute_underside(*compute_forms(system.cell.touch.fingertip.outline(poses)), places)
    lowest, highest = find_speeds(system.cell).reach(before, under, system.period)
    # Rounding: these undersides are worked out from other products.
    return bool((after >= lowest - 1e-12).all() and (after <= highest + 1e-12).all())


def period_of(step: float) -> float:
    """Return the control period a physics step goes with, s."""
    return max(step, PERIOD)


def commands_of(case: Case) -> Floats:
    """Record the commands of a case, (t, n), each held for `HOLD`."""
    known = scene(CASES[EASY] if case.borrowed else case, "bernoulli", 1e-3, HOLD)
    return case.factor * _played(assemble(known), known.trajectories(), known.periods)[1]


def live(case: Case, stepper: str, step: float) -> Floats:
    """Run a case with its controller, and return the heights, (t, n). `step`: physics step, s."""
    known = scene(case, stepper, step, period_of(step))
    return _played(assemble(known), known.trajectories(), known.periods)[0]


def _replaying(
    case: Case, commands: Floats, stepper: str, step: float, period: float
) -> tuple[System, Sequence[Trajectory], int]:
    """Return a case's system that plays commands, its path, and its number of periods."""
    known = scene(case, stepper, step, period)
    system = assemble(known)
    played = Replay(system.grid, np.repeat(commands, round(HOLD / period), axis=0))
    system = replace(system, controller=played, rows=replace(system.rows, control=0))
    return system, known.trajectories(), known.periods


def replayed(case: Case, commands: Floats, stepper: str, step: float, period: float) -> Floats:
    """Integrate a case under recorded commands and return the heights, (t, n).

    `commands` (t, n), held for `HOLD` each; `step`, `period`: physics step and control period, s.
    """
    return _played(*_replaying(case, commands, stepper, step, period))[0]


def largest_force(case: Case, commands: Floats) -> float:
    """Return the largest force on a cell at the end of a control period, N.

    `commands` (t, n), held for `HOLD` each.
    """
    return _played(*_replaying(case, commands, "bernoulli", 1e-3, PERIOD))[2]


def calls_of(case: Case, commands: Floats, step: float = 1e-3) -> float:
    """Return the numpy calls a control period of the default stepper makes, the median over the run.

    `commands` (t, n), held for `HOLD` each; `step`: physics step, s.
    """
    system, trajectories, count = _replaying(case, commands, "bernoulli", step, period_of(step))
    return statistics.median(period_calls(system, trajectories, count // 2)[0])


def reference(
    case: Case, commands: Floats, step: float = FINE, integrate: Integrate | None = None
) -> tuple[Floats, float]:
    """Return the heights every 5 ms, (t, n), and how far they may be off, m.

    `commands` (t, n), held for `HOLD` each; `step`: physics step, s; `integrate`: see `outcome`.
    """
    integrate = integrate or partial(replayed, case, commands)
    fine = integrate("richardson", step, PERIOD)
    coarse = integrate("richardson", 1e-3 if step < ROUGH else 2 * step, PERIOD)
    # Order 2 is what is left of order 3 across a kink.
    return fine, float(np.abs(fine - coarse).max()) / (24.0 if step < ROUGH else 3.0)


def outcome(
    case: Case,
    commands: Floats,
    exact: Floats,
    stepper: str,
    step: float,
    integrate: Integrate | None = None,
) -> Outcome:
    """Run one stepper at one step, and judge it.

    `commands` (t, n), held for `HOLD` each; `exact` (t, n), heights every 5 ms, m; `step`: physics step, s;
    `integrate`: returns what `replayed` does for a stepper, its step and the control period, s. Callers that
    judge several steppers can keep the results: the finer run is the same for each, and that of the shortest
    step is the reference's.
    """
    integrate = integrate or partial(replayed, case, commands)
    period = period_of(step)
    every = round(period / PERIOD)
    try:
        with strict():
            found = integrate(stepper, step, period)
    except DivergenceError as wrong:
        return Outcome(float("nan"), stopped=f"{wrong.quantity} {wrong.value:.2g} at {wrong.time:.3g} s")
    except (FloatingPointError, RuntimeWarning) as wrong:
        return Outcome(float("nan"), stopped=str(wrong).partition(" encountered")[0])
    except AssertionError as wrong:
        return Outcome(float("nan"), stopped=f"INVARIANT: {wrong}")
    error = float(np.abs(found - exact[every - 1 :: every]).max())
    if error <= WRONG:
        return Outcome(error)
    judge = reference_settings(scene(case, stepper, step, period).simulation)
    with strict():
        finer = integrate(judge.stepper, judge.physics_step, period)
    return Outcome(error, SHARE * float(np.abs(found - finer).max()))
