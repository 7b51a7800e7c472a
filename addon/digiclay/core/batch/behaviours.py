"""Elastic and plastic behaviour of a batch: `control.elastic` and `control.plastic`.

See there for what they do and why.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.modes import Mode
from ..control.drive import Drive
from ..control.elastic import STILL, Elastic, ElasticControl
from ..control.plastic import Plastic, PlasticControl
from ..model.interfaces import Measurement, Orders
from .beds import NO_DISC, Disc
from .broadcasting import Floats, numbers, together

__all__ = ["Drives", "Elastics", "Plastics", "elastics", "plastics"]

REST, HOLD, SPRING, FORCE_FOLLOW = (
    np.int8(mode) for mode in (Mode.REST, Mode.HOLD, Mode.SPRING, Mode.FORCE_FOLLOW)
)


@dataclass(frozen=True, eq=False)
class Drives:
    """Valve commands for wanted speeds, see `control.drive.Drive`.

    Attributes
    ----------
    each : tuple of Drive
        One for all runs, or one a run.
    settling_time, dead_band, lift : ndarray (b,)
        s, m, N.
    """

    each: tuple[Drive, ...]
    settling_time: Floats
    dead_band: Floats
    lift: Floats

    def commands(self, speed: Floats, force: Floats) -> Floats:
        """Return valve commands for speeds, m/s; a cell pressed harder than can be lifted is locked."""
        if len(self.each) == 1:
            command = self.each[0].at_speed(speed)
        else:
            columns = [drive.at_speed(speed[:, run]) for run, drive in enumerate(self.each)]
            command = np.stack(columns, axis=-1)
        np.putmask(command, (force >= self.lift) & (command > 0.0), 0.0)
        return command

    def approach(self, error: Floats) -> Floats:
        """Return the speed that takes a pin to its height, m/s; see `control.drive.Drive.approach`."""
        speed: Floats = np.where(np.abs(error) > self.dead_band, error / self.settling_time, 0.0)
        return speed


def _drives(drives: Sequence[Drive]) -> Drives:
    """Put the drives of all runs together."""
    first = drives[0]
    alike = all(np.array_equal(d.up, first.up) and np.array_equal(d.down, first.down) for d in drives)
    known = (numbers([getattr(d, name) for d in drives]) for name in ("settling_time", "dead_band", "lift"))
    return Drives((first,) if alike else tuple(drives), *known)


@dataclass(frozen=True, eq=False)
class _Behaviour:
    """Common part: no memory, control of the cells near a fingertip and of those in motion only.

    Attributes
    ----------
    rest : ndarray (b,)
        Rest height, m.
    drives : Drives
    """

    rest: Floats
    drives: Drives

    def begin(self) -> None:
        """Nothing to remember."""

    def attend(self, memory: None, touched: Measurement) -> tuple[None, Disc]:
        """Ask for no more than the cells near the fingers and those that move."""
        return None, NO_DISC

    def kept(self, memory: None, runs: NDArray[np.intp]) -> None:
        """Nothing to keep."""

    def of(self, memory: None, run: int) -> None:
        """Nothing to remember."""


@dataclass(frozen=True, eq=False)
class Elastics(_Behaviour):
    """Pressed: ``c dH/dt = k (H_0 - H) - F``. Left alone: back to rest."""

    parameters: Elastic

    def command(self, memory: None, seen: Measurement) -> tuple[None, Orders]:
        """Let pressed cells give way, and the others spring back."""
        known = self.parameters
        error = self.rest - seen.height
        pressed = seen.force >= known.felt_force * np.where(seen.mode == SPRING, STILL, 1.0)
        giving = (known.stiffness * error - seen.force) / known.damping
        speed = np.where(pressed, giving, self.drives.approach(error))
        target = np.broadcast_to(self.rest, error.shape)
        return None, Orders(target, np.where(pressed, SPRING, REST), self.drives.commands(speed, seen.force))


@dataclass(frozen=True, eq=False)
class Plastics(_Behaviour):
    """Above yield: ``c dH/dt = -(F - F_y)``, and the height reached is kept."""

    parameters: Plastic

    def command(self, memory: None, seen: Measurement) -> tuple[None, Orders]:
        """Let cells give way that are pressed beyond yield, hold the others."""
        known = self.parameters
        pressed = seen.force >= known.felt_force
        yielding = seen.force > known.yield_force
        target = np.where(yielding, np.minimum(seen.target, seen.height), seen.target)
        # A pin under the finger is not pushed back up: what it sank after yielding is felt as no force.
        back = self.drives.approach(target - seen.height)
        speed = np.where(pressed, np.minimum(back, 0.0), back)
        np.putmask(speed, yielding, (known.yield_force - seen.force) / known.damping)
        mode = np.where(np.abs(target - self.rest) > known.dead_band, HOLD, REST)
        np.putmask(mode, pressed, SPRING)
        np.putmask(mode, yielding, FORCE_FOLLOW)
        return None, Orders(target, mode, self.drives.commands(speed, seen.force))


def elastics(controllers: Sequence[ElasticControl]) -> Elastics:
    """Put the elastic behaviour together for a stack."""
    rest = numbers([one.actuator.rest_height for one in controllers])
    drives = _drives([one.drive for one in controllers])
    return Elastics(rest, drives, together([one.parameters for one in controllers]))


def plastics(controllers: Sequence[PlasticControl]) -> Plastics:
    """Put the plastic behaviour together for a stack."""
    rest = numbers([one.actuator.rest_height for one in controllers])
    drives = _drives([one.drive for one in controllers])
    return Plastics(rest, drives, together([one.parameters for one in controllers]))
