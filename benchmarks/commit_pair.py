"""``python -m benchmarks commits``: processor time of a control period at two commits, by turns."""

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
from typing import Any

from digiclay.core.base.errors import DigiclayError

from .report import add_kind, kept, made_with, progress, table

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
EXAMPLES = """\
  python -m benchmarks commits v0.1.0             the last release beside HEAD
  python -m benchmarks commits v0.1.0 main --turns 9
"""
#: Longest run of one commit, s.
LONGEST = 600.0


def add(kinds: Any) -> None:
    """Add this benchmark to the parser."""
    parser = add_kind(kinds, "commits", "time of a control period at two commits", EXAMPLES)
    parser.add_argument("old", help="commit, branch or tag")
    parser.add_argument("new", nargs="?", default="HEAD", help="another one, by default HEAD")
    parser.add_argument("--turns", type=int, default=5, metavar="N", help="runs of each commit, default 5")
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> None:
    """Time both commits by turns, and print the ratios turn by turn."""
    turns, count = (2, 200) if arguments.quick else (max(arguments.turns, 1), 1000)
    names = (arguments.old, arguments.new)
    with tempfile.TemporaryDirectory() as scratch, progress(arguments, "commits", 2 * turns) as bar:
        trees = [extract(name, Path(scratch) / str(number)) for number, name in enumerate(names)]
        rounds = []
        for _ in range(turns):
            times = []
            for name, tree in zip(names, trees, strict=True):
                times.append(run(tree, name, count))
                bar(name)
            rounds.append(times)
    head = ["case", f"{names[0]} (µs)", f"{names[1]} (µs)", "ratio", "least", "largest"]
    rows = []
    for number, case in enumerate(CASES):
        old, new = ([1e6 * turn[which][number] for turn in rounds] for which in (0, 1))
        ratios = [after / before for before, after in zip(old, new, strict=True)]
        figures = (statistics.median(old), statistics.median(new))
        spread = (statistics.median(ratios), min(ratios), max(ratios))
        rows.append([case, *(f"{one:.1f}" for one in figures), *(f"{one:.2f}" for one in spread)])
    title = f"processor time of a control period, medians of {turns} turns; {made_with()}"
    text = "\n".join([title, "", *table(head, rows)])
    print(text)
    kept(arguments.out, "commits", text, head, rows)


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
