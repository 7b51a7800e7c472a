"""Sweeps: what varies, what points have in common, what is kept; stops, points or workers that go wrong."""

import itertools
import json
import os
import re
import signal
import subprocess
import time
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from itertools import starmap
from pathlib import Path

import pytest
from digiclay.cli import main
from digiclay.commands.evaluator import Evaluator, evaluate_elsewhere, submit
from digiclay.commands.worker import Processes
from digiclay.core.base.errors import DigiclayError, OutputError, ParameterError
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.session.accuracy import estimate_errors
from digiclay.core.session.run_scene import run
from digiclay.core.studies.axes import Axis, Point, find_ends, make_points, place_points, read_axis
from digiclay.core.studies.evaluation import evaluate
from digiclay.core.studies.series import finish

from tests.other_process import PROGRAM, start
from tests.other_process import finish as finish_process
from tests.scene_files import command, interrupt_after, read_text, timeless, write_text
from tests.scene_files import rows as read_table
from tests.timeouts import TIMEOUT, wait_until

GAINS = command("sweep my.toml --vary control.force_gain=2,5 --metric rfd")
GAINS += command("--workers 1 --quiet --out out")


pytestmark = pytest.mark.usefixtures("here")


def rows(folder):
    return read_table(Path(folder) / "sweep.csv")


def kept(folder):
    found = sorted(Path(folder).glob("points/*"))
    return {path.name: json.loads(read_text(path)) for path in found}


READ = {
    "a.b=1:10:4": ("1", "4", "7", "10"),
    "a.b=0.1:0.3:3": ("0.1", "0.2", "0.3"),
    "a.b=3:1:3": ("3", "2", "1"),
    "a.b=1:100:3:log": ("1", "10", "100"),
    "a.b=2 mm:4 mm:3": ("2 mm", "3 mm", "4 mm"),
    "a.b=cone, gaussian": ("cone", "gaussian"),
    "preset=paper": ("paper",),
}


@pytest.mark.parametrize("said, words", READ.items())
def test_what_varies_is_read_from_a_line(said, words):
    assert read_axis(said) == Axis(said.partition("=")[0], words, said.endswith("log"))


@pytest.mark.parametrize(
    "said, message",
    [
        (
            "a.b",
            " must be KEY=START:STOP:COUNT, KEY=START:STOP:COUNT:log or KEY=A,B,C (got 'a.b').",
        ),
        ("a.b=1:2", " a.b must be START:STOP:COUNT or START:STOP:COUNT:log (got '1:2')."),
        ("a.b=1:x:3", " a.b must have a number at START and STOP (got '1:x:3')."),
        ("a.b=1:2:1", " a.b must have a whole number from 2 to 10000 at COUNT (got '1:2:1')."),
        (
            "a.b=0:2:3:log",
            " a.b must have numbers above 0 at START and STOP for a logarithmic scale",
        ),
        ("a.b=1:inf:3", " a.b must have two different finite numbers at START and STOP"),
        ("a.b=1 mm:2 m:3", " a.b must have the same unit at START and STOP (got '1 mm:2 m:3')."),
        ("a.b=1,,2", " a.b must have a value between commas (got '1,,2')."),
        ("a.b=1,2,1", " a.b must not name a value twice (got '1,2,1')."),
    ],
)
def test_what_cannot_vary_is_told_with_key_rule_and_value(said, message):
    with pytest.raises(ParameterError, match=f"^{re.escape(f'--vary{message}')}"):
        read_axis(said)


@pytest.mark.parametrize(
    "words, message",
    [
        (
            "--vary control.force_gian=1,2",
            "--vary: control.force_gian must be a known key (got 1).",
        ),
        (
            "--vary control.force_gain=-1,2",
            "--vary: control.force_gain must be at least 0 1/N (got -1",
        ),
        ("--vary layout.rows=11,11.5", "--vary: layout.rows must be a whole number (got 11.5)."),
        ("--vary seed=1:2:6000 --vary b=1,2", "--vary must come to 10000 points at most"),
        ("--vary layout.rows=11,13 --vary layout.rows=15", "--vary layout.rows must be given once"),
        (
            "--vary layout.rows=11,13 --set layout.rows=15",
            "--vary layout.rows must not be given to",
        ),
        (
            "--vary layout.rows=11,13 --metric rdf",
            "--metric must be a known metric (got 'rdf'). Did",
        ),
        (
            "--vary control.method=a --method a",
            "--vary control.method must not be given to --method",
        ),
        (
            "--vary simulation.stepper=a --tolerance 1um",
            "--vary simulation.stepper must not be given to --tole",
        ),
        (
            "--vary layout.rows=11,13 --workers 0",
            "digiclay sweep: argument --workers: must be a whole",
        ),
        (
            "--vary layout.rows=11,13 --set recorder=absent",
            "A sweep needs a recorder, and the scene",
        ),
    ],
)
def test_a_mistake_is_told_in_one_line_and_leaves_no_folder(words, message, here, refused):
    refused(["sweep", "my.toml", "--out", "out", *words.split()], message)
    assert not (here / "out").exists()


def test_a_point_is_the_run_with_that_setting_also_within_a_tolerance():
    line = (
        "sweep my.toml --vary control.force_gain=5 --metric rfd,contact_share "
        "--set simulation.physics_step=5e-3"
    )
    assert main([*command(line), "--tolerance", "50 um", "--out", "out", "--quiet"]) == 0
    changes = {"control.force_gain": "5", "simulation.physics_step": "5e-3"}
    changes |= {"simulation.stepper": "adaptive", "simulation.tolerance": "50 um"}
    alone = run(load(find("my.toml"), list(starmap(Setting, changes.items()))))
    for name, unit in (("rfd", "N"), ("contact_share", "1")):
        assert rows("out")[0][f"{name} ({unit})"] == repr(alone.metrics[name])


def test_a_point_that_fails_or_is_no_scene_is_recorded_and_the_others_go_on(capsys):
    vary = command("sweep my.toml --vary")
    assert main([*vary, "simulation.duration=100 ms,1e6,0.05", "--out", "out"]) == 0
    assert list(rows("out")[0]) == [
        "simulation.duration (s)",
        "rfd (N)",
        "lag_mean (m)",
        "run_time (s)",
        "height_error (m)",
        "force_error (N)",
        "lost",
        "error",
    ]
    assert [line["simulation.duration (s)"] for line in rows("out")] == ["0.1", "1000000.0", "0.05"]
    assert [bool(line["rfd (N)"]) for line in rows("out")] == [True, False, True]
    assert rows("out")[1]["error"].startswith("recorder.every must be at least")
    assert "1 of them failed" in capsys.readouterr().out
    assert main([*vary, "simulation.duration=1e6,9e5", "--out", "none"]) == 2
    assert capsys.readouterr().err.startswith(
        "Every point failed; the first one: recorder.every must be"
    )
    triggers = command(
        "--vary control.blister_trigger=0.01,0.03 --vary control.spring_trigger=0.02,0.06"
    )
    assert (
        main(
            ["sweep", "my.toml", "--quiet", "--method", "cell_states", *triggers, "--out", "mixed"]
        )
        == 0
    )
    assert [line["error"] for line in rows("mixed")][:2] == ["", ""]
    assert "must be below spring_trigger, 0.02 N (got 0.03 N)" in rows("mixed")[2]["error"]


def test_finished_points_are_kept_for_another_metric_too_and_unreadable_ones_run_again(here):
    main(GAINS)
    before, files, points = timeless(here / "out/sweep.csv"), kept("out"), here / "out" / "points"
    assert main([*GAINS, "--metric", "highest"]) == 0
    assert float(rows("out")[0]["highest (m)"]) > 0.03
    assert kept("out") == files
    write_text(points / "000001.json", '{"figures"')
    assert main(GAINS) == 0
    assert timeless(here / "out/sweep.csv") == before
    write_text(points / "000000.json", '{"figures": {"rfd": 42.0}}')
    assert main([*GAINS, "--workers", "2"]) == 0
    assert rows("out")[0]["rfd (N)"] == "42.0"


def test_a_folder_with_another_sweep_is_refused_in_one_line(refused):
    main(GAINS)
    before = kept("out")
    for change in ("--vary layout.rows=11,13", "--set layout.rows=13", "--stepper runge_kutta_4"):
        refused(
            [*GAINS, *change.split()],
            "out holds another sweep (2 points over control.force_gain, digiclay ",
        )
        assert kept("out") == before


ERRORS = ["--metric", "rfd,total_force_error"]


def test_errors_are_estimated_where_they_are_asked_for_and_then_stay():
    main(GAINS)
    before = rows("out")
    assert main([*GAINS, *ERRORS]) == 0
    scene = load(find("my.toml"), [Setting("control.force_gain", "5")])
    expected = estimate_errors(scene, run(scene).history)
    found = rows("out")[1]["height_error (m)"], rows("out")[1]["total_force_error (N)"]
    assert found == (repr(expected.height), repr(expected.total_force))
    judged = kept("out")
    assert main(GAINS) == 0
    assert (rows("out"), kept("out")) == (before, judged)
    # Of rows that leave out commands there are none.
    assert main([*GAINS, "--set", "recorder.every=2", *ERRORS, "--out", "thin"]) == 0
    assert [line["height_error (m)"] for line in rows("thin")] == ["", ""]
    assert all(line["rfd (N)"] for line in rows("thin"))


def test_a_sweep_estimates_errors_at_the_ends_of_what_varies_and_says_where(capsys):
    grid = command("--vary control.force_gain=1:5:3 --vary control.dead_band=1e-5,2e-5,3e-5")
    sweep = ["sweep", "my.toml", *grid, "--metric", "rfd", "--workers", "1", "--out", "grid"]
    assert main(sweep) == 0
    said = capsys.readouterr().out
    found = rows("grid")
    # These are the corners.
    assert [index for index, line in enumerate(found) if line["height_error (m)"]] == [
        0,
        2,
        6,
        8,
    ]
    assert all(float(line["run_time (s)"]) > 0.0 for line in found)
    worst = max(float(line["height_error (m)"]) for line in found if line["height_error (m)"])
    assert f"height error about {worst * 1e6:.2g} µm" in said
    assert "estimated at 4 of 9 points: 0, 2, 6, 8\n" in said
    # A sweep whose estimates were stopped, or that an older version made, goes on to them alone.
    file = Path("grid/points/000006.json")
    record = json.loads(read_text(file))
    record["figures"] = {
        name: value for name, value in record["figures"].items() if "_error" not in name[-6:]
    }
    record["figures"]["rfd"] = 7.0
    write_text(file, json.dumps(record))
    before = {name: value for name, value in kept("grid").items() if name != file.name}
    assert main([*sweep, "--quiet"]) == 0
    assert kept("grid").items() >= before.items()
    assert (rows("grid")[6]["rfd (N)"], rows("grid")[6]["height_error (m)"]) == (
        "7.0",
        found[6]["height_error (m)"],
    )


ENDS = {
    "the ends of a number": ([("3",), ("1",), ("2",), ("9",)], [1, 3]),
    "every word": ([("cone",), ("gaussian",)], [0, 1]),
    "corners of a grid": ([(a, b) for a in "135" for b in "246"], [0, 2, 6, 8]),
    "the ends of each parameter of a design": (
        [("1", "5"), ("2", "1"), ("5", "4"), ("3", "9"), ("4", "6")],
        [0, 1, 2, 3],
    ),
    "a point alone": ([("1",)], [0]),
}


@pytest.mark.parametrize("name", ENDS)
def test_points_at_the_ends_are_found_whatever_their_order(name):
    words, expected = ENDS[name]
    keys = (
        ["blister.profile"]
        if "cone" in words[0]
        else ["control.force_gain", "layout.rows"][: len(words[0])]
    )
    points = place_points(find("my.toml"), [], keys, words)
    assert [point.index for point in find_ends(points, keys)] == expected
    lost = Point(99, ("0",) * len(keys), None, "values that do not go together")
    assert [point.index for point in find_ends([lost, *points], keys)] == expected


#: What other sections depend on: the method has its blister, the contact of a hexagonal bed its
#: share.
AXES = [
    "control.method=virtual_master,cell_states",
    "layout.arrangement=aligned,hexagonal",
    "valve.stroke=20 um,30 um",
    "delay.dead_time=5 ms,10 ms",
]
SHORT = [Setting("simulation.duration", "0.1")]


def test_a_point_is_the_scene_with_its_values():
    keys = [axis.partition("=")[0] for axis in AXES]
    rows = itertools.product(*(axis.partition("=")[2].split(",") for axis in AXES))
    points = make_points(find("slow_press"), SHORT, [read_axis(axis) for axis in AXES])
    for point, words in zip(points, rows, strict=True):
        varied = [Setting(key, word) for key, word in zip(keys, words, strict=True)]
        scene = load(find("slow_press"), [*SHORT, *varied])
        assert point.scene == scene


#: Beds of different sizes, which run one at a time.
MANY = command("sweep slow_press --vary layout.rows=20:25:6 --metric rfd --workers 2 --quiet")
QUICK = [*MANY, "--set", "simulation.duration=0.3"]


def some(count=3):
    return make_points(
        find("slow_press"), SHORT, [read_axis(f"valve_lag.time_constant=1 ms:2 ms:{count}")]
    )


def finished(executor, task, todo, **known):
    done = {}
    finish(
        submit(executor, task, [(point,) for point in todo], **{"stopped": lambda: False, **known}),
        lambda bundle, records: done.update({bundle[0].index: records[0]}),
        lambda bundle, why: done.update({bundle[0].index: {"error": why}}),
    )
    return done


def test_a_point_that_fails_is_recorded_and_a_stopped_one_is_not(monkeypatch):
    scene = some()[0].scene
    assert evaluate(scene, stopped=lambda: True) is None

    def faulty(*given, **known):
        raise ZeroDivisionError("one line\nand another")

    monkeypatch.setattr("digiclay.core.studies.evaluation.run", faulty)
    assert evaluate(scene) == {"error": "ZeroDivisionError: one line and another"}


def test_a_piece_whose_task_fails_is_told_of_and_the_others_go_on_unless_the_workers_die():
    faults = {
        1: DigiclayError("killed too often"),
        2: KeyError("own fault"),
        4: BrokenExecutor("gone"),
    }

    def task(bundle):
        if fault := faults.get(bundle[0].index):
            raise fault
        return [{"figures": {}}]

    with ThreadPoolExecutor(1) as threads:
        assert finished(threads, task, some(4)) == {
            0: {"figures": {}},
            1: {"error": "killed too often"},
            2: {"error": "KeyError: 'own fault'"},
            3: {"figures": {}},
        }
        with pytest.raises(OutputError, match=r"gone Finished work is kept"):
            finished(threads, task, some(5)[4:])


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("sweep") / "whole"
    assert main([*QUICK, "--workers", "1", "--out", str(out)]) == 0
    return timeless(out / "sweep.csv")


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
@pytest.mark.parametrize("number, workers", [(signal.SIGINT, "2"), (signal.SIGTERM, "1")])
def test_a_sweep_stopped_half_way_keeps_what_is_done_and_goes_on_from_there(
    number, workers, here, whole, monkeypatch
):
    with monkeypatch.context() as patch:
        interrupt_after(2, patch, number)
        assert main([*QUICK, "--workers", workers, "--out", "out"]) == 130
    files = kept("out")
    assert 2 <= len(files) < 6
    assert not (here / "out" / "sweep.csv").exists()
    assert main([*QUICK, "--workers", "1", "--out", "out"]) == 0
    after = kept("out")
    assert all(
        record["figures"].items() <= after[name]["figures"].items()
        for name, record in files.items()
    )
    assert timeless(here / "out" / "sweep.csv") == whole


@pytest.mark.skipif(os.name == "nt", reason="Windows has no process groups to signal")
def test_ctrl_c_on_a_terminal_ends_sessions_of_hours_without_a_word(here):
    hours = command("--set simulation.duration=1e4 --set recorder.every=1000")
    process = start(PROGRAM, *MANY, *hours, "--out", "out", start_new_session=True)
    wait_until((here / "out" / "sweep.json").exists)
    time.sleep(3.0)  # the workers run or are being started; a terminal sends Ctrl-C to them as well
    os.killpg(process.pid, signal.SIGINT)
    code, _, err = finish_process(process)  # the sessions would take hours
    assert (code, err, list((here / "out").glob("points/*"))) == (130, "", [])


def idle():
    return Processes[Evaluator](lambda: False, lambda: None)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_a_sweep_whose_worker_is_killed_comes_to_the_same_table(here, whole):
    out = here / "out"
    sweep = start(PROGRAM, *QUICK, "--out", str(out))
    wait_until(lambda: list(out.glob("points/*.json")))
    told = subprocess.run(
        ["ps", "-A", "-o", "pid=,ppid="], capture_output=True, encoding="utf-8", check=True
    ).stdout
    pairs = [tuple(map(int, line.split())) for line in told.splitlines()]
    worker, *_ = (pid for pid, parent in pairs if parent == sweep.pid)
    os.kill(worker, signal.SIGKILL)
    code, _, err = finish_process(sweep)
    assert (code, err, timeless(out / "sweep.csv")) == (0, "", whole)


def test_a_worker_is_out_of_reach_of_ctrl_c_and_ends_when_it_cannot_read_its_bundle():
    with idle() as processes:
        worker = processes.start(Evaluator)
        if os.name != "nt":
            assert os.getpgid(worker.process.pid) != os.getpgid(0)
        worker.input.write(b"cdigiclay.no_such_module\nPoint\n.")  # as another version may send it
        worker.input.flush()
        assert worker.process.wait(TIMEOUT) == 0
    stopped = Processes[Evaluator](lambda: True, lambda: None)
    assert stopped.stopped()
    assert evaluate_elsewhere(stopped, [], some(2)) == [None, None]
