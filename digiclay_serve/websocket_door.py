"""WebSocket door: requests in, frames out, for a bounded number of clients."""

from __future__ import annotations

import asyncio
import http
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import asdict
from typing import Any, NamedTuple
from urllib.parse import parse_qsl, urlsplit

from digiclay.core.base.errors import DigiclayError, ParameterError
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from .door_link import DoorLink, FrequentError
from .protocol import (
    LARGEST_REQUEST,
    format_frame,
    format_message,
    is_token,
    read_binary,
    read_json,
)

#: Most clients, and most connections that have not said yet who they are: beyond it the oldest is
#: cut.
MOST_CLIENTS, MOST_SILENT = 64, 512
#: Time for a client to say who it is, s; and to answer a ping.
OPENING, PING = 5.0, 10.0
#: Most messages of a client in a second, and most wrong ones, before it is closed.
FLOOD, WRONG = 4000, 20
#: Bytes that wait for a slow reader; then frames pass it by.
UNSENT = 64 * 1024
#: Bytes that wait for one at most, and some frames; websockets answers pings without regard to a
#: limit.
MOST_UNSENT = 4 * 1024 * 1024
#: Frames a second of a client that names no rate.
USUAL_RATE = 60.0
POLICY = 1008


class Wishes(NamedTuple):
    """Options of a client in its address."""

    #: Frames in binary.
    binary: bool = False
    #: Frames a second at most; 0: none.
    rate: float = USUAL_RATE
    #: Empty where the header has it.
    token: str = ""


def read_wishes(path: str) -> Wishes:
    """Read the address of a request, ``/?format=binary&rate=1000``. Raises ParameterError."""
    try:
        address = urlsplit(path)
        given = dict(parse_qsl(address.query, keep_blank_values=True, max_num_fields=8))
    except ValueError:
        raise ParameterError("address", "", "must be an address", repr(path[:40])) from None
    unknown = sorted(set(given) - {"format", "rate", "token"})
    if unknown or address.path not in ("", "/"):
        wrong = repr(unknown[0] if unknown else address.path)[:40]
        raise ParameterError("address", "", "must be / with format, rate and token alone", wrong)
    if given.get("format", "json") not in ("json", "binary"):
        raise ParameterError(
            "address", "format", "must be json or binary", repr(given["format"])[:40]
        )
    try:
        rate = float(given.get("rate", USUAL_RATE))
    except ValueError:
        rate = math.nan
    if not 0.0 <= rate <= 1000.0:
        raise ParameterError(
            "address", "rate", "must be from 0 to 1000 Hz", repr(given["rate"])[:40]
        )
    return Wishes(given.get("format") == "binary", rate, given.get("token", ""))


@asynccontextmanager
async def open_websocket(link: DoorLink, host: str, port: int) -> AsyncIterator[int]:
    """Open the door at a port, 0: chosen by the system, and give the port; OSError if it cannot be used."""
    door = _WebSocketDoor(link)
    async with serve(
        door.handle,
        host,
        port,
        process_request=door.admit,
        create_connection=door.connect,
        compression=None,
        max_size=LARGEST_REQUEST,
        max_queue=16,
        write_limit=UNSENT,
        open_timeout=OPENING,
        ping_interval=PING,
        ping_timeout=PING,
        close_timeout=2.0,
        server_header=None,
        backlog=1024,
    ) as server:
        yield server.sockets[0].getsockname()[1]


class _Connection(ServerConnection):
    """Connection that is cut while it has not said who it is, and too many others have come since."""

    door: _WebSocketDoor

    def connection_made(self, transport: Any) -> None:
        """Begin, and cut the oldest of too many silent ones: a client with the token sends it at once."""
        super().connection_made(transport)
        silent = self.door.silent
        silent[self] = None
        if len(silent) > MOST_SILENT:
            oldest = next(iter(silent))
            del silent[oldest]
            oldest.transport.abort()
            self.door.link.counts["connections beyond the limit"] += 1

    def data_received(self, data: bytes) -> None:
        """Take in what has come; cut a client whose pings are answered faster than it reads."""
        super().data_received(data)
        if self.transport.get_write_buffer_size() > MOST_UNSENT + 4 * len(self.door.link.packed):
            self.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self.door.clients.discard(self)
        self.door.silent.pop(self, None)
        super().connection_lost(exc)


class _WebSocketDoor:
    """Handlers of the connections."""

    def __init__(self, link: DoorLink) -> None:
        self.link = link
        self.clients: set[ServerConnection] = set()
        #: Oldest first.
        self.silent: dict[ServerConnection, None] = {}

    def connect(self, *arguments: Any, **options: Any) -> ServerConnection:
        """Make a connection of this door."""
        connection = _Connection(*arguments, **options)
        connection.door = self
        return connection

    def admit(self, connection: ServerConnection, request: Request) -> Response | None:
        """Refuse a client without the token, or with an address that makes no sense."""
        try:
            wishes = read_wishes(request.path)
            header = request.headers.get("Authorization", "")
        except DigiclayError as error:
            self.link.counts["requests refused"] += 1
            return connection.respond(http.HTTPStatus.BAD_REQUEST, f"{error}\n")
        except Exception:  # two headers of one name: websockets raises an error of its own
            header, wishes = "", Wishes()
        scheme, _, given = header.partition(" ")
        given = given.strip() if scheme.lower() == "bearer" else wishes.token
        if not is_token(given, self.link.token):
            self.link.counts["wrong tokens"] += 1
            return connection.respond(
                http.HTTPStatus.UNAUTHORIZED, "The token is missing or wrong.\n"
            )
        self.silent.pop(connection, None)
        if len(self.clients) >= MOST_CLIENTS:
            self.link.counts["clients beyond the limit"] += 1
            reason = f"{MOST_CLIENTS} clients at most: wait until one has left.\n"
            return connection.respond(http.HTTPStatus.SERVICE_UNAVAILABLE, reason)
        self.clients.add(connection)
        return None

    async def handle(self, connection: ServerConnection) -> None:
        """Serve a client until it goes."""
        assert connection.request is not None
        wishes = read_wishes(connection.request.path)
        self.link.counts["clients"] += 1
        sender = asyncio.ensure_future(self._send_frames(connection, wishes))
        try:
            await self._take_requests(connection)
        except ConnectionClosed:
            pass
        finally:
            self.link.leave(connection)
            sender.cancel()
            with suppress(asyncio.CancelledError, ConnectionClosed):
                await sender

    async def _send_frames(self, connection: ServerConnection, wishes: Wishes) -> None:
        """Send what the bed is, then frames at the rate of the client, as far as it reads them."""
        await connection.send(format_message("bed", **asdict(self.link.bed)))
        if wishes.rate == 0.0:
            return
        every, due = max(1, round(1.0 / (self.link.bed.period * wishes.rate))), 0
        while True:
            frame = await self.link.next_frame()
            if frame is None or due - every < frame.period < due:
                continue
            due = frame.period + every
            await connection.send(self.link.packed if wishes.binary else format_frame(frame))
            self.link.counts["frames sent"] += 1

    async def _take_requests(self, connection: ServerConnection) -> None:
        """Carry out requests; a client that floods, or sends many wrong ones, is closed."""
        clock = asyncio.get_running_loop().time
        second, count, wrong, refused = clock(), 0, 0, -math.inf
        async for message in connection:
            if clock() - second >= 1.0:
                second, count = clock(), 0
            count += 1
            if count > FLOOD:
                self.link.counts["floods"] += 1
                self.link.leave(connection)
                await connection.close(POLICY, f"more than {FLOOD} messages per second")
                return
            try:
                request = read_json(message) if isinstance(message, str) else read_binary(message)
                answer = self.link.order(request, connection)
            except FrequentError as error:
                # Answered once a second: poses come a thousand times as often.
                if clock() - refused >= 1.0:
                    refused = clock()
                    await connection.send(format_message("error", message=str(error)))
            except DigiclayError as error:
                wrong += 1
                self.link.counts["messages refused"] += 1
                await connection.send(format_message("error", message=str(error)))
                if wrong >= WRONG:
                    await connection.close(POLICY, "too many wrong messages")
                    return
            else:
                if answer is not None:
                    await connection.send(format_message("status", counts=answer))
