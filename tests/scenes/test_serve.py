"""A server that runs: WebSocket and OSC, a take, clients that mean no good, an example of a pin display."""

import json
import os
import pty
import re
import resource
import select
import signal
import socket
import struct
import subprocess
import sys
import time
from contextlib import ExitStack, suppress
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from digiclay.core.session.take import from_bytes, replay
from pythonosc.osc_message import OscMessage
from pythonosc.osc_message_builder import OscMessageBuilder
from websockets.exceptions import ConnectionClosed, InvalidStatus

from digiclay_serve.hands_command import read_packets
from digiclay_serve.protocol import Flag, Pose, pack_pose
from tests.other_process import PACKAGES
from tests.served import PRESS, TOKEN, frame_message, frames, is_well, load_example, press, serve
from tests.timeouts import TIMEOUT, wait_until

pytestmark = pytest.mark.skipif(
    "sys.platform == 'win32'", reason="the server runs on Linux and macOS"
)


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """One server for all clients; it must be alive in the end, and have its take whole."""
    folder = tmp_path_factory.mktemp("served")
    with serve(folder, "--out", "recorded", rate=100) as one:
        yield one
        report = one.stop(signal.SIGHUP)
        assert "doors that did not answer" not in report["counts"]
        found = sorted((folder / "recorded").iterdir())
        takes = [from_bytes(path.read_bytes()) for path in found]
        assert [path.name for path in found] == [
            f"take_{1 + index:03}.npz" for index in range(len(takes))
        ]
        assert sum(take.periods for take in takes) + report["left_out"] == report["periods"]


def refused(server, *, token="", wishes=""):
    with pytest.raises(InvalidStatus) as caught:
        server.connect(wishes, token)
    return caught.value.response.status_code


# Those with servers of their own come first: the one for all clients does not run yet.


def test_a_killed_server_leaves_takes_that_can_be_replayed(tmp_path):
    part = tmp_path / "recorded" / "take_001_part_00001.npz"
    with serve(tmp_path, "--out", "recorded", "--part", "0.2") as one:
        with one.connect("?format=binary&rate=200") as client:
            client.send(pack_pose(Pose(PRESS, 1)))
            while not part.exists():
                next(frames(client))
        one.process.kill()
        one.process.wait(TIMEOUT)
    take = from_bytes(part.read_bytes())
    assert take.periods >= 40
    assert sum(1 for _ in replay(take)) == take.periods


def test_a_signal_ends_a_server_whose_doors_hang_and_finishes_its_take(tmp_path):
    with serve(tmp_path, "--out", "recorded", "--part", "0.2") as one:
        wait_until(lambda: list((tmp_path / "recorded").glob("*_part_00002.npz")))
        (door,) = subprocess.check_output(
            ["pgrep", "-P", str(one.process.pid)], encoding="utf-8"
        ).split()
        os.kill(int(door), signal.SIGSTOP)
        began = time.monotonic()
        report = one.stop(signal.SIGTERM)
        assert time.monotonic() - began < 15.0  # 5 s by design; the machine may be busy
    (found,) = (tmp_path / "recorded").iterdir()
    assert from_bytes(found.read_bytes()).periods + report["left_out"] == report["periods"]
    assert "doors that did not answer" in report["counts"]


def fingers_after(client, *identities):
    while True:
        said = json.loads(client.recv(TIMEOUT))
        found = {one["id"]: one for one in said["fingers"]} if said["type"] == "state" else {-1: {}}
        if set(found) == set(identities):
            return found


def test_a_session_has_fingers_by_identity_as_long_as_they_are_named(tmp_path):
    places = {5: [-0.006, 0.0, 0.039], 9: [0.006, 0.0, 0.038]}
    fingers = [{"id": one, "position": place} for one, place in places.items()]
    bad = [{"id": 7, "position": [0, 0, float("nan")]}]
    with serve(tmp_path, "--fingers", "2") as one, one.connect("?rate=200") as client:
        assert json.loads(client.recv(TIMEOUT))["fingers"] == 2
        found = {}
        while {name: each["position"] for name, each in found.items()} != places:
            client.send(json.dumps({"type": "poses", "fingers": fingers}))
            found = fingers_after(client, *places)
        assert min(each["force"] for each in found.values()) > 0.0
        client.send(json.dumps({"type": "poses", "fingers": [*bad, *fingers[1:]], "alive": [9]}))
        refusal = ""
        while not refusal:
            refusal = json.loads(client.recv(TIMEOUT)).get("message", "")
        assert refusal.startswith("Finger 7: pose must be finite numbers")
        began = time.monotonic()
        fingers_after(client)  # nobody is named any more
        assert time.monotonic() - began < 5.0  # 0.1 s by design; the machine may be busy
        state = json.loads(client.recv(TIMEOUT))
        while state["total_force"] > 0.0:
            state = json.loads(client.recv(TIMEOUT))


def test_hands_of_a_quest_are_recorded_and_played_into_a_server(tmp_path):
    numbers = ", ".join(["0.01"] * 63)
    lines = f"Left wrist:, 0, 1, 0, 0, 0, 0, 1\nLeft landmarks:, {numbers}\n".encode()
    environment = {**os.environ, "PYTHONPATH": PACKAGES, "DIGICLAY_SERVE_TOKEN": TOKEN}
    with serve(tmp_path, "--fingers", "5", rate=50) as one, one.connect("?rate=200") as client:
        command = [sys.executable, "-m", "digiclay", "hands", "--to", f"ws://127.0.0.1:{one.port}"]
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        listen = [*command, "--port", str(port), "--record", "hands.txt"]
        with (
            subprocess.Popen(
                listen, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, encoding="utf-8",
                preexec_fn=partial(signal.signal, signal.SIGINT, signal.default_int_handler),
            ) as hands,
            ExitStack() as stack,
        ):  # fmt: skip
            stack.callback(hands.kill)
            assert "listening" in hands.stdout.readline()
            with socket.create_connection(("127.0.0.1", port)) as quest:
                for _ in range(20):
                    quest.sendall(lines)
                    time.sleep(0.01)
                quest.sendall(lines[:-2])  # the connection ends within a number
            fingers_after(client, 0, 1, 2, 3, 4)
            hands.send_signal(signal.SIGINT)
            assert hands.wait(TIMEOUT) == 0
        fingers_after(client)
        packets = read_packets(tmp_path / "hands.txt")
        assert {data for _, data in packets} == set(lines.splitlines(keepends=True))
        with (tmp_path / "hands.txt").open("a") as file:
            file.write('[1.0, "Left wr')  # the disk was full
        osc = ["--to", f"osc://127.0.0.1:{one.osc_port}", "--play", "hands.txt"]
        played = subprocess.Popen([*command, *osc], cwd=tmp_path, env=environment)
        fingers_after(client, 0, 1, 2, 3, 4)
        assert played.wait(TIMEOUT) == 0


# One server for all clients.


def test_a_pose_comes_back_as_forces_and_heights(server):
    with server.connect("?format=binary&rate=200") as client:
        bed = json.loads(client.recv(TIMEOUT))
        assert (bed["type"], bed["rows"], bed["columns"], len(bed["positions"])) == (
            "bed",
            9,
            9,
            81,
        )
        frame = press(client, 7)
        while frame.heights.min() > 0.0399:
            frame = press(client, 7)
    assert frame.forces.sum() == pytest.approx(frame.total_force, rel=1e-5)
    assert np.argmin(frame.heights) == 40  # the pin in the middle of 9 x 9


def test_a_reset_brings_the_bed_to_rest(server):
    with server.connect("?format=binary&rate=200") as client:
        before = press(client, 9)
        client.send(json.dumps({"type": "reset"}))
        frame = next(frame for frame in frames(client) if frame.period < before.period)
    np.testing.assert_array_equal(frame.heights, np.float32(0.04))
    assert frame.total_force == 0.0


def test_a_client_names_the_token_in_its_header_or_in_the_address(server):
    with server.connect(f"?token={TOKEN}", token="") as client:
        assert json.loads(client.recv(TIMEOUT))["type"] == "bed"
    wrong = [
        refused(server, token=token) for token in ("", "another-token", TOKEN[:-1], TOKEN + "x")
    ]
    assert (wrong, refused(server, token=TOKEN, wishes="?format=xml")) == ([401] * 4, 400)


WRONG = [
    "garbage", "[" * 3000, '{"type": "pose", "position": [0, 0, NaN]}', '{"type": "posse"}',
    b"\x00\xff" * 100, b"DC", pack_pose(Pose((*PRESS[:3], 1.7e308, 1.7e308, 1.7e308, 1.7e308))),
]  # fmt: skip


def test_a_wrong_message_is_answered_in_one_line(server):
    with server.connect("?rate=0") as client:
        client.recv(TIMEOUT)
        for message in WRONG:
            client.send(message)
            answer = json.loads(client.recv(TIMEOUT))
            told = answer["message"]
            assert (answer["type"], "must" in told, "\n" in told) == ("error", True, False), message
    is_well(server, 10)


def test_a_pose_of_1e300_m_is_where_a_finger_can_be(server):
    with server.connect("?format=binary&rate=200") as client:
        client.send(pack_pose(Pose((1e300, -1e300, 1e300, 1.0, 0.0, 0.0, 0.0), 11)))
        frame = next(frame for frame in frames(client) if frame.number == 11)
    assert np.isfinite(frame.pose).all()
    assert frame.flags & Flag.POSE_LIMITED
    is_well(server, 12)


def test_a_huge_message_or_a_reset_connection_closes_its_client_alone(server):
    with server.connect("?rate=0") as client:
        client.recv(TIMEOUT)
        client.send(b"x" * 5_000_000)
        with pytest.raises(ConnectionClosed) as caught:
            client.recv(TIMEOUT)
    assert caught.value.rcvd.code == 1009
    is_well(server, 13)
    with server.connect("?rate=0") as client:
        client.send(pack_pose(Pose(PRESS, 23)))
        client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        client.socket.close()
    is_well(server, 24)


def test_a_flood_or_a_slow_reader_harms_nobody(server):
    framed = frame_message(pack_pose(Pose(PRESS, 14)))
    with (
        server.connect("?format=binary&rate=200") as other,
        server.connect("?rate=0", close_timeout=0) as client,
        # Reads nothing from here on.
        server.connect("?rate=200", max_queue=1, close_timeout=0) as slow,
    ):
        slow.recv(TIMEOUT)
        with suppress(OSError):  # a machine that takes them within a second closes the client
            client.socket.sendall(framed * 10_000)
        periods = [next(frames(other)).period for _ in range(50)]
        assert periods == sorted(set(periods))
    is_well(server, 15)


def test_the_force_of_a_client_that_has_gone_ends_and_frames_say_so(server):
    with server.connect("?format=binary&rate=200") as watching:
        with server.connect("?format=binary&rate=200") as pressing:
            while press(pressing, 19).flags & Flag.NO_POSE:
                pass
        own = (frame for frame in frames(watching) if frame.number == 19)
        lifted = next(frame for frame in own if frame.pose[2] > frame.heights.max())
        assert (lifted.total_force, bool(lifted.flags & Flag.NO_POSE)) == (0.0, True)
    is_well(server, 20)  # the next pose brings it down


def test_a_frame_after_periods_that_were_left_out_says_so(server):
    with server.connect("?format=binary&rate=200") as client:
        server.process.send_signal(signal.SIGSTOP)
        time.sleep(0.2)  # four times what is made up for
        server.process.send_signal(signal.SIGCONT)
        assert any(frame.flags & Flag.LEFT_OUT for frame in islice(frames(client), 200))
        # It ends, on a machine that keeps up for a second.
        assert any(not frame.flags & Flag.LEFT_OUT for frame in frames(client))


def test_a_thousand_silent_connections_shut_out_nobody_with_the_token(server):
    with server.connect("?format=binary&rate=200") as client:
        client.recv(TIMEOUT)
        press(client, 19)
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(max(soft, 4096), hard), hard))
        silent = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(1000)]
        try:
            press(client, 20)
            while server.count("connections beyond the limit") < 488:
                # All but the newest 512 are cut.
                press(client, 20)
        finally:
            for one in silent:
                one.close()
    is_well(server, 21)


pin_display = load_example("pin_display")
PLACE = (0.0, 0.0, 0.038)


@pytest.fixture
def door(server):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.connect(("127.0.0.1", server.osc_port))
        client.settimeout(0.2)
        yield client


def message(address, *values):
    builder = OscMessageBuilder(address)
    for value in values:
        builder.add_arg(value)
    return bytes(builder.build().dgram)


def received(door, address, *requests):
    """Return the values of the next message to an address; requests are sent until there is one."""
    while True:
        for request in requests:
            door.send(request)
        with suppress(TimeoutError):
            while True:
                got = OscMessage(door.recv(65536))
                if got.address == address:
                    return list(got.params)


def state_after(door, number, part="state"):
    subscribe = message("/digiclay/subscribe", TOKEN, part, 200.0)
    while True:
        state = received(door, "/digiclay/state", subscribe)
        if state[1] == number:
            return state


def is_well_by_osc(door, number):
    subscribe = message("/digiclay/subscribe", TOKEN, "state", 200.0)
    pose = message("/digiclay/pose", TOKEN, *PLACE, number)
    state = [0, 0]
    while state[1] != number or state[4:7] != pytest.approx(PLACE, abs=1e-8):
        # Python-osc sends 32 bits.
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
    assert float(said.split()[6]) > 0.0
    assert said.endswith(": 2.0 N\n")
    subscribe = message("/digiclay/subscribe", TOKEN, "state", 200.0)
    wait_until(
        lambda: received(door, "/digiclay/state", subscribe)[4:7] == pytest.approx(PLACE, abs=1e-8)
    )


def test_the_pins_come_as_blobs_and_a_reset_has_its_message(door):
    subscribe = message("/digiclay/subscribe", TOKEN, "pins", 200.0)
    heights = np.frombuffer(received(door, "/digiclay/heights", subscribe)[1], ">f4")
    assert heights.shape == (81,)
    assert ((heights > 0.0) & (heights < 0.1)).all()
    is_well_by_osc(door, 2)
    assert state_after(door, 2)[7:] == [1.0, 0.0, 0.0, 0.0]
    door.send(message("/digiclay/reset", TOKEN))
    assert state_after(door, 0)[3] == 0.0


def test_a_wrong_osc_message_is_answered_in_one_line(door):
    for address, values in (
        ("pose", (float("nan"), 0.0, 0.0)), ("subscribe", ("state", 1e9)), ("posse", ()),
    ):  # fmt: skip
        # Errors are sent ten times a second at most.
        (said, *_) = received(
            door, "/digiclay/error", message(f"/digiclay/{address}", TOKEN, *values)
        )
        assert ("must" in said, "\n" in said) == (True, False)


def test_without_the_token_nothing_is_answered(door, server):
    before = server.count("wrong tokens")
    for token in ("", "another-token", 7, TOKEN.encode()):
        door.send(message("/digiclay/subscribe", token, "state", 200.0))
    is_well_by_osc(door, 3)  # by now those were looked at, too
    assert server.count("wrong tokens") == before + 4


def test_garbage_harms_nobody(door):
    random = np.random.default_rng(7)
    for size in (0, 1, 3, 4, 100, 60_000):
        door.send(random.bytes(size))
    good = message("/digiclay/pose", TOKEN, *PLACE)
    for cut in range(0, len(good), 3):
        door.send(good[:cut])
    door.send(b"#bundle\0" + bytes(8) + b"\x7f\xff\xff\xff" + good)
    for kind in range(1, 1000):
        # Arguments of kinds that are none: nothing is printed, see `Server.stop`.
        door.send(b"/digiclay/pose\0\0," + bytes([1 + kind % 31, 1 + kind % 97, 0]) + bytes(16))
    is_well_by_osc(door, 4)


def test_the_example_shows_the_heights_on_a_pin_display(server, door):
    ours, theirs = pty.openpty()
    command = [
        sys.executable,
        str(pin_display.__file__),
        f"ws://127.0.0.1:{server.port}",
        os.ttyname(theirs),
    ]
    environment = {
        **os.environ,
        "DIGICLAY_SERVE_TOKEN": TOKEN,
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    rest, bodies = b"", []

    def receive():
        nonlocal rest
        while not bodies:
            assert select.select([ours], [], [], TIMEOUT)[0], example.poll()
            found, rest = pin_display.split(rest + os.read(ours, 65536))
            bodies.extend(body for body in found if body)
        return bodies.pop(0)

    with (
        subprocess.Popen(
            [*command, "--rate", "100"],
            env=environment,
            stdout=subprocess.PIPE,
            encoding="utf-8",
            # In the background of a shell it would have Ctrl-C ignored.
            preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
        ) as example,
        ExitStack() as stack,
    ):
        stack.callback(example.kill)  # a claim that fails does not wait for it
        is_well_by_osc(door, 5)
        heights = np.ones(81)
        while heights[40] > 0.0399:  # pressed in the middle, to within a count of 0.1 m / 65,535
            body = receive()
            assert body[:2] == bytes([1, 1])
            stroke = pin_display.BODY.unpack_from(body, pin_display.HEAD.size)[1]
            start = pin_display.HEAD.size + pin_display.BODY.size
            heights = np.frombuffer(body, "<u2", offset=start) / 65535 * stroke
            os.write(ours, acknowledgement(body))
        assert heights.shape == (81,)
        lost = [receive() for _ in range(pin_display.WINDOW)]  # more come when these are dropped
        os.write(ours, acknowledgement(receive()))
        example.send_signal(signal.SIGINT)
        said = example.communicate(timeout=TIMEOUT)[0]
    counts = {name: int(count) for name, count in re.findall(r"(\w+): (\d+)", said)}
    assert counts["sent"] == counts["acknowledged"] + counts["dropped"]
    assert counts["dropped"] >= len(lost)
    for line in (ours, theirs):
        os.close(line)


def acknowledgement(body):
    sequence = pin_display.HEAD.unpack_from(body)[2]
    return pin_display.pack(pin_display.HEAD.pack(1, 2, sequence))
