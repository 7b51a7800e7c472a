"""Height servo by the inverse of the flow law: openings that bring loaded pins to their heights in time.

The commanded speed is ``w = (e - Σ w_j t_j) / (T_a - δ)`` for the error e, the time T_a until the
height is aimed at, the delay δ of the valve, and earlier commands with speeds w_j that still act
for t_j. The error of a free pin then decays with poles at 0 and about 0.3.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arrays import Constants, Floats
from ..base.errors import ParameterError
from ..model.delay import Queue
from ..model.physics import Cell
from .pin_motion import OPENINGS, find_free_speeds

#: Instants of a control period at which the lag of the valve is evaluated.
INSTANTS = 64
#: Speeds below this share of the free speed are set to 0: a valve must not stay open for them.
STILL = 1e-6
#: Share of the free speed below which a loaded pin is raised more slowly still.
LOADED = 0.3


@dataclass(frozen=True, eq=False)
class FlowServo:
    """Servo of a device."""

    cell: Cell
    ratios: Floats
    openings: Floats
    """(257,): Openings from -1 to 1, and the speed of a pin without load at them, as a share of the
    largest."""
    fall: float
    rise: float
    pull: float
    lift: float
    """Largest speeds without load, m/s, and forces of the reservoirs on a pin, N, all positive."""
    ahead: float
    left: tuple[float, ...]
    """Time until the heights aimed at, s; (q,): how long earlier commands still act, s, the newest first."""
    dead_band: float
    exact: bool
    """Whether the flow is proportional to the pressure drop, so that a load scales all speeds alike."""

    @property
    def rows(self) -> int:
        """State rows per cell: speeds of the commands that still act."""
        return len(self.left)

    @cached_property
    def span(self) -> float:
        """Time for which a new command acts until the heights aimed at, s."""
        return self.ahead - sum(self.left)

    def find_limits(self, force: Floats) -> Floats:
        """Return the lowest (negative) and highest speeds of pins under forces (m,), N; (2, m), m/s."""
        free, change = self._speeds
        limits: Floats = change * force
        limits += free
        highest = limits[1]
        np.maximum(highest, 0.0, out=highest)
        return limits

    @cached_property
    def _speeds(self) -> tuple[Floats, Floats]:
        """Speeds of pins without load, m/s, and how these change with a force, m/s/N, (2, 1) each."""
        free = np.array([[-self.fall], [self.rise]])
        return free, free / [[self.pull], [-self.lift]]

    def coast(self, height: Floats, speeds: Floats) -> Floats:
        """Return the heights, (m,), m, at which earlier commands of speeds (q, m), m/s, will leave pins."""
        coasted: Floats = self._times.dot(speeds)
        coasted += height
        return coasted

    @cached_property
    def _times(self) -> Floats:
        """Times for which earlier commands still act, (q,), s."""
        return np.array(self.left)

    @cached_property
    def _numbers(self) -> Constants:
        """Constants of `serve`: inverse of the span, 1/s; dead band, m; slowest speed, m/s; 0; and inverse of
        the speed of a loaded pin, s/m.
        """
        slowest, loaded = STILL * self.rise, LOADED * self.rise
        return Constants((1.0 / self.span, self.dead_band, slowest, 0.0, 1.0 / loaded))

    def serve(self, error: Floats, limits: Floats, force: Floats, speeds: Floats) -> Floats:
        """Return commands (m,) for errors of coasted heights (m,), m; updates speeds (q, m) in place."""
        fall, rise = limits
        per_span, band, slowest, none, per_loaded = self._numbers[error.shape]
        speed = error * per_span
        np.maximum(speed, fall, out=speed)
        # At full opening a loaded pin would exceed the force of its reservoir, and be lowered
        # again.
        np.minimum(speed, np.minimum(rise, rise * rise * per_loaded), out=speed)
        still = np.abs(error) <= band
        still |= np.abs(speed) < slowest
        np.putmask(speed, still, none)
        if len(self.left) > 1:
            speeds[1:] = speeds[:-1]
        speeds[0] = speed
        speed /= np.where(speed > none, rise, -fall)
        command: Floats = np.interp(speed, self.ratios, self.openings)
        if not self.exact:
            command = self._refine(command, speeds[0], force)
        return command

    def _refine(self, command: Floats, speed: Floats, force: Floats) -> Floats:
        """Return commands for which the flow law gives the speeds: one correction of the scaled ones."""
        moving = np.flatnonzero(command)
        opening, wanted = command[moving], speed[moving]
        drop = self.cell.supply.pressure(opening) - self.cell.actuator.pressure(force[moving])
        reached = self.cell.flow.flow(opening, drop) / self.cell.actuator.area
        share = np.interp(opening, self.openings, self.ratios)
        share *= np.clip(wanted / reached, 0.5, 2.0)
        command[moving] = np.interp(share, self.ratios, self.openings)
        return command


class BalancingServo(FlowServo):
    """Servo of back-drivable motors, which balance the load."""

    def _refine(self, command: Floats, speed: Floats, force: Floats) -> Floats:
        """Return commands for speeds, m/s, under forces, N: ``K = v / v0 + F / F_stall``."""
        return np.clip(speed / self.rise + force / self.lift, -1.0, 1.0)


def make_flow_servo(cell: Cell, period: float, dead_time: float, dead_band: float) -> FlowServo:
    """Return a servo that aims two periods ahead, plus the whole periods of the dead time, s."""
    area, supply = cell.actuator.area, cell.supply
    for name in ("high", "low"):
        if getattr(supply, name) == 0.0:
            rule = "must move pins without a load for Method III, control.method = hybrid"
            raise ParameterError("supply", name, rule, "0 Pa")
    up, down = find_free_speeds(cell, 1.0), find_free_speeds(cell, -1.0)
    ratios = np.concatenate((-down[::-1] / down[-1], up[1:] / up[-1]))
    openings = np.concatenate((-OPENINGS[::-1], OPENINGS[1:]))
    half = find_free_speeds(cell, 0.5)
    delay = dead_time + _measure_lag(cell, period)
    whole = math.ceil(delay / period - 1e-9)
    left = tuple(min(delay - number * period, period) for number in range(whole))
    ahead = 2.0 * period + math.floor(delay / period + 1e-9) * period
    exact = supply.locks and bool(np.allclose(2.0 * half, up, rtol=1e-6, atol=1e-12))
    kind = FlowServo if supply.locks else BalancingServo
    return kind(
        cell,
        ratios,
        openings,
        float(down[-1]),
        float(up[-1]),
        -supply.low * area,
        supply.high * area,
        ahead,
        left or (0.0,),
        dead_band,
        exact,
    )


def _measure_lag(cell: Cell, period: float) -> float:
    """Return the mean delay of the valve's opening behind its command over a control period, s."""
    times = (np.arange(INSTANTS) + 0.5) * (period / INSTANTS)
    return period * float(np.mean(1.0 - cell.lag.response(Queue(), times.tolist())[:, -1]))
