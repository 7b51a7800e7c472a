"""WebSocket door in this process: what takes too long with the real times."""

from __future__ import annotations

import asyncio
import sys

import pytest

if sys.platform == "win32":
    pytest.skip("the server runs on Linux and macOS", allow_module_level=True)

from digiclay_serve import finger_lease, websocket_door
from digiclay_serve.door_bed import Bed
from digiclay_serve.door_link import DoorLink
from digiclay_serve.finger_lease import HeldError
from digiclay_serve.latest_slot import make_slot
from digiclay_serve.order_slot import Order, pack_order
from digiclay_serve.protocol import Pose, pack_pose
from digiclay_serve.websocket_door import open_websocket
from tests.timeouts import TIMEOUT

POSE = Pose((0.0, 0.0, 0.038, 1.0, 0.0, 0.0, 0.0), 1)
REQUEST = (
    "GET /?rate=0&token=a-token-of-tests HTTP/1.1\r\nHost: 127.0.0.1\r\n"
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
    "Sec-WebSocket-Version: 13\r\n\r\n"
)
#: Status by which websockets closes a connection whose pings are not answered.
UNANSWERED = (1011).to_bytes(2, "big")


def make_link() -> DoorLink:
    """Return a link without a session."""
    slot, file = make_slot(len(pack_order(Order())))
    file.unlink()
    return DoorLink(Bed("bed", 1, 1, 3e-3, 0.1, 5e-3, ()), slot, slot, "a-token-of-tests")


async def press_and_fall_silent(link: DoorLink) -> bytes:
    """Send a pose as RFC 6455 has it, answer nothing; return what comes until another client may."""
    server = await open_websocket(link, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    packed = pack_pose(POSE)
    writer.write(REQUEST.encode() + bytes([0x82, 0x80 | len(packed), 0, 0, 0, 0]) + packed)
    try:
        async with asyncio.timeout(TIMEOUT):
            said = await reader.read()
            await press_elsewhere(link)
    finally:
        writer.close()
        server.close()
    return said


async def press_elsewhere(link: DoorLink) -> None:
    """Send a pose as another client, as soon as it may."""
    while True:
        try:
            link.order(POSE, "another client")
            return
        except HeldError:
            await asyncio.sleep(0.01)


def test_a_client_that_answers_no_ping_is_closed_and_its_fingertip_is_free(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(websocket_door, "PING", 0.1)
    monkeypatch.setattr(finger_lease, "LEASE", 1e9)  # nobody else may by silence alone
    link = make_link()
    assert UNANSWERED in asyncio.run(press_and_fall_silent(link))
    assert link.counts["poses"] == 2


async def connect_and_say_nothing(link: DoorLink) -> bytes:
    """Return what comes until the door closes."""
    server = await open_websocket(link, "127.0.0.1", 0)
    reader, writer = await asyncio.open_connection("127.0.0.1", server.sockets[0].getsockname()[1])
    try:
        async with asyncio.timeout(TIMEOUT):
            return await reader.read()
    finally:
        writer.close()
        server.close()


def test_a_client_that_is_silent_before_the_token_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(websocket_door, "OPENING", 0.1)
    link = make_link()
    assert asyncio.run(connect_and_say_nothing(link)) == b""
    assert link.counts["clients"] == 0
