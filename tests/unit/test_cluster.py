"""Sweeps on a Dask cluster: the table, stops, addresses. Its processes that die are in tests/proof."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from digiclay.cli import main
from digiclay.commands import cluster as cluster_module
from digiclay.commands.cluster import Versions, describe_versions, evaluate_on_worker, open_cluster
from digiclay.commands.evaluator import submit
from digiclay.core.base.errors import DigiclayError, OutputError
from digiclay.core.scene.scene_source import Setting, find
from digiclay.core.studies.axes import Point, make_points, read_axis
from digiclay.core.studies.series import finish
from distributed import Client, LocalCluster

from tests.other_process import finish as run_process
from tests.other_process import start
from tests.scene_files import left
from tests.timeouts import wait_until

ROOT = Path(__file__).parents[2]
#: Two batches, and no pictures of three axes.
AXES = ["control.force_gain=1,2", "control.dead_band=1e-5,2e-5", "layout.rows=3,4"]
SWEEP = ["sweep", "my.toml", *(word for axis in AXES for word in ("--vary", axis)), "--quiet"]
VARIED = "--vary control.force_gain=1:2 --vary control.position_gain=100:900 --population 4 --generations 2"
TUNING = ["tune", "my.toml", *VARIED.split(), "--metric", "rfd,highest", "--quiet"]


pytestmark = pytest.mark.usefixtures("here")


def cluster_here(workers: int) -> LocalCluster:
    """Return a scheduler with workers, on threads of this process."""
    return LocalCluster(
        n_workers=workers, threads_per_worker=2, processes=False, protocol="tcp://", host="127.0.0.1",
        dashboard_address=":0",
    )  # fmt: skip


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """The address of a scheduler with one worker."""
    with cluster_here(1) as cluster:
        yield cluster.scheduler_address


def hours(count: int) -> list[Point]:
    """Return points that would take hours."""
    long = [Setting("simulation.duration", "1e5"), Setting("recorder.every", "1000")]
    return make_points(find("slow_press"), long, [read_axis(f"layout.rows=20:{19 + count}:{count}")])


def silent(note: str) -> None:
    """Draw nothing."""


def never() -> bool:
    """Ask for no stop."""
    return False


@pytest.mark.parametrize(("words", "tables"), [(SWEEP, 1), (TUNING, 2)], ids=["sweep", "tuning"])
def test_a_series_on_a_cluster_comes_to_the_tables_of_this_machine(words, tables, here, address):
    assert main([*words, "--workers", "1", "--out", "own"]) == 0
    assert main([*words, "--scheduler", address, "--out", "far"]) == 0
    own, far = ({path.name: path.read_bytes() for path in (here / at).glob("*.csv")} for at in ("own", "far"))
    assert (len(own), own) == (tables, far)
    assert left(here / "far/points") == left(here / "own/points") != []


def test_after_a_stop_no_task_is_left_in_the_cluster(address: str) -> None:
    with Client(address, set_as_default=False) as client:

        def look(dask_worker: Any) -> tuple[int, int]:
            return len(dask_worker.active_threads), len(dask_worker.state.tasks)

        running: list[int] = []

        def stop() -> bool:
            if not running and [busy for busy, _ in client.run(look).values()] == [2]:
                running.append(2)
            return bool(running)

        with open_cluster(address, lambda: False, silent) as cluster:
            finish(submit(cluster, evaluate_hours, hours(4), stopped=stop), lambda *_: None, lambda *_: None)
        wait_until(lambda: list(client.run(look).values()) == [(0, 0)])


def evaluate_hours(point: Point) -> Any:
    """Evaluate one point on a worker."""
    return evaluate_on_worker([point], errors=False)


def test_a_cluster_without_workers_is_waited_for_and_the_wait_can_be_stopped(capsys):
    notes: list[str] = []
    with (
        cluster_here(0) as empty,
        open_cluster(empty.scheduler_address, lambda: len(notes) > 1, notes.append),
    ):
        pass
    assert notes == [", no workers: waiting"] * 2
    address = empty.scheduler_address
    assert capsys.readouterr().err == (
        f"{address} has no workers yet: start some with 'dask worker {address}'.\n"
    )


def test_errors_of_tasks_are_told_and_a_result_that_does_not_arrive_is_computed_again(address, monkeypatch):
    done: dict[int, Any] = {}
    with open_cluster(address, lambda: False, silent) as cluster:
        finish(submit(cluster, invert, [0, 1, 2], stopped=never), done.__setitem__, done.__setitem__)
        assert done == {0: "ZeroDivisionError: division by zero", 1: 1.0, 2: 0.5}
        monkeypatch.setattr(cluster_module, "FETCH", 0.3)
        finish(submit(cluster, give_slowly, [0], stopped=never), done.__setitem__, done.__setitem__)
    assert isinstance(done[0], SlowToSend)
    assert SlowToSend.sent > 1


def invert(number: int) -> float:
    """Return the reciprocal."""
    return 1 / number


class SlowToSend:
    """Result that takes seconds to be sent the first time."""

    sent = 0

    def __reduce__(self) -> tuple[type[SlowToSend], tuple[()]]:
        SlowToSend.sent += 1
        if SlowToSend.sent == 1:
            time.sleep(1.5)
        return SlowToSend, ()


def give_slowly(number: int) -> SlowToSend:
    """Return a result that arrives late."""
    return SlowToSend()


def test_a_scheduler_that_is_gone_ends_a_series_in_one_line() -> None:
    with cluster_here(1) as other:
        address = other.scheduler_address
        with open_cluster(address, lambda: False, silent) as cluster:
            other.close()
            gone = f"^The scheduler {address} is gone. What is done is kept, and the same command goes on"
            with pytest.raises(OutputError, match=gone):
                finish(submit(cluster, invert, [1], stopped=never), print, print)


def test_versions_that_differ_are_named_with_who_has_them() -> None:
    here = describe_versions()
    cluster_module._refuse_others({"a": here, "b": here}, here)
    older = Versions("0.0.9", here.numpy, here.python)
    named = r"^b has digiclay 0\.0\.9, numpy .* \(and 1 more like it\); here it"
    with pytest.raises(DigiclayError, match=named):
        cluster_module._refuse_others({"a": here, "b": older, "c": older}, here)


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("foo", "missing port number"), ("", "missing port number"),
        ("http://127.0.0.1:8786", "unknown address scheme 'http'"),
        ("tls://127.0.0.1:8786", "TLS expects a `ssl_context`"),
    ],
)  # fmt: skip
def test_a_bad_address_is_refused_in_one_line(address: str, why: str, refused: Any) -> None:
    rule = "--scheduler must be an address such as tcp://127.0.0.1:8786"
    refused([*SWEEP, "--scheduler", address, "--out", "out"], f"{rule} (got {address!r}: {why}")


@pytest.mark.parametrize(
    ("address", "host"),
    [
        ("tcp://127.0.0.1:8786", ""), ("tcp://localhost:8786", ""), ("tcp://[::1]:8786", ""),
        ("tls://10.0.0.1:8786", ""), ("10.0.0.1:8786", "10.0.0.1"), ("tcp://[fe80::1]:8786", "fe80::1"),
        ("tcp://login.example:8786", "login.example"),
    ],
)  # fmt: skip
def test_an_address_without_encryption_beyond_this_machine_is_warned_of(address: str, host: str) -> None:
    said = cluster_module._describe_exposure(address)
    assert said.partition(",")[0] == (f"Other machines can reach {host}" if host else "")


def test_the_example_for_slurm_makes_the_script_of_a_job_and_nothing_else_imports_dask() -> None:
    said = (ROOT / "docs" / "cluster.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"    (from dask_jobqueue(?:.*\n)+?)(?=\n\S)", said)
    lines = [line.removeprefix("    ") for line in example.splitlines()]
    made = lines.index(next(line for line in lines if line.startswith("cluster.scale")))
    script = "import sys\nfrom digiclay.commands.parser import parser\nparser()\n"
    script += "assert not {name.split('.')[0] for name in sys.modules} & {'dask', 'distributed', 'tornado'}\n"
    script += "\n".join([*lines[:made], "print(cluster.job_script())", "cluster.close()"])
    code, out, err = run_process(start(script, env={"DASK_DISTRIBUTED__LOGGING__DISTRIBUTED": "critical"}))
    assert code == 0, err
    assert out.startswith("#!/")
    assert re.search(r"^#SBATCH --cpus-per-task=\d+$", out, re.MULTILINE)
    assert "distributed.cli.dask_worker tcp://" in out or "dask worker tcp://" in out
