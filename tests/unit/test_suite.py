"""Benchmark of methods: trials with repeated noise, their league, resumption, mistakes."""

import csv
import json
import math
import statistics
from dataclasses import replace

import numpy as np
import pytest
from digiclay import __version__
from digiclay.cli import main
from digiclay.core.base.modes import Mode
from digiclay.core.base.quantity import show_digits
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.run_scene import run
from digiclay.core.studies.nominal_relief import find_nominal, measure_relief
from scipy.stats import t as student

from digiclay_study.league import find_interval, find_league
from digiclay_study.method_trials import (
    GROUPS,
    OUTCOMES,
    RANDOM,
    draw_drags,
    judge_trial,
    list_paths,
    list_trajectories,
    measure_trial,
    place_trial,
)
from tests.own_methods import forgotten, write_method
from tests.scene_files import command, folder_with, left, read_text, scene_text, write_text

SCENE = scene_text(11, 11, (0.0, 0.041), (0.1, 0.036), (0.2, 0.036))
BOTH = ("virtual_master", "hybrid")
SHORT = command("compare my.toml --suite --trajectories session --repeats 2 --workers 1")
BOTH_METHODS = [*SHORT, "--methods", ",".join(BOTH), "--out", "league", "--quiet"]


def read_table(path):
    lines = read_text(path).splitlines()
    comments = [line for line in lines if line.startswith("#")]
    return comments, list(csv.DictReader(line for line in lines if not line.startswith("#")))


@pytest.fixture(scope="module")
def league(tmp_path_factory):
    folder = tmp_path_factory.mktemp("suite")
    with pytest.MonkeyPatch.context() as monkeypatch:
        folder_with(SCENE, folder, monkeypatch)
        assert main(BOTH_METHODS) == 0
    return folder / "league"


def test_the_folder_holds_plots_and_tables_with_a_row_a_trial_that_differs_by_seed(league):
    files = {path.name for path in league.iterdir() if not path.name.startswith(".")}
    wanted = (
        "index.html league.csv trajectories.csv results.csv rfd.svg measures.svg suite.json points"
    )
    assert files == set(wanted.split())
    _, rows = read_table(league / "results.csv")
    assert [(row["method"], row["trajectory"], row["seed"]) for row in rows] == [
        (method, "session", seed) for method in BOTH for seed in "12"
    ]
    assert all(row["error"] == "" and float(row["period_cost (s)"]) > 0.0 for row in rows)
    assert len({row["rfd (N)"] for row in rows}) == 4
    # Errors are estimated with the first seed; the league has the largest.
    assert [row["height_error (m)"] != "" for row in rows] == [True, False] * 2
    errors = {
        row["method"]: float(row["height_error (m)"]) for row in rows if row["height_error (m)"]
    }
    # The league holds means and Student's intervals of the results.
    _, ranks = read_table(league / "league.csv")
    assert [row["rank"] for row in ranks] == ["1", "2"]
    assert {row["method"]: float(row["height_error (m)"]) for row in ranks} == errors
    assert float(ranks[0]["rfd (N)"]) <= float(ranks[1]["rfd (N)"])
    for row in ranks:
        values = [float(one["rfd (N)"]) for one in rows if one["method"] == row["method"]]
        assert float(row["rfd (N)"]) == pytest.approx(statistics.fmean(values))
        half = student.ppf(0.975, 1) * statistics.stdev(values) / math.sqrt(2)
        assert float(row["rfd, half width (N)"]) == pytest.approx(half)


def test_tables_and_page_name_their_origin_and_no_other_suite_goes_there(
    league, refused, monkeypatch
):
    identity = json.loads(read_text(league / "suite.json"))["scenes"]
    comments, _ = read_table(league / "league.csv")
    page = read_text(league / "index.html")
    command = "digiclay compare my.toml --suite --methods virtual_master,hybrid"
    for text in ("\n".join(comments), page):
        assert [
            word for word in (identity, command, "seeds 1 to 2", "noise 2 mN") if word not in text
        ] == []
    assert 'src="rfd.svg"' in page
    monkeypatch.chdir(league.parent)
    said = f"league holds another suite (4 trials, digiclay {__version__}): "
    said += "choose another folder with --out.\n"
    refused([*SHORT, "--methods", "hybrid", "--out", "league", "--quiet"], said)


@pytest.mark.parametrize(
    "words, said",
    [
        ("--suite --trajectories figure-eigth", "Did you mean figure-eight?"),
        ("--suite --trajectories ,", "--trajectories must name at least one trajectory"),
        ("--suite --repeats 0", "--repeats: must be a whole number from 1 to 100 (got '0')"),
        ("--suite --repeats two", "must be a whole number from 1 to 100 (got 'two')"),
        ("--suite --drags -3", "--drags: must be a whole number from 1 to 200"),
        ("--suite --noise nan", "--noise: sensors.force_noise must be a finite number"),
        ("--suite --noise=-1mN", "force_noise must be at least 0 N"),
        ("--suite --noise 0", "--repeats must be 1 without noise (got 5)"),
        ("--suite --trajectories ridge-15", "must make the bed at least as wide as the drag"),
        ("--suite --methods hybird", "did you mean hybrid"),
        ("--suite --method hybird", "Did you mean hybrid?"),
        ("--suite --overwrite", "--overwrite is not for --suite"),
        ("--suite --speed", "--speed is not for --suite"),
        ("--repeats 2", "--repeats is for --suite"),
        ("", "The following arguments are required: SCENE, or --suite."),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(words, said, here, refused):
    refused(["compare", *(["my.toml"] if words else []), *words.split()], said)
    assert left(here) == []


def test_a_scene_without_a_finger_has_no_suite(here, refused):
    write_text(here / "my.toml", "finger = []\nsimulation.duration = 1\n")
    refused(command("compare my.toml --suite"), "scene.fingers must be at least 1 (got 0)")
    assert left(here) == []


def test_a_method_of_one_s_own_enters_by_one_option(here):
    write_method(here)
    with forgotten():
        arguments = command("--methods virtual_master --method pad.py:SoftPad --repeats 1")
        assert main([*SHORT, *arguments, "--out", "mine"]) == 0
    _, ranks = read_table(here / "mine" / "league.csv")
    # It asks for no force, so that it has no RFD, and is last.
    assert [bool(row["rfd (N)"]) for row in ranks] == [True, False]
    comments, _ = read_table(here / "mine" / "results.csv")
    assert "--methods virtual_master,pad.py:SoftPad" in comments[1]


def test_an_interval_is_student_s_and_one_value_has_none():
    found, single = find_interval([1.0, 2.0, None, 3.0, math.nan]), find_interval([1.0])
    assert (found.mean, found.number, single.half) == (2.0, 3, None)
    assert found.half == pytest.approx(4.302652729911275 / math.sqrt(3.0))  # t(0.975, 2), table
    assert find_interval([None, math.inf]) is None


@pytest.mark.parametrize(
    "value, shown", [(1652.4, "1650"), (390.1, "390"), (0.0186, "0.0186"), (32.0, "32")]
)
def test_a_cost_above_a_millisecond_has_no_exponent(value, shown):
    assert show_digits(value, 3) == shown


def test_the_league_counts_worse_trajectories_and_random_drags_as_one():
    def figures(rfd, cost=1e-4):
        return {"rfd": rfd, "period_cost": cost, "max_total_force": 10.0 * rfd, "losses": 1.0}

    table = {
        ("one", "lift", 1): figures(0.1), ("one", "random-1", 1): figures(0.2),
        ("one", "random-2", 1): figures(0.4), ("two", "lift", 1): figures(0.2, 2e-4),
        ("two", "random-1", 1): figures(0.1, 2e-4), ("two", "random-2", 1): figures(0.1, 2e-4),
        ("two", "lift-limit", 1): {"speed_limit": 24e-3}, ("one", "lift-limit", 1): {"speed_limit": None},
    }  # fmt: skip
    first, second = find_league(table, ["one", "two"])
    assert (first.method, second.method) == ("two", "one")
    means = [row.measures["rfd"].mean for row in (first, second)]
    assert means == pytest.approx([0.15, 0.2])
    assert (first.worse, first.trajectories, second.worse) == (1, 3, None)
    ratio, force = first.measures["cost_ratio"], first.measures["max_total_force"]
    assert (ratio.mean, force.mean) == pytest.approx((2.0, 2.0))
    assert second.measures["lift-limit"] is None
    assert second.searched == {"lift-limit"}


def test_every_trajectory_can_be_placed_and_judged_and_random_drags_follow_their_seed():
    scene = resolve({"control": {"method": "virtual_master"}})
    names = list_trajectories(GROUPS, 3)
    assert [name for name in names if name.startswith(RANDOM)] == [
        "random-1",
        "random-2",
        "random-3",
    ]
    placed = {name: place_trial(scene, name)[0] for name in names}
    assert all(one.recorder for name, one in placed.items() if "limit" not in name)
    assert draw_drags(2) == draw_drags(3)[:2]
    assert set(list_paths()) < set(GROUPS)
    # The fingertip leaves the bed at the end of every path, so that pins come to their final
    # heights.
    for name in ("ridge-15", "dead-stop", "random-1"):
        assert placed[name].trajectories()[0].poses(np.array([1e3]))[0, 2] > 75e-3


@pytest.mark.parametrize(
    "name, fingers, nearest",
    [
        ("two-hands", 2, 24e-3),
        ("pinch", 2, 12e-3),
        ("crossing", 2, 11e-3),
        ("five-fingers", 5, 18.5e-3),
    ],
)
def test_fingers_of_a_trajectory_come_as_near_as_it_says(name, fingers, nearest):
    placed, _ = place_trial(resolve({}), name)
    ways = [path.poses(np.arange(0.0, 9.0, 1e-3))[:, :2] for path in placed.trajectories()]
    assert len(ways) == fingers
    apart = [np.hypot(*(a - b).T).min() for place, a in enumerate(ways) for b in ways[:place]]
    # A path is smooth between its waypoints.
    assert min(apart) == pytest.approx(nearest, abs=0.2e-3)


def test_a_trial_of_several_fingers_is_judged_by_the_worst():
    scene = resolve(
        {"layout": {"rows": 15, "columns": 25}, "control": {"method": "virtual_master"}}
    )
    placed, measure = place_trial(scene, "two-hands")
    short = replace(placed, simulation=replace(placed.simulation, duration=3.0))
    both = measure(short, None)["figures"]
    assert list(both) == list(OUTCOMES)
    each = [measure(replace(short, fingers=(finger,)), None)["figures"] for finger in short.fingers]
    # Apart as they are, each is as alone; the sum of both would be 0.4 N off.
    for name in ("rfd", "max_total_force", "lag_max"):
        assert both[name] == pytest.approx(max(one[name] for one in each), rel=0.05)
    assert both["losses"] == sum(one["losses"] for one in each)
    # And neither is off the relief that both draw.
    assert both["relief_largest"] is None or both["relief_largest"] < 4e-3


def placed_lift(method):
    scene = resolve({"layout": {"rows": 9, "columns": 15}, "control": {"method": method}})
    return place_trial(scene, "lift")


def test_a_phase_is_judged_alone_and_a_method_that_counts_nothing_itself_loses_the_fingertip():
    placed, _ = placed_lift("virtual_master")
    short = placed.with_sections(simulation=replace(placed.simulation, duration=2.5))
    done = run(short)
    assert judge_trial(done, (2.0, 2.4))["rfd"] != judge_trial(done, None)["rfd"]
    placed, measure = placed_lift("elastic")
    done = run(placed)
    phase, whole = (judge_trial(done, each) for each in (measure.keywords["phase"], None))
    assert phase["contact_loss_share"] > 0.5
    assert (phase["losses"], whole["losses"]) == (1.0, 1.0)


def test_a_relief_of_two_fingers_is_that_of_both_and_an_error_under_either_is_found():
    scene = resolve(
        {"layout": {"rows": 25, "columns": 25}, "control": {"method": "virtual_master"}}
    )
    rest, place = scene.actuator.rest_height, assemble(scene).grid.positions
    tips = np.zeros((61, 2, 7))
    tips[:, :, 0] = np.linspace(-30e-3, 30e-3, 61)[:, None]
    # A ridge, and a valley beside it.
    tips[:, :, 1], tips[:, :, 2] = (-20e-3, 20e-3), (rest + 8e-3, rest - 8e-3)
    nominal = sum(
        find_nominal(scene, {"position": place, "fingertip": own[::4]}, np.full(16, 5), 1e-3)
        for own in np.moveaxis(tips, 1, 0)
    )
    history = {
        "fingertip": tips,
        "position": place,
        "finger_force": np.full((61, 2), 0.4),
        "force": np.zeros((61, len(place))),
        "mode": np.full((61, len(place)), Mode.FORCE_FOLLOW),
    }
    for cell in (6 * 25 + 12, 18 * 25 + 12):
        off = np.where(np.arange(len(place)) == cell, 1e-3, 0.0)
        found = measure_relief(scene, {**history, "height": (rest + nominal + off)[None]}, 1e-3)
        assert found.largest == pytest.approx(1e-3)


def test_the_losses_of_two_fingers_are_counted_of_each():
    placed, _ = placed_lift("elastic")
    (finger,) = placed.fingers
    moved = tuple(
        replace(one, position=(10e-3, *one.position[1:])) for one in finger.trajectory.waypoints
    )
    other = replace(finger, trajectory=replace(finger.trajectory, waypoints=moved))
    assert measure_trial(replace(placed, fingers=(finger, other)))["figures"]["losses"] == 2.0
