"""OSC door: requests and frames as datagrams, for a bounded number of subscribers."""

from __future__ import annotations

import asyncio
import math
from dataclasses import dataclass
from typing import Any

from digiclay.core.base.errors import DigiclayError, ParameterError

from .access_token import is_token
from .door_link import DoorLink
from .osc_messages import Subscription, format_osc_error, format_osc_frame, read_osc

#: Most subscribers, and how long a subscription lasts unless it is repeated, s.
MOST_SUBSCRIBERS, LASTS = 16, 5.0
#: Shortest time between two errors that are sent, s.
BETWEEN_ERRORS = 0.1
#: Bytes that wait for the network at most.
MOST_UNSENT = 1024 * 1024
#: A client that has the token, but is one of too many.
FULL = f"must be one of {MOST_SUBSCRIBERS} at most"


@dataclass
class _Subscriber:
    """Subscription of an address, its end, s, and the period from which the next frame is sent."""

    part: str
    every: int
    until: float
    due: int = 0


class _OscDoor(asyncio.DatagramProtocol):
    """Handlers of the datagrams.

    Parameters
    ----------
    link : DoorLink
    """

    def __init__(self, link: DoorLink) -> None:
        self._link = link
        self._subscribers: dict[Any, _Subscriber] = {}
        self._last_error = -math.inf
        self._transport: Any = None

    def connection_made(self, transport: Any) -> None:
        """Begin."""
        self._transport = transport

    def error_received(self, exc: Exception) -> None:
        """Pass over what a subscriber that has gone sends back; its subscription will end."""

    def datagram_received(self, data: bytes, address: Any) -> None:
        """Carry out a request; without the right token nothing is answered."""
        try:
            token, request = read_osc(data)
        except DigiclayError:
            self._link.counts["datagrams refused"] += 1
            return
        if not is_token(token, self._link.token):
            self._link.counts["wrong tokens"] += 1
            return
        try:
            if isinstance(request, ParameterError):
                raise request
            if isinstance(request, Subscription):
                self._subscribe(address, request)
            else:
                self._link.order(request, address)
        except DigiclayError as error:
            self._link.counts["datagrams refused"] += 1
            now = asyncio.get_running_loop().time()
            if now - self._last_error >= BETWEEN_ERRORS:
                self._last_error = now
                self._transport.sendto(format_osc_error(str(error)), address)

    def _subscribe(self, address: Any, request: Subscription) -> None:
        """Begin or renew a subscription."""
        now = asyncio.get_running_loop().time()
        kept = {where: one for where, one in self._subscribers.items() if now < one.until}
        if address not in kept and len(kept) >= MOST_SUBSCRIBERS:
            raise ParameterError("subscriber", "", FULL, f"{len(kept) + 1}")
        every = max(1, round(1.0 / (self._link.bed.period * request.rate)))
        kept[address] = _Subscriber(request.part, every, now + LASTS)
        self._subscribers = kept

    async def send_frames(self) -> None:
        """Send frames to the subscribers, each at its rate."""
        clock = asyncio.get_running_loop().time
        while True:
            await self._link.next_frame()
            if not self._subscribers:
                continue
            frame, now = self._link.read_frame(), clock()
            if frame is None:
                continue
            for address, one in list(self._subscribers.items()):
                if now >= one.until:
                    del self._subscribers[address]
                elif self._transport.get_write_buffer_size() > MOST_UNSENT:
                    self._link.counts["datagrams dropped"] += 1
                elif not one.due - one.every < frame.period < one.due:
                    one.due = frame.period + one.every
                    for datagram in format_osc_frame(frame, one.part):
                        self._transport.sendto(datagram, address)
                    self._link.counts["frames sent"] += 1


async def open_osc(link: DoorLink, host: str, port: int) -> tuple[Any, asyncio.Task[None]]:
    """Open the door; return its transport, and the task that sends frames.

    `port`: 0: chosen by the system. Raises OSError when the address cannot be used.
    """
    loop = asyncio.get_running_loop()
    transport, door = await loop.create_datagram_endpoint(lambda: _OscDoor(link), local_addr=(host, port))
    return transport, asyncio.ensure_future(door.send_frames())
