"""digiclay tune: fronts and knees, generations, chosen scene, continuation bit for bit, mistakes."""

import os
import shutil

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.core.scene.scene_source import load
from digiclay.core.scene.toml_table import format_scene
from digiclay.core.session.run_scene import run

from digiclay_study.tune_command import find_front, find_knee
from tests.scene_files import (
    SMALL_BLISTER,
    command,
    interrupt_after,
    read_text,
    rows,
    timeless,
    write_text,
)

pytest.importorskip("optuna", reason="digiclay[study] is not installed")

#: A press that moves to the side, so that there is a lag.
SCENE = f"""
[layout]
rows = 3
columns = 4
{SMALL_BLISTER}
[trajectory]
waypoints = [
  {{ time = 0.0, position = [-0.002, 0, 0.041] }},
  {{ time = 0.05, position = [0, 0, 0.038] }},
  {{ time = 0.1, position = [0.002, 0, 0.038] }},
]
"""
VARIED = command("--vary control.position_gain=100:1000:log --vary control.force_gain=1:10")
SMALL = command("--population 8 --workers 1")
TUNE = ["tune", "my.toml", *VARIED, *SMALL, "--out", "out", "--quiet"]
#: Four generations after the unchanged scene.
ALL = 1 + 4 * 8


pytestmark = pytest.mark.usefixtures("here")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tune")
    write_text(folder / "my.toml", SCENE)
    command = ["tune", str(folder / "my.toml"), *VARIED, *SMALL, "--generations", "4"]
    assert main([*command, "--out", str(folder / "out"), "--quiet"]) == 0
    return folder / "out"


def values(path):
    return np.array([[float(row["rfd (N)"]), float(row["lag_mean (m)"])] for row in rows(path)])


def files(folder):
    texts = {name: (folder / name).read_bytes() for name in ("chosen.toml", "tuning.json")}
    return texts | {name: timeless(folder / name) for name in ("points.csv", "front.csv")}


def test_a_tuning_leaves_tables_a_plot_and_a_scene_that_gives_the_same_metrics(whole):
    left = {path.name for path in whole.iterdir() if not path.name.startswith(".")}
    assert left == {"chosen.toml", "front.csv", "front.png", "points", "points.csv", "tuning.json"}
    assert len(rows(whole / "points.csv")) == len(list((whole / "points").iterdir())) == ALL
    assert (whole / "front.png").read_bytes()[:4] == b"\x89PNG"
    scene = load(whole / "chosen.toml")
    metrics = run(scene).metrics
    # A stack takes sums in another order than a run by itself.
    near = np.isclose(values(whole / "front.csv"), [metrics["rfd"], metrics["lag_mean"]], rtol=1e-9)
    assert np.all(near, axis=1).any()
    # A preset of Blender is a file of this text.
    assert read_text(whole / "chosen.toml") == format_scene(scene)
    assert scene.name == "my_tuned"
    assert scene.description.startswith(
        "Chosen by digiclay tune from 32 runs, knee of the front: rfd "
    )


def test_the_least_of_a_metric_can_be_chosen_of_a_finished_tuning(whole, here, capsys):
    shutil.copytree(whole, here / "out")
    assert main([*TUNE[:-1], "--generations", "4", "--choose", "lag"]) == 0
    front = values(here / "out" / "front.csv")
    metrics = run(load(here / "out" / "chosen.toml")).metrics
    assert [metrics["rfd"], metrics["lag_mean"]] == pytest.approx(
        front[np.argmin(front[:, 1])], rel=1e-9
    )
    assert "chosen (lag_mean): rfd " in capsys.readouterr().out


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_a_tuning_that_is_stopped_goes_on_from_there_bit_for_bit(here, whole, monkeypatch, capsys):
    with monkeypatch.context() as patch:
        interrupt_after(12, patch)
        assert main([*TUNE[:-1], "--generations", "4"]) == 130
    # The second generation is one stack, which is kept whole.
    assert f"Stopped: 17 of {ALL} points are done and kept in out." in capsys.readouterr().out
    assert not (here / "out" / "front.csv").exists()
    assert main([*TUNE, "--generations", "4"]) == 0
    assert files(here / "out") == files(whole)


def test_points_of_another_search_are_refused_and_without_any_contact_there_is_no_front(
    whole, here, refused
):
    shutil.copytree(whole, here / "out")
    one, other = (here / "out" / "points" / f"{index:06d}.json" for index in (12, 13))
    one.write_bytes(other.read_bytes())
    refused([*TUNE, "--generations", "4"], "out holds points of another version of optuna")
    shutil.rmtree(here / "out")
    write_text(here / "my.toml", SCENE.replace("0.038", "0.045"))
    refused([*TUNE, "--generations", "1"], "No run has both metrics without losing the fingertip")


def test_where_every_trial_fails_the_scene_stays_as_it_is(here):
    # A slot is a whole number of control periods.
    write_text(here / "my.toml", SCENE + "[drive]\nsections = 1\n")
    varied = command("--vary drive.slot=0.005:0.02 --vary control.force_gain=1:10")
    options = command("--population 4 --generations 1 --workers 1 --out out --quiet")
    assert main(["tune", "my.toml", *varied, *options]) == 0
    assert load(here / "out" / "chosen.toml").drive == load(here / "my.toml").drive
    assert (here / "out" / "front.png").exists()


@pytest.mark.parametrize(
    "words, message",
    [
        ("--metric rfd", "--metric must name two metrics (got 'rfd')."),
        ("--metric rfd,lag,relief", "--metric must name two metrics"),
        (
            "--metric rfd,contact_share",
            "whose lower values are better: both are minimized (got contact_share)",
        ),
        ("--choose relief", "--choose must be knee, rfd or lag_mean (got 'ridge_error')."),
        ("--choose kneee", "--choose must be knee, rfd or lag_mean (got 'kneee')."),
        (
            "--population 3",
            "digiclay tune: argument --population: must be a whole number from 4 to",
        ),
        (
            "--generations 0",
            "digiclay tune: argument --generations: must be a whole number from 1 to",
        ),
        (
            "--generations 4096",
            "--population times --generations must come to 10000 points at most",
        ),
        (
            "--vary control.travel=1:nan",
            "--vary control.travel must have two different finite numbers at LO",
        ),
    ],
)
def test_a_mistake_is_told_in_one_line_and_leaves_no_folder(words, message, here, refused):
    refused([*TUNE, *words.split()], message)
    assert not (here / "out").exists()


POINTS = np.array(
    [[1.0, 5.0], [2.0, 2.0], [3.0, 3.0], [2.0, 4.0], [5.0, 1.0], [np.nan, 0.0], [2.0, 2.0]]
)


def test_a_front_has_the_points_that_none_dominates_in_order():
    assert find_front(POINTS).tolist() == [0, 1, 4]
    values = np.random.default_rng(5).random((200, 2))
    front = find_front(values)
    one, other = values[front][:, None], values[None]
    better = np.all(one <= other, axis=2) & np.any(one < other, axis=2)
    assert better.any(axis=0).sum() == len(values) - len(front)
    assert not better[:, front].any()


@pytest.mark.parametrize(
    "front, knee",
    [
        ([[0.0, 100.0], [1.0, 20.0], [6.0, 10.0], [10.0, 0.0]], 1),
        ([[1.0, 2.0]], 0),
        ([[1.0, 2.0], [2.0, 1.0]], 0),
    ],
)
def test_the_knee_is_where_both_are_small(front, knee):
    assert find_knee(np.array(front)) == knee
