"""Benchmark ``serve``: deadlines of a session for other programs, with a client that moves the fingertip."""

from __future__ import annotations

import argparse
import json
import re
import secrets
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from digiclay.commands.progress import table
from digiclay.core.base.errors import OutputError
from digiclay.core.model.trajectory import sample_poses
from digiclay.core.scene.scene_source import find, load
from digiclay.plots.figure import empty

from .report import BLUE, RED, STYLE, Report, Steps

#: The session of the paper, its control periods a second, and when its fingertip comes down, s.
SCENE, RATE, DOWN = "ridge_mound_valley", 1000, 5.0
#: Seconds that are served, with --quiet and without.
QUICK, FULL = 3.0, 20.0
SHARES = ("p50", "p99", "p99.9", "longest")
#: Lines of the report: what is measured, by the names of the server's.
LINES = {
    "elapsed": "beginning of a period to its frame",
    "lateness": "of which before it is simulated",
    "processor": "processor time of a period",
}
#: Upper ends of the histogram's bins, ms.
ENDS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 5.0, 10.0, 50.0, np.inf)
#: Mark, version, kind, number, pose; and mark, version, kind, pins, period, number of a frame.
POSE, HEAD = struct.Struct("<2sBBI7d"), struct.Struct("<2sBBIQI")


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Serve for a while."""
    figures, frames = _serve(QUICK if arguments.quick else FULL)
    head = ("what", *(f"{share}_s" for share in SHARES))
    rows = [[name, *(figures[name][share] for share in SHARES)] for name in LINES]
    lines = _list_lines(figures, frames)
    return Report(lines, head, rows, lambda: _draw(figures), packages=("websockets",))


def _serve(seconds: float) -> tuple[dict[str, Any], int]:
    """Run a server and a client; return the server's report, and how many frames the client received."""
    token = secrets.token_urlsafe(18)
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        command = [sys.executable, "-m", "digiclay", "serve", SCENE, "--rate", str(RATE), "--port", "0"]
        command += ["--osc-port", "0", "--token", token, "--report", str(report), "--seconds", str(seconds)]
        command += ["--out", str(Path(folder) / "recorded")]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            address = re.search(
                r"ws://127\.0\.0\.1:(\d+)", "".join(process.stdout.readline() for _ in range(3))
            )
            frames = _move(int(address[1]), token) if address else 0
            process.stdout.read()
        if process.returncode or not frames:
            raise OutputError("digiclay serve has ended early: see above.")
        figures: dict[str, Any] = json.loads(report.read_text(encoding="utf-8"))
        return figures, frames


def _move(port: int, token: str) -> int:
    """Answer every frame by the next pose of the session, until the server ends; return how many came."""
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect

    scene = load(find(SCENE))
    times = np.arange(0.0, scene.simulation.duration or scene.periods * 5e-3, 1.0 / RATE)
    poses = sample_poses(scene.trajectories(), times)[:, 0]
    header, frames = {"Authorization": f"Bearer {token}"}, 0
    address = f"ws://127.0.0.1:{port}/?format=binary&rate={RATE}"
    with connect(address, additional_headers=header, compression=None) as client:
        try:
            while True:
                message = client.recv()
                if not isinstance(message, bytes):
                    continue
                frames += 1
                period = HEAD.unpack_from(message)[4]
                row = (period + round(DOWN * RATE)) % len(poses)
                client.send(POSE.pack(b"DC", 1, 2, period % 2**32, *poses[row]))
        except ConnectionClosed:
            return frames


def sum_bins(bins: Sequence[tuple[float, int]], ends: Sequence[float]) -> list[int]:
    """Return how many times lie between one end and the next, ms; `bins`: lower end, s, and count."""
    starts = np.array([start for start, _ in bins]) * 1e3
    counts = np.array([count for _, count in bins])
    # A narrow bin belongs where its lower end is; rounding must not move it.
    place = np.searchsorted(np.asarray(ends), starts + 1e-6, side="right")
    return [int(counts[place == index].sum()) for index in range(len(ends))]


def _list_lines(figures: Mapping[str, Any], frames: int) -> Iterator[str]:
    """Give the lines of the report."""
    yield f"\ndigiclay serve {SCENE} --rate {RATE}: 625 pins, a pose from a client after every frame; ms\n"
    rows = [[LINES[name], *(f"{1e3 * figures[name][share]:.2f}" for share in SHARES)] for name in LINES]
    yield from table(("", *SHARES), rows)
    periods, missed = figures["periods"], figures["missed"]
    yield f"\n{periods} periods; past their deadline of 1 ms: {missed} ({100.0 * missed / periods:.2f} %),"
    yield f"of them left out: {figures['left_out']}; the client received {frames} frames\n"
    counts = (map(str, sum_bins(figures[name]["bins"], ENDS)) for name in ("elapsed", "processor"))
    names = [f"below {end:g} ms" if np.isfinite(end) else "longer" for end in ENDS]
    yield from table(("", "elapsed", "processor"), list(zip(names, *counts, strict=True)))


def _draw(figures: Mapping[str, Any]) -> Any:
    """Draw the histograms of elapsed and processor time."""
    with empty(7.2, 4.2, STYLE, layout="constrained") as figure:
        panels = figure.subplots(2, 1, sharex=True)
        edges = np.geomspace(0.1, 100.0, 91)
        for panel, name in zip(panels, ("elapsed", "processor"), strict=True):
            bins = np.array(figures[name]["bins"])
            panel.hist(1e3 * bins[:, 0], edges, weights=bins[:, 1], color=BLUE, log=True)
            panel.axvline(1e3 * figures["period"], color=RED, linestyle="--", label="deadline")
            panel.set(title=LINES[name], ylabel="periods")
            panel.legend(loc="upper right")
        panels[-1].set(xscale="log", xlabel="ms")
        return figure
