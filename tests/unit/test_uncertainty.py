"""Bands of a run over the uncertainty of fitted files: closed forms, SciPy, runs of each member."""

import json

import digiclay
import numpy as np
import pytest
from digiclay.cli import main
from digiclay.commands import evaluation_pool, uncertain
from digiclay.core.metrics.bands import find_band
from digiclay.core.scene.scene_source import find, read_parts
from digiclay.core.session.run_scene import Result
from digiclay.core.studies.uncertainty import draw_members
from scipy import stats

from tests.assemble import table
from tests.scene_files import SMALL_BLISTER, call, read_json, scene_text
from tests.unit.test_commands import RUN_FILES, list_files, stop_before

pytestmark = pytest.mark.usefixtures("here")

#: A press of a tenth of a second on a few pins.
SCENE = scene_text(5, 5, (0.0, 0.041), (0.05, 0.038), (0.1, 0.038), parts=SMALL_BLISTER)
#: Stiffness and exponent are correlated; the dead time is independent, the weight cannot be below 0.
KEYS = ("contact.stiffness", "contact.exponent", "delay.dead_time", "relaxation.weights.1")
LOGS = (True, True, False, False)
SPREAD = np.diag([0.2, 0.05, 2e-4, 0.02])
COVARIANCE = SPREAD @ [[1, -0.8, 0, 0], [-0.8, 1, 0, 0.1], [0, 0, 1, 0], [0, 0.1, 0, 1]] @ SPREAD
#: Values of the fitted scene.
VALUES = np.array([320.0, 1800.0, 2e-3, 0.1])
PARTS = """
[contact]
stiffness = 320.0
exponent = 1800.0
[delay]
dead_time = 0.002
[relaxation]
weights = [0.1, 0.6, 0.2, 0.1]
"""


def fitted(folder, chosen=(0, 1, 2, 3), parts=PARTS, name="fitted.toml", **changed):
    """Write a fitted file with some of the parameters, in this order."""
    rows = COVARIANCE[np.ix_(chosen, chosen)].tolist()
    content = {
        "keys": [KEYS[number] for number in chosen],
        "logarithms": [LOGS[number] for number in chosen],
        "covariance": rows,
        **changed,
    }
    lines = [
        f"{key} = {value if isinstance(value, str) else json.dumps(value)}"
        for key, value in content.items()
    ]
    (folder / name).write_text("\n".join([parts, "[uncertainty]", *lines, ""]), encoding="utf-8")
    return folder / name


def draw(*files, count=1000, seed=1, scene="tap"):
    parts = [part for file in files for part in read_parts(file)]
    return draw_members(files, find(scene), parts, count, seed)


def test_members_are_normal_with_the_covariance_of_the_file_by_scipy(here):
    members = draw(fitted(here))
    number = [members.keys.index(key) for key in KEYS]
    values = np.array([point.words for point in members.points], np.float64)[:, number]
    off = np.where(LOGS, np.log(values / VALUES), values - VALUES)
    # Squared lengths in units of the covariance; no weight of 1000 is below 0, five deviations away.
    lengths = np.einsum("ni,ij,nj->n", off, np.linalg.inv(COVARIANCE), off)
    assert stats.kstest(lengths, stats.chi2(4).cdf).pvalue > 0.01
    for column, deviation in zip(off.T, np.diag(SPREAD), strict=True):
        assert stats.kstest(column / deviation, stats.norm.cdf).pvalue > 0.01
    # 3 standard errors of a correlation of 1000: 0.095 at most.
    found = np.corrcoef(off.T) - COVARIANCE / np.outer(*[np.diag(SPREAD)] * 2)
    assert np.abs(found).max() < 0.095
    assert members.note == "1000 members, seed 1"


@table("chosen", {"one parameter in closed form": (0,), "two that are correlated": (0, 1)})
def test_the_band_of_a_held_plate_is_that_of_scipy(chosen, here):
    members, depth = draw(fitted(here, chosen)), 1.5e-3
    ends = find_band([float(digiclay.plate_force(each.scene, depth)) for each in members.points])
    scene = digiclay.scene("tap", with_="fitted.toml")
    plain = float(digiclay.plate_force(scene, depth))
    shares = stats.qmc.LatinHypercube(2, seed=3).random(20_000)
    off = stats.norm.ppf(shares) @ np.linalg.cholesky(COVARIANCE[:2, :2]).T
    # F = b f(m): the logarithm of F is that of b, plus what the exponent does.
    grid = np.linspace(-0.3, 0.3, 61)
    curve = [
        float(digiclay.plate_force(digiclay.scene(scene, {"contact.exponent": value}), depth))
        for value in 1800.0 * np.exp(grid)
    ]
    moved = off[:, 0] + np.interp(off[:, 1], grid, np.log(np.array(curve) / plain))
    wanted = np.quantile(moved, [0.025, 0.975])
    if chosen == (0,):
        wanted = 0.2 * stats.norm.ppf([0.025, 0.975])
    # 3 standard errors of a quantile of 1000: 0.25 standard deviations.
    deviation = 0.25 * np.diff(wanted)[0] / 3.92
    np.testing.assert_allclose(np.log(np.array(ends) / plain), wanted, atol=deviation)


def test_a_band_has_a_further_member_with_95_percent_and_none_comes_of_39():
    # A further one has 80 equally likely ranks: 2 are below, 2 above.
    assert find_band(list(range(1, 80))) == pytest.approx([2.0, 78.0])
    assert find_band([1.0] * 39) == []
    assert find_band([1.0] * 40) == [1.0, 1.0]


def test_neither_the_order_of_keys_nor_that_of_files_matters(here):
    def read(members):
        return [dict(zip(members.keys, point.words, strict=True)) for point in members.points]

    plain = read(draw(fitted(here), count=50))
    assert read(draw(fitted(here, (3, 1, 0, 2), name="other.toml"), count=50)) == plain
    files = [fitted(here, chosen, name=f"{chosen[0]}.toml") for chosen in ((1, 0), (3, 2))]
    assert read(draw(*files, count=50)) == read(draw(*files[::-1], count=50)) != plain
    assert read(draw(fitted(here), count=50, seed=2)) != plain


def test_what_the_scene_does_not_permit_is_drawn_again_and_said(here, refused):
    wide = COVARIANCE.copy()
    wide[3] = wide[:, 3] = 0.0
    wide[3, 3] = 0.01  # a weight of 0.1 ± 0.1: 16 % are below 0
    members = draw(fitted(here, covariance=wide.tolist()), count=200)
    weights = [each.scene.section("relaxation").weights[0] for each in members.points]
    assert [each.index for each in members.points] == list(range(200))
    assert 0.0 <= min(weights) < 0.02
    said = members.note.partition("seed 1; ")[2]
    # 0.16 / 0.84 of 200: 38 ± 3 standard deviations of 7.
    assert 17 < int(said.split()[0]) < 59
    assert "relaxation.weights must be at least 0" in said
    wide[3, 3] = 1e300
    fitted(here, covariance=wide.tolist())
    refused(RUN, "More than half of all members cannot be, such as ")


RUN = "run my.toml --uncertain fitted.toml --members 40 --out o"
SOME = [[1e-2, 2e-3], [2e-3, 1e-2]]


@table(
    "changed, said",
    {
        "no key": ({"keys": []}, "uncertainty.keys must be a list of at least 1 text (got [])"),
        "keys that are no list": ({"keys": 3}, "uncertainty.keys must be a list of at least"),
        "keys that are no texts": ({"keys": [1, 2]}, "uncertainty.keys must be 2 texts"),
        "a key twice": ({"keys": ["contact.stiffness"] * 2}, "must not name a parameter twice"),
        "a misspelt key": ({"keys": ["contact.stifness", "contact.exponent"]}, "contact.stifness"),
        "a section": ({"keys": ["contact", "contact.exponent"]}, "'contact'"),
        "a word": ({"keys": ["contact.law", "contact.exponent"]}, "'contact.law'"),
        "a number that is not there": (
            {"keys": ["relaxation.times.4", "contact.exponent"]},
            "times.4",
        ),
        "a flag too few": ({"logarithms": [True]}, "uncertainty.logarithms must be 2 of true"),
        "flags that are numbers": ({"logarithms": [1, 0]}, "uncertainty.logarithms must be"),
        "a logarithm of 0": (
            {"keys": ["contact.offset", "contact.exponent"], "parts": ""},
            "uncertainty.logarithms must be of numbers above 0 (got 'contact.offset')",
        ),
        "a row too few": ({"covariance": [[1e-2, 2e-3]]}, "must be 2 x 2 numbers"),
        "rows of different lengths": (
            {"covariance": [[1e-2], [2e-3, 1e-2]]},
            "must be 2 x 2 numbers",
        ),
        "texts": ({"covariance": [["1", "0"], ["0", "1"]]}, "must be 2 x 2 numbers"),
        "a huge number": ({"covariance": f"[[1{'0' * 400}, 0], [0, 1]]"}, "must be 2 x 2 numbers"),
        "NaN": ({"covariance": "[[1e-2, nan], [nan, 1e-2]]"}, "must be finite, symmetric"),
        "no symmetry": ({"covariance": [[1e-2, 2e-3], [3e-3, 1e-2]]}, "must be finite, symmetric"),
        "a negative variance": (
            {"covariance": [[-1e-2, 0], [0, 1e-2]]},
            "must be finite, symmetric",
        ),
        "no variance": ({"covariance": [[0.0, 0.0], [0.0, 1e-2]]}, "must be finite, symmetric"),
        "a covariance beyond all numbers": (
            {"covariance": [[1e-300, 1e10], [1e10, 1e-300]]},
            "must be finite, symmetric",
        ),
        "a correlation above 1": ({"covariance": [[1e-2, 2e-2], [2e-2, 1e-2]]}, "must be finite"),
        "an unknown field": ({"covarance": SOME}, "uncertainty.covarance must be a known key"),
    },
)
def test_a_table_that_is_not_one_is_refused_in_a_line(changed, said, here, refused):
    fitted(here, (0, 1), **changed)
    refused(RUN, said)
    assert list_files(here) == {"my.toml", "fitted.toml"}


def test_three_correlations_that_contradict_each_other_are_refused(here, refused):
    ones = np.array([[1, 0.9, -0.9], [0.9, 1, 0.9], [-0.9, 0.9, 1]])
    fitted(here, (0, 1, 2), covariance=(1e-4 * ones).tolist())
    refused(RUN, "uncertainty.covariance must be finite, symmetric and positive")


@table(
    "line, said",
    {
        "no such table": ("run my.toml --uncertain my.toml", "my.toml: layout must be"),
        "no such file": ("run my.toml --uncertain none.toml", "none.toml cannot be read"),
        "no table": ("run my.toml --uncertain plain.toml", "uncertainty must be a table"),
        "a key in two files": (f"{RUN} --uncertain fitted.toml", "must not name a parameter twice"),
        "a value that another option sets": (f"{RUN} --set contact.stiffness=500", "other options"),
        "a list that another option sets": (
            f"{RUN} --set relaxation.weights=[0.2,0.5,0.2,0.1]",
            "other options",
        ),
        "a part left out": (f"{RUN} --set delay=absent", "delay.dead_time"),
        "too few members": (f"{RUN} --members 39", "from 40 to 1000"),
        "no seed": (f"{RUN} --seed 0", "from 1 to"),
        "members of nothing": ("run my.toml --members 50", "with --uncertain only"),
        "a budget": (f"{RUN} --budget 20um", "without --budget"),
        "no recorder": (f"{RUN} --set recorder=absent", "--uncertain needs a recorder"),
    },
)
def test_options_that_do_not_go_together_are_refused_in_a_line(line, said, here, refused):
    fitted(here)
    (here / "plain.toml").write_text(PARTS, encoding="utf-8")
    refused(line, said)


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """Folder with a run of 40 members, and what it printed."""
    folder = tmp_path_factory.mktemp("measured")
    (folder / "my.toml").write_text(SCENE, encoding="utf-8")
    fitted(folder, (3, 1, 0))  # another dead time is another structure
    words = ["--uncertain", str(folder / "fitted.toml"), "--members", "40", "--quiet"]
    assert main(["run", str(folder / "my.toml"), *words, "--out", str(folder / "o")]) == 0
    return folder


def test_bands_are_quantiles_of_runs_of_the_members_one_by_one(measured):
    content = read_json(measured / "o/uncertainty.json")
    metrics = read_json(measured / "o/metrics.json")
    scenes = [digiclay.scene(measured / "o", each["values"]) for each in content["members"]]
    runs = [digiclay.run(scene) for scene in scenes]
    for name, error, factor in (
        ("rfd", "total_force_error", 1.0),
        ("max_total_force", "total_force_error", 1.0),
        ("height_range", "height_error", 2.0),
    ):
        band, values = content["bands"][name], [run.metrics[name] for run in runs]
        # A batch differs from a run by rounding.
        wanted = stats.mstats.mquantiles(values, [0.025, 0.975], 0.0, 0.0)
        np.testing.assert_allclose(band["ends"], wanted, rtol=1e-9)
        assert band["value"] == metrics[name]
        assert band["integration"] == factor * metrics[error] > 0.0
        assert band["members"] == 40
        assert band["ends"][0] < band["value"] < band["ends"][1]
    free = content["bands"]["free_rise"]
    assert free["value"] == digiclay.free_speed(scenes[0]).rise
    assert free["integration"] is None
    assert free["ends"] == pytest.approx([free["value"]] * 2)  # the valve is known
    assert content["notes"][1:] == ["40 points run in 1 batch"]


def test_the_table_has_value_band_its_width_and_the_error_of_integration_and_a_seed_its_members(
    measured, here, capsys
):
    line = f"run my.toml --uncertain '{measured}/fitted.toml' --members 40 --out o"
    assert call(line) == 0
    lines = capsys.readouterr().out.splitlines()
    (row,) = [line.split() for line in lines if line.split()[:2] == ["largest", "force"]]
    band = read_json(here / "o/uncertainty.json")["bands"]["max_total_force"]
    low, high = band["ends"]
    numbers = [float(row[number]) for number in (3, 4, 6, 8, 11)]
    wanted = [band["value"], low, high, 50.0 * (high - low) / band["value"], band["integration"]]
    np.testing.assert_allclose(numbers, wanted, rtol=0.05)  # two digits
    assert call(f"{line} --overwrite --no-errors --seed 2") == 0
    others = read_json(here / "o/uncertainty.json")["members"]
    assert others != read_json(measured / "o/uncertainty.json")["members"]
    (row,) = [line for line in capsys.readouterr().out.splitlines() if "largest force" in line]
    assert row.split()[-1] == "–"


#: A shorter press, since several fingers are in no batch.
SHORT = scene_text(5, 5, (0.0, 0.0405), (0.02, 0.038), parts=SMALL_BLISTER)


@table(
    "scene, method, fingers",
    {
        "Method III": (SCENE, "hybrid", 1),
        "two fingers with Method I": (SHORT, "virtual_master", 2),
    },
)
def test_every_method_and_several_fingers_have_bands(scene, method, fingers, here, capsys):
    bed, trajectory, path = scene.partition("[trajectory]")
    paths = f"[[finger]]\n[finger.trajectory]{path}" * 2 if fingers > 1 else trajectory + path
    (here / "my.toml").write_text(bed + paths, encoding="utf-8")
    fitted(here)
    assert call(f"{RUN} --method {method} --no-errors") == 0
    content = read_json(here / "o/uncertainty.json")
    bands = content["bands"]
    assert {"max_total_force", "height_range", "free_rise"} < set(bands)
    assert bands["max_total_force"]["ends"][0] < bands["max_total_force"]["ends"][1]
    scene = digiclay.scene(here / "o", content["members"][7]["values"])
    assert (len(scene.fingers), scene.method) == (fingers, method)
    force = digiclay.run(scene).metrics["max_total_force"]
    # A batch differs from a run by rounding.
    assert content["members"][7]["figures"]["max_total_force"] == pytest.approx(force, rel=1e-9)
    assert ("several fingers" in capsys.readouterr().out) == (fingers > 1)


def test_a_band_is_that_of_the_members_that_have_a_value_and_says_of_how_many(here, capsys):
    # Pins more than 2 mm lower are not touched, those of one member in six.
    rest = {"keys": ["actuator.rest_height"], "covariance": [[4e-6]], "logarithms": [False]}
    fitted(here, parts="", **rest)
    assert call(f"{RUN} --members 60 --no-errors") == 0
    content = read_json(here / "o/uncertainty.json")
    figures = [row["figures"] for row in content["members"]]
    touched = sum(each["rfd"] is not None for each in figures)
    assert 40 <= touched < 60
    assert content["bands"]["rfd"]["members"] == touched
    assert content["bands"]["max_total_force"]["members"] == 60
    lines = capsys.readouterr().out.splitlines()
    assert [f" of {touched} " in line for line in lines if "RFD (" in line] == [True]
    assert not any(" of 60 " in line for line in lines)


def test_members_that_fail_are_counted_and_said_and_none_is_dropped(here, capsys):
    # Heun's step is unstable where the finger is four times as stiff as this one: of one in four.
    fitted(here, (0,), "[contact]\nstiffness = 3e4\n", covariance=[[4.0]])
    line = f"{RUN} --set simulation.stepper=heun --no-errors"
    assert call(f"{line} --members 60") == 0
    content = read_json(here / "o/uncertainty.json")
    failed = [row["error"] for row in content["members"] if "error" in row]
    assert 4 < len(failed) < 20
    assert content["notes"][-1] == f"{len(failed)} of 60 members failed; the first: {failed[0]}"
    assert content["notes"][-1] in capsys.readouterr().out
    assert len(content["members"]) == 60
    assert content["bands"]["max_total_force"]["members"] == 60 - len(failed)
    # Fewer than 40 make no band: the run is written, and it is said.
    assert call(f"{line} --overwrite") == 2
    err = capsys.readouterr().err
    assert err.startswith("No metric has 40 members: ")
    assert "of 40 members failed; the first: At 0.0" in err
    assert list_files(here / "o") == {*RUN_FILES, "uncertainty.json"}


@table(
    "module, step",
    {
        "before the members": (Result, "estimate_errors"),
        "in them": (evaluation_pool, "evaluate_bundle"),
    },
)
def test_a_run_stopped_before_its_bands_says_how_to_have_them(
    module, step, measured, here, monkeypatch, capsys
):
    line = f"run my.toml --uncertain '{measured}/fitted.toml' --members 40 --quiet --out first"
    with monkeypatch.context() as patched:
        stop_before(patched, module, step)
        assert call(line) == 130
    assert list_files(here / "first") == RUN_FILES
    said = capsys.readouterr().err.splitlines()[-1]
    begin = "Stopped before uncertainty.json; to have it: digiclay "
    assert said.startswith(begin)
    assert call(said.removeprefix(begin)) == 0
    again = (here / "first/uncertainty.json").read_bytes()
    assert again == (measured / "o/uncertainty.json").read_bytes()


def test_a_run_outlives_the_processes_of_its_members(measured, here, monkeypatch, capsys):
    pytest.importorskip("distributed", reason="digiclay[cluster] is not installed")
    monkeypatch.setattr("digiclay.commands.cluster.PATIENCE", 0.5)
    line = f"run my.toml --uncertain '{measured}/fitted.toml' --members 40 --quiet --out first"
    assert call(f"{line} --scheduler tcp://127.0.0.1:9") == 2
    told, error = capsys.readouterr().err.splitlines()
    assert error.startswith("No Dask scheduler answers")
    assert list_files(here / "first") == RUN_FILES
    assert call(told.partition("to have it: digiclay ")[2]) == 0
    again = (here / "first/uncertainty.json").read_bytes()
    assert again == (measured / "o/uncertainty.json").read_bytes()


@table(
    "scene, words, message",
    {
        "without a fitted file": (SCENE, "--speed", "must be given with --uncertain only"),
        "a bed that is too narrow for the drag": (
            SCENE,
            "--speed --uncertain fitted.toml",
            "at least as wide as the drag",
        ),
        "without a fingertip": (
            "fingertip = 'absent'\n" + scene_text(5, 15, (0.0, 0.041), (0.1, 0.038)),
            "--speed --uncertain fitted.toml",
            "--speed needs a fingertip",
        ),
    },
)
def test_speeds_that_cannot_be_searched_are_refused_before_the_run(
    scene, words, message, here, capsys
):
    (here / "my.toml").write_text(scene, encoding="utf-8")
    fitted(here, (2,))
    assert call(f"run my.toml {words} --out o") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert not (here / "o").exists()


def test_a_speed_beyond_the_range_of_the_search_is_no_number():
    bands = {
        "largest_drag_speed": {"value": 0.04, "ends": [0.021, 0.04], "integration": None},
        "largest_lift_speed": {"value": 0.02, "ends": [0.0, 0.03], "integration": None},
    }
    members = [{}] * 40
    content = {
        "bands": {name: {**band, "members": 40} for name, band in bands.items()},
        "members": members,
        "notes": [],
    }
    _, _, drags, lifts = uncertain.describe(content)
    assert "at least 40  21 to at least 40" in drags
    assert "below 2 to 30" in lifts
