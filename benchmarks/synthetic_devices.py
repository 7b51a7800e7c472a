"""Synthetic measurements of fingers and cells: the equations integrated in small steps, and noise.

Nothing here is shared with `digiclay_fit`: the equations are written again, as another would.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from digiclay.core.base.arrays import Floats

#: Points (time, s, position, m) that straight lines join.
Path = list[tuple[float, float]]
#: Small steps per sample.
FINE = 40


class Finger(NamedTuple):
    """A fingertip pressed on a plate."""

    stiffness: float = 250.0
    exponent: float = 2000.0
    weights: tuple[float, ...] = (0.08, 0.62, 0.20, 0.10)
    times: tuple[float, ...] = (4e-3, 70e-3, 1.4)
    touch: float = 0.0
    """Position at which it touches, m."""
    offset: float = 0.0
    """Force shown without contact, N."""

    def press(self, depth: Floats) -> Floats:
        """Return the elastic force, N: cells of 9 mm² with 0.34 of the law each, under an ellipsoid."""
        length, width, height = 10e-3, 8e-3, 8e-3
        u = self.exponent * np.maximum(depth, 0.0)
        grown = np.exp(u) - 1.0 - u
        lifted = (grown - u * u / 2.0) / (self.exponent * height)
        footprint = 2.0 * math.pi * length * width / height
        density = 0.34 / 9e-6 * self.stiffness / self.exponent**2
        return footprint * density * (grown - lifted)

    def measure(self, path: Path, rate: float) -> tuple[Floats, ...]:
        """Return time, position and force, without noise, on a path of straight lines (time, position)."""
        moments, places = np.array(path).T
        step = 1.0 / rate / FINE
        fine = np.arange(round(moments[-1] / step) + 1) * step
        elastic = self.press(np.interp(fine, moments, places) - self.touch)
        force = elastic.copy()
        shares = np.array(self.weights[1:]) / sum(self.weights)
        for share, relaxing in zip(shares, self.times, strict=True):
            force -= share * follow(elastic, step / relaxing)
        force = np.maximum(force, 0.0) + self.offset
        time = fine[::FINE]
        return time, np.interp(time, moments, places), force[::FINE]


def follow(driver: Floats, turn: float) -> Floats:
    """Return z of dz = turn (driver - z) per step, from 0, by the trapezoidal rule."""
    from scipy.signal import lfilter

    half = 0.5 * turn
    z: Floats = lfilter([half, half], [1.0 + half, half - 1.0], driver)
    return z


class Cell(NamedTuple):
    """A pin that a valve moves."""

    diameter: float = 0.5e-3
    stroke: float = 30e-6
    high: float = 50e3
    low: float = -50e3
    lag: float = 2e-3
    delay: float = 1e-3
    rest: float = 40e-3
    density: float = 855.0
    viscosity: float = 1.6e-6
    bore: float = 2e-3

    def measure(self, commands: Floats, rate: float, load: Floats | float = 0.0) -> Floats:
        """Return the heights at the instants of commands, (n,), that are held from one to the next."""
        step = 1.0 / rate
        fine = (np.arange((commands.size - 1) * FINE) + 0.5) * step / FINE
        opening = self._open(commands, step, fine)
        area = math.pi * self.bore**2 / 4.0
        source = np.where(opening > 0.0, self.high, self.low)
        instants = np.arange(commands.size) * step
        push = np.interp(fine, instants, np.broadcast_to(load, commands.shape)) / area
        speed = self._flow(opening, source - push) / area
        moved = np.cumsum(speed)[FINE - 1 :: FINE] * step / FINE
        return self.rest + np.concatenate(([0.0], moved))

    def _open(self, commands: Floats, step: float, times: Floats) -> Floats:
        """Return the openings at times."""
        stay = math.exp(-step / self.lag)
        level = np.zeros(commands.size)
        for number, command in enumerate(commands[:-1], 1):
            level[number] = command + (level[number - 1] - command) * stay
        late = times - self.delay
        number = np.floor(late / step + 1e-9).astype(int)
        command, begun = commands[np.maximum(number, 0)], level[np.maximum(number, 0)]
        passed = np.exp(-(late - number * step) / self.lag)
        return np.where(late < 0.0, 0.0, command + (begun - command) * passed)

    def _flow(self, opening: Floats, drop: Floats) -> Floats:
        """Return the flow through valve and conduit, whose drops sum up to `drop`."""
        seat = math.pi * 0.18 * self.diameter**2
        laminar = seat**2 / (8.0 * 200.0**2 * self.density * self.viscosity * self.stroke)
        turbulent = seat / 4.0 * math.sqrt(2.0 / self.density)
        resistance = 128.0 * self.density * self.viscosity * 10e-3 / (math.pi * 0.8e-3**4)
        size, push = np.maximum(np.abs(opening), 1e-9), np.abs(drop)
        slow = push / (1.0 / (laminar * size**2) + resistance)
        # (Q / a)² + R Q = P
        squared = 1.0 / (turbulent * size) ** 2
        fast = 2.0 * push / (resistance + np.sqrt(resistance**2 + 4.0 * squared * push))
        return np.minimum(slow, fast) * np.sign(drop)


def press_at(speeds: Sequence[float], touch: float, hold: float = 1.0) -> list[Path]:
    """Return paths that wait above a finger, press it 1.5 mm deep at a speed, and hold."""
    gap, depth, wait = 0.3e-3, 1.5e-3, 0.1
    paths = []
    for speed in speeds:
        arrived = wait + (depth + gap) / speed
        points = [(0.0, -gap), (wait, -gap), (arrived, depth), (arrived + hold, depth)]
        paths.append([(time, place + touch) for time, place in points])
    return paths


def command_at_random(random: np.random.Generator, count: int) -> Floats:
    """Return commands of -1, 0 and 1 that last 5 to 60 samples and stay near where they began."""
    commands: list[float] = []
    while len(commands) < count:
        level = float(random.choice((-1.0, 0.0, 1.0)))
        if level * sum(commands) > 60:
            level = -level
        commands += [level] * int(random.integers(5, 60))
    return np.array(commands[:count])
