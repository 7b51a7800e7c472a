"""Benchmark ``commits``: processor time of a control period at two commits, by turns."""

from __future__ import annotations

import argparse
import io
import json
import os
import statistics
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from digiclay.commands.progress import table
from digiclay.core.base.errors import DigiclayError

from .report import Report, Steps, cells

ROOT = Path(__file__).parents[1]
#: Cases and their settings of the session.
CASES: dict[str, tuple[str, ...]] = {
    "Method I": (),
    "no control": ("control=absent",),
    "force noise 2 mN": ("sensors.force_noise=2 mN",),
    "Method II": ("control.method=cell_states",),
    "Method III": ("control.method=hybrid",),
}
#: Run at both commits: prints the least processor time of a control period in each case, s.
PROGRAM = """
import json, sys, time
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load

def measure(settings):
    scene = load(find("ridge_mound_valley"), [Setting(*one.split("=", 1)) for one in settings])
    system, count, times = assemble(scene), int(sys.argv[2]), []
    for _ in range(3):
        start = time.process_time()
        for _ in periods(system, scene.trajectories(), begin(system), count):
            pass
        times.append((time.process_time() - start) / count)
    return min(times)

print(json.dumps([measure(settings) for settings in json.loads(sys.argv[1])]))
"""
#: Longest run of one commit, s.
LONGEST = 600.0


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Time both commits by turns."""
    turns, count = (2, 200) if arguments.quick else (max(arguments.turns, 1), 1000)
    names = (arguments.old, arguments.new)
    with tempfile.TemporaryDirectory() as scratch:
        trees = [extract(name, Path(scratch) / str(number)) for number, name in enumerate(names)]
        jobs = steps.through([*zip(trees, names, strict=True)] * turns, lambda job: str(job[1]))
        times = [[1e6 * time for time in run(tree, name, count)] for tree, name in jobs]
    head = ["case", f"{names[0]} (µs)", f"{names[1]} (µs)", "ratio", "least", "largest"]
    rows = []
    for case, old, new in zip(
        CASES, zip(*times[::2], strict=True), zip(*times[1::2], strict=True), strict=True
    ):
        ratios = [after / before for before, after in zip(old, new, strict=True)]
        figures = statistics.median(old), statistics.median(new), statistics.median(ratios)
        rows.append(cells("s .1f .1f .2f .2f .2f", case, *figures, min(ratios), max(ratios)))
    title = f"processor time of a control period, medians of {turns} turns"
    return Report(["", title, "", *table(head, rows)], head, rows)


def extract(commit: str, folder: Path) -> Path:
    """Unpack the extension's package at a commit into a folder, and return the folder of its imports."""
    git = ["git", "-c", "safe.directory=*", "archive", commit, "addon"]
    done = subprocess.run(git, cwd=ROOT, capture_output=True, timeout=LONGEST, check=False)
    if done.returncode:
        raise DigiclayError(f"commits: {commit} must be a commit, branch or tag of this checkout.")
    with tarfile.open(fileobj=io.BytesIO(done.stdout)) as archive:
        archive.extractall(folder, filter="data")
    return folder / "addon"


def run(tree: Path, commit: str, count: int) -> list[float]:
    """Return the time of a control period in each of `CASES`, s, by the package in a folder."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"}
    words = [sys.executable, "-c", PROGRAM, json.dumps(list(CASES.values())), str(count)]
    done = subprocess.run(
        words, cwd=tree, env=environment, capture_output=True, text=True, timeout=LONGEST, check=False
    )
    if done.returncode:
        why = done.stderr.strip().rpartition("\n")[2]
        raise DigiclayError(f"commits: {commit} cannot be timed: {why}.")
    times: list[float] = json.loads(done.stdout)
    return times
