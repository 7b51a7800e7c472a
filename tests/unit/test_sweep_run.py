"""Sweeps while they run: any executor, a stop half way, a point or a worker that goes wrong."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import threading
import time
from concurrent.futures import BrokenExecutor, Executor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from digiclay.cli import main
from digiclay.commands.evaluator import Evaluator, evaluate_elsewhere, submit
from digiclay.commands.worker import Processes
from digiclay.core.base.errors import DigiclayError, OutputError
from digiclay.core.scene.scene_source import Setting, find
from digiclay.core.studies.axes import Point, Record, make_points, read_axis
from digiclay.core.studies.evaluation import evaluate
from digiclay.core.studies.series import finish

from tests.other_process import PROGRAM, start
from tests.other_process import finish as finish_process
from tests.scene_files import interrupt_after
from tests.timeouts import TIMEOUT, wait_until

#: A tenth of a second of a scene is enough for most of this.
SHORT = [Setting("simulation.duration", "0.1")]
#: Beds of different sizes, which run one at a time.
MANY = ["sweep", "slow_press", "--vary", "layout.rows=20:29:10", "--workers", "2", "--quiet"]
#: The same, each half a second long.
QUICK = [*MANY, "--set", "simulation.duration=0.5"]


pytestmark = pytest.mark.usefixtures("here")


def some(count: int = 3) -> list[Point]:
    """Return the points of a small sweep."""
    return make_points(find("slow_press"), SHORT, [read_axis(f"valve_lag.time_constant=1 ms:2 ms:{count}")])


def finished(executor: Executor, task: Any, todo: list[Point], **known: Any) -> dict[int, Record]:
    """Run points, each in a bundle of its own; return what was kept."""
    done: dict[int, Record] = {}
    finish(
        submit(executor, task, [(point,) for point in todo], **{"stopped": lambda: False, **known}),
        lambda bundle, records: done.update({bundle[0].index: records[0]}),
        lambda bundle, why: done.update({bundle[0].index: {"error": why}}),
    )  # fmt: skip
    return done


def test_a_point_that_fails_is_recorded_and_a_stopped_one_is_not(monkeypatch):
    scene = some()[0].scene
    assert scene is not None
    assert evaluate(scene, stopped=lambda: True) is None

    def faulty(*given: Any, **known: Any) -> None:
        raise ZeroDivisionError("one line\nand another")

    monkeypatch.setattr("digiclay.core.studies.evaluation.run", faulty)
    assert evaluate(scene) == {"error": "ZeroDivisionError: one line and another"}


def test_a_piece_whose_task_fails_is_told_of_and_the_others_go_on_unless_the_workers_die() -> None:
    faults = {1: DigiclayError("killed too often"), 2: KeyError("own fault"), 4: BrokenExecutor("gone")}

    def task(bundle: list[Point]) -> list[Record | None]:
        if fault := faults.get(bundle[0].index):
            raise fault
        return [{"figures": {}}]

    with ThreadPoolExecutor(1) as threads:
        assert finished(threads, task, some(4)) == {
            0: {"figures": {}}, 1: {"error": "killed too often"}, 2: {"error": "KeyError: 'own fault'"},
            3: {"figures": {}},
        }  # fmt: skip
        with pytest.raises(OutputError, match=r"gone What is done is kept"):
            finished(threads, task, some(5)[4:])


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


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The table of a sweep that nobody stopped."""
    out = tmp_path_factory.mktemp("sweep") / "whole"
    assert main([*QUICK, "--workers", "1", "--out", str(out)]) == 0
    return (out / "sweep.csv").read_bytes()


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
@pytest.mark.parametrize(("number", "workers"), [(signal.SIGINT, "2"), (signal.SIGTERM, "1")])
def test_a_sweep_stopped_half_way_keeps_what_is_done_and_goes_on_from_there(
    number: int, workers: str, here: Path, whole: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        interrupt_after(2, patch, number)
        assert main([*QUICK, "--workers", workers, "--out", "out"]) == 130
    files = {path: path.stat().st_mtime_ns for path in (here / "out").glob("points/*")}
    assert 2 <= len(files) < 10
    assert all("figures" in json.loads(path.read_text(encoding="utf-8")) for path in files)
    assert not (here / "out" / "sweep.csv").exists()
    assert main([*QUICK, "--workers", "1", "--out", "out"]) == 0
    assert {path: path.stat().st_mtime_ns for path in files} == files
    assert (here / "out" / "sweep.csv").read_bytes() == whole


@pytest.mark.skipif(os.name == "nt", reason="Windows has no process groups to signal")
def test_ctrl_c_on_a_terminal_ends_sessions_of_hours_without_a_word(here: Path) -> None:
    hours = ["--set", "simulation.duration=1e4", "--set", "recorder.every=1000"]
    process = start(PROGRAM, *MANY, *hours, "--out", "out", start_new_session=True)
    wait_until((here / "out" / "sweep.json").exists)
    time.sleep(3.0)  # the workers run or are being started; a terminal sends Ctrl-C to them as well
    os.killpg(process.pid, signal.SIGINT)
    code, _, err = finish_process(process)  # the sessions would take hours
    assert (code, err, list((here / "out").glob("points/*"))) == (130, "", [])


def idle() -> Processes[Evaluator]:
    """Return the processes of a series that nobody stops."""
    return Processes[Evaluator](lambda: False, lambda: None)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_a_sweep_whose_worker_is_killed_comes_to_the_same_table(here: Path, whole: bytes) -> None:
    out = here / "out"
    sweep = start(PROGRAM, *QUICK, "--out", str(out))
    wait_until(lambda: list(out.glob("points/*.json")))
    told = subprocess.run(["ps", "-A", "-o", "pid=,ppid="], capture_output=True, text=True, check=True).stdout
    pairs = [tuple(map(int, line.split())) for line in told.splitlines()]
    worker, *_ = (pid for pid, parent in pairs if parent == sweep.pid)
    os.kill(worker, signal.SIGKILL)
    code, _, err = finish_process(sweep)
    assert (code, err, (out / "sweep.csv").read_bytes()) == (0, "", whole)


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
    stopped = Processes[Evaluator](lambda: True, lambda: None)
    assert stopped.stopped()
    assert evaluate_elsewhere(stopped, [], some(2), errors=False) == [None, None]
