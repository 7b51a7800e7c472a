"""Motion of fingertips on yielding hands together with the pins, physics step by physics step.

The path of a fingertip in a step follows from the force at its end. That force is the one with
which the pins then press: it is solved for, so that a step is stable at any mass and stiffness.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.arrays import TIE, Floats
from .state import State

if TYPE_CHECKING:
    from ..model.yielding_hand import Deflection, Swing

#: Relative error of a force that is solved for, also of one that is smaller than `SMALL`, N.
TOLERANCE, SMALL = 1e-6, 1e-2
#: Most trials per step.
MOST_TRIALS = 200


@dataclass(frozen=True, eq=False)
class HandStep:
    """A physics step of hands and pins."""

    system: Any
    """Moves the pins in this step alone; see `engine.system.System`."""
    nodes: slice
    """Instants of the control period at which the fingertips' poses are needed."""
    swing: Swing
    """Of the hands."""

    def move(self, state: State, finger: Any, now: Deflection) -> Deflection:
        """Move active cells and fingertips through the step, in place; return the deflection after it."""
        active, path = state.active, finger.heights[self.nodes]
        before = active.block.copy()

        def press(force: Floats) -> Floats:
            if not active.cells.size:
                return np.zeros_like(force)
            _, rise = self.swing.move(now, path, force)
            active.block[:] = before
            self.system.move(active, RaisedPeriod(finger, self.nodes, rise))
            return np.where(self.swing.push > 0.0, state.finger_forces().reshape(-1), force)

        force = solve_force(press, now.force)
        lost = ~np.isfinite(force)
        # A force that is not finite is refused after the period, with its time and its cell.
        active.block[active.rows.force][..., lost if active.cells.ndim > 1 else lost.any()] = np.inf
        return self.swing.move(now, path, force)[0]


class RaisedPeriod(NamedTuple):
    """Fingertip paths in a step, raised above the intended ones."""

    finger: Any
    """Intended paths; see `touch.FingerPeriod` and `fingers.HandPeriod`."""
    nodes: slice
    rise: Floats
    """(p, c): m."""

    def under(self, positions: Any) -> Floats:
        """Return the undersides at positions, m."""
        intended: Floats = self.finger.under(positions)[self.nodes]
        return intended + self.finger.spread(self.rise, positions)


def rest_hands(steps: tuple[HandStep, ...]) -> Deflection | None:
    """Return the deflection of hands at rest; None where there are none."""
    return steps[0].swing.rest() if steps else None


def lower_reach(steps: tuple[HandStep, ...], state: State, finger: Any) -> Any:
    """Return the fingers' paths in a period with windows of all that hands can touch: pins push only up."""
    now = state.deflection
    if now is None or finger is None:
        return finger
    rises, none = [now.rise], np.zeros_like(now.force)
    for step in steps:
        now, passed = step.swing.move(now, finger.heights[step.nodes], none)
        rises.extend(passed)
    least, window = np.minimum.reduce(rises), np.reshape(finger.window, (6, -1))
    window = np.array(np.broadcast_to(window, (6, least.size)))
    window[3] += least
    alone = isinstance(finger.window, list)
    return finger._replace(window=window[:, 0].tolist() if alone else window)


def move_hands(steps: tuple[HandStep, ...], state: State, finger: Any) -> Deflection:
    """Move active cells and fingertips through a control period, in place; return the deflection."""
    now: Any = state.deflection
    for step in steps:
        now = step.move(state, finger, now)
    return now


def solve_force(press: Callable[[Floats], Floats], guess: Floats) -> Floats:
    """Return forces (c,), N, that are equal to those felt under them, which fall with them.

    Secants of the logarithm, within bounds; the last call of `press` is with the result. A force
    that is not found is infinite.
    """
    force, none, unlimited = guess, np.zeros_like(guess), np.full_like(guess, np.inf)
    low, high = none, unlimited
    # Force and error of the trial before: none yet.
    former = last = unlimited
    for _ in range(MOST_TRIALS):
        felt = press(force)
        with np.errstate(all="ignore"):
            error = np.log((felt + SMALL) / (force + SMALL))
            solved = np.abs(error) <= TOLERANCE
            if solved.all():
                return force
            # The bounds of fingers on the same pins move with the others' forces.
            wrong = high - low <= TIE
            low, high = np.where(wrong, none, low), np.where(wrong, unlimited, high)
            low = np.maximum(low, np.minimum(force, felt))
            high = np.minimum(high, np.maximum(force, felt))
            middle = np.sqrt((low + SMALL) * (high + SMALL)) - SMALL
            secant = force - error * (force - former) / (error - last)
            quick = (secant > low) & (secant < high) & (np.abs(error) < 0.5 * np.abs(last))
            former, last = force, error
            force = np.where(solved, force, np.where(quick, secant, middle))
    return np.where(solved, force, np.inf)
