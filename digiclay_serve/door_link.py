"""Link of the doors to the session: newest frame, orders, lease of the fingertip, counts."""

import asyncio
from collections import Counter

from digiclay.core.base.errors import DigiclayError, ParameterError
from digiclay.core.files.tables import Record

from .doors import LatestSlot, Order, pack_order
from .protocol import Bed, Frame, Pose, Poses, Reset, Status, unpack_frame

#: Time after the last pose of a client when another one may move the fingertip, s.
LEASE = 2.0


class FrequentError(DigiclayError):
    """What may be wrong with each of a thousand poses a second, of a client that means well."""


class DoorLink:
    """Link of all doors of a process to the session, by a slot for orders and one for frames."""

    def __init__(self, bed: Bed, orders: LatestSlot, frames: LatestSlot, token: str) -> None:
        self.bed, self.token = bed, token
        self.counts: Counter[str] = Counter()
        self.packed: bytes = b""
        self._orders, self._frames = orders, frames
        self._order = Order()
        #: Client that moves the fingertip, and when its lease ends, s.
        self._holder: object = None
        self._until = 0.0
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

    async def next_frame(self) -> Frame | None:
        """Wait for a newer frame, and return it; a busy reader misses some."""
        await self._changed.wait()
        if self._frame is None and self.packed:
            self._frame = unpack_frame(self.packed)
        return self._frame

    def order(self, request: Pose | Poses | Reset | Status, client: object) -> Record | None:
        """Carry out a request of a client, equal to itself alone; return the answer, if there is one.

        Raises FrequentError while another client moves the fingertip; and for what was wrong with
        some of several fingers, after the others have been moved.
        """
        if isinstance(request, Status):
            return dict(self.counts)
        now = asyncio.get_running_loop().time()
        if self._holder not in (None, client) and now < self._until:
            self.counts["poses while held"] += 1
            raise FrequentError(
                f"Another client moves the fingertip: wait until it is silent for {LEASE:g} s."
            )
        self._holder, self._until = client, now + LEASE
        fault = ""
        if isinstance(request, Pose):
            self.counts["poses"] += 1
            self._order = self._order._replace(pose=request.pose, number=request.number)
        elif isinstance(request, Poses):
            self.counts["poses"] += 1
            self._order, more = self._order.name(request, self.bed.fingers)
            rule = f"must be at most {self.bed.fingers}, the fingertips of the session (--fingers)"
            refusal = ParameterError("poses", "fingers", rule, f"{more} more")
            fault = str(refusal) if more else request.fault
        else:
            self.counts["resets"] += 1
            self._order = Order(resets=self._order.resets + 1)
        self._orders.write(pack_order(self._order))
        if fault:
            self.counts["poses refused in part"] += 1
            raise FrequentError(fault)
        return None

    def leave(self, client: object) -> None:
        """Note that a client has gone: another one may move the fingertip."""
        if self._holder == client:
            self._holder = None
