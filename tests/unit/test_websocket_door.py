"""WebSocket door in this process: what takes too long with the real times."""

import asyncio
import sys
from contextlib import suppress

import pytest

if sys.platform == "win32":
    pytest.skip("the server runs on Linux and macOS", allow_module_level=True)

from digiclay_serve import door_link, websocket_door
from digiclay_serve.door_link import Bed, DoorLink, FrequentError
from digiclay_serve.doors import LAYOUT, make_slot
from digiclay_serve.protocol import Pose, pack_pose
from digiclay_serve.websocket_door import open_websocket
from tests.served import TOKEN, frame_message
from tests.timeouts import TIMEOUT

POSE = Pose((0.0, 0.0, 0.038, 1.0, 0.0, 0.0, 0.0), 1)
REQUEST = (
    f"GET /?rate=0&token={TOKEN} HTTP/1.1\r\nHost: 127.0.0.1\r\n"
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
    "Sec-WebSocket-Version: 13\r\n\r\n"
)
#: Status by which websockets closes a connection whose pings are not answered.
UNANSWERED = (1011).to_bytes(2, "big")


def make_link():
    slot, file = make_slot(LAYOUT.size)
    file.unlink()
    return DoorLink(Bed("bed", 1, 1, 3e-3, 0.1, 5e-3, ()), slot, slot, TOKEN)


async def connect(link, sent=b""):
    """Send bytes, answer nothing; return what comes until the door closes and another client has pressed."""
    async with asyncio.timeout(TIMEOUT), open_websocket(link, "127.0.0.1", 0) as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(sent)
        said = await reader.read()
        await press_elsewhere(link)
        writer.close()
    return said


async def press_elsewhere(link):
    while True:
        try:
            link.order(POSE, "another client")
            return
        except FrequentError:
            await asyncio.sleep(0.01)


def test_a_client_beyond_the_limit_is_told_and_one_silent_before_the_token_closed(monkeypatch):
    monkeypatch.setattr(websocket_door, "MOST_CLIENTS", 0)
    assert asyncio.run(connect(make_link(), REQUEST.encode())).startswith(b"HTTP/1.1 503")
    monkeypatch.setattr(websocket_door, "OPENING", 0.1)
    link = make_link()
    assert asyncio.run(connect(link)) == b""
    assert link.counts["clients"] == 0


def test_a_client_that_floods_or_answers_no_ping_is_closed_and_leaves_the_fingertip(monkeypatch):
    monkeypatch.setattr(websocket_door, "FLOOD", 2)
    monkeypatch.setattr(door_link, "LEASE", 1e9)  # the fingertip is another's by the close alone
    link = make_link()
    sent = asyncio.run(connect(link, REQUEST.encode() + 3 * frame_message(pack_pose(POSE))))
    assert b"more than 2 messages per second" in sent
    assert (link.counts["floods"], link.counts["poses"]) == (1, 3)
    monkeypatch.setattr(websocket_door, "PING", 0.1)
    monkeypatch.setattr(door_link, "LEASE", 1e9)  # nobody else may by silence alone
    link = make_link()
    sent = REQUEST.encode() + frame_message(pack_pose(POSE))
    assert UNANSWERED in asyncio.run(connect(link, sent))
    assert link.counts["poses"] == 2


def test_the_fingertip_is_anothers_when_its_client_is_silent(monkeypatch):
    async def take_turns():
        link, moved = make_link(), []
        for client in ("one", "two", "one"):
            with suppress(FrequentError):
                link.order(POSE, client)
                moved.append(client)
        link.leave("two")  # it did not move the fingertip
        with pytest.raises(FrequentError, match="Another client moves the fingertip"):
            link.order(POSE, "two")
        monkeypatch.setattr(door_link, "LEASE", 1e-3)
        link.order(POSE, "one")
        await asyncio.sleep(0.01)
        link.order(POSE, "two")
        return moved

    monkeypatch.setattr(door_link, "LEASE", 1e9)
    assert asyncio.run(take_turns()) == ["one", "one"]
