"""OSC door: messages, requests and frames as datagrams, for a bounded number of subscribers."""

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from digiclay.core.base.errors import DigiclayError, ParameterError
from pythonosc import osc_bundle, osc_message
from pythonosc.osc_message_builder import OscMessageBuilder

from .door_link import DoorLink
from .protocol import Frame, Pose, Poses, Reset, check_fingers, check_number, check_pose, is_token

#: What can be subscribed to: the pose and the total force, or every pin's height and force besides.
PARTS = ("state", "pins")
#: Most pins whose heights fit into a datagram.
MOST_PINS = 16_000


class Subscription(NamedTuple):
    """Request: frames to the sender's address, with a part of `PARTS`, so many a second at most."""

    part: str
    rate: float


def read_osc(data: bytes) -> tuple[object, str, list[object]]:
    """Read a datagram: token, address and arguments. Raises ParameterError without a token."""
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
    return token, address, rest


def read_request(address: str, rest: list[object]) -> Pose | Poses | Reset | Subscription:
    """Read what follows the token. Raises ParameterError when it is no request."""
    if address == "/digiclay/pose":
        number = check_number(rest.pop(), 31) if len(rest) in (4, 8) else 0
        return Pose(check_pose(rest), number)
    if address == "/digiclay/poses":
        fingers: list[tuple[object, list[object]]] = []
        for value in rest[1:]:
            if isinstance(value, float) and fingers:
                fingers[-1][1].append(value)
            else:
                fingers.append((value, []))
        return check_fingers(fingers, None, check_number(rest[0] if rest else None, 31))
    if address == "/digiclay/reset" and not rest:
        return Reset()
    if address == "/digiclay/subscribe":
        part, rate = rest if len(rest) == 2 else (None, None)
        if part not in PARTS or not isinstance(rate, int | float) or not 0.0 < rate <= 1000.0:
            rule = "must be state or pins, and a rate of at most 1000 Hz"
            raise ParameterError("subscription", "", rule, repr(rest)[:60])
        return Subscription(str(part), float(rate))
    rule = "must be /digiclay/pose, /digiclay/poses, /digiclay/reset or /digiclay/subscribe"
    raise ParameterError("address", "", rule, repr(address)[:40])


def format_osc_frame(frame: Frame, part: str) -> list[bytes]:
    """Write the datagrams of a frame, of a part of `PARTS`: its flags come first."""
    state = (frame.period, frame.number, frame.time, frame.total_force, *frame.pose.tolist())
    datagrams = [
        format_osc("flags", "hi", frame.period, frame.flags),
        *([format_osc("errors", "hdd", frame.period, *frame.errors)] if frame.errors else []),
        format_osc("state", "hh" + 9 * "d", *state),
    ]
    if frame.fingers:
        there = [
            (identity, force, *pose) for identity, force, pose in frame.fingers if identity >= 0
        ]
        each = (value for finger in there for value in finger)
        datagrams.append(format_osc("fingers", "h" + len(there) * "hdddddddd", frame.period, *each))
    if part == "pins" and len(frame.heights) <= MOST_PINS:
        for name, values in (("heights", frame.heights), ("forces", frame.forces)):
            # OSC is big-endian.
            datagrams.append(
                format_osc(name, "hb", frame.period, np.asarray(values, ">f4").tobytes())
            )
    return datagrams


def format_osc(name: str, kinds: str, *values: object) -> bytes:
    """Write a message; `kinds`: one letter per value, as in OSC."""
    builder = OscMessageBuilder(f"/digiclay/{name}")
    for kind, value in zip(kinds, values, strict=True):
        builder.add_arg(value, kind)
    return builder.build().dgram


#: Most subscribers, and how long a subscription lasts unless it is repeated, s.
MOST_SUBSCRIBERS, LASTS = 16, 5.0
#: Shortest time between two errors that are sent, s.
BETWEEN_ERRORS = 0.1
#: Bytes that wait for the network at most.
MOST_UNSENT = 1024 * 1024


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
        """Carry out a request; without the right token nothing is answered, nor even looked at."""
        try:
            token, name, rest = read_osc(data)
        except DigiclayError:
            self._link.counts["datagrams refused"] += 1
            return
        if not is_token(token, self._link.token):
            self._link.counts["wrong tokens"] += 1
            return
        try:
            request = read_request(name, rest)
            if isinstance(request, Subscription):
                self._subscribe(address, request)
            else:
                self._link.order(request, address)
        except DigiclayError as error:
            self._link.counts["datagrams refused"] += 1
            now = asyncio.get_running_loop().time()
            if now - self._last_error >= BETWEEN_ERRORS:
                self._last_error = now
                reason = str(error).encode("ascii", "replace").decode()
                self._transport.sendto(format_osc("error", "s", reason), address)

    def _subscribe(self, address: Any, request: Subscription) -> None:
        """Begin or renew a subscription."""
        now = asyncio.get_running_loop().time()
        subscribers = {where: each for where, each in self._subscribers.items() if now < each.until}
        if address not in subscribers and len(subscribers) >= MOST_SUBSCRIBERS:
            rule = f"must be one of {MOST_SUBSCRIBERS} at most"
            raise ParameterError("subscriber", "", rule, f"{len(subscribers) + 1}")
        every = max(1, round(1.0 / (self._link.bed.period * request.rate)))
        subscribers[address] = _Subscriber(request.part, every, now + LASTS)
        self._subscribers = subscribers

    async def send_frames(self) -> None:
        """Send frames to the subscribers, each at its rate."""
        clock = asyncio.get_running_loop().time
        while True:
            frame, now = await self._link.next_frame(), clock()
            if frame is None:
                continue
            for address, subscriber in list(self._subscribers.items()):
                if now >= subscriber.until:
                    del self._subscribers[address]
                elif self._transport.get_write_buffer_size() > MOST_UNSENT:
                    self._link.counts["datagrams dropped"] += 1
                elif not subscriber.due - subscriber.every < frame.period < subscriber.due:
                    subscriber.due = frame.period + subscriber.every
                    for datagram in format_osc_frame(frame, subscriber.part):
                        self._transport.sendto(datagram, address)
                    self._link.counts["frames sent"] += 1


@asynccontextmanager
async def open_osc(link: DoorLink, host: str, port: int) -> AsyncIterator[int]:
    """Open the door at a port, 0: chosen by the system, and give the port; OSError if it cannot be used."""
    loop = asyncio.get_running_loop()
    transport, door = await loop.create_datagram_endpoint(
        lambda: _OscDoor(link), local_addr=(host, port)
    )
    sending = asyncio.ensure_future(door.send_frames())
    try:
        yield transport.get_extra_info("sockname")[1]
    finally:
        sending.cancel()
        transport.close()
