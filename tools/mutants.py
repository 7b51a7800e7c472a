"""Mutation test: one change at a time in the core's physics, engine, control and metrics, under its tests.

cosmic-ray makes the mutants. Its own runner writes each one into the source file and starts a Python for it;
here each is loaded in a fork of one process that has numpy, SciPy and pytest imported already. No file is
changed. A first run of the tests finds which of them execute each line, and how long they take: a mutant is
judged by some that execute its line.

Without modules named, a sample is taken: the mutants whose text has the smallest hashes. It is the same in
every run, and an edit changes only what it touches.
"""

import argparse
import contextlib
import functools
import importlib
import math
import os
import pickle
import re
import resource
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType

import coverage
import pytest
from mutation import CORE, ROOT, Mutant, Place, find_places, mutants, sample

#: Packages of the core that are changed, but modules that only declare or list.
PACKAGES, DECLARING = ("model", "steppers", "engine", "control", "metrics"), ("methods", "interfaces")
#: Folders of the tests that may judge, and how long those of a mutant take, s of processor time.
FOLDERS, JUDGING = ("unit", "property", "scenes", "regression", "convergence"), 12.0
#: Tests that judge every mutant, after its own.
EVERY = ("tests/regression/test_golden_run.py", "tests/regression/test_old_formats.py")
OPTIONS = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
OPTIONS += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]
#: Memory a mutant may take, bytes; processor time, in times of what its tests take without it, and s more.
MEMORY, PATIENCE, ALLOWANCE = 6 * 2**30, 4.0, 20.0
#: The longest that the first run of the tests may take, s; and a test in it, s of processor time.
LONGEST, LONG = 900.0, 5.0
#: Status of pytest where no test was run. Any other but 0 says that a mutant is noticed.
NOT_RUN = 5
Lines = dict[Place, set[str]]
#: By name: what a process does, and the longest that it may take, s.
Tasks = dict[str, tuple[Callable[[], int], float]]


class Tracer:
    """Plugin of pytest: which lines of the core each test executes, and its processor time, s."""

    def __init__(self) -> None:
        source = [str(CORE / package) for package in PACKAGES]
        self.coverage = coverage.Coverage(data_file=None, source=source, config_file=False)
        self.times: dict[str, float] = defaultdict(float)
        self.slow: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Let no test judge that fails."""
        self.times[report.nodeid] += 0.0 if report.passed else math.inf

    @contextlib.contextmanager
    def limit(self, item: pytest.Item) -> Iterator[None]:
        """Let a part of a test fail that takes long, and try no other row of it."""
        name = item.nodeid.partition("[")[0]

        def stop(number: int, frame: object) -> None:
            self.slow.add(name)
            pytest.fail("too long for a judge")

        if name in self.slow:
            pytest.skip("too long for a judge")
        signal.signal(signal.SIGPROF, stop)
        signal.setitimer(signal.ITIMER_PROF, 0.0 if name.startswith(EVERY) else LONG)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> Iterator[None]:
        """Limit the fixtures."""
        with self.limit(item):
            yield

    pytest_runtest_call = pytest_runtest_setup

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        """Ascribe what is executed to the test."""
        before = sum(os.times()[:4])
        self.coverage.switch_context(item.nodeid)
        done = yield
        self.coverage.switch_context("")
        self.times[item.nodeid] += sum(os.times()[:4]) - before
        return done

    def run(self, files: Sequence[str], output: Path) -> int:
        """Run files of tests, and write the tests of each line and the times of all."""
        for module in list_modules():  # lines executed at import are ascribed to no test
            importlib.import_module(f"digiclay.core.{module}")
        self.coverage.start()
        pytest.main([*OPTIONS, *files], plugins=[self])
        self.coverage.stop()
        data, lines = self.coverage.get_data(), {}
        for path in data.measured_files():
            for line, tests in data.contexts_by_lineno(path).items():
                lines[path, line] = {test for test in tests if self.times.get(test, math.inf) < math.inf}
        output.write_bytes(pickle.dumps((lines, dict(self.times))))
        return 0


def judge(mutant: Mutant, tests: Sequence[str], limit: int) -> int:
    """Run tests on a mutant, so long, s of processor time; return pytest's status."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
    source, load = mutant.source(), SourceFileLoader.get_code

    def load_changed(loader: SourceFileLoader, name: str) -> CodeType | None:
        changed = name == f"digiclay.core.{mutant.module}"
        return compile(source, loader.path, "exec", dont_inherit=True) if changed else load(loader, name)

    SourceFileLoader.get_code = load_changed  # type: ignore[assignment,method-assign]
    return int(pytest.main(["-x", *OPTIONS, *tests]))


def start(work: Callable[[], int], output: Path) -> int:
    """Start a function in a process and a session of its own, which writes into a file."""
    if process := os.fork():
        return process
    status = 3
    try:
        os.setsid()
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        with output.open("wb") as file:
            os.dup2(file.fileno(), 1)
            os.dup2(file.fileno(), 2)
        status = work()
    finally:
        os._exit(status)


def end(processes: Iterable[int]) -> None:
    """End processes, and all that they have started."""
    for process in processes:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process, signal.SIGKILL)


def run(todo: Tasks, workers: int, until: float, folder: Path) -> Iterator[tuple[str, int | None]]:
    """Run functions begun until a time, so many at once; yield name and status (None: too slow) of each."""
    waiting, running = list(reversed(todo)), dict[int, tuple[str, float]]()
    with contextlib.ExitStack() as left:
        left.callback(end, running)
        while running or (waiting and time.monotonic() < until):
            while waiting and len(running) < workers and time.monotonic() < until:
                work, limit = todo[name := waiting.pop()]
                running[start(work, folder / f"{name}.txt")] = name, time.monotonic() + limit
            time.sleep(0.02)
            for process, (name, last) in list(running.items()):
                done, status = os.waitpid(process, os.WNOHANG)
                if done or time.monotonic() > last:
                    end([process])
                    del running[process]
                    yield name, os.waitstatus_to_exitcode(status) if done else None


def list_files() -> list[str]:
    """Return the files of tests that import what is changed, or assemble it."""
    mark = re.compile(rf"core\.({'|'.join(PACKAGES)}|scene\.schema)\b|tests\.(assemble|reliefs)")
    files = (path for name in FOLDERS for path in sorted((ROOT / "tests" / name).glob("test_*.py")))
    importing = [
        str(path.relative_to(ROOT)) for path in files if mark.search(path.read_text(encoding="utf-8"))
    ]
    return sorted({*importing, *EVERY})


def trace(workers: int, folder: Path) -> tuple[Lines, dict[str, float]]:
    """Run the tests that may judge; return the tests that execute each line, and the times of all, s."""
    files, lines, times = list_files(), defaultdict[Place, set[str]](set), dict[str, float]()
    outputs = [folder / f"{i}.pickle" for i in range(workers)]
    todo = {
        output.stem: (functools.partial(Tracer().run, files[i::workers], output), LONGEST)
        for i, output in enumerate(outputs)
    }
    for name, status in run(todo, workers, math.inf, folder):
        if status != 0:
            print((folder / f"{name}.txt").read_text(errors="replace")[-4000:])
            raise SystemExit(f"mutants: FAILED (the first run of the tests ended with status {status})")
    for output in outputs:
        traced, took = pickle.loads(output.read_bytes())
        times |= took
        for line, tests in traced.items():
            lines[line] |= tests
    failed = [test for test, took in times.items() if took == math.inf]
    if any(test.startswith(EVERY) for test in failed):
        raise SystemExit(f"mutants: FAILED (without a mutation, these fail: {', '.join(failed)})")
    if failed:  # while it is traced, such as one that counts calls
        print(f"not among the judges: {', '.join(failed)}", flush=True)
    return lines, times


def choose(mutant: Mutant, lines: Lines, times: dict[str, float]) -> list[str]:
    """Return the tests that judge a mutant, of those that execute its line.

    In turn one that executes little but its module, one that executes much of it as well, and one of another
    file. A line that is executed at import is judged by tests of lines which use the name it defines.
    """
    shown = find_places(mutant, {place for place, tests in lines.items() if tests})
    judges = sorted(set[str]().union(*(lines[place] for place in shown)), key=times.__getitem__)
    sizes = Counter(test for tests in lines.values() for test in tests)
    inner = Counter(test for place in lines if place[0] == str(mutant.path) for test in lines[place])
    files, ranks = Counter[str](), dict[str, int]()
    for test in judges:
        file = test.partition("::")[0]
        ranks[test] = files[file] = files[file] + 1
    orders = (
        sorted(judges, key=lambda test: inner[test] / sizes[test], reverse=True),
        sorted(judges, key=lambda test: inner[test] ** 2 / sizes[test], reverse=True),
        sorted(judges, key=ranks.__getitem__),
    )
    chosen, left = list[str](), JUDGING
    for test in dict.fromkeys(test for several in zip(*orders, strict=True) for test in several):
        if times[test] <= left:
            left -= times[test]
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


def judge_all(
    chosen: Sequence[Mutant], arguments: argparse.Namespace, started: float
) -> tuple[int, list[str]]:
    """Judge mutants; return how many are noticed, and the lines of those that survive."""
    killed, survivors = 0, []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        lines, times = trace(arguments.workers, folder)
        todo, by_name = Tasks(), {f"mutant{number}": mutant for number, mutant in enumerate(chosen)}
        for name, mutant in by_name.items():
            tests = choose(mutant, lines, times)
            limit = int(ALLOWANCE + PATIENCE * sum(times.get(test, 0.0) for test in tests))
            # It may wait, and other programs may run.
            todo[name] = functools.partial(judge, mutant, tests, limit), 4.0 * limit
        for name, status in run(todo, arguments.workers, started + arguments.limit, folder):
            if status == 0:
                survivors.append(f"survived: {by_name[name].describe()}")
                print(survivors[-1], flush=True)  # seen also where the run is broken off
            elif status == NOT_RUN:
                raise SystemExit(f"mutants: FAILED (no test is run of {by_name[name]})")
            else:
                killed += 1
    return killed, survivors


def main() -> int:
    """Judge what the command line asks for, and write the report."""
    arguments, modules, started = read_arguments(), list_modules(), time.monotonic()
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))  # ends its processes too
    unknown = [module for module in arguments.modules if module not in modules]
    if unknown:
        raise SystemExit(f"MODULES must be of {', '.join(modules)} (got {', '.join(unknown)})")
    os.chdir(ROOT)
    os.environ["DIGICLAY_HYPOTHESIS"] = "first_failure"
    for name in ("numpy", "hypothesis", "scipy.integrate", "scipy.interpolate"):
        importlib.import_module(name)  # once, and not in every fork

    every = [mutant for module in arguments.modules or modules for mutant in mutants(module)]
    chosen = every if arguments.modules else sample(every, arguments.count)
    killed, survivors = judge_all(chosen, arguments, started)
    judged = killed + len(survivors)
    share = len(survivors) / judged if judged else 1.0
    # A sample most of which there was no time for is none.
    bad = share > arguments.most or judged <= len(chosen) // 2
    text = (
        f"mutants: {'FAILED' if bad else 'passed'}: {judged} judged of {len(chosen)} out of {len(every)}: "
        f"{killed} noticed, {len(survivors)} survived ({share:.0%}; {arguments.most:.0%} may), "
        f"in {time.monotonic() - started:.0f} s\n" + "".join(f"{line}\n" for line in sorted(survivors))
    )
    print(text, end="")
    if arguments.report:
        arguments.report.parent.mkdir(exist_ok=True)
        arguments.report.write_text(text, encoding="utf-8")
    return int(bad)


if __name__ == "__main__":
    sys.exit(main())
