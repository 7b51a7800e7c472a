"""Link of the doors to the session: newest frame, orders, lease of the fingertip, counts."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, replace
from typing import Any

from digiclay.core.base.errors import DigiclayError

from .doors import LatestSlot, Order, pack_order
from .protocol import Bed, Frame, Pose, Reset, Status, unpack_frame

#: Time after the last pose of a client when another one may move the fingertip, s.
LEASE = 2.0


class HeldError(DigiclayError):
    """Request of a client while another one moves the fingertip."""

    def __init__(self) -> None:
        super().__init__(f"Another client moves the fingertip: wait until it is silent for {LEASE:g} s.")


@dataclass(frozen=True)
class Lease:
    """Client that moves the fingertip, and the end of its lease, s; none before the first pose."""

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


@dataclass(frozen=True)
class Door:
    """Open door: its port, and a function that closes it."""

    port: int
    close: Callable[[], Awaitable[None]]


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
        """Wait for a newer frame; a busy reader misses some."""
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
