"""OSC door: messages, requests and frames as datagrams, for a bounded number of subscribers."""

from __future__ import annotations

import asyncio
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from digiclay.core.base.errors import DigiclayError, ParameterError
from pythonosc import osc_bundle, osc_message
from pythonosc.osc_message_builder import OscMessageBuilder

from .door_link import Door, DoorLink
from .protocol import Frame, Pose, Reset, check_pose, is_token

#: What can be subscribed to: the pose and the total force, or every pin's height and force besides.
PARTS = ("state", "pins")
#: Most pins whose heights fit into a datagram.
MOST_PINS = 16_000


@dataclass(frozen=True)
class Subscription:
    """Request: frames to the sender's address.

    Attributes
    ----------
    part : {"state", "pins"}
    rate : float
        Frames a second at most.
    """

    part: str
    rate: float


def read_osc(data: bytes) -> tuple[object, Pose | Reset | Subscription | ParameterError]:
    """Read a datagram; return the token in it, and the request or what is wrong with it.

    The request of a client without the token is never looked at, so it is checked after that.

    Raises ParameterError when it is no OSC message with a token.
    """
    rule = "must be an OSC message with the token as its first argument"
    try:
        if osc_bundle.OscBundle.dgram_is_bundle(data):
            raise ParameterError("datagram", "", rule, "a bundle")
        message = osc_message.OscMessage(data)
        address, parameters = message.address, message.params
    except ParameterError:
        raise
    except Exception:  # python-osc raises errors of many kinds over bytes that are no OSC
        raise ParameterError("datagram", "", rule, repr(data[:16])) from None
    if not parameters:
        raise ParameterError("datagram", "", rule, "no argument")
    token, *rest = parameters
    try:
        return token, _read_request(address, rest)
    except ParameterError as error:
        return token, error


def _read_request(address: str, rest: list[object]) -> Pose | Reset | Subscription:
    """Read what follows the token."""
    if address == "/digiclay/pose":
        number = rest.pop() if len(rest) in (4, 8) else 0
        if type(number) is not int or not 0 <= number < 2**31:
            raise ParameterError("pose", "number", "must be a whole number of 32 bits", repr(number)[:40])
        return Pose(check_pose(rest), number)
    if address == "/digiclay/reset" and not rest:
        return Reset()
    if address == "/digiclay/subscribe":
        part, rate = rest if len(rest) == 2 else (None, None)
        if part not in PARTS or not isinstance(rate, int | float) or not 0.0 < rate <= 1000.0:
            rule = "must be state or pins, and a rate of at most 1000 Hz"
            raise ParameterError("subscription", "", rule, repr(rest)[:60])
        return Subscription(str(part), float(rate))
    rule = "must be /digiclay/pose, /digiclay/reset or /digiclay/subscribe"
    raise ParameterError("address", "", rule, repr(address)[:40])


def format_osc_frame(frame: Frame, part: str) -> list[bytes]:
    """Write the datagrams of a frame, of a part of `PARTS`: its flags come first."""
    flags = OscMessageBuilder("/digiclay/flags")
    flags.add_arg(frame.period, OscMessageBuilder.ARG_TYPE_INT64)
    flags.add_arg(frame.flags, OscMessageBuilder.ARG_TYPE_INT)
    state = OscMessageBuilder("/digiclay/state")
    state.add_arg(frame.period, OscMessageBuilder.ARG_TYPE_INT64)
    state.add_arg(frame.number, OscMessageBuilder.ARG_TYPE_INT64)
    for value in (frame.time, frame.total_force, *frame.pose.tolist()):
        state.add_arg(value, OscMessageBuilder.ARG_TYPE_DOUBLE)
    made = [flags.build().dgram, state.build().dgram]
    if part == "pins" and len(frame.heights) <= MOST_PINS:
        for name, values in (("heights", frame.heights), ("forces", frame.forces)):
            builder = OscMessageBuilder(f"/digiclay/{name}")
            builder.add_arg(frame.period, OscMessageBuilder.ARG_TYPE_INT64)
            # OSC is big-endian.
            builder.add_arg(np.asarray(values, ">f4").tobytes(), OscMessageBuilder.ARG_TYPE_BLOB)
            made.append(builder.build().dgram)
    return made


def format_osc_error(message: str) -> bytes:
    """Write an error as a datagram."""
    builder = OscMessageBuilder("/digiclay/error")
    builder.add_arg(message.encode("ascii", "replace").decode(), OscMessageBuilder.ARG_TYPE_STRING)
    made: bytes = builder.build().dgram
    return made


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
    """Handlers of the datagrams."""

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


async def open_osc(link: DoorLink, host: str, port: int) -> Door:
    """Open the door at a port, 0: chosen by the system; OSError when the address cannot be used."""
    loop = asyncio.get_running_loop()
    transport, door = await loop.create_datagram_endpoint(lambda: _OscDoor(link), local_addr=(host, port))
    sending = asyncio.ensure_future(door.send_frames())

    async def close() -> None:
        sending.cancel()
        transport.close()

    return Door(transport.get_extra_info("sockname")[1], close)
