"""Benchmarks ``commits`` and ``serve``: work of other processes than this one."""

import json
import os
import re
import secrets
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from argparse import Namespace
from contextlib import suppress
from pathlib import Path

import numpy as np
from digiclay.core.base.errors import DigiclayError, OutputError
from digiclay.core.files.tables import Record
from digiclay.core.model.trajectory import sample_poses
from digiclay.core.scene.scene_source import find, load

from .report import Report, Steps, tabulate

ROOT = Path(__file__).parents[1]
#: The paper's session.
SCENE = "ridge_mound_valley"

# Two commits, by turns

#: Cases and their settings of the session.
CASES: dict[str, tuple[str, ...]] = {
    "Method I": (),
    "no control": ("control=absent",),
    "force noise 2 mN": ("sensors.force_noise=2 mN",),
    "Method II": ("control.method=cell_states",),
    "Method III": ("control.method=hybrid",),
}
#: The last case: a command as a whole, bytecode kept; so often, of which the least time counts.
START, STARTS = "digiclay run tap --quiet --overwrite", 5
#: Run at both commits: prints the least processor time of a control period in each case, s.
PROGRAM = """
import json, sys, time
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load

def measure(settings):
    scene = load(find("ridge_mound_valley"), [Setting(*text.split("=", 1)) for text in settings])
    system, count, times = assemble(scene), int(sys.argv[2]), []
    for _ in range(3):
        start = time.process_time()
        for _ in periods(system, scene.trajectories(), begin(system), count):
            pass
        times.append((time.process_time() - start) / count)
    return min(times)

print(json.dumps([measure(settings) for settings in json.loads(sys.argv[1])]))
"""
#: Longest run of a process, s.
LONGEST = 7200.0


def measure_commits(arguments: Namespace, steps: Steps) -> Report:
    """Time both commits by turns."""
    turns, count = (2, 200) if arguments.quick else (max(arguments.turns, 1), 1000)
    names = (arguments.old, arguments.new)
    with tempfile.TemporaryDirectory() as scratch:
        trees = [extract(name, Path(scratch) / str(number)) for number, name in enumerate(names)]
        jobs = steps.through([*zip(trees, names, strict=True)] * turns, lambda job: str(job[1]))
        times = 1e6 * np.array([run_commit(tree, name, count) for tree, name in jobs])
    before, after = times[::2], times[1::2]
    figures = [np.median(before, 0), np.median(after, 0)]
    figures += [reduce(after / before, axis=0) for reduce in (np.median, np.min, np.max)]
    figures.append([*np.median(after[:, :-1] / after[:, :1], 0), None])
    keys = ("case", "old_us", "new_us", "ratio", "least", "largest", "to_first")
    rows = [
        dict(zip(keys, row, strict=True)) for row in zip([*CASES, START], *figures, strict=True)
    ]
    columns = {
        "case": "case",
        f"old, {names[0]} (µs)": "old_us .0f",
        f"new, {names[1]} (µs)": "new_us .0f",
        **{key: f"{key} .2f" for key in keys[3:-1]},
        f"new, to {next(iter(CASES))}": "to_first .2f",
    }
    title = f"\nprocessor time of a control period, and of a command; medians of {turns} turns\n"
    return Report([title, *tabulate(rows, columns)], rows)


def extract(commit: str, folder: Path) -> Path:
    """Unpack a commit into a folder, and return that."""
    archive = folder.with_suffix(".tar")
    git = ["git", "-c", "safe.directory=*", "archive", f"--output={archive}", commit]
    if subprocess.run(git, cwd=ROOT, capture_output=True, timeout=LONGEST, check=False).returncode:
        raise DigiclayError(f"commits: {commit} must be a commit, branch or tag of this checkout.")
    shutil.unpack_archive(archive, folder, filter="data")
    return folder


def run_python(
    tree: Path, who: str, *words: str, python: str = sys.executable, **change: str
) -> str:
    """Run Python on one core with the code in a folder, and a changed environment; return its output.

    `who`: of the message where it fails.
    """
    paths = os.pathsep.join([str(tree / "addon"), str(tree)])
    environment = {**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1", **change}
    done = subprocess.run(
        [python, *words],
        cwd=tree,
        env=environment,
        capture_output=True,
        text=True,
        timeout=LONGEST,
        check=False,
    )
    if done.returncode:
        raise DigiclayError(f"{who} failed: {done.stderr.strip().rpartition(chr(10))[2][:200]}.")
    return done.stdout


def run_commit(tree: Path, commit: str, count: int) -> list[float]:
    """Return the time of a control period in each of `CASES`, s, and of `START`, by the code in a folder."""
    from resource import RUSAGE_CHILDREN, getrusage  # Windows has none

    cases = json.dumps(list(CASES.values()))
    times: list[float] = json.loads(
        run_python(tree, f"commits: {commit}", "-c", PROGRAM, cases, str(count))
    )
    starts = []
    for _ in range(STARTS):
        before = sum(getrusage(RUSAGE_CHILDREN)[:2])
        run_python(tree, f"commits: {commit}", "-m", *START.split(), PYTHONDONTWRITEBYTECODE="")
        starts.append(sum(getrusage(RUSAGE_CHILDREN)[:2]) - before)
    return [*times, min(starts)]


# A server, with a client that moves the fingertips

#: When the session's fingertip comes down, s.
DOWN = 5.0
#: Seconds that are served, with --quick and without.
QUICK, FULL = 3.0, 20.0
SHARES = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999, "longest": 1.0}
#: Lines of the report: what is measured, by the names of the server's, and of the client's.
LINES = {
    "elapsed": "beginning of a period to its frame",
    "lateness": "of which before it is simulated",
    "processor": "processor time of a period",
    "answer": "pose sent to a frame that has it",
}
#: Mark, version, kind, number, pose; and mark, version, kind, pins, period, number of a frame.
POSE, HEAD = struct.Struct("<2sBBI7d"), struct.Struct("<2sBBIQI")
#: Several fingers, so far apart, m, come as from a camera, Hz, and go a share of the session's way.
CAMERA, APART, SHARE = 60.0, (18e-3, 30e-3), 0.2


def measure_serve(arguments: Namespace, steps: Steps) -> Report:
    """Serve for a while."""
    seconds, rate, fingers = QUICK if arguments.quick else FULL, arguments.rate, arguments.fingers
    figures, frames = _serve(seconds, rate, fingers)
    rows = [{"what": name, **{f"{s}_s": figures[name][s] for s in SHARES}} for name in LINES]
    often = "after every frame" if fingers == 1 else f"{CAMERA:g} times a second"
    title = f"\ndigiclay serve {SCENE} --rate {rate} --fingers {fingers}: 625 pins, a pose {often}; ms\n"
    named = [{**row, "what": LINES[row["what"]]} for row in rows]
    periods, missed = figures["periods"], figures["missed"]
    lines = [
        title,
        *tabulate(named, {"": "what", **{share: f"{share}_s .2f 1e3" for share in SHARES}}),
        f"\n{periods} periods; past their deadline: {missed} ({100.0 * missed / periods:.2f} %),",
        f"of them left out: {figures['left_out']}; the client received {frames} frames",
    ]
    return Report(lines, rows)


def _serve(seconds: float, rate: int, fingers: int) -> tuple[Record, int]:
    """Run a server and a client; return what they report, and how many frames the client received."""
    token = secrets.token_urlsafe(18)
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        ports = "--port 0 --osc-port 0"
        words = f"serve {SCENE} --rate {rate} {ports} --seconds {seconds} --fingers {fingers}"
        files = [f"--report={report}", f"--out={Path(folder) / 'recorded'}", f"--token={token}"]
        command = [sys.executable, "-m", "digiclay", *words.split(), *files]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            head = "".join(process.stdout.readline() for _ in range(3))
            address = re.search(r"ws://127\.0\.0\.1:(\d+)", head)
            answers, frames = _move(int(address[1]), token, rate, fingers) if address else ([], 0)
            process.stdout.read()
        if process.returncode or not answers:
            raise OutputError("digiclay serve has ended early: see above.")
        figures: Record = json.loads(report.read_text(encoding="utf-8"))
    shares = np.quantile(answers, list(SHARES.values())).tolist()
    return {**figures, "answer": dict(zip(SHARES, shares, strict=True))}, frames


def _move(port: int, token: str, rate: int, fingers: int) -> tuple[list[float], int]:
    """Send poses along the session until the server ends; return times to their frames, s, and all frames."""
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect

    scene = load(find(SCENE))
    times = np.arange(0.0, scene.simulation.duration or scene.periods * 5e-3, 1.0 / rate)
    poses = sample_poses(scene.trajectories(), times)[:, 0]
    places = APART * (np.array([(k % 5, k // 5) for k in range(fingers)]) - (2.0, 0.5))
    header = {"Authorization": f"Bearer {token}"}
    random = np.random.default_rng(1)
    start = time.perf_counter()
    sent, answers, frames, answered, due = [start], list[float](), 0, 0, start

    def make_message(number: int) -> bytes | str:
        pose = poses[round((time.perf_counter() - start + DOWN) * rate) % len(poses)]
        if fingers == 1:
            return POSE.pack(b"DC", 1, 2, number, *pose)
        there = np.column_stack([places + SHARE * pose[:2], np.full(fingers, pose[2])]).tolist()
        named = [{"id": identity, "position": place} for identity, place in enumerate(there)]
        return json.dumps({"type": "poses", "number": number, "fingers": named})

    address = f"ws://127.0.0.1:{port}/?format=binary&rate={rate}"
    with (
        suppress(ConnectionClosed),
        connect(address, additional_headers=header, compression=None) as client,
    ):
        while True:
            if due <= time.perf_counter():
                message = make_message(len(sent))
                due = time.perf_counter() + random.uniform(0.5, 1.5) / CAMERA
                sent.append(time.perf_counter())
                client.send(message)
            with suppress(TimeoutError):
                frame = client.recv(max(0.0, due - time.perf_counter()))
                if isinstance(frame, bytes):
                    frames, number = frames + 1, HEAD.unpack_from(frame)[5]
                    if number > answered:
                        answers.append(time.perf_counter() - sent[number])
                        answered = number
                    due = 0.0 if fingers == 1 else due
    return answers, frames
