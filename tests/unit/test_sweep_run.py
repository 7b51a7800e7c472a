"""Sweeps while they run: any executor, a stop half way, a point that goes wrong; and their pictures."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.core.errors import OutputError
from digiclay.core.scene import Scene
from digiclay.core.scene_file import Setting, find
from digiclay.core.sweep import Point, Record, evaluate, finish, points
from digiclay.core.sweep_axis import axis
from digiclay.core.sweep_bundles import evaluate_all
from digiclay.core.sweep_folder import Column, columns
from digiclay.plots.sweep import sweep_figure

from tests.patience import HANGS, until

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
    return points(find("slow_press"), SHORT, [axis(f"valve_lag.time_constant=1 ms:2 ms:{count}")])


class AtOnce(Executor):
    """An executor that runs what it is given when it is given."""

    def submit(self, task: Any, /, *arguments: Any, **known: Any) -> Future[Any]:
        """Run."""
        future: Future[Any] = Future()
        future.set_result(task(*arguments, **known))
        return future


class Broken(Executor):
    """An executor whose workers die."""

    def submit(self, task: Any, /, *arguments: Any, **known: Any) -> Future[Any]:
        """Fail."""
        future: Future[Any] = Future()
        future.set_exception(BrokenExecutor("gone"))
        return future


def finished(executor: Executor, task: Any, todo: list[Point], **known: Any) -> dict[int, Record]:
    """Run points, each in a bundle of its own; return what was kept."""
    done: dict[int, Record] = {}
    finish(
        executor,
        task,
        [[point] for point in todo],
        lambda point, record: done.update({point.index: record}),
        **known,
    )
    return done


def never() -> bool:
    """Nobody asks to stop."""
    return False


def test_any_executor_will_do() -> None:
    at_once = finished(AtOnce(), evaluate_all, some(), stopped=never)
    with ThreadPoolExecutor(2) as threads:
        in_threads = finished(threads, evaluate_all, some(), stopped=never)
    assert [at_once[i]["figures"]["rfd"] for i in range(3)] == [
        in_threads[i]["figures"]["rfd"] for i in range(3)
    ]


def test_a_fault_in_one_point_is_recorded_by_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    def faulty(*given: Any, **known: Any) -> None:
        raise ZeroDivisionError("one line\nand another")

    monkeypatch.setattr("digiclay.core.sweep.run", faulty)
    scene = some()[0].scene
    assert scene is not None
    assert evaluate(scene) == {"error": "ZeroDivisionError: one line and another"}


def test_a_session_that_was_stopped_is_no_finished_point() -> None:
    scene = some()[0].scene
    assert scene is not None
    assert evaluate(scene, stopped=lambda: True) is None


def test_after_a_stop_nothing_is_begun_and_what_is_done_stays() -> None:
    begun: list[Scene] = []
    asked = threading.Semaphore(0)

    def task(scenes: list[Scene]) -> list[Record | None]:
        begun.extend(scenes)
        # Asked once more after it was told to stop, it has given up what was not begun.
        assert asked.acquire(timeout=HANGS)
        assert asked.acquire(timeout=HANGS)
        return [{"figures": {}}]

    def stopped() -> bool:
        if begun:
            asked.release()
        return bool(begun)

    with ThreadPoolExecutor(1) as one:
        done = finished(one, task, some(9), stopped=stopped)
    assert (len(begun), len(done)) == (1, 1)


def test_workers_that_die_are_told_in_one_line() -> None:
    with pytest.raises(OutputError, match=r"A worker died.*fewer --workers"):
        finished(Broken(), evaluate_all, some(), stopped=never)


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
        "from digiclay.core.sweep_folder import Folder\n"
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
        timeout=HANGS, env={**os.environ, "PYTHONPATH": str(ADDON)},
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
        until((here / "out" / "sweep.json").exists)
        time.sleep(3.0)  # the workers run or are being started; a terminal sends Ctrl-C to them as well
        os.killpg(started.pid, signal.SIGINT)
        _, err = started.communicate(timeout=HANGS)  # the sessions would take hours
    finally:
        if started.poll() is None:
            os.killpg(started.pid, signal.SIGKILL)
    assert (started.returncode, err, list((here / "out").glob("points/*"))) == (130, "", [])


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_ctrl_c_does_not_reach_a_worker_that_is_just_being_started(here: Path) -> None:
    # Python runs this file before all else; of the processes a sweep starts only workers are told of a fork.
    ctrl_c = "import os, sys\nif '--multiprocessing-fork' in sys.orig_argv:\n    os.kill(os.getpid(), {})\n"
    (here / "sitecustomize.py").write_text(ctrl_c.format(int(signal.SIGINT)), encoding="utf-8")
    script = "from digiclay.cli import console; console()"
    done = subprocess.run(
        [sys.executable, "-c", script, *MANY, "--set", "simulation.duration=0.1", "--out", "out"],
        env={**os.environ, "PYTHONPATH": f"{here}{os.pathsep}{ADDON}"}, capture_output=True, text=True,
        timeout=HANGS,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")


ONE = Column("control.force_gain", "1/N", (1.0, 2.0, 4.0), True)
TWO = Column("layout.pitch", "m", (2.5e-3, 3e-3), False)
WORDS = Column("blister.profile", "", ("cone", "gaussian", "flat"), False)


def test_one_axis_is_a_line_with_markers_labelled_with_units() -> None:
    picture = sweep_figure([ONE], "lag_mean", np.array([1e-3, 2e-3, 3e-3]))
    (axes,) = picture.axes
    (line,) = axes.get_lines()
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("control.force_gain (1/N)", "lag_mean (mm)")
    assert (line.get_marker(), axes.get_xscale()) == ("o", "log")
    np.testing.assert_allclose(line.get_xydata(), [[1.0, 1.0], [2.0, 2.0], [4.0, 3.0]], rtol=1e-12)


def test_values_in_any_order_make_a_line_from_left_to_right() -> None:
    picture = sweep_figure([Column("a.b", "", (3, 1, 2), False)], "rfd", np.array([0.3, 0.1, 0.2]))
    assert picture.axes[0].get_lines()[0].get_xydata().tolist() == [[1.0, 0.1], [2.0, 0.2], [3.0, 0.3]]


def test_words_are_not_joined_by_a_line() -> None:
    picture = sweep_figure([WORDS], "rfd", np.array([0.3, 0.1, 0.2]))
    assert [text.get_text() for text in picture.axes[0].get_xticklabels()] == list(WORDS.values)
    assert picture.axes[0].get_lines()[0].get_linestyle() == "None"


def test_two_axes_are_a_heat_map_labelled_with_units() -> None:
    values = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, np.nan]])
    axes, scale = sweep_figure([ONE, TWO], "rfd", values).axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("control.force_gain (1/N)", "layout.pitch (mm)")
    assert scale.get_ylabel() == "rfd (N)"
    drawn = axes.collections[0].get_array().reshape(2, 3)
    np.testing.assert_array_equal(drawn.filled(np.nan), values.T)
    assert [text.get_text() for text in axes.texts] == ["0.1", "0.3", "0.5", "0.2", "0.4", "×"]


@pytest.mark.parametrize("columns", [[ONE], [ONE, TWO]])
def test_a_metric_nobody_has_is_drawn_as_missing_at_every_point(columns: list[Column]) -> None:
    nothing = np.full([len(one.values) for one in columns], np.nan)
    picture = sweep_figure(columns, "rfd", nothing)
    picture.canvas.draw()
    crosses = sum(len(line.get_xdata()) for line in picture.axes[0].get_lines() if line.get_marker() == "x")
    assert crosses + sum(text.get_text() == "×" for text in picture.axes[0].texts) == nothing.size


def test_a_sweep_over_two_axes_leaves_a_picture_of_each_metric(here: Path) -> None:
    two = ["--vary", "valve_lag.time_constant=1 ms,2 ms", "--vary", "delay.dead_time=0,0.001"]
    assert (
        main(
            [
                "sweep",
                "slow_press",
                "--set",
                "simulation.duration=0.1",
                *two,
                "--metric",
                "rfd,highest",
                "--out",
                "out",
                "--quiet",
            ]
        )
        == 0
    )
    assert sorted(path.name for path in (here / "out").glob("*.png")) == ["highest.png", "rfd.png"]


def test_a_sweep_over_three_axes_says_that_there_is_a_table_only(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    three = [
        f"--vary={key}" for key in ("valve_lag.time_constant=1 ms", "delay.dead_time=0", "layout.rows=11,13")
    ]
    assert main(["sweep", "slow_press", "--set", "simulation.duration=0.1", *three, "--out", "out"]) == 0
    assert "3 axes: a table only, no pictures" in capsys.readouterr().out
    assert list((here / "out").glob("*.png")) == []


def test_an_axis_of_numbers_is_what_the_scenes_made_of_its_words() -> None:
    axes = [axis("valve_lag.time_constant=1 ms:2 ms:2")]
    (column,) = columns(some(2), axes)
    assert (column.values, column.unit, column.numeric) == ((1e-3, 2e-3), "s", True)
