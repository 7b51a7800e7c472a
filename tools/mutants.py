"""Mutation test: one change at a time in the core's physics, engine, control and metrics, under its tests.

cosmic-ray makes the mutants. Its own runner writes each one into the source file and starts a Python for it;
here each is loaded in a fork of one process that has numpy, SciPy and pytest imported already. No file is
changed. tools/mutants.toml names the modules, and the few tests that judge each of them.

Without modules named, a sample is taken: the mutants whose text has the smallest hashes. It is the same in
every run, and an edit changes only what it touches.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.abc
import importlib.machinery
import importlib.util
import math
import os
import resource
import signal
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, ModuleType

import pytest
from mutation import ROOT, Mutant, mutants, sample

TABLE = ROOT / "tools" / "mutants.toml"
#: Memory a mutant may take, bytes; and how many times longer than without a mutation its tests may take.
MEMORY, PATIENCE = 6 * 2**30, 4.0
#: The longest that a test may take without one, s.
LONGEST = 300.0
#: Status of pytest where a mutant is noticed: failed, broken off, a fault inside, tests not imported.
NOTICED = (1, 2, 3, 4)


class Changed(importlib.abc.MetaPathFinder, importlib.machinery.SourceFileLoader):
    """Finds and loads one module with other source than its file has."""

    def __init__(self, name: str, path: Path, source: str) -> None:
        super().__init__(name, str(path))
        self._source = source

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Tell of the one module."""
        return (
            importlib.util.spec_from_file_location(fullname, self.path, loader=self)
            if fullname == self.name
            else None
        )

    def get_code(self, fullname: str) -> CodeType:
        """Return the changed code, and leave the caches alone."""
        return compile(self._source, self.path, "exec", dont_inherit=True)


def play(mutant: Mutant | None, tests: Sequence[str]) -> int:
    """Run tests on a mutant, or on none; return pytest's status."""
    if mutant:
        sys.meta_path.insert(0, Changed(f"digiclay.core.{mutant.module}", mutant.path, mutant.source()))
    options = [
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:xdist",
        "-W",
        "ignore::pytest.PytestAssertRewriteWarning",
    ]
    return int(pytest.main([*options, *tests]))


@dataclass
class Run:
    """Process that runs the tests of mutants."""

    mutant: Mutant | None
    judge: str
    limit: float
    started: float
    output: Path

    @property
    def said(self) -> str:
        """What the tests printed."""
        return self.output.read_text(errors="replace")


def fork(
    mutant: Mutant | None, name: str, tests: Sequence[str], limit: float, folder: Path
) -> tuple[int, Run]:
    """Start a process that judges, in a session of its own."""
    output = folder / f"{time.monotonic_ns()}.txt"
    process = os.fork()
    if process == 0:
        status = 3
        try:
            os.setsid()
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            with output.open("wb") as file:
                os.dup2(file.fileno(), 1)
                os.dup2(file.fileno(), 2)
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            status = play(mutant, tests)
        finally:
            os._exit(status)
    return process, Run(mutant, name, limit, time.monotonic(), output)


def judge(
    todo: Sequence[tuple[Mutant | None, str, float]], judges: dict[str, list[str]], workers: int, until: float
) -> Iterator[tuple[Run, int | None, float]]:
    """Judge mutants, so many at a time; yield each with its status (None: too slow) and time, s."""
    waiting, running = list(reversed(todo)), dict[int, Run]()
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as left:
        left.callback(lambda: [end(process) for process in running])
        while running or (waiting and time.monotonic() < until):
            while waiting and len(running) < workers and time.monotonic() < until:
                mutant, name, limit = waiting.pop()
                process, run = fork(mutant, name, judges[name], limit, Path(folder))
                running[process] = run
            time.sleep(0.02)
            for process, run in list(running.items()):
                took = time.monotonic() - run.started
                done, status = os.waitpid(process, os.WNOHANG)
                if done or took > run.limit:
                    end(process)
                    if not done:
                        os.waitpid(process, 0)
                    del running[process]
                    yield run, os.waitstatus_to_exitcode(status) if done else None, took


def end(process: int) -> None:
    """End a process that judges, and all that it has started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process, signal.SIGKILL)


def judges_of(table: Path) -> dict[str, list[str]]:
    """Return the tests that judge each module."""
    read = tomllib.loads(table.read_text(encoding="utf-8"))
    return {module: [*own, *read["every"]] for module, own in read["modules"].items()}


def undisturbed(judges: dict[str, list[str]], workers: int) -> dict[str, float]:
    """Return how long each test takes without a mutant, s; they must pass."""
    alone = {test: [test] for tests in judges.values() for test in tests}
    times: dict[str, float] = {}
    for run, status, took in judge([(None, test, LONGEST) for test in alone], alone, workers, math.inf):
        if status != 0:
            print(run.said, flush=True)
            raise SystemExit(f"mutants: FAILED (without a mutant, {run.judge} ends with status {status})")
        times[run.judge] = took
    return times


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("modules", nargs="*", help="modules of the core, all of whose mutants are judged")
    parser.add_argument("--count", type=int, default=150, help="mutants of the sample")
    parser.add_argument("--limit", type=float, default=1e6, help="begin no mutant after so long, s")
    parser.add_argument("--most", type=float, default=1.0, help="share that may survive")
    parser.add_argument("--report", type=Path, help="file the outcome is written to as well")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)), help="at a time")
    return parser.parse_args()


def main() -> int:
    """Judge what the command line asks for, and write the report."""
    given, judges, started = arguments(), judges_of(TABLE), time.monotonic()
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))  # ends its processes too
    unknown = [module for module in given.modules if module not in judges]
    if unknown:
        raise SystemExit(f"{TABLE.name} has no module {', '.join(unknown)}")
    os.chdir(ROOT)
    os.environ["DIGICLAY_HYPOTHESIS"] = "first_failure"
    for name in ("numpy", "hypothesis", "scipy.integrate", "scipy.interpolate"):
        importlib.import_module(name)  # once, and not in every fork

    every = [one for module in given.modules or judges for one in mutants(module)]
    chosen = every if given.modules else sample(every, given.count)
    judges = {module: judges[module] for module in sorted({one.module for one in chosen})}
    times = undisturbed(judges, given.workers)
    limits = {
        module: 10.0 + PATIENCE * sum(times[test] for test in tests) for module, tests in judges.items()
    }
    todo = [(one, one.module, limits[one.module]) for one in chosen]
    killed, broken, survivors = 0, [], []
    for run, status, _ in judge(todo, judges, given.workers, started + given.limit):
        if status == 0:
            survivors.append(f"survived: {run.mutant.said() if run.mutant else ''}")
            print(survivors[-1], flush=True)  # seen also where the run is broken off
        elif status is None or status < 0 or status in NOTICED:
            killed += 1
        else:
            broken.append(f"broken: {run.mutant}: pytest ended with status {status}")
    judged = killed + len(survivors)
    share = len(survivors) / judged if judged else 1.0
    # A sample most of which there was no time for is none.
    bad = bool(broken) or share > given.most or judged <= len(chosen) // 2
    took = time.monotonic() - started
    lines = [
        f"mutants: {'FAILED' if bad else 'passed'}: {judged} judged of {len(chosen)} out of {len(every)}: "
        f"{killed} noticed, {len(survivors)} survived ({share:.0%}; {given.most:.0%} may), in {took:.0f} s",
        *broken,
        *sorted(survivors),
    ]
    print("\n".join(lines))
    if given.report:
        given.report.parent.mkdir(exist_ok=True)
        given.report.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
