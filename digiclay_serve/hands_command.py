"""``digiclay hands``: fingers of tracked hands or of a touch pad, to a server of a session."""

import asyncio
import json
import logging
import math
import os
import time
from argparse import Namespace
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from digiclay.commands.arguments import Options, add_command, add_options, millimeters, whole_number
from digiclay.commands.refusals import refuse_without
from digiclay.commands.stop import Stop
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import DigiclayError, OutputError

from .hts import Hands
from .protocol import VARIABLE, choose_token

EXAMPLES = """\
examples:
  digiclay serve --fingers 10 --clutch 10 --filter 1 --coupling 0.05
  digiclay hands --from hts --to ws://127.0.0.1:8765 --record hands.txt
  digiclay hands --from tuio --to osc://127.0.0.1:8766
  digiclay hands --from hts --play hands.txt

A Quest sends the lines of Hand Tracking Streamer to --port by UDP or TCP, a tablet TUIO 1.1 or 2.0 by UDP;
for a tablet serve without --clutch.
"""
#: Ports by source, as the programs have them.
PORTS = {"hts": 9000, "tuio": 3333}
HOST, TO = "127.0.0.1", "ws://127.0.0.1:8765"
#: Fingers that rest are named again after this time, s.
AGAIN = 0.03

#: Sends fingers by identity, (3,), m, each.
Send = Callable[[Mapping[int, Floats]], Awaitable[None]]


def add(commands: Any) -> None:
    """Add the command."""
    options: Options = {
        "--from SOURCE": {
            "dest": "source",
            "choices": sorted(PORTS),
            "default": "hts",
            "help": "hts: Hand Tracking Streamer, the default; tuio: a touch pad",
        },
        "--to ADDRESS": (
            None,
            f"of 'digiclay serve': ws://HOST:PORT or osc://HOST:PORT; default: {TO}",
            TO,
        ),
        "--token T": f"token of the server; default: {VARIABLE}",
        "--host": (
            None,
            f"address of this machine to listen at, 0.0.0.0: all; default: {HOST}",
            HOST,
        ),
        "--port N": (whole_number(1, 65535), "to listen at; default: 9000, of tuio 3333"),
        "--height MM": (millimeters, "height of the clay at rest, mm; default: 40", 40e-3),
        "--size MM": (
            millimeters,
            "side of the bed that a touch pad covers, mm; default: 70",
            70e-3,
        ),
        "--depth MM": (
            millimeters,
            "depth of a finger on a pad at full pressure, mm; default: 20",
            20e-3,
        ),
        "--record FILE": (Path, "write what is received, with its times"),
        "--play FILE": (Path, "take a recording in place of a device"),
    }
    purpose = "move the fingertips of a server by tracked hands or a touch pad"
    add_options(add_command(commands, "hands", purpose, EXAMPLES, carry_out=carry_out), options)


def carry_out(arguments: Namespace) -> int:
    """Pass fingers on until Ctrl-C, or the end of a recording."""
    refuse_without("digiclay hands", "serve", "websockets", "pythonosc")
    from .tuio import Pad

    # Python-osc prints what hostile senders like.
    logging.getLogger().addHandler(logging.NullHandler())
    if arguments.token is None and VARIABLE not in os.environ:
        raise OutputError(f"digiclay hands needs the token of the server: --token, or {VARIABLE}.")
    token = choose_token(arguments.token)[0]
    pad = (arguments.height, arguments.size, arguments.depth)
    for name, length in zip(("--height", "--size", "--depth"), pad, strict=True):
        if not 0.0 < length <= 1.0:
            raise OutputError(f"{name} must be above 0 and at most 1000 mm (got {1e3 * length:g}).")
    source = Hands(arguments.height) if arguments.source == "hts" else Pad(*pad)
    with Stop() as stop:
        try:
            asyncio.run(_pass_on(arguments, source, token, stop))
        except OSError as error:
            where = f": {error.filename}" if error.filename else ""
            raise OutputError(
                f"digiclay hands has ended: {error.strerror or error}{where}."
            ) from None
    return 0


async def _pass_on(arguments: Namespace, source: Any, token: str, stop: Stop) -> None:
    """Pass what comes on to the server; fingers that rest are named again and again."""
    packets = read_packets(arguments.play) if arguments.play else None
    came, told_at = asyncio.Event(), -math.inf
    file: Any = None
    async with AsyncExitStack() as stack:

        def tell(line: object) -> None:
            nonlocal told_at
            if time.monotonic() - told_at >= 1.0:
                print(line, flush=True)
                told_at = time.monotonic()

        def take(data: bytes) -> None:
            nonlocal source, file
            now = time.monotonic()
            try:
                if file:
                    print(
                        json.dumps([round(now, 6), data.decode("latin-1")]), file=file, flush=True
                    )
            except OSError as error:
                file = None
                tell(f"The recording ends here: {error.strerror}.")
            try:
                source = source.take(data, now)
            except DigiclayError as error:
                tell(error)
            came.set()

        send = await stack.enter_async_context(_connect(arguments.to, token, tell))
        ways = await _listen(stack, arguments, take) if packets is None else ""
        if arguments.record:  # nothing is left behind by what is refused before
            file = stack.enter_context(arguments.record.open("x", encoding="utf-8"))
        lasts = f", {packets[-1][0] - packets[0][0]:.1f} s" if packets else ""
        print(f"listening at {ways}" if ways else f"playing {arguments.play}{lasts}", flush=True)
        late = time.monotonic() - packets[0][0] if packets else 0.0
        while not stop() and (packets is None or packets):
            with suppress(TimeoutError):
                await asyncio.wait_for(came.wait(), AGAIN if packets is None else AGAIN / 10.0)
            came.clear()
            while packets and packets[0][0] + late <= time.monotonic():
                take(packets.popleft()[1])
            await send(source.fingers(time.monotonic()))


async def _listen(
    stack: AsyncExitStack, arguments: Namespace, take: Callable[[bytes], None]
) -> str:
    """Listen at a port by UDP and, to lines, by TCP; return it in words."""
    host, port = arguments.host, arguments.port or PORTS[arguments.source]

    class Datagrams(asyncio.DatagramProtocol):
        def datagram_received(self, data: bytes, address: Any) -> None:
            take(data)

    async def take_lines(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(ValueError, OSError):  # a line without end; a connection that was reset
            async for line in reader:
                if line.endswith(b"\n"):  # else the connection ended within it
                    take(line)
        writer.close()

    transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
        Datagrams, (host, port)
    )
    stack.callback(transport.close)
    if arguments.source == "hts":
        stack.callback((await asyncio.start_server(take_lines, host, port)).close)
    return f"{host}:{port}, by UDP{' and TCP' * (arguments.source == 'hts')}"


def read_packets(path: Path) -> deque[tuple[float, bytes]]:
    """Return the packets of a recording with their times, s: lines of JSON, a character a byte."""
    packets: deque[tuple[float, bytes]] = deque()
    number, last = 0, -1e300
    try:
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        for number, line in enumerate(lines, 1):
            if number > 1 and not line.endswith("\n"):
                break  # the last may be cut
            at, text = json.loads(line)
            packets.append((float(at), str(text).encode("latin-1")))
            if not last <= float(at) < math.inf:
                raise ValueError(
                    f"a time must be finite and not before that of the line above ({at})"
                )
            last = float(at)
    except (OSError, ValueError, TypeError, OverflowError, RecursionError) as error:
        rule = "must be a recording of 'digiclay hands --record'"
        reason = getattr(error, "strerror", None) or f"line {number}: {error}"
        raise OutputError(f"--play {path} {rule} ({reason}).") from None
    return packets


@asynccontextmanager
async def _connect(address: str, token: str, tell: Callable[[object], None]) -> AsyncIterator[Send]:
    """Give the function that sends fingers to the server at an address; what it refuses is told."""
    from pythonosc.osc_message import OscMessage
    from websockets.asyncio.client import connect
    from websockets.exceptions import InvalidStatus, WebSocketException

    from .osc_door import format_osc

    parts = urlsplit(address)
    try:
        if parts.scheme not in ("ws", "osc") or not parts.hostname or not parts.port:
            raise ValueError
    except ValueError:
        raise OutputError(
            f"--to must be ws://HOST:PORT or osc://HOST:PORT (got {address!r})."
        ) from None
    missing = f"No server at {address}: it has ended, or is not started yet."
    if parts.scheme == "osc":

        class Answers(asyncio.DatagramProtocol):
            def datagram_received(self, data: bytes, _: Any) -> None:
                tell(f"server: {OscMessage(data).params[0]}")

            def error_received(self, exc: Exception) -> None:
                tell(missing)

        where = parts.hostname, parts.port
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            Answers, remote_addr=where
        )

        async def send_datagram(fingers: Mapping[int, Floats]) -> None:
            values = [
                value
                for identity, place in fingers.items()
                for value in (identity, *place.tolist())
            ]
            transport.sendto(format_osc("poses", "si" + "hddd" * len(fingers), token, 0, *values))

        try:
            yield send_datagram
        finally:
            transport.close()
        return

    async def send(fingers: Mapping[int, Floats]) -> None:
        places = [
            {"id": identity, "position": place.tolist()} for identity, place in fingers.items()
        ]
        await server.send(json.dumps({"type": "poses", "fingers": places}))

    async def take_answers() -> None:
        async for message in server:
            if (answer := json.loads(message))["type"] == "error":
                tell(f"server: {answer['message']}")

    header, door = {"Authorization": f"Bearer {token}"}, f"ws://{parts.netloc}/?rate=0"
    try:
        async with connect(door, additional_headers=header, compression=None) as server:
            answers = asyncio.ensure_future(take_answers())
            yield send
            answers.cancel()
    except InvalidStatus as error:
        reason = (error.response.body or b"").decode().strip()
        raise OutputError(f"The server at {address} refuses: {reason}") from None
    except ConnectionRefusedError:
        raise OutputError(missing) from None
    except WebSocketException as error:
        raise OutputError(f"The server at {address} has ended: {error}.") from None
