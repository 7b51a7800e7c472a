"""Sweeps whose processes die: those of this machine, a cluster's worker, its scheduler; other versions."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from digiclay.cli import main
from digiclay.commands.cluster import open_cluster
from digiclay.commands.evaluator import submit
from digiclay.core.files.run_folder import read_json
from digiclay.core.studies.series import finish as finish_series
from distributed import Client

from tests.other_process import finish
from tests.own_methods import forgotten, write_method
from tests.package_copy import copy_package
from tests.scene_files import (
    SCENE,
    command,
    folder_with,
    read_text,
    timeless,
    write_text,
)
from tests.timeouts import TIMEOUT, wait_until

ADDON = Path(__file__).parents[2] / "addon"
#: Libraries of this Python; as a path, and with -S, without an installed digiclay.
LIBRARIES = Path(pytest.__file__).parents[1]
#: Twelve batches of four, some tenths of a second each.
AXES = ["control.force_gain=1,2", "control.dead_band=1e-5,2e-5", "layout.rows=20:31:12"]
SWEEP = ["sweep", "my.toml", *(word for axis in AXES for word in ("--vary", axis)), "--quiet"]
SWEEP += ["--set", "simulation.duration=2"]
#: Makes hours of each point.
HOURS = command("--set simulation.duration=1e5 --set recorder.every=1000")


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """Work in an empty folder with one scene, my.toml."""
    return folder_with(SCENE, tmp_path, monkeypatch)


@pytest.fixture
def start(here):
    running = []

    def start(*arguments, addon=ADDON, bare=False, **settings):
        process = subprocess.Popen(
            [sys.executable, *["-S"] * bare, "-m", *arguments],
            stderr=subprocess.PIPE,
            encoding="utf-8",
            env={**os.environ, "PYTHONPATH": str(addon), **settings},
        )
        running.append(process)
        return process

    yield start
    for process in reversed(running):
        if process.poll() is None:
            process.kill()
        process.communicate()


def start_scheduler(start, folder, port="0", **settings):
    file = folder / "scheduler.json"
    file.unlink(missing_ok=True)
    words = command(f"--host 127.0.0.1 --port {port} --no-dashboard --scheduler-file")
    process = start("distributed.cli.dask_scheduler", *words, str(file), **settings)
    wait_until(lambda: read_json(file) is not None)
    return process, read_json(file)["address"]


def start_worker(start, address, *arguments, **settings):
    words = command(f"distributed.cli.dask_worker {address} --nthreads 1 --no-dashboard")
    return start(*words, *arguments, **settings)


def points(folder):
    return list(folder.glob("points/*.json"))


def read_figures(point):
    """Return what stands in the file of a finished point."""
    return read_json(point)["figures"]


def test_a_point_that_no_process_of_this_machine_survives_fails_alone(here):
    resource = pytest.importorskip("resource", reason="Windows does not limit processor time")
    line = "sweep my.toml --vary layout.rows=3,4 --vary simulation.duration=0.1,1e5 --out o"
    # The system kills a process that has run for so many seconds: a point of hours, each time it is
    # begun.
    done = subprocess.run(
        [sys.executable, "-m", "digiclay", *command(f"{line} --workers 2")],
        capture_output=True,
        encoding="utf-8",
        check=False,
        timeout=TIMEOUT,
        env={**os.environ, "PYTHONPATH": str(ADDON)},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (4, 4)),
    )
    rule = "A worker died twice of this (signal 9), perhaps for lack of memory"
    failed = sorted(line for line in done.stderr.splitlines() if rule in line)
    assert [line.partition(": A")[0] for line in failed] == ["failed: point 1", "failed: point 3"]
    assert (done.returncode, len(done.stderr.splitlines())) == (0, 2)
    assert "4 points, 2 of them failed: see the column error" in done.stdout
    assert sorted(path.stem for path in points(here / "o")) == ["000000", "000002"]


def test_a_killed_worker_and_a_killed_scheduler_change_no_bit_of_the_table(here, start):
    assert main([*SWEEP, "--workers", "2", "--out", "own"]) == 0
    scheduler, address = start_scheduler(start, here)
    workers = [start_worker(start, address, "--no-nanny") for _ in range(2)]
    words = ["digiclay", *SWEEP, "--scheduler", address, "--out", "far"]

    sweep = start(*words)
    wait_until(lambda: points(here / "far"))
    workers[0].send_signal(signal.SIGKILL)
    done = len(points(here / "far"))
    wait_until(lambda: len(points(here / "far")) > done)  # the other one goes on
    assert sweep.poll() is None
    scheduler.send_signal(signal.SIGKILL)
    code, _, said = finish(sweep)
    rule = "Finished work is kept, and the same command continues."
    lines = [line for line in said.splitlines() if "no workers yet" not in line]
    assert (code, lines) == (2, [f"The scheduler {address} is gone. {rule}"])
    kept = {path: read_figures(path) for path in points(here / "far")}
    assert 8 <= len(kept) < 48
    finish(workers[1])  # a worker ends with its scheduler

    _, again = start_scheduler(start, here, address.rpartition(":")[2])
    assert again == address
    start_worker(start, address)
    assert finish(start(*words))[0] == 0
    # None is run again, for its run time stands; those at the ends of what varies get their errors.
    for path, figures in kept.items():
        assert "run_time" in figures
        assert figures.items() <= read_figures(path).items()
    assert timeless(here / "far/sweep.csv") == timeless(here / "own/sweep.csv")


def test_a_piece_that_no_worker_survives_fails_alone(here, start):
    _, address = start_scheduler(start, here, DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="1")
    start_worker(start, address)  # its nanny starts it again
    done = {}
    with open_cluster(address, lambda: False, lambda note: None) as cluster:
        pieces = ["1 + 1", "__import__('os')._exit(1)", "2 + 2"]
        evaluated = submit(cluster, eval, pieces, stopped=lambda: False)
        finish_series(evaluated, done.__setitem__, done.__setitem__)
    assert [done[piece] for piece in pieces[::2]] == [2, 4]
    assert done[pieces[1]].startswith("2 workers died of this, the last one tcp://127.0.0.1:")


def test_a_worker_that_dies_when_it_is_asked_for_its_versions_changes_nothing(here, start):
    other = copy_package(here / "other") / "addon"
    write_text(other / "digiclay/__init__.py", "import os\nos._exit(1)\n")
    _, address = start_scheduler(start, here)
    workers = [start_worker(start, address, "--no-nanny", addon=addon) for addon in (other, ADDON)]
    with Client(address, set_as_default=False) as client:
        wait_until(lambda: len(client.scheduler_info()["workers"]) == 2)
    line = f"digiclay sweep my.toml --vary control.force_gain=1,2 --quiet --scheduler {address}"
    assert finish(start(*command(line), "--out", "far")) == (0, None, "")
    assert [worker.poll() for worker in workers] == [1, None]
    assert len(points(here / "far")) == 2


def test_a_worker_of_another_version_is_named_at_once_and_when_it_joins(here, start):
    other = copy_package(here / "other") / "addon"
    front = other / "digiclay" / "core" / "version.py"
    text = read_text(front)
    write_text(front, text.replace('__version__ = "', '__version__ = "9.'))
    _, address = start_scheduler(start, here)
    first = start_worker(start, address, "--no-nanny")
    words = ["digiclay", *SWEEP, *HOURS, "--scheduler", address, "--out", "far"]
    sweep = start(*words)
    with Client(address, set_as_default=False) as client:
        wait_until(lambda: any(client.processing().values()))
    start_worker(start, address, "--no-nanny", addon=other)
    code, _, said = finish(sweep)
    assert code == 2
    line = said.splitlines()[-1]
    assert line.startswith("Worker tcp://127.0.0.1:")
    assert " has digiclay 9." in line
    assert "; here it is digiclay 0" in line
    assert first.poll() is None

    code, _, said = finish(start(*words))
    assert code == 2
    assert " has digiclay 9." in said
    assert said.endswith("Install the same there.\n")


@pytest.mark.parametrize(
    "place, line",
    [
        ("scheduler", "The scheduler {} lacks digiclay; here it is digiclay 0"),
        ("worker", "Worker tcp://127.0.0.1:"),
        ("late worker", "A worker of {} lacks digiclay. Finished work is kept"),
    ],
)
def test_a_place_without_digiclay_is_named_in_one_line(place, line, here, start):
    bare = {"addon": LIBRARIES, "bare": True}
    _, address = start_scheduler(start, here, **(bare if place == "scheduler" else {}))
    start_worker(start, address, "--no-nanny", **(bare if place == "worker" else {}))
    sweep = start("digiclay", *SWEEP, *HOURS, "--scheduler", address, "--out", "far")
    if place == "late worker":
        with Client(address, set_as_default=False) as client:
            wait_until(lambda: any(client.processing().values()))
        start_worker(start, address, "--no-nanny", **bare)
    code, _, said = finish(sweep)
    (told,) = [each for each in said.splitlines() if " has no workers" not in each]
    assert (code, told.startswith(line.format(address))) == (2, True)
    assert " lacks digiclay" in told


def test_a_worker_elsewhere_gets_the_code_of_a_method_with_its_points(here, start):
    own = write_method(here)
    axes = ["--vary", "control.step=1e-5,3e-5", "--vary", "control.yield_force=0.01,0.02,0.03"]
    sweep = ["sweep", "tap", "--method", f"{own}:SoftPad", *axes, "--metric", "lowest", "--quiet"]
    _, address = start_scheduler(start, here)
    (here / "elsewhere").mkdir()
    start_worker(start, address, "--no-nanny", "--local-directory", "elsewhere")
    with forgotten():
        assert main([*sweep, "--workers", "1", "--out", "near"]) == 0
        assert main([*sweep, "--scheduler", address, "--out", "far"]) == 0
    near, far = (timeless(here / name / "sweep.csv") for name in ("near", "far"))
    assert near == far
    assert len({[*row.values()][2] for row in near}) > 2
