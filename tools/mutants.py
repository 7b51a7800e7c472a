"""Mutation test: one change at a time in the core's physics, engine, control and metrics, under its tests.

cosmic-ray makes the mutants. Its own runner writes each one into the source file and starts a Python for it;
here each is loaded in a fork of one process that has numpy, SciPy and pytest imported already. No file is
changed. A first run of the tests finds which of them execute each line, and how long they take; a mutant is
judged by the quickest that execute its line.

Without modules named, a sample is taken: the mutants whose text has the smallest hashes. It is the same in
every run, and an edit changes only what it touches.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import importlib.machinery
import importlib.util
import math
import os
import pickle
import re
import resource
import signal
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, ModuleType

import coverage
import pytest
from mutation import CORE, ROOT, Mutant, mutants, sample

#: Packages of the core that are changed, but modules that only declare or list.
PACKAGES, DECLARING = ("model", "steppers", "engine", "control", "metrics"), ("methods", "interfaces")
#: Folders of the tests that may judge; of those that execute a line, the quickest so many and so long, s.
FOLDERS, MOST, JUDGING = ("unit", "property", "scenes", "regression", "convergence"), 40, 12.0
#: Tests that judge every mutant, after its own.
EVERY = ["tests/regression/test_golden_run.py", "tests/regression/test_old_formats.py"]
OPTIONS = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
OPTIONS += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]
#: Memory a mutant may take, bytes; the time of its tests, in times of what they take without one and s more.
MEMORY, PATIENCE, ALLOWANCE = 6 * 2**30, 4.0, 40.0
#: The longest that the first run of the tests may take, s.
LONGEST = 900.0
#: Status of pytest where a mutant is noticed: failed, broken off, a fault inside, tests not imported.
NOTICED = (1, 2, 3, 4)
Lines = dict[tuple[str, int], list[str]]


class Changed(importlib.machinery.SourceFileLoader):
    """Finds and loads one module with other source than its file has."""

    def __init__(self, name: str, path: Path, source: str) -> None:
        super().__init__(name, str(path))
        self._source = source

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Return the loader of the one module."""
        if fullname != self.name:
            return None
        return importlib.util.spec_from_file_location(fullname, self.path, loader=self)

    def get_code(self, fullname: str) -> CodeType:
        """Return the changed code, and leave the caches alone."""
        return compile(self._source, self.path, "exec", dont_inherit=True)


class Tracer:
    """Plugin of pytest that records which lines of the core each test executes, and how long it takes, s."""

    def __init__(self) -> None:
        source = [str(CORE / package) for package in PACKAGES]
        self.coverage = coverage.Coverage(data_file=None, source=source, config_file=False)
        self.times: dict[str, float] = defaultdict(float)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add the time of a phase of a test; one that fails judges nothing."""
        self.times[report.nodeid] += math.inf if report.failed else report.duration

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Ascribe what is executed to the test."""
        self.coverage.switch_context(item.nodeid)
        yield
        self.coverage.switch_context("")

    def run(self, files: Sequence[str], output: Path) -> int:
        """Run files of tests, and write the tests of each line and the times of all."""
        self.coverage.start()
        pytest.main([*OPTIONS, *files], plugins=[self])
        self.coverage.stop()
        data, lines = self.coverage.get_data(), {}
        for path in data.measured_files():
            for line, tests in data.contexts_by_lineno(path).items():
                lines[path, line] = [test for test in tests if self.times.get(test, math.inf) < math.inf]
        output.write_bytes(pickle.dumps((lines, dict(self.times))))
        return 0


def judge(mutant: Mutant, tests: Sequence[str]) -> int:
    """Run tests on a mutant; return pytest's status."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    changed = Changed(f"digiclay.core.{mutant.module}", mutant.path, mutant.source())
    sys.meta_path.insert(0, changed)  # type: ignore[arg-type]
    return int(pytest.main(["-x", *OPTIONS, *tests]))


@dataclass
class Task:
    """What a fork does; its name, what it returns a status of, and the longest it may take, s."""

    name: str
    work: Callable[[], int]
    limit: float
    started: float = 0.0


def fork(task: Task, output: Path) -> int:
    """Start a task in a process and a session of its own, which writes into a file."""
    task.started, process = time.monotonic(), os.fork()
    if process == 0:
        status = 3
        try:
            os.setsid()
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            with output.open("wb") as file:
                os.dup2(file.fileno(), 1)
                os.dup2(file.fileno(), 2)
            status = task.work()
        finally:
            os._exit(status)
    return process


def end(process: int) -> None:
    """End a process, and all that it has started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process, signal.SIGKILL)


def run(todo: Sequence[Task], workers: int, until: float, folder: Path) -> Iterator[tuple[Task, int | None]]:
    """Run tasks, so many at a time; yield each with its status (None: too slow), begun until a time."""
    waiting, running = list(reversed(todo)), dict[int, Task]()
    with contextlib.ExitStack() as left:
        left.callback(lambda: [end(process) for process in running])
        while running or (waiting and time.monotonic() < until):
            while waiting and len(running) < workers and time.monotonic() < until:
                task = waiting.pop()
                running[fork(task, folder / f"{task.name}.txt")] = task
            time.sleep(0.02)
            for process, task in list(running.items()):
                done, status = os.waitpid(process, os.WNOHANG)
                if done or time.monotonic() - task.started > task.limit:
                    end(process)
                    if not done:
                        os.waitpid(process, 0)
                    del running[process]
                    yield task, os.waitstatus_to_exitcode(status) if done else None


def list_files() -> list[str]:
    """Return the files of tests that import what is changed, or assemble it."""
    mark = re.compile(rf"digiclay\.core\.({'|'.join(PACKAGES)})\b|tests\.assemble|tests\.reliefs")
    files = (path for name in FOLDERS for path in sorted((ROOT / "tests" / name).glob("test_*.py")))
    found = [str(path.relative_to(ROOT)) for path in files if mark.search(path.read_text(encoding="utf-8"))]
    return sorted({*found, *EVERY})


def trace(workers: int, folder: Path) -> tuple[Lines, dict[str, float]]:
    """Run the tests that may judge; return the tests that execute each line, and the times of all, s."""
    files, lines, times = list_files(), defaultdict[tuple[str, int], list[str]](list), dict[str, float]()
    outputs = [folder / f"{i}.pickle" for i in range(workers)]
    tasks = [
        Task(output.stem, lambda i=i, output=output: Tracer().run(files[i::workers], output), LONGEST)
        for i, output in enumerate(outputs)
    ]
    for task, status in run(tasks, workers, math.inf, folder):
        if status != 0:
            print((folder / f"{task.name}.txt").read_text(errors="replace")[-4000:])
            raise SystemExit(f"mutants: FAILED (the first run of the tests ended with status {status})")
    for output in outputs:
        found, took = pickle.loads(output.read_bytes())
        times |= took
        for line, tests in found.items():
            lines[line] += tests
    failed = [test for test, took in times.items() if took == math.inf]
    if any(test.partition("::")[0] in EVERY for test in failed):
        raise SystemExit(f"mutants: FAILED (without a mutation, these fail: {', '.join(failed)})")
    if failed:  # while it is traced, such as one that counts calls
        print(f"not among the judges: {', '.join(failed)}", flush=True)
    return lines, times


def choose(mutant: Mutant, lines: Lines, times: dict[str, float]) -> list[str]:
    """Return the tests that judge a mutant: the quickest that execute its line.

    A line that is executed at import is judged by the quickest tests of each line of its module.
    """
    path = str(mutant.path)
    judges = set(lines.get((path, mutant.line), ()))
    if not judges:
        several = [
            sorted(tests, key=times.__getitem__)[:3] for (file, _), tests in lines.items() if file == path
        ]
        judges = {test for tests in several for test in sorted(tests, key=times.__getitem__)[:3]}
    chosen, total = [], 0.0
    for test in sorted(judges, key=times.__getitem__)[:MOST]:
        total += times[test]
        if total > JUDGING and chosen:
            break
        chosen.append(test)
    return [*chosen, *EVERY]


def list_modules() -> list[str]:
    """Return the modules of the core that are changed."""
    files = (path for package in PACKAGES for path in sorted((CORE / package).glob("*.py")))
    return [f"{path.parent.name}.{path.stem}" for path in files if path.stem not in ("__init__", *DECLARING)]


def read_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("modules", nargs="*", help="modules of the core, all of whose mutants are judged")
    parser.add_argument("--count", type=int, default=150, help="mutants of the sample")
    parser.add_argument("--limit", type=float, default=1e6, help="begin no mutant after so long, s")
    parser.add_argument("--most", type=float, default=1.0, help="share that may survive")
    parser.add_argument("--report", type=Path, help="file the outcome is written to as well")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)), help="at a time")
    return parser.parse_args()


def judge_all(chosen: Sequence[Mutant], given: argparse.Namespace, started: float) -> tuple[int, list[str]]:
    """Judge mutants; return how many are noticed, and the lines of those that survive."""
    killed, survivors = 0, []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        lines, times = trace(given.workers, folder)
        tasks, by_name = [], dict[str, Mutant]()
        for number, mutant in enumerate(chosen):
            tests = choose(mutant, lines, times)
            limit = ALLOWANCE + PATIENCE * sum(times.get(test, 0.0) for test in tests)
            by_name[f"mutant{number}"] = mutant
            tasks.append(Task(f"mutant{number}", lambda m=mutant, t=tests: judge(m, t), limit))
        for task, status in run(tasks, given.workers, started + given.limit, folder):
            if status == 0:
                survivors.append(f"survived: {by_name[task.name].describe()}")
                print(survivors[-1], flush=True)  # seen also where the run is broken off
            elif status is None or status < 0 or status in NOTICED:
                killed += 1
            else:
                raise SystemExit(f"mutants: FAILED ({by_name[task.name]}: pytest ended with status {status})")
    return killed, survivors


def main() -> int:
    """Judge what the command line asks for, and write the report."""
    given, known, started = read_arguments(), list_modules(), time.monotonic()
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))  # ends its processes too
    unknown = [module for module in given.modules if module not in known]
    if unknown:
        raise SystemExit(f"MODULES must be of {', '.join(known)} (got {', '.join(unknown)})")
    os.chdir(ROOT)
    os.environ["DIGICLAY_HYPOTHESIS"] = "first_failure"
    for name in ("numpy", "hypothesis", "scipy.integrate", "scipy.interpolate"):
        importlib.import_module(name)  # once, and not in every fork

    every = [mutant for module in given.modules or known for mutant in mutants(module)]
    chosen = every if given.modules else sample(every, given.count)
    killed, survivors = judge_all(chosen, given, started)
    judged = killed + len(survivors)
    share = len(survivors) / judged if judged else 1.0
    # A sample most of which there was no time for is none.
    bad = share > given.most or judged <= len(chosen) // 2
    text = (
        f"mutants: {'FAILED' if bad else 'passed'}: {judged} judged of {len(chosen)} out of {len(every)}: "
        f"{killed} noticed, {len(survivors)} survived ({share:.0%}; {given.most:.0%} may), "
        f"in {time.monotonic() - started:.0f} s\n" + "".join(f"{line}\n" for line in sorted(survivors))
    )
    print(text, end="")
    if given.report:
        given.report.parent.mkdir(exist_ok=True)
        given.report.write_text(text, encoding="utf-8")
    return int(bad)


if __name__ == "__main__":
    sys.exit(main())
