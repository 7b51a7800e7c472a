"""The WebSocket of a server that runs: poses in, frames out, a take, and clients that mean no good."""

from __future__ import annotations

import json
import os
import resource
import signal
import socket
import struct
import subprocess
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digiclay.core.session.take import from_bytes, replay
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection

from digiclay_serve.protocol import Flag, Frame, Pose, pack_pose, unpack_frame
from tests.served import TOKEN, Server, frame_message, serve
from tests.timeouts import TIMEOUT, wait_until

pytestmark = pytest.mark.skipif("sys.platform == 'win32'", reason="the server runs on Linux and macOS")
PRESS = (0.0, 0.0, 0.038, 1.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One server for all clients; it must be alive in the end, and have its take whole."""
    folder = tmp_path_factory.mktemp("served")
    with serve(folder, "--out", "recorded") as one:
        yield one
        report = one.stop(signal.SIGHUP)
        assert "doors that did not answer" not in report["counts"]
        found = sorted((folder / "recorded").iterdir())
        takes = [from_bytes(path.read_bytes()) for path in found]
        assert [path.name for path in found] == [f"take_{1 + index:03}.npz" for index in range(len(takes))]
        assert sum(take.periods for take in takes) + report["left_out"] == report["periods"]


def frames(client: ClientConnection) -> Iterator[Frame]:
    """Yield the frames that a client receives in binary."""
    while True:
        message = client.recv(TIMEOUT)
        if isinstance(message, bytes):
            yield unpack_frame(message)


def frame_after(client: ClientConnection, number: int) -> Frame:
    """Return the first frame after a pose has been reached."""
    return next(one for one in frames(client) if one.number == number and not one.flags & Flag.POSE_LIMITED)


def is_well(server: Server, number: int) -> None:
    """Check that a client is served as ever; the fingertip may be another's for 2 s."""
    with server.connect("?format=binary&rate=200") as client:
        client.send(pack_pose(Pose(PRESS, number)))
        for frame in frames(client):
            if frame.number == number and not frame.flags & Flag.POSE_LIMITED:
                assert frame.pose.tolist() == list(PRESS)
                return
            client.send(pack_pose(Pose(PRESS, number)))


def refused(server: Server, *, token: str = "", wishes: str = "") -> int:
    """Return the HTTP status by which a client is refused."""
    with pytest.raises(InvalidStatus) as caught:
        server.connect(wishes, token)
    return caught.value.response.status_code


def test_a_pose_comes_back_as_forces_and_heights(server: Server) -> None:
    with server.connect("?format=binary&rate=200") as client:
        bed = json.loads(client.recv(TIMEOUT))
        assert (bed["type"], bed["rows"], bed["columns"], len(bed["positions"])) == ("bed", 9, 9, 81)
        client.send(pack_pose(Pose(PRESS, 7)))
        frame = frame_after(client, 7)
        while frame.total_force == 0.0 or frame.heights.min() > 0.0399:
            frame = next(frames(client))
    assert frame.pose.tolist() == list(PRESS)
    assert frame.forces.sum() == pytest.approx(frame.total_force, rel=1e-5)
    assert np.argmin(frame.heights) == 40  # the pin in the middle of 9 x 9


def test_json_says_the_same_and_flags_a_jump_of_10_mm(server: Server) -> None:
    with server.connect("?rate=200") as client:
        bed = json.loads(client.recv(TIMEOUT))
        said = {"type": "pose", "position": [0.0, 0.0, 0.039], "number": 8}
        client.send(json.dumps(said))
        frame: dict[str, Any] = {}
        while frame.get("number") != 8 or "pose_limited" in frame["flags"]:
            frame = json.loads(client.recv(TIMEOUT))
        assert (frame["type"], frame["version"]) == ("state", 1)
        assert (frame["position"], frame["orientation"]) == ([0.0, 0.0, 0.039], [1.0, 0.0, 0.0, 0.0])
        assert len(frame["heights"]) == len(frame["forces"]) == 81
        client.send(json.dumps({**said, "position": [0.0, 0.0, 0.029]}))
        while frame["flags"] != ["beyond_a_finger", "force_limited"]:
            frame = json.loads(client.recv(TIMEOUT))
            assert sum(frame["forces"]) <= bed["most_force"] * (1.0 + 1e-6)  # 32 bits
    assert frame["total_force"] == bed["most_force"] == 2.0


def test_a_reset_brings_the_bed_to_rest(server: Server) -> None:
    with server.connect("?format=binary&rate=200") as client:
        client.send(pack_pose(Pose(PRESS, 9)))
        before = frame_after(client, 9)
        client.send(json.dumps({"type": "reset"}))
        frame = next(frame for frame in frames(client) if frame.period < before.period)
    np.testing.assert_array_equal(frame.heights, np.float32(0.04))
    assert frame.total_force == 0.0


def test_a_client_names_the_token_in_its_header_or_in_the_address(server: Server) -> None:
    with server.connect(f"?token={TOKEN}", token="") as client:
        assert json.loads(client.recv(TIMEOUT))["type"] == "bed"
    wrong = [refused(server, token=token) for token in ("", "another-token", TOKEN[:-1], TOKEN + "x")]
    assert (wrong, refused(server, token=TOKEN, wishes="?format=xml")) == ([401] * 4, 400)


WRONG: list[str | bytes] = [
    "garbage", "[" * 3000, '{"type": "pose", "position": [0, 0, NaN]}',
    '{"type": "pose", "position": [0, 0]}',
    '{"type": "pose", "position": [0, 0, 1e999]}', '{"type": "posse"}',
    '{"type": "pose", "position": [0, 0, 0], "orientation": [0, 0, 0, 0]}', b"\x00\xff" * 100, b"DC",
    pack_pose(Pose((float("nan"), *PRESS[1:]))),
    pack_pose(Pose((*PRESS[:3], 1.7e308, 1.7e308, 1.7e308, 1.7e308))),
]  # fmt: skip


def test_a_wrong_message_is_answered_in_one_line(server: Server) -> None:
    with server.connect("?rate=0") as client:
        client.recv(TIMEOUT)
        for message in WRONG:
            client.send(message)
            answer = json.loads(client.recv(TIMEOUT))
            told = answer["message"]
            assert (answer["type"], "must" in told, "\n" in told) == ("error", True, False), message
    is_well(server, 10)


def test_a_pose_of_1e300_m_is_where_a_finger_can_be(server: Server) -> None:
    with server.connect("?format=binary&rate=200") as client:
        client.send(pack_pose(Pose((1e300, -1e300, 1e300, 1.0, 0.0, 0.0, 0.0), 11)))
        frame = next(frame for frame in frames(client) if frame.number == 11)
    assert np.isfinite(frame.pose).all()
    assert frame.flags & Flag.POSE_LIMITED
    is_well(server, 12)


def test_a_huge_message_or_a_reset_connection_closes_its_client_alone(server: Server) -> None:
    with server.connect("?rate=0") as client:
        client.recv(TIMEOUT)
        client.send(b"x" * 5_000_000)
        with pytest.raises(ConnectionClosed) as caught:
            client.recv(TIMEOUT)
    assert caught.value.rcvd is not None
    assert caught.value.rcvd.code == 1009
    is_well(server, 13)
    with server.connect("?rate=0") as client:
        client.send(pack_pose(Pose(PRESS, 23)))
        client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        client.socket.close()
    is_well(server, 24)


def test_a_flood_or_a_slow_reader_harms_nobody(server: Server) -> None:
    framed = frame_message(pack_pose(Pose(PRESS, 14)))
    with (
        server.connect("?format=binary&rate=200") as other,
        server.connect("?rate=0", close_timeout=0) as client,
        server.connect("?rate=200", max_queue=1, close_timeout=0) as slow,  # reads nothing from here on
    ):
        slow.recv(TIMEOUT)
        with suppress(OSError):  # a machine that takes them within a second closes the client
            client.socket.sendall(framed * 10_000)
        periods = [next(frames(other)).period for _ in range(50)]
        assert periods == sorted(set(periods))
    is_well(server, 15)


def test_the_fingertip_has_one_client_at_a_time(server: Server) -> None:
    with server.connect("?format=binary&rate=200") as first, server.connect("?rate=0") as second:
        first.send(pack_pose(Pose(PRESS, 16)))
        frame_after(first, 16)
        second.recv(TIMEOUT)
        second.send(pack_pose(Pose(PRESS, 17)))
        assert "Another client moves the fingertip" in json.loads(second.recv(TIMEOUT))["message"]
    is_well(server, 18)  # it has gone, so that the fingertip is free


def test_a_thousand_silent_connections_shut_out_nobody_with_the_token(server: Server) -> None:
    with server.connect("?format=binary&rate=200") as client:
        client.recv(TIMEOUT)
        client.send(pack_pose(Pose(PRESS, 19)))
        frame_after(client, 19)
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(max(soft, 4096), hard), hard))
        silent = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(1000)]
        try:
            client.send(pack_pose(Pose(PRESS, 20)))
            frame_after(client, 20)
            while server.count("connections beyond the limit") < 488:  # all but the newest 512 are cut
                frame_after(client, 20)
        finally:
            for one in silent:
                one.close()
    is_well(server, 21)


def test_a_killed_server_leaves_takes_that_can_be_replayed(tmp_path: Path) -> None:
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


def test_a_signal_ends_a_server_whose_doors_hang_and_finishes_its_take(tmp_path: Path) -> None:
    with serve(tmp_path, "--out", "recorded", "--part", "0.2") as one:
        wait_until(lambda: list((tmp_path / "recorded").glob("*_part_00002.npz")))
        (door,) = subprocess.check_output(["pgrep", "-P", str(one.process.pid)], text=True).split()
        os.kill(int(door), signal.SIGSTOP)
        began = time.monotonic()
        report = one.stop(signal.SIGTERM)
        assert time.monotonic() - began < 15.0  # 5 s by design; the machine may be busy
    (found,) = (tmp_path / "recorded").iterdir()
    assert from_bytes(found.read_bytes()).periods + report["left_out"] == report["periods"]
    assert "doors that did not answer" in report["counts"]
