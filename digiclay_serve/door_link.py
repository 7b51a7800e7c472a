"""Link of the doors to the session: bed, newest frame, orders, lease of the fingertip, counts."""

from __future__ import annotations

import asyncio
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

from digiclay.core.base.errors import DigiclayError
from digiclay.core.engine.system import System
from digiclay.core.scene.schema import Scene

from .latest_slot import LatestSlot, Order, pack_order
from .protocol import LIMITS, Frame, Limits, Pose, Reset, Status, unpack_frame

#: Most pins whose positions are told: libraries refuse messages of a megabyte.
MOST_POSITIONS = 10_000


@dataclass(frozen=True)
class Bed:
    """Bed of the session, sent to a client once.

    Attributes
    ----------
    name : str
        Of the scene.
    pitch, stroke : float
        m.
    period : float
        Control period, s.
    positions : tuple of (float, float)
        Of the pins, m; none of a bed of more than 10,000.
    most_force, most_speed : float
        Largest total force handed out, N, and largest speed of the fingertip, m/s.
    """

    name: str
    rows: int
    columns: int
    pitch: float
    stroke: float
    period: float
    positions: tuple[tuple[float, float], ...]
    most_force: float = LIMITS.force
    most_speed: float = LIMITS.speed


def describe_bed(scene: Scene, system: System, limits: Limits) -> Bed:
    """Return what clients are told of the bed of a scene."""
    layout, grid = scene.layout, system.grid
    told = grid.positions if grid.count <= MOST_POSITIONS else grid.positions[:0]
    return Bed(
        scene.name, layout.rows, layout.columns, layout.pitch, system.cell.actuator.stroke, system.period,
        tuple((float(x), float(y)) for x, y in told), limits.force, limits.speed,
    )  # fmt: skip


#: Time after the last pose of a client when another one may move the fingertip, s.
LEASE = 2.0


class HeldError(DigiclayError):
    """Request of a client while another one moves the fingertip."""

    def __init__(self) -> None:
        super().__init__(f"Another client moves the fingertip: wait until it is silent for {LEASE:g} s.")


@dataclass(frozen=True)
class Lease:
    """Client that moves the fingertip, and the end of its lease, s; nobody before the first pose."""

    holder: object = None
    until: float = 0.0


def claim(lease: Lease, client: object, now: float) -> tuple[bool, Lease]:
    """Return whether a client may move the fingertip now, and the lease after that.

    `client`: anything that is equal for one client only; `now`: by a clock that never goes back, s.
    """
    if lease.holder not in (None, client) and now < lease.until:
        return False, lease
    return True, Lease(client, now + LEASE)


def release(lease: Lease, client: object) -> Lease:
    """Return the lease after a client has gone."""
    return Lease() if lease.holder == client else lease


class DoorLink:
    """Link of all doors of a process to the session.

    Parameters
    ----------
    orders, frames : LatestSlot
        To the session, and from it.
    """

    def __init__(self, bed: Bed, orders: LatestSlot, frames: LatestSlot, token: str) -> None:
        self.bed, self.token = bed, token
        self.counts: Counter[str] = Counter()
        self.packed: bytes = b""
        self._orders, self._frames = orders, frames
        self._order, self._lease = Order(), Lease()
        self._changed = asyncio.Event()
        self._frame: Frame | None = None

    def take_frame(self) -> None:
        """Take the newest frame from the session, and wake those who wait for it."""
        packed = self._frames.read()
        if packed is None:
            return
        self.packed, self._frame = packed, None
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    async def next_frame(self) -> None:
        """Wait for a newer frame; whoever is busy misses some."""
        await self._changed.wait()

    def read_frame(self) -> Frame | None:
        """Return the newest frame; None before the first."""
        if self._frame is None and self.packed:
            self._frame = unpack_frame(self.packed)
        return self._frame

    def order(self, request: Pose | Reset | Status, client: object) -> dict[str, Any] | None:
        """Carry out a request; return the answer, if it has one.

        `client`: anything that is equal for one client only. Raises HeldError when another client moves the
        fingertip.
        """
        if isinstance(request, Status):
            return dict(self.counts)
        now = asyncio.get_running_loop().time()
        granted, self._lease = claim(self._lease, client, now)
        if not granted:
            self.counts["poses while held"] += 1
            raise HeldError
        if isinstance(request, Pose):
            self.counts["poses"] += 1
            self._order = replace(self._order, pose=request.pose, number=request.number)
        else:
            self.counts["resets"] += 1
            self._order = Order(None, 0, self._order.resets + 1)
        self._orders.write(pack_order(self._order))
        return None

    def leave(self, client: object) -> None:
        """Note that a client has gone: another one may move the fingertip."""
        self._lease = release(self._lease, client)
