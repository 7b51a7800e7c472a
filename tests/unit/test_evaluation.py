"""Points of a sweep that run together, in this process or on a Dask cluster, and the arrays they share."""

import re
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.commands import cluster as cluster_module
from digiclay.commands.cluster import evaluate_on_worker, open_cluster
from digiclay.commands.evaluator import submit
from digiclay.core.base.arrays import MOST_SHAPES, Constants, any_true, count_true
from digiclay.core.base.errors import OutputError
from digiclay.core.batch.play import begin_play, play_all
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find
from digiclay.core.session.run_scene import run
from digiclay.core.studies.axes import make_points, read_axis
from digiclay.core.studies.evaluation import (
    RUNS,
    TIMES,
    BatchWarning,
    evaluate,
    evaluate_bundle,
    judge_all,
    make_bundles,
)
from digiclay.core.studies.series import finish as finish_series
from distributed import Client, LocalCluster

from tests.assemble import table
from tests.other_process import finish as finish
from tests.other_process import start
from tests.scene_files import call, left, read_json, timeless
from tests.timeouts import wait_until

pytestmark = pytest.mark.usefixtures("here")


CASES = {
    "no cell": np.zeros(0, np.bool_),
    "nowhere": np.zeros(150, np.bool_),
    "in the last cell": np.arange(150) == 149,
    "everywhere": np.ones(7, np.bool_),
    "in a comparison with nan": np.array([np.nan, 1.0, 2.0]) > 1.0,
    "in every other column of a table": (np.arange(24).reshape(4, 6) % 5 == 0)[:, ::2],
}


@pytest.mark.parametrize("test", CASES.values(), ids=CASES.keys())
def test_it_holds_somewhere_and_as_often_as_numpy_says(test):
    assert any_true(test) is bool(test.any())
    assert count_true(test) == np.count_nonzero(test, axis=0).tolist()


def test_constants_of_one_run_are_shared_few_and_read_only_and_of_many_the_numbers_themselves():
    known, own = Constants((1.0,)), np.array([1.0, 2.0])
    (one,) = known[5,]
    assert known[5,][0] is one
    with pytest.raises(ValueError, match="read-only"):
        one[0] = 2.0
    sizes = [known[count,][0].size for count in range(3 * MOST_SHAPES)]
    assert (sizes, len(known) <= MOST_SHAPES) == (list(range(3 * MOST_SHAPES)), True)
    assert Constants((3.0, own))[4, 2] == (3.0, own)
    (code,) = Constants((3,), np.int8)[4, 2]
    assert type(code) is np.int8


SHORT = [Setting("simulation.duration", "0.1")]


def some(*varied, settings=None):
    return make_points(find("tap"), settings or SHORT, [read_axis(one) for one in varied])


def indices(parts):
    return [[point.index for point in part] for part in parts]


def calls(count):
    """Return how many functions of numpy and others each control period of so many taps calls."""
    points = some(f"control.force_gain=1:6:{count}", settings=[])
    scenes = {point.index: point.scene for point in points}
    play = begin_play(scenes, {run: assemble(scene) for run, scene in scenes.items()})
    made, counted = [0], []

    def count_one(frame, event, argument):
        made[0] += event == "c_call"

    periods = play_all(play, dict.fromkeys(scenes, 101), None)
    for _ in range(100):
        made[0] = 0
        sys.setprofile(count_one)
        try:
            next(periods)
        finally:
            sys.setprofile(None)
        counted.append(made[0])
    return counted


def test_a_control_period_of_a_larger_stack_takes_no_more_calls():
    # The median: now and then a set of cells is made anew, and not in the same periods.
    assert np.median(calls(16)) == np.median(calls(4))


@pytest.mark.parametrize(
    "count, duration, sizes",
    [
        (2 * RUNS - 1, "0.1", [2 * RUNS - 1]),
        (2 * RUNS + 1, "0.1", [RUNS, RUNS + 1]),
        (20, "1e4", [10, 10]),  # 2 million rows of 41 bytes are 82 MB, and a stack may hold 1 GiB
        (5, "1e5", []),
    ],
)
def test_a_stack_has_no_more_runs_than_pay_or_fit_into_memory(count, duration, sizes):
    settings = [Setting("simulation.duration", duration)]
    parts = make_bundles(some(f"control.force_gain=1:6:{count}", settings=settings))
    assert [len(batch) for batch in parts.batches] == sizes
    reason = f"{count} points one at a time: their histories are too long to keep several at once"
    assert (parts.describe() == [reason]) == (not sizes)


HALVED = ("delay.dead_time=1 ms,2.5 ms", "control.force_gain=1:4:4")
METHODS = "control.method=viscous,push_pull,cell_states,virtual_master"
NOISE = ("sensors.force_noise=1e-3,2e-3,3e-3", "sensors.seed=1,2")
TRIGGERS = ("control.blister_trigger=0.01,0.03", "control.spring_trigger=0.02,0.06,0.08")


@table(
    "varied, setting, errors, batches, said",
    {
        "points of one structure run together": (
            ("control.force_gain=1,2,3,4", "layout.rows=11,13"),
            "",
            False,
            [[0, 2, 4, 6], [1, 3, 5, 7]],
            "8 points run in 2 batches",
        ),
        "too few of a kind": (
            ("layout.rows=11,13,15",),
            "",
            False,
            [],
            "3 points one at a time: fewer than 4 have the same bed, parts and steps",
        ),
        "not judged": (HALVED, "", False, [[*range(8)]], "8 points run in 1 batch"),
        # A dead time of half a control period falls on the end of a half step.
        "h": (HALVED, "", True, [[0, 1, 2, 3], [4, 5, 6, 7]], "8 points run in 2 batches"),
        "too fine": (
            HALVED[1:],
            "simulation.stepper=heun simulation.physics_step=5e-6",
            True,
            [],
            "",
        ),
        "every method with noise": (
            (METHODS, *NOISE),
            "",
            False,
            [[*range(first, first + 6)] for first in (0, 6, 12, 18)],
            "24 points run in 4 batches",
        ),
        "with noise and without it are two structures": (
            ("sensors.force_noise=0,1e-3", NOISE[1]),
            "",
            False,
            [],
            "4 points one at a time: fewer than 4 have the same bed, parts and steps",
        ),
        "Method III": (
            ("control.force_setpoint=0.2:0.5:4",),
            "control.method=hybrid",
            False,
            [],
            "4 points one at a time: a batch of hybrid would not be faster",
        ),
        "values that do not go together": (
            TRIGGERS,
            "control.method=cell_states",
            False,
            [[0, 1, 2, 4, 5]],
            "5 points run in 1 batch",
        ),
        "values at which a pin would swing": (
            ("control.damping=0.1,3,5,10,20",),
            "control.method=force_display",
            False,
            [[1, 2, 3, 4]],
            "4 points run in 1 batch",
        ),
    },
)
def test_points_of_one_structure_run_together_and_others_alone(
    varied, setting, errors, batches, said
):
    settings = [*SHORT, *(Setting(*word.split("=")) for word in setting.split())]
    points = some(*varied, settings=settings)
    parts = make_bundles(judge_all(points) if errors else points)
    together = {index for batch in batches for index in batch}
    alone = [[point.index] for point in points if point.index not in together]
    assert (indices(parts.batches), indices(parts.alone)) == (batches, alone)
    assert "".join(parts.describe()) == said


#: A contact of 14 ms, within a step of 20 ms.
BLIP = "".join(f"{{ time = {time}, position = [0, 0, {height}] }}, " for time, height in (
    (0, 0.041), (0.103, 0.041), (0.11, 0.0385), (0.117, 0.041), (0.2, 0.041)
))  # fmt: skip


@pytest.mark.parametrize(
    "step, errors, doubted", [("20 ms", True, True), ("20 ms", False, False), ("1 ms", True, False)]
)
def test_errors_of_points_whose_contact_a_step_may_hide_are_doubted(step, errors, doubted):
    ways = (
        "simulation.control_period=20 ms",
        f"simulation.physics_step={step}",
        f"trajectory.waypoints=[{BLIP}]",
    )
    settings = [Setting(*way.split("=", 1)) for way in (*ways, "trajectory.interpolation=linear")]
    points = some("control.force_gain=1:4:4", settings=settings)
    said = make_bundles(judge_all(points) if errors else points).describe()
    assert (said[1:] != [], len(said)) == (doubted, 1 + doubted)
    if doubted:
        assert said[1].startswith(
            "4 points with larger errors: within a step the path of the fingertip"
        )
    (done,) = [run(point.scene).estimate_errors() for point in points[:1] if point.scene]
    doubt = done.metrics.get("errors_in_doubt", "")
    assert (doubt != "", "or more" in done.summary(), doubt in done.summary()) == (
        step == "20 ms",
        step == "20 ms",
        True,
    )


@pytest.mark.parametrize("errors", [False, True])
def test_a_bundle_comes_to_the_figures_of_its_points_and_can_be_stopped(errors):
    bundle = some("control.force_gain=1,5")
    assert evaluate_bundle(bundle, lambda: True) == [None, None]
    bundle = judge_all(bundle) if errors else bundle
    for record, point in zip(evaluate_bundle(bundle), bundle, strict=True):
        own, other = (
            {
                name: value
                for name, value in one["figures"].items()
                if name not in TIMES and value is not None
            }
            for one in (record, evaluate(point.scene, errors=errors))
        )
        assert own == pytest.approx(other, rel=1e-9, abs=1e-15)


TAPS = "sweep tap --vary control.force_gain=1:5:4 --metric rfd --set simulation.duration=0.1"


def break_stacks(monkeypatch, error):
    def faulty(*given, **known):
        raise error

    monkeypatch.setattr("digiclay.core.studies.evaluation.measure_together", faulty)


def test_a_fault_in_a_stack_is_not_passed_over(here, monkeypatch, capsys):
    # Warnings are errors in tests: a stack that fails by our own fault fails the test it runs in.
    break_stacks(monkeypatch, ZeroDivisionError("by\nzero"))
    with pytest.warns(BatchWarning, match="A batch of 2 runs failed: ZeroDivisionError: by zero"):
        records = evaluate_bundle(some("control.force_gain=1,5"))
    assert [record and record["alone"] for record in records] == ["ZeroDivisionError: by zero"] * 2
    break_stacks(monkeypatch, MemoryError())
    assert call(f"{TAPS} --out out") == 0
    assert (
        "\n4 points one at a time: there is not enough memory for a batch\n"
        in capsys.readouterr().out
    )
    table = (here / "out" / "sweep.csv").read_text(encoding="utf-8").splitlines()
    assert [line.endswith(",") for line in table[1:]] == [True] * 4  # no point has an error


def test_a_sweep_says_how_its_points_were_run_and_one_done_again_comes_to_the_same_bits(
    here, capsys
):
    call(f"{TAPS} --out out")
    assert "4 points\n4 points run in 1 batch\n" in capsys.readouterr().out
    file, figures = here / "out" / "points" / "000003.json", []
    for _ in range(2):
        kept = read_json(file)["figures"]
        figures.append({name: value for name, value in kept.items() if name not in TIMES})
        file.unlink()
        call(f"{TAPS} --out out --quiet")
    assert figures[0] == figures[1]


ROOT = Path(__file__).parents[2]
#: Two batches, and no pictures of three axes.
AXES = ["control.force_gain=1,2", "control.dead_band=1e-5,2e-5", "layout.rows=3,4"]
SWEEP = ["sweep", "my.toml", *(word for axis in AXES for word in ("--vary", axis)), "--quiet"]
VARIED = "--vary control.force_gain=1:2 --vary control.position_gain=100:900 --population 4 --generations 2"
TUNING = ["tune", "my.toml", *VARIED.split(), "--metric", "rfd,highest", "--quiet"]


def cluster_here(workers):
    """Return a scheduler with workers, on threads of this process."""
    return LocalCluster(
        n_workers=workers,
        threads_per_worker=2,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address=":0",
    )


@pytest.fixture(scope="module")
def address():
    """The address of a scheduler with one worker."""
    with cluster_here(1) as cluster:
        yield cluster.scheduler_address


def hours(count):
    long = [Setting("simulation.duration", "1e5"), Setting("recorder.every", "1000")]
    return make_points(
        find("slow_press"), long, [read_axis(f"layout.rows=20:{19 + count}:{count}")]
    )


def silent(note):
    """Draw nothing."""


def never():
    return False


@table("words, tables", {"sweep": (SWEEP, 1), "tuning": (TUNING, 2)})
def test_a_series_on_a_cluster_comes_to_the_tables_of_this_machine(words, tables, here, address):
    assert main([*words, "--workers", "1", "--out", "own"]) == 0
    assert main([*words, "--scheduler", address, "--out", "far"]) == 0
    own, far = (
        {path.name: timeless(path) for path in (here / at).glob("*.csv")} for at in ("own", "far")
    )
    assert (len(own), own) == (tables, far)
    assert left(here / "far/points") == left(here / "own/points") != []


# Dask may drop a coroutine of its own that waited for a task's result.
@pytest.mark.filterwarnings("ignore:.*Future._result:pytest.PytestUnraisableExceptionWarning")
def test_after_a_stop_no_task_is_left_in_the_cluster(address):
    with Client(address, set_as_default=False) as client:

        def look(dask_worker):
            return len(dask_worker.active_threads), len(dask_worker.state.tasks)

        running = []

        def stop():
            if not running and [busy for busy, _ in client.run(look).values()] == [2]:
                running.append(2)
            return bool(running)

        with open_cluster(address, lambda: False, silent) as cluster:
            finish_series(
                submit(cluster, evaluate_hours, hours(4), stopped=stop),
                lambda *_: None,
                lambda *_: None,
            )
        wait_until(lambda: list(client.run(look).values()) == [(0, 0)])


def evaluate_hours(point):
    return evaluate_on_worker([point])


def test_a_cluster_without_workers_is_waited_for_and_the_wait_can_be_stopped(capsys):
    notes = []
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


def test_errors_of_tasks_are_told_and_a_result_that_does_not_arrive_is_computed_again(
    address, monkeypatch
):
    done = {}
    with open_cluster(address, lambda: False, silent) as cluster:
        finish_series(
            submit(cluster, invert, [0, 1, 2], stopped=never), done.__setitem__, done.__setitem__
        )
        assert done == {0: "ZeroDivisionError: division by zero", 1: 1.0, 2: 0.5}
        monkeypatch.setattr(cluster_module, "FETCH", 0.3)
        finish_series(
            submit(cluster, give_slowly, [0], stopped=never), done.__setitem__, done.__setitem__
        )
    assert isinstance(done[0], SlowToSend)
    assert SlowToSend.sent > 1


def invert(number):
    return 1 / number


class SlowToSend:
    sent = 0

    def __reduce__(self):
        SlowToSend.sent += 1
        if SlowToSend.sent == 1:
            time.sleep(1.5)
        return SlowToSend, ()


def give_slowly(number):
    return SlowToSend()


def test_a_scheduler_that_is_gone_ends_a_series_in_one_line(monkeypatch):
    monkeypatch.setattr("digiclay.commands.cluster.PATIENCE", 3.0)
    with cluster_here(1) as other:
        address = other.scheduler_address
        with open_cluster(address, lambda: False, silent) as cluster:
            other.close()
            gone = f"^The scheduler {address} is gone. Finished work is kept, and the same command continues"
            with pytest.raises(OutputError, match=gone):
                finish_series(submit(cluster, invert, [1], stopped=never), print, print)


@pytest.mark.parametrize(
    "address, why",
    [
        ("foo", "missing port number"), ("", "missing port number"),
        ("http://127.0.0.1:8786", "unknown address scheme 'http'"),
        ("tls://127.0.0.1:8786", "TLS expects a `ssl_context`"),
    ],
)  # fmt: skip
def test_a_bad_address_is_refused_in_one_line(address, why, refused):
    rule = "--scheduler must be an address such as tcp://127.0.0.1:8786"
    refused([*SWEEP, "--scheduler", address, "--out", "out"], f"{rule} (got {address!r}: {why}")


@pytest.mark.parametrize(
    "address, host",
    [
        ("tcp://127.0.0.1:8786", ""), ("tcp://localhost:8786", ""), ("tcp://[::1]:8786", ""),
        ("tls://10.0.0.1:8786", ""), ("10.0.0.1:8786", "10.0.0.1"), ("tcp://[fe80::1]:8786", "fe80::1"),
        ("tcp://login.example:8786", "login.example"),
    ],
)  # fmt: skip
def test_an_address_without_encryption_beyond_this_machine_is_warned_of(address, host):
    said = cluster_module._describe_exposure(address)
    assert said.partition(",")[0] == (f"Other machines can reach {host}" if host else "")


def test_the_example_for_slurm_makes_the_script_of_a_job_and_nothing_else_imports_dask():
    said = (ROOT / "docs" / "cluster.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"    (from dask_jobqueue(?:.*\n)+?)(?=\n\S)", said)
    lines = [line.removeprefix("    ") for line in example.splitlines()]
    made = lines.index(next(line for line in lines if line.startswith("cluster.scale")))
    script = "import sys\nfrom digiclay.commands.parser import parser\nparser()\n"
    script += "assert not {name.split('.')[0] for name in sys.modules} & {'dask', 'distributed', 'tornado'}\n"
    script += "\n".join([*lines[:made], "print(cluster.job_script())", "cluster.close()"])
    code, out, err = finish(
        start(script, env={"DASK_DISTRIBUTED__LOGGING__DISTRIBUTED": "critical"})
    )
    assert code == 0, err
    assert out.startswith("#!/")
    assert re.search(r"^#SBATCH --cpus-per-task=\d+$", out, re.MULTILINE)
    assert "distributed.cli.dask_worker tcp://" in out or "dask worker tcp://" in out
