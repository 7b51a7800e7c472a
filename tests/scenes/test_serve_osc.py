"""OSC and a pin display at a server that runs: datagrams, and a pty that stands for a serial line."""

from __future__ import annotations

import json
import os
import re
import socket
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pythonosc.osc_message import OscMessage
from pythonosc.osc_message_builder import OscMessageBuilder

from digiclay_serve.display_line import pack_acknowledgement, read_heights, split_frames
from tests.served import TOKEN, Server, serve
from tests.timeouts import TIMEOUT, wait_until

if sys.platform == "win32":
    pytest.skip("the server runs on Linux and macOS", allow_module_level=True)

import pty

PLACE = (0.0, 0.0, 0.038)


@dataclass
class Reader:
    """Other end of the serial line."""

    line: int
    rest: bytes = b""
    seen: list[Any] = field(default_factory=list)

    def receive(self) -> tuple[int, int, np.ndarray]:
        """Return sequence number, period and heights of the next frame."""
        while not self.seen:
            bodies, self.rest = split_frames(self.rest + os.read(self.line, 65536))
            self.seen += [read_heights(body) for body in bodies if body is not None]
        return self.seen.pop(0)


@pytest.fixture(scope="module")
def line() -> Iterator[tuple[Reader, str]]:
    """A pty: this end, and the name of the other one."""
    ours, theirs = pty.openpty()
    yield Reader(ours), os.ttyname(theirs)
    for one in (ours, theirs):
        with suppress(OSError):
            os.close(one)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory, line: tuple[Reader, str]) -> Iterator[Server]:
    """One server for all tests; in the end it must be alive, and account for every frame of the line."""
    with serve(tmp_path_factory.mktemp("served"), "--display", line[1], "--display-rate", "100") as one:
        yield one
        counts = one.stop()["counts"]["display"]
        assert counts["sent"] == counts["acknowledged"] + counts["dropped"]


@pytest.fixture
def door(server: Server) -> Iterator[socket.socket]:
    """A client's socket."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.connect(("127.0.0.1", server.osc_port))
        client.settimeout(0.2)
        yield client


def message(address: str, *values: Any) -> bytes:
    """Return an OSC message as another program would write it."""
    builder = OscMessageBuilder(address)
    for value in values:
        builder.add_arg(value)
    return bytes(builder.build().dgram)


def received(door: socket.socket, address: str, *requests: bytes) -> list[Any]:
    """Return the values of the next message to an address; requests are sent until there is one."""
    while True:
        for request in requests:
            door.send(request)
        with suppress(TimeoutError):
            while True:
                got = OscMessage(door.recv(65536))
                if got.address == address:
                    return list(got.params)


def state_after(door: socket.socket, number: int, part: str = "state") -> list[Any]:
    """Subscribe, and return the state that names a pose."""
    subscribe = message("/digiclay/subscribe", TOKEN, part, 200.0)
    while True:
        state = received(door, "/digiclay/state", subscribe)
        if state[1] == number:
            return state


def is_well(door: socket.socket, number: int) -> None:
    """Check that a client with good intentions is served as ever."""
    subscribe = message("/digiclay/subscribe", TOKEN, "state", 200.0)
    pose = message("/digiclay/pose", TOKEN, *PLACE, number)
    state: list[Any] = [0, 0]
    while state[1] != number or state[4:7] != pytest.approx(PLACE, abs=1e-8):  # python-osc sends 32 bits
        state = received(door, "/digiclay/state", subscribe, pose)
    assert state[1] == number


def test_the_examples_of_the_page_run(
    server: Server, door: socket.socket, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (Path(__file__).parents[2] / "docs" / "serve.md").read_text(encoding="utf-8")
    by_websocket, by_osc, joining = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(server.report.parent)
    monkeypatch.setenv("DIGICLAY_SERVE_TOKEN", TOKEN)
    monkeypatch.setenv("DIGICLAY_SERVE", f"ws://127.0.0.1:{server.port}")
    monkeypatch.setenv("DIGICLAY_SERVE_OSC", str(server.osc_port))
    for example in (by_websocket, by_osc, joining):
        exec(example, {})
    said = capsys.readouterr().out
    assert said.startswith("9 x 9 pins\ntotal force: ")
    assert float(said.split()[-2]) > 0.0
    subscribe = message("/digiclay/subscribe", TOKEN, "state", 200.0)
    wait_until(lambda: received(door, "/digiclay/state", subscribe)[4:7] == pytest.approx(PLACE, abs=1e-8))


def test_a_pose_comes_back_as_a_state(door: socket.socket) -> None:
    is_well(door, 1)
    assert state_after(door, 1)[7:] == [1.0, 0.0, 0.0, 0.0]


def test_the_pins_come_as_blobs(door: socket.socket) -> None:
    subscribe = message("/digiclay/subscribe", TOKEN, "pins", 200.0)
    heights = np.frombuffer(received(door, "/digiclay/heights", subscribe)[1], ">f4")
    assert heights.shape == (81,)
    assert ((heights > 0.0) & (heights < 0.1)).all()


def test_a_reset_has_its_message(door: socket.socket) -> None:
    is_well(door, 2)
    door.send(message("/digiclay/reset", TOKEN))
    assert state_after(door, 0)[3] == 0.0


@pytest.mark.parametrize(
    ("address", "values"),
    [
        ("/digiclay/pose", (0.0, 0.0)),
        ("/digiclay/pose", (float("nan"), 0.0, 0.0)),
        ("/digiclay/pose", ("x", 0.0, 0.0)),
        ("/digiclay/subscribe", ("state", 1e9)),
        ("/digiclay/subscribe", ("state",)),
        ("/digiclay/posse", ()),
    ],
)
def test_a_wrong_message_is_answered_in_one_line(door: socket.socket, address: str, values: Any) -> None:
    # Errors are sent ten times a second at most.
    answer = received(door, "/digiclay/error", message(address, TOKEN, *values))
    assert "must" in answer[0]
    assert "\n" not in answer[0]


def test_without_the_token_nothing_is_answered(door: socket.socket, server: Server) -> None:
    for token in ("", "another-token", 7, TOKEN.encode()):
        door.send(message("/digiclay/subscribe", token, "state", 200.0))
    is_well(door, 3)  # by now those were looked at, too
    assert server.count("wrong tokens") == 4


def test_garbage_harms_nobody(door: socket.socket) -> None:
    random = np.random.default_rng(7)
    for size in (0, 1, 3, 4, 100, 60_000):
        door.send(random.bytes(size))
    good = message("/digiclay/pose", TOKEN, *PLACE)
    for cut in range(0, len(good), 3):
        door.send(good[:cut])
    door.send(b"#bundle\0" + bytes(8) + b"\x7f\xff\xff\xff" + good)
    for kind in range(1, 1000):  # arguments of kinds that are none: nothing is printed, see `Server.stop`
        door.send(b"/digiclay/pose\0\0," + bytes([1 + kind % 31, 1 + kind % 97, 0]) + bytes(16))
    is_well(door, 4)


def test_heights_arrive_at_the_display_and_are_acknowledged(
    server: Server, line: tuple[Reader, str], door: socket.socket
) -> None:
    reader = line[0]
    first = reader.receive()
    os.write(reader.line, pack_acknowledgement(first[0]))
    is_well(door, 5)
    lowest = 1.0
    while lowest > 0.0399:  # pressed, to within a count of 0.1 m / 65,535
        sequence, _, heights = reader.receive()
        os.write(reader.line, pack_acknowledgement(sequence))
        lowest = heights.min()
    assert heights.shape == (81,)
    assert np.argmin(heights) == 40


def wait_for(server: Server, reader: Reader, name: str, count: int, *, answer: bool = True) -> int:
    """Read on, and acknowledge or not, until the server has counted so many frames more; return these."""
    with server.connect("?rate=0") as client:
        client.recv(TIMEOUT)
        found, first = 0, None
        while first is None or found < first + count:
            sequence = reader.receive()[0]
            if answer:
                os.write(reader.line, pack_acknowledgement(sequence))
            client.send('{"type": "status"}')
            found = json.loads(client.recv(TIMEOUT))["counts"][f"display frames {name}"]
            first = found if first is None else first
    return found - first


def test_a_display_that_corrupts_is_counted(server: Server, line: tuple[Reader, str]) -> None:
    reader = line[0]
    sequence = reader.receive()[0]
    damaged = bytearray(pack_acknowledgement(sequence))
    damaged[3] ^= 0x11
    for _ in range(3):
        os.write(reader.line, bytes(damaged) + b"\xff" * 40 + b"\xc0")
    assert wait_for(server, reader, "acknowledged", 3) >= 3
    assert server.count("display frames damaged") >= 6


def test_a_display_that_drops_is_counted(server: Server, line: tuple[Reader, str]) -> None:
    assert wait_for(server, line[0], "dropped", 4, answer=False) >= 4
    assert wait_for(server, line[0], "acknowledged", 3) >= 3


def test_a_display_that_delays_is_counted(server: Server, line: tuple[Reader, str]) -> None:
    reader = line[0]
    with server.connect("?format=binary&rate=100") as client:
        late = 0
        while late < 3:
            sequence = reader.receive()[0]
            for _ in range(4):  # frames at the display's rate: three of its periods at least have gone by
                while not isinstance(client.recv(TIMEOUT), bytes):
                    pass
            os.write(reader.line, pack_acknowledgement(sequence))
            client.send('{"type": "status"}')
            answer = client.recv(TIMEOUT)
            while isinstance(answer, bytes):
                answer = client.recv(TIMEOUT)
            late = json.loads(answer)["counts"]["display frames late"] if "counts" in answer else late
    assert late >= 3


def test_a_display_that_stops_reading_costs_nothing_but_its_frames(
    server: Server, line: tuple[Reader, str], door: socket.socket
) -> None:
    least = server.count("display frames skipped") + 20
    while server.count("display frames skipped") < least:
        is_well(door, 6)
    assert wait_for(server, line[0], "acknowledged", 3) >= 3
