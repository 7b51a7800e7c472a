"""OSC at a server that runs, and the example of a pin display, with a pty as its serial line."""

from __future__ import annotations

import os
import re
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pythonosc.osc_message import OscMessage
from pythonosc.osc_message_builder import OscMessageBuilder

from tests.served import TOKEN, Server, load_example, serve
from tests.timeouts import TIMEOUT, wait_until

if sys.platform == "win32":
    pytest.skip("the server runs on Linux and macOS", allow_module_level=True)

import pty

pin_display = load_example("pin_display")
PLACE = (0.0, 0.0, 0.038)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One server for all tests; in the end it must be alive."""
    with serve(tmp_path_factory.mktemp("served")) as one:
        yield one
        one.stop()


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


def test_the_examples_of_the_page_run(server, door, monkeypatch, capsys):
    page = (Path(__file__).parents[2] / "docs" / "serve.md").read_text(encoding="utf-8")
    by_websocket, by_osc = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(server.report.parent)
    monkeypatch.setenv("DIGICLAY_SERVE_TOKEN", TOKEN)
    monkeypatch.setenv("DIGICLAY_SERVE", f"ws://127.0.0.1:{server.port}")
    monkeypatch.setenv("DIGICLAY_SERVE_OSC", str(server.osc_port))
    for example in (by_websocket, by_osc):
        exec(example, {})
    said = capsys.readouterr().out
    assert said.startswith("9 x 9 pins\ntotal force: ")
    assert float(said.split()[-2]) > 0.0
    subscribe = message("/digiclay/subscribe", TOKEN, "state", 200.0)
    wait_until(lambda: received(door, "/digiclay/state", subscribe)[4:7] == pytest.approx(PLACE, abs=1e-8))


def test_a_pose_comes_back_as_a_state(door: socket.socket) -> None:
    is_well(door, 1)
    assert state_after(door, 1)[7:] == [1.0, 0.0, 0.0, 0.0]


def test_the_pins_come_as_blobs_and_a_reset_has_its_message(door: socket.socket) -> None:
    subscribe = message("/digiclay/subscribe", TOKEN, "pins", 200.0)
    heights = np.frombuffer(received(door, "/digiclay/heights", subscribe)[1], ">f4")
    assert heights.shape == (81,)
    assert ((heights > 0.0) & (heights < 0.1)).all()
    is_well(door, 2)
    door.send(message("/digiclay/reset", TOKEN))
    assert state_after(door, 0)[3] == 0.0


def test_a_wrong_message_is_answered_in_one_line(door: socket.socket) -> None:
    for address, values in (
        ("pose", (0.0, 0.0)), ("pose", (float("nan"), 0.0, 0.0)), ("pose", ("x", 0.0, 0.0)),
        ("subscribe", ("state", 1e9)), ("subscribe", ("state",)), ("posse", ()),
    ):  # fmt: skip
        # Errors are sent ten times a second at most.
        (said, *_) = received(door, "/digiclay/error", message(f"/digiclay/{address}", TOKEN, *values))
        assert ("must" in said, "\n" in said) == (True, False)


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


def test_the_example_shows_the_heights_on_a_pin_display(server: Server, door: socket.socket) -> None:
    ours, theirs = pty.openpty()
    command = [sys.executable, str(pin_display.__file__), f"ws://127.0.0.1:{server.port}", os.ttyname(theirs)]
    environment = {**os.environ, "DIGICLAY_SERVE_TOKEN": TOKEN, "PYTHONPATH": os.pathsep.join(sys.path)}
    rest, bodies = b"", []

    def receive() -> bytes:
        nonlocal rest
        while not bodies:
            assert select.select([ours], [], [], TIMEOUT)[0], example.poll()
            found, rest = pin_display.split(rest + os.read(ours, 65536))
            bodies.extend(body for body in found if body)
        return bodies.pop(0)

    with (
        subprocess.Popen(
            [*command, "--rate", "100"], env=environment, stdout=subprocess.PIPE, text=True
        ) as example,
        ExitStack() as stack,
    ):
        stack.callback(example.kill)  # a claim that fails does not wait for it
        is_well(door, 5)
        heights = np.ones(81)
        while heights[40] > 0.0399:  # pressed in the middle, to within a count of 0.1 m / 65,535
            body = receive()
            assert body[:2] == bytes([1, 1])
            stroke = pin_display.BODY.unpack_from(body, pin_display.HEAD.size)[1]
            start = pin_display.HEAD.size + pin_display.BODY.size
            heights = np.frombuffer(body, "<u2", offset=start) / 65535 * stroke
            os.write(ours, acknowledgement(body))
        assert heights.shape == (81,)
        damaged = bytearray(acknowledgement(receive()))
        damaged[3] ^= 0x11
        os.write(ours, bytes(damaged) + b"\xff" * 40 + b"\xc0")
        lost = [receive() for _ in range(pin_display.WINDOW)]  # more come when these are dropped
        os.write(ours, acknowledgement(receive()))
        os.write(ours, acknowledgement(lost[0]))
        os.write(ours, acknowledgement(receive()))
        example.send_signal(signal.SIGINT)
        said = example.communicate(timeout=TIMEOUT)[0]
    counts = {name: int(count) for name, count in re.findall(r"(\w+): (\d+)", said)}
    assert counts["sent"] == counts["acknowledged"] + counts["dropped"]
    assert counts["dropped"] >= len(lost)
    assert counts["damaged"] >= 3
    assert counts["skipped"] > 0
    for line in (ours, theirs):
        os.close(line)


def acknowledgement(body: bytes) -> bytes:
    """Return the acknowledgement of a frame of heights."""
    sequence = pin_display.HEAD.unpack_from(body)[2]
    return pin_display.pack(pin_display.HEAD.pack(1, 2, sequence))
