"""A server of a small bed in a process of its own, for tests of its doors."""

import importlib.util
import json
import os
import re
import signal
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

from websockets.sync.client import connect

from digiclay_serve.protocol import Pose, pack_pose, unpack_frame
from tests.timeouts import TIMEOUT

ROOT = Path(__file__).parents[1]
TOKEN = "a-token-of-tests"
#: A bed of a few pins, and a blister that fits it.
SMALL = (
    "layout.rows=9",
    "layout.columns=9",
    "blister.radius=5e-3",
    "blister.edge_radius=8e-3",
    "blister.flat_radius=2e-3",
)


@dataclass(frozen=True)
class Server:
    """Server that runs: its process, its ports, and where its report will be."""

    process: subprocess.Popen[str]
    port: int
    osc_port: int
    report: Path

    def connect(self, wishes="", token=TOKEN, **options):
        """Return a client's connection."""
        header = {"Authorization": f"Bearer {token}"} if token else {}
        address = f"ws://127.0.0.1:{self.port}/{wishes}"
        return connect(
            address,
            additional_headers=header,
            compression=None,
            **{"close_timeout": 1.0, **options},
        )

    def count(self, name):
        """Return a count of the doors."""
        with self.connect("?rate=0") as client:
            client.recv(TIMEOUT)
            client.send('{"type": "status"}')
            return int(json.loads(client.recv(TIMEOUT))["counts"].get(name, 0))

    def stop(self, number=signal.SIGINT):
        """Stop the server; return its report."""
        self.process.send_signal(number)
        out, err = self.process.communicate(timeout=TIMEOUT)
        assert self.process.returncode == 0, out + err
        assert err == ""
        report = json.loads(self.report.read_text(encoding="utf-8"))
        return report


@cache
def load_example(name):
    """Return a program of docs/examples as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / "examples" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def frame_message(packed):
    """Return a binary message of up to 125 bytes as RFC 6455 has it, masked by zeros."""
    return bytes([0x82, 0x80 | len(packed), 0, 0, 0, 0]) + packed


@contextmanager
def serve(folder, *options, rate=200):
    """Run a server of a small bed, and end it with the block."""
    settings = [word for one in SMALL for word in ("--set", one)]
    command = [
        sys.executable,
        "-m",
        "digiclay",
        "serve",
        *settings,
        "--rate",
        str(rate),
        "--port",
        "0",
    ]
    command += ["--osc-port", "0", "--token", TOKEN, "--report", "report.json", *options]
    path = os.pathsep.join([str(ROOT / "addon"), str(ROOT)])
    process = subprocess.Popen(
        command,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
        encoding="utf-8",
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        # Its end by SIGHUP is tested, also below a nohup, which would have it ignored.
        preexec_fn=partial(signal.signal, signal.SIGHUP, signal.SIG_DFL),
    )
    try:
        said = "".join(process.stdout.readline() for _ in range(3))
        ports = re.findall(r"127\.0\.0\.1:(\d+)", said)
        assert len(ports) == 2, said + process.communicate(timeout=TIMEOUT)[1]
        yield Server(process, int(ports[0]), int(ports[1]), folder / "report.json")
    finally:
        process.kill()
        process.communicate()


PRESS = (0.0, 0.0, 0.038, 1.0, 0.0, 0.0, 0.0)


def frames(client):
    while True:
        message = client.recv(TIMEOUT)
        if isinstance(message, bytes):
            yield unpack_frame(message)


def press(client, number):
    """Send a pose until a frame has it and its force; return that frame.

    A pose that is sent once may be too old when a busy machine comes to it.
    """
    while True:
        client.send(pack_pose(Pose(PRESS, number)))
        frame = next(frames(client))
        if (
            frame.number == number
            and frame.pose.tolist() == list(PRESS)
            and frame.total_force > 0.0
        ):
            return frame


def is_well(server, number):
    with server.connect("?format=binary&rate=200") as client:
        press(client, number)
