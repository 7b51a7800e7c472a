"""Sweeps while they run: any executor, a stop half way, a point or a worker that goes wrong."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest
from digiclay.cli import main
from digiclay.commands.evaluator import Evaluator, evaluate_elsewhere, finish
from digiclay.commands.worker import Processes
from digiclay.core.base.errors import DigiclayError, OutputError
from digiclay.core.scene.scene_source import Setting, find
from digiclay.core.studies.axes import Point, Record, make_points, read_axis
from digiclay.core.studies.evaluation import evaluate, evaluate_bundle

from tests.timeouts import TIMEOUT, wait_until

#: A tenth of a second of a scene is enough for most of this.
SHORT = [Setting("simulation.duration", "0.1")]
ADDON = Path(__file__).parents[2] / "addon"
#: Beds of different sizes, which run one at a time.
MANY = ["sweep", "slow_press", "--vary", "layout.rows=20:29:10", "--workers", "2", "--quiet"]
#: The same, each a second long.
QUICK = [*MANY, "--set", "simulation.duration=1"]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def some(count: int = 3) -> list[Point]:
    """Return the points of a small sweep."""
    return make_points(find("slow_press"), SHORT, [read_axis(f"valve_lag.time_constant=1 ms:2 ms:{count}")])


def finished(executor: Executor, task: Any, todo: list[Point], **known: Any) -> dict[int, Record]:
    """Run points, each in a bundle of its own; return what was kept."""
    done: dict[int, Record] = {}
    finish(
        executor, task, [(point,) for point in todo],
        lambda bundle, records: done.update({bundle[0].index: records[0]}),
        lambda bundle, why: done.update({bundle[0].index: {"error": why}}),
        **{"stopped": lambda: False, **known},
    )  # fmt: skip
    return done


def test_any_executor_will_do() -> None:
    with ThreadPoolExecutor(2) as threads:
        in_threads = finished(threads, evaluate_bundle, some())
    # Processes that are started afresh get and give values: nothing of this one is theirs.
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as processes:
        in_processes = finished(processes, partial(evaluate_bundle, errors=True), some())
    figures = [[done[i]["figures"]["rfd"] for i in range(3)] for done in (in_threads, in_processes)]
    assert figures[0] == figures[1]
    assert "height_error" in in_processes[2]["figures"]


def test_a_point_that_fails_is_recorded_and_a_stopped_one_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = some()[0].scene
    assert scene is not None
    assert evaluate(scene, stopped=lambda: True) is None

    def faulty(*given: Any, **known: Any) -> None:
        raise ZeroDivisionError("one line\nand another")

    monkeypatch.setattr("digiclay.core.studies.evaluation.run", faulty)
    assert evaluate(scene) == {"error": "ZeroDivisionError: one line and another"}


def test_after_a_stop_nothing_is_begun_and_what_is_done_stays() -> None:
    begun: list[Point] = []
    asked = threading.Semaphore(0)

    def task(bundle: list[Point]) -> list[Record | None]:
        begun.extend(bundle)
        # Asked once more after it was told to stop, it has given up what was not begun.
        assert asked.acquire(timeout=TIMEOUT)
        assert asked.acquire(timeout=TIMEOUT)
        return [{"figures": {}}]

    def stopped() -> bool:
        if begun:
            asked.release()
        return bool(begun)

    with ThreadPoolExecutor(1) as one:
        done = finished(one, task, some(9), stopped=stopped)
    assert (len(begun), len(done)) == (1, 1)


def test_a_piece_whose_task_fails_is_told_of_and_the_others_go_on() -> None:
    def task(bundle: list[Point]) -> list[Record | None]:
        if bundle[0].index == 1:
            raise DigiclayError("killed too often")
        if bundle[0].index == 2:
            raise KeyError("own fault")
        return [{"figures": {}}]

    with ThreadPoolExecutor(1) as threads:
        assert finished(threads, task, some(4)) == {
            0: {"figures": {}},
            1: {"error": "killed too often"},
            2: {"error": "KeyError: 'own fault'"},
            3: {"figures": {}},
        }


def test_workers_that_die_are_told_in_one_line() -> None:
    def die(bundle: list[Point]) -> list[Record | None]:
        raise BrokenExecutor("gone")

    with ThreadPoolExecutor(1) as threads, pytest.raises(OutputError, match=r"gone What is done is kept"):
        finished(threads, die, some())


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The table of a sweep that nobody stopped."""
    out = tmp_path_factory.mktemp("sweep") / "whole"
    assert main([*QUICK, "--workers", "1", "--out", str(out)]) == 0
    return (out / "sweep.csv").read_bytes()


def interrupted(out: Path, number: int) -> tuple[int, str]:
    """Run a sweep that gets a signal as soon as it has kept its second point; return exit code and stderr."""
    script = (
        "import os\n"
        "from digiclay.core.studies.sweep_plan import Folder\n"
        "keep, kept = Folder.keep, []\n"
        "def told(*given):\n"
        "    keep(*given)\n"
        "    kept.append(given)\n"
        "    if len(kept) == 2:\n"
        f"        os.kill(os.getpid(), {int(number)})\n"
        "Folder.keep = told\n"
        "from digiclay.cli import console; console()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, *QUICK, "--out", str(out)], capture_output=True, text=True,
        timeout=TIMEOUT, env={**os.environ, "PYTHONPATH": str(ADDON)},
    )  # fmt: skip
    return done.returncode, done.stderr


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_sweep_stopped_half_way_keeps_what_is_done_and_goes_on_from_there(
    number: int, here: Path, whole: bytes
) -> None:
    assert interrupted(here / "out", number) == (130, "")
    files = {path: path.stat().st_mtime_ns for path in (here / "out").glob("points/*")}
    assert 2 <= len(files) < 10
    assert all("figures" in json.loads(path.read_text(encoding="utf-8")) for path in files)
    assert not (here / "out" / "sweep.csv").exists()
    assert main([*QUICK, "--out", "out"]) == 0
    assert {path: path.stat().st_mtime_ns for path in files} == files
    assert (here / "out" / "sweep.csv").read_bytes() == whole


@pytest.mark.skipif(os.name == "nt", reason="Windows has no process groups to signal")
def test_ctrl_c_on_a_terminal_ends_sessions_of_hours_without_a_word(here: Path) -> None:
    hours = ["--set", "simulation.duration=1e4", "--set", "recorder.every=1000"]
    script = "from digiclay.cli import console; console()"
    started = subprocess.Popen(
        [sys.executable, "-c", script, *MANY, *hours, "--out", "out"], stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(ADDON)}, start_new_session=True,
    )  # fmt: skip
    try:
        wait_until((here / "out" / "sweep.json").exists)
        time.sleep(3.0)  # the workers run or are being started; a terminal sends Ctrl-C to them as well
        os.killpg(started.pid, signal.SIGINT)
        _, err = started.communicate(timeout=TIMEOUT)  # the sessions would take hours
    finally:
        if started.poll() is None:
            os.killpg(started.pid, signal.SIGKILL)
    assert (started.returncode, err, list((here / "out").glob("points/*"))) == (130, "", [])


def idle() -> Processes:
    """Return the processes of a series that nobody stops."""
    return Processes(lambda: False, lambda: None)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_a_sweep_whose_worker_is_killed_comes_to_the_same_table(here: Path, whole: bytes) -> None:
    out = here / "out"
    sweep = subprocess.Popen(
        [sys.executable, "-m", "digiclay", *QUICK, "--out", str(out)], stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(ADDON)},
    )  # fmt: skip
    wait_until(lambda: list(out.glob("points/*.json")))
    told = subprocess.run(["ps", "-A", "-o", "pid=,ppid="], capture_output=True, text=True, check=True).stdout
    pairs = [tuple(map(int, line.split())) for line in told.splitlines()]
    worker, *_ = (pid for pid, parent in pairs if parent == sweep.pid)
    os.kill(worker, signal.SIGKILL)
    _, err = sweep.communicate(timeout=TIMEOUT)
    assert (sweep.returncode, err) == (0, "")
    assert (out / "sweep.csv").read_bytes() == whole


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_a_bundle_that_no_worker_survives_is_told() -> None:
    with idle() as processes:
        dead = []
        for _ in range(2):
            worker = processes.start(Evaluator)
            assert worker is not None
            worker.process.kill()
            dead.append(worker)
        with pytest.raises(DigiclayError, match=r"A worker died twice of this \(signal 9\)"):
            evaluate_elsewhere(processes, dead, some(2), errors=False)


def test_a_worker_is_out_of_reach_of_ctrl_c_and_ends_when_it_cannot_read_its_bundle() -> None:
    with idle() as processes:
        worker = processes.start(Evaluator)
        assert worker is not None
        if os.name != "nt":
            assert os.getpgid(worker.process.pid) != os.getpgid(0)
        worker.input.write(b"cdigiclay.no_such_module\nPoint\n.")  # as another version may send it
        worker.input.flush()
        assert worker.process.wait(TIMEOUT) == 0


def test_after_a_stop_a_bundle_has_no_records() -> None:
    processes = Processes(lambda: True, lambda: None)
    assert processes.stopped()
    assert evaluate_elsewhere(processes, [], some(2), errors=False) == [None, None]
