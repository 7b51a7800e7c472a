"""Sensor model: noise, quantization and delay of forces and heights.

Each effect is a part around another one, which a scene combines:
``Delayed(Quantized(Noisy(PerfectSensors())))``, with `observer.ValveObserver` in between. A
part without an effect is left out.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity
from .control_interface import Measurement
from .interfaces import Sensors

Words = NDArray[np.uint64]

#: Standard deviations above which a reading is not noise: noise exceeds them once in 3.5 million
#: readings.
SURE = 5.0
#: Finest step a reading can have: below it, rounding errors are larger than the step.
FINEST = 1e-12
#: Odd constants of the 64-bit mixer SplitMix64 (Steele, Lea and Flood 2014).
WEYL, FIRST, SECOND = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
#: Control periods whose noise is drawn at once, one more than a set of active cells serves; and
#: most numbers at once.
AHEAD, MOST = 33, 200_000


@dataclass(frozen=True, eq=False, repr=False)
class Sensing(Parameters):
    """Parameters of the sensor model; 0 omits an effect."""

    force_noise: float = quantity(
        0.0,
        "standard deviation of the force sensors",
        unit="N",
        symbol="σ_F",
        at_least=0.0,
        at_most=100.0,
    )
    height_noise: float = quantity(
        0.0,
        "standard deviation of the height sensors",
        unit="m",
        symbol="σ_H",
        at_least=0.0,
        at_most=1.0,
    )
    force_step: float = quantity(
        0.0, "resolution of a force reading", unit="N", symbol="q_F", at_least=0.0, at_most=100.0
    )
    height_step: float = quantity(
        0.0, "resolution of a height reading", unit="m", symbol="q_H", at_least=0.0, at_most=1.0
    )
    delay: int = quantity(
        0, "delay of readings in control periods", symbol="d", at_least=0, at_most=100
    )
    observer: str = quantity(
        "none",
        "replacement of the force sensors: none, or an estimate from heights and commands",
        choices=("none", "valve"),
    )
    seed: int = quantity(0, "seed of the noise", at_least=0, at_most=2**63 - 1)

    @property
    def noisy(self) -> bool:
        """Whether there is noise."""
        return bool(self.force_noise or self.height_noise)

    @property
    def force_floor(self) -> float:
        """Force above which a reading is not noise, N: rounding adds half a step; 0 without noise."""
        return SURE * self.force_noise + 0.5 * self.force_step if self.force_noise else 0.0

    @property
    def height_floor(self) -> float:
        """Largest error of a height reading, m; 0 for perfect sensors."""
        return SURE * self.height_noise + 0.5 * self.height_step

    @property
    def motion_floor(self) -> float:
        """Difference of two height readings above which a pin has moved, m."""
        return SURE * math.sqrt(2.0) * self.height_noise + self.height_step

    def check(self) -> None:
        """Refuse steps too small to round to, and force sensors beside an observer."""
        for name, unit in (("force_step", "N"), ("height_step", "m")):
            step = getattr(self, name)
            if 0.0 < step < FINEST:
                rule = f"must be 0 {unit}, or at least {FINEST:g} {unit}"
                raise ParameterError("Sensing", name, rule, f"{step:g} {unit}")
        for name in ("force_noise", "force_step"):
            if self.observer != "none" and getattr(self, name):
                rule = f"must be 0 N with observer = {self.observer!r}: there are no force sensors then"
                raise ParameterError("Sensing", name, rule, f"{getattr(self, name):g} N")


def draw_polar(seed: Any, period: Any, cells: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Return a radius and an angle per cell, a pure function of the arguments.

    A hashed counter replaces a generator: the noise of a cell does not depend on other cells or
    earlier readings. The numbers are ([t,] m[, b]) for seeds (b,), periods (t,) and cells (m[, b]).
    Radius times cosine and sine are two independent standard normal numbers (Box and Muller); none
    is farther from 0 than 8.6.
    """
    periods = np.asarray(period, np.uint64)
    start = _mix(np.array(seed, np.uint64, ndmin=1))
    start = _mix(start + periods.reshape(*periods.shape, *[1] * cells.ndim))
    counter = start + np.uint64(WEYL) * (2 * cells.astype(np.uint64))
    radius = np.sqrt(-2.0 * np.log(_draw_uniform(counter)))
    return radius, 2.0 * np.pi * _draw_uniform(counter + np.uint64(WEYL))


def _mix(words: Words) -> Words:
    """Scramble 64-bit words: each bit changes about half the bits of the result."""
    words = words + np.uint64(WEYL)
    for shift, factor in ((30, FIRST), (27, SECOND), (31, 1)):
        words ^= words >> np.uint64(shift)
        words *= np.uint64(factor)
    return words


def _draw_uniform(counter: Words) -> Floats:
    """Return uniform numbers in (0, 1), without both ends."""
    return ((_mix(counter) >> np.uint64(12)).astype(np.float64) + 0.5) * 2.0**-52


class NoiseAhead:
    """Noise of the coming periods, drawn at once for the cells read last.

    It depends only on seed, a number or (b,), period and cell, so that it holds for any first part
    of the cells. `deviations` are those of forces, N, and heights, m, numbers or (b,).
    """

    def __init__(self, seed: Any, *deviations: Any) -> None:
        self._seed, self._deviations, self._first, self._end = seed, deviations, 0, 0
        self._cells: NDArray[np.intp] = np.empty(0, np.intp)
        self._drawn: list[Floats | None] = []

    def draw(self, period: int, cells: NDArray[np.intp]) -> list[Floats | None]:
        """Return the noise of forces, N, and heights, m, in a period, (m[, b]) each; None: no noise."""
        count = len(cells)
        continued = bool(self._drawn) and cells.tobytes() == self._cells[:count].tobytes()
        if not (continued and self._first <= period < self._end):
            # The first part of the cells is read before all of them.
            self._cells = self._cells if continued else cells.copy()
            self._first, self._end = (
                period,
                period + max(1, min(AHEAD, MOST // max(1, self._cells.size))),
            )
            radius, angle = draw_polar(self._seed, np.arange(self._first, self._end), self._cells)
            turns: tuple[np.ufunc, ...] = np.cos, np.sin
            self._drawn = [
                by * (radius * turn(angle)) if np.any(by) else None
                for by, turn in zip(self._deviations, turns, strict=True)
            ]
        return [
            noise if noise is None else noise[period - self._first, :count] for noise in self._drawn
        ]


@dataclass(frozen=True)
class Stateless(Sensors):
    """Sensors around others, without state rows of their own."""

    inner: Sensors

    @property
    def rows(self) -> int:
        """State rows per cell: those of the inner sensors."""
        return self.inner.rows

    def note(self, seen: Measurement, period: int) -> None:
        """Update the rows of the inner sensors."""
        self.inner.note(seen, period)


@dataclass(frozen=True)
class Noisy(Stateless):
    """Normal noise, white from cell to cell and from period to period."""

    force: float
    height: float
    """Standard deviations, N and m."""
    seed: int

    def measure(self, seen: Measurement, period: int) -> tuple[Floats, Floats]:
        """Return forces and heights with noise; a force may read below 0."""
        force, height = self.inner.measure(seen, period)
        of_force, of_height = self._ahead.draw(period, seen.cells)
        force = force if of_force is None else force + of_force
        return force, height if of_height is None else height + of_height

    @cached_property
    def _ahead(self) -> NoiseAhead:
        """Noise drawn ahead, a cache that changes no reading."""
        return NoiseAhead(self.seed, self.force, self.height)


@dataclass(frozen=True)
class Quantized(Stateless):
    """Readings rounded to the nearest step, halves to the even one; a step of 0 rounds nothing."""

    force: float
    height: float
    """Steps, N and m."""

    def measure(self, seen: Measurement, period: int) -> tuple[Floats, Floats]:
        """Return rounded forces and heights."""
        force, height = self.inner.measure(seen, period)
        return _round_to_step(force, self.force), _round_to_step(height, self.height)


def _round_to_step(values: Floats, step: Floats | float) -> Floats:
    """Return values in whole steps; a step, or each run's (b,), of 0 rounds nothing."""
    if not np.any(step):
        return values
    whole: Floats = np.rint(values / np.where(step, step, 1.0)) * step
    return np.where(step, whole, values)


@dataclass(frozen=True)
class Delayed(Sensors):
    """Readings that arrive whole control periods late; before the first arrives, those of the start.

    An idle cell is not read, and does not change: its readings of that time are computed when
    they are needed, so that results do not depend on which cells are active.
    """

    inner: Sensors
    periods: int
    """Delay, at least 1."""
    rest: float
    """Height of every pin at the start, m."""

    @property
    def rows(self) -> int:
        """State rows: periods read (0: none), force and height then, delayed readings, the inner rows."""
        return 3 + 2 * (self.periods + 1) + self.inner.rows

    def measure(self, seen: Measurement, period: int) -> tuple[Floats, Floats]:
        """Return the readings of `periods` ago."""
        force, height = self._read(seen, max(period - self.periods, 0))
        return force, height

    def note(self, seen: Measurement, period: int) -> None:
        """Add the readings that cells have missed while idle, and the new ones."""
        rows = seen.sensed
        for missed in range(max(period - self.periods, 0), period):
            rows[self._slot(missed)] = self._read(seen, missed)
        inner = self._show_inner(seen)
        self.inner.note(inner, period)
        rows[self._slot(period)] = self.inner.measure(inner, period)
        rows[0] = period + 1
        rows[1], rows[2] = seen.force, seen.height

    def _show_inner(self, seen: Measurement) -> Measurement:
        """Return cells with the rows of the inner sensors."""
        return seen._replace(sensed=seen.sensed[self.rows - self.inner.rows :])

    def _slot(self, period: int) -> slice:
        """Rows that hold the readings of a period."""
        first = 3 + 2 * (period % (self.periods + 1))
        return slice(first, first + 2)

    def _read(self, seen: Measurement, period: int) -> Floats:
        """Return force and height read in a period, shape (2, m[, b])."""
        rows = seen.sensed
        stored: Floats = rows[self._slot(period)]
        missed = rows[0] <= period
        if not missed.any():
            return stored
        height = np.where(rows[0] > 0.0, rows[2], self.rest)
        # An idle cell has a shut valve and no queued command.
        still = self._show_inner(seen)._replace(
            force=rows[1], height=height, command=np.zeros_like(height)
        )
        return np.where(missed, self.inner.measure(still, period), stored)
