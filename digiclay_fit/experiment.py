"""Design of a measurement: the touches, or the commands, that tell most in a given time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import OutputError
from digiclay.core.base.quantity import Parameters, quantity
from digiclay.core.model.touch import MOST_FORCE, MOST_INDENTATION
from digiclay.core.scene.schema import Scene

from .estimation import NORMAL, NOTHING, USELESS, Derived
from .records import Trial
from .verdicts import make_model

#: Share of the largest force that the scene's finger reaches: others are stiffer.
CAREFUL = 0.9
#: Gap to the finger, m, and rest, s, before a touch.
GAP, REST = 0.3e-3, 0.15
#: Touches to choose from: speeds and depths as shares of the largest, and holds of the time.
SPEEDS, DEPTHS, HOLDS = (1.0, 0.25, 0.06, 0.02), (1.0, 0.6), (0.0, 0.01, 0.1, 0.4, 0.8)
#: Best plans of touches, by the sum of what each tells of a rested finger, that are predicted whole.
PREDICTED = 6
#: Frequencies of sines, 1/s, their amplitude as a share of the depth, and duration, s.
SINES, AMPLITUDE, SWING = (2.0, 8.0, 30.0), 0.06, 1.0
#: Speed, m/s, and depth, m, of the one ramp that a design is compared with.
RAMP = 8e-3, 1.5e-3
#: Random sequences of commands to choose from, and the share of the stroke that a pin keeps from its ends.
SEQUENCES, MARGIN = 60, 0.1
#: Least eigenvalue of a matrix of information with a diagonal of 1.
RIDGE = 1e-11


@dataclass(frozen=True, eq=False, repr=False)
class Limits(Parameters):
    """Noise of a measurement, and limits of the machine that presses the finger."""

    noise: float = quantity(10e-3, "noise of the force (of a height 10 um)", unit="N", above=0.0)
    step: float = quantity(1e-3, "time between samples", unit="s", at_least=5e-4, at_most=0.02)
    time: float = quantity(10.0, "duration", unit="s", at_least=1.0, at_most=60.0)
    max_speed: float = quantity(32e-3, "largest speed", unit="m/s", at_least=1e-3, at_most=1.0)
    max_force: float = quantity(2.0, "largest force", unit="N", above=0.0, at_most=MOST_FORCE)
    max_depth: float = quantity(
        3e-3, "largest depth", unit="m", above=0.0, at_most=MOST_INDENTATION
    )


@dataclass(frozen=True, eq=False, repr=False)
class CellLimits(Limits):
    """Noise of the height of a pin."""

    noise: float = quantity(10e-6, "noise of the height", unit="m", above=0.0)


LIMITS = {"pulp": Limits, "cell": CellLimits}


class Prediction(NamedTuple):
    """What a measurement tells."""

    drive: Floats
    """Position, m, from the first contact, or valve command."""
    answer: Floats
    """Force, N, or height, m."""
    information: Floats
    """(p, p): Of the free parameters of the model."""
    derived: list[Derived]

    @property
    def widths(self) -> Floats:
        """Half widths of the 95 % intervals of the derived values, as shares of these, (d,)."""
        return find_widths(self.derived, self.information)


class Task(NamedTuple):
    """What is to be known, and within which limits."""

    part: str
    scene: Scene
    groups: Sequence[str]
    law: str
    limits: Limits

    def predict(self, drive: Floats) -> Prediction:
        """Return what a measurement would tell, were the scene true."""
        rest = self.scene.actuator.rest_height if self.part == "cell" else 0.0
        nothing = np.zeros(drive.size)
        trial = Trial("1", np.arange(drive.size) * self.limits.step, drive, nothing + rest, nothing)
        model = make_model(self.part, self.scene, [trial], self.groups, self.law)
        free = np.zeros(len(model.parameters))
        free[list(model.defaults)] = list(model.defaults.values())
        free[-1] += rest  # the zero of a height
        model.refine(free)  # by the force that bends the frame
        answer, jacobian = model.predict(free)
        information = jacobian.T @ jacobian / self.limits.noise**2
        return Prediction(drive, answer, information, model.derive(free))


def find_widths(derived: Sequence[Derived], information: Floats, ridge: float = RIDGE) -> Floats:
    """Return half widths of 95 % intervals as shares of the values (..., d), by information (..., p, p)."""
    sizes = np.sqrt(np.diagonal(information, axis1=-2, axis2=-1)) + NOTHING
    scaled = information / sizes[..., None] / sizes[..., None, :]
    covariance = np.linalg.inv(scaled + ridge * np.eye(sizes.shape[-1]))
    units = [1.0 if each.log else abs(each.value) + NOTHING for each in derived]
    gradients = np.array([each.gradient for each in derived]) / np.array(units)[:, None]
    turned = gradients / sizes[..., None, :]
    widths: Floats = NORMAL * np.sqrt((turned @ covariance * turned).sum(axis=-1))
    return widths


def design(task: Task) -> tuple[Prediction, Prediction]:
    """Return the designed measurement and, of equal time, one ramp and hold, or one step.

    OutputError where nothing within the limits determines what is to be known.
    """
    if {"contact", "relaxation"}.isdisjoint(task.groups) and task.part == "pulp":
        given = ",".join(task.groups)
        raise OutputError(f"--free must have contact or relaxation with --design (got {given}).")
    best, plain = _design_commands(task) if task.part == "cell" else _design_touches(task)
    # A width that is the ridge's alone is no width.
    bare = find_widths(best.derived, best.information, 0.01 * RIDGE)
    lost = ~(bare < np.minimum(2.0 * best.widths, USELESS))
    if unknown := [each.key for each, gone in zip(best.derived, lost, strict=True) if gone]:
        names = ", ".join(unknown)
        raise OutputError(f"--free must be what the limits permit to know (got {names}).")
    return best, plain


def _touch(task: Task, speed: float, depth: float, hold: float, sine: float = 0.0) -> Floats:
    """Return the positions of a touch: rest, ramp, hold with a sine, ramp back."""
    step = task.limits.step
    rest = np.full(round(REST / step), -GAP)
    ramp = np.linspace(-GAP, depth, int((depth + GAP) / speed / step) + 2)
    turns = 2.0 * np.pi * sine * np.arange(round(hold / step)) * step
    held = depth * (1.0 - AMPLITUDE * (1.0 - np.cos(turns)))
    return np.concatenate((rest, ramp, held, ramp[::-1]))


def _find_depth(task: Task, speed: float) -> float:
    """Return the largest depth at which the finger of the scene stays below the force, at a speed."""
    limits = task.limits
    ramp = _touch(task, speed, limits.max_depth, 0.0)[: int(limits.time / limits.step)]
    ramp = ramp[: ramp.argmax() + 1]
    return float(np.interp(CAREFUL * limits.max_force, task.predict(ramp).answer, ramp))


def _list_touches(task: Task) -> Iterator[Floats]:
    """Give the touches to choose from."""
    limits = task.limits
    for speed in np.array(SPEEDS) * limits.max_speed:
        deepest = _find_depth(task, speed)
        for share, hold in product(DEPTHS, HOLDS):
            yield _touch(task, speed, share * deepest, hold * limits.time)
        for sine in SINES:
            fastest = 2.0 * np.pi * sine * AMPLITUDE * deepest
            if fastest < limits.max_speed and sine * limits.step < 0.05:
                yield _touch(task, speed, deepest, SWING, sine)


def _design_touches(task: Task) -> tuple[Prediction, Prediction]:
    """Return the best touches, and one ramp and hold."""
    limits = task.limits
    room = int(limits.time / limits.step)
    speed = min(RAMP[0], limits.max_speed)
    depth = min(RAMP[1], _find_depth(task, speed))
    plain = task.predict(_touch(task, speed, depth, limits.time)[:room])
    touches = [task.predict(path) for path in _list_touches(task) if path.size <= room]
    touches = [each for each in touches if each.answer.max() <= CAREFUL * limits.max_force]
    if not touches:
        raise OutputError(f"--time must suffice for a touch (got {limits.time:g} s).")
    information = np.stack([each.information for each in touches])
    sizes = np.array([each.drive.size for each in touches])

    def rate(total: Floats) -> Floats:
        ratios: Floats = find_widths(plain.derived, total) / plain.widths
        return -np.log((ratios**2).sum(axis=-1))

    def fill(first: int) -> tuple[int, ...]:
        chosen = [first]
        while (left := room - sizes[chosen].sum()) >= sizes.min():
            total = information[chosen].sum(axis=0)
            gain = (rate(total + information) - rate(total)) / sizes
            chosen.append(int(np.where(sizes <= left, gain, -np.inf).argmax()))
        return tuple(sorted(chosen, key=lambda number: (-sizes[number], number)))

    def tell(plan: tuple[int, ...]) -> float:
        return float(rate(information[list(plan)].sum(axis=0)))

    # A long hold tells most of a finger that has rested, so it comes first.
    plans = sorted(set(map(fill, range(sizes.size))), key=tell)[-PREDICTED:]
    tried = [task.predict(np.concatenate([touches[i].drive for i in plan])) for plan in plans]
    return max(tried, key=lambda each: float(rate(each.information))), plain


def _design_commands(task: Task) -> tuple[Prediction, Prediction]:
    """Return the best of random sequences of commands, and one step that ends before the stroke does."""
    count, random = int(task.limits.time / task.limits.step), np.random.default_rng(1)
    low, high = np.array((MARGIN, 1.0 - MARGIN)) * task.scene.actuator.stroke
    step = (np.arange(count) > 0.05 * count).astype(float)
    step[task.predict(step).answer > 0.95 * high] = 0.0
    tried = [task.predict(step)]
    for longest in random.integers(10, 120, SEQUENCES):
        # Each command is followed by its opposite, so the pin stays near.
        levels = random.choice((-1.0, 0.0, 1.0), (count, 1)) * (1.0, -1.0)
        lengths = random.integers(5, longest, count).repeat(2)
        commands = levels.ravel().repeat(lengths)[:count]
        # In half of them a long way up and down, which tells the orifice.
        if (run := int(random.integers(-count // 6, count // 6))) > 0:
            commands[-2 * run :] = np.repeat((1.0, -1.0), run)
        tried.append(task.predict(commands))
    inside = [each for each in tried if low < each.answer.min() and each.answer.max() < high]
    if not inside:
        rest = task.scene.actuator.rest_height
        rule = f"must be so far from {low:g} and {high:g} m that a pin stays between"
        raise OutputError(f"actuator.rest_height {rule} (got {rest:g} m).")
    return min(inside, key=lambda each: float(np.log(each.widths).sum())), tried[0]
