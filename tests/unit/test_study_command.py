"""digiclay study: files, continuation, mistakes; on a bed of a few pins. Ranges of varied parameters."""

import shutil
import sys
from pathlib import Path

import pytest
from digiclay.cli import main
from digiclay.core.base.errors import DigiclayError, ParameterError
from digiclay.core.metrics.bands import find_band
from digiclay.core.scene.scene_source import Setting, find, load, read_parts
from digiclay.core.session.run_scene import run

from digiclay_study.point_series import Range, fit_ranges, read_range
from tests.scene_files import (
    SCENE,
    SMALL_BLISTER,
    command,
    interrupt_after,
    read_json,
    read_text,
    rows,
    scene_text,
    timeless,
    write_text,
)
from tests.unit.test_uncertainty import fitted

pytest.importorskip("SALib", reason="digiclay[study] is not installed")

GAINS = command("--vary control.position_gain=100:1000:log --vary control.force_gain=1:10")
STUDY = [
    "study",
    "my.toml",
    *GAINS,
    "--samples",
    "8",
    "--workers",
    "1",
    "--metric",
    "rfd,lag,max_cell_force",
]
QUIET = [*STUDY, "--quiet", "--out", "out"]


pytestmark = pytest.mark.usefixtures("here")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    write_text(folder / "my.toml", SCENE)
    study = [str(folder / "my.toml") if word == "my.toml" else word for word in STUDY]
    assert main([*study, "--second", "--out", str(folder / "out"), "--quiet"]) == 0
    return folder / "out"


def files(folder):
    texts = ("indices.csv", "study.json")
    return {name: (folder / name).read_bytes() for name in texts} | {
        "points": timeless(folder / "points.csv")
    }


def test_a_study_leaves_tables_a_page_and_a_plot_and_every_point_is_the_run_with_its_settings(
    whole,
):
    left = {path.name for path in whole.iterdir() if not path.name.startswith(".")}
    assert left == {"indices.csv", "indices.png", "points", "points.csv", "study.json", "study.md"}
    # Two parameters of first and total order, and a pair; a press in the middle has no lag.
    orders = ("first", "first", "total", "total", "second")
    found = rows(whole / "indices.csv")
    assert [(row["output"], row["order"]) for row in found] == [
        *(("rfd", order) for order in orders),
        *(("lag_mean", order) for order in orders[:4]),
        *(("max_cell_force", order) for order in orders),
    ]
    assert [row["index"] == "" for row in found] == [row["output"] == "lag_mean" for row in found]
    assert all(float(row["interval (95%, +-)"]) > 0.0 for row in found if row["index"])
    assert (whole / "indices.png").read_bytes()[:4] == b"\x89PNG"
    page = read_text(whole / "study.md")
    assert "| `control.position_gain` | 100 to 1000, log |" in page
    assert "| `rfd` | N |" in page
    assert (page.count("± "), page.count("It does not vary.")) == (2 * 5 + 1, 1)
    assert "49 runs took " in page
    assert "of 49 points: 0, " in page
    found = rows(whole / "points.csv")
    assert len(found) == 1 + 8 * 6
    for row, settings in (
        (found[0], []),
        (found[5], [Setting(key, found[5][f"{key} ({unit})"]) for key, unit in KEYS]),
    ):
        alone = run(load(find("my.toml"), settings)).metrics
        assert float(row["rfd (N)"]) == pytest.approx(alone["rfd"], rel=1e-9)
    assert all(100.0 <= float(row["control.position_gain (1/m)"]) <= 1000.0 for row in found)


KEYS = (("control.position_gain", "1/m"), ("control.force_gain", "1/N"))


def test_the_command_of_the_page_runs_points_that_are_missing_and_all_is_as_before(whole, here):
    shutil.copytree(whole, here / "again")
    for path in [
        *sorted((here / "again" / "points").iterdir())[3::4],
        here / "again" / "indices.csv",
    ]:
        path.unlink()
    page = read_text(whole / "study.md")
    command = next(line for line in page.splitlines() if line.startswith("    digiclay study"))
    assert main([*command.split()[1:-1], "again", "--workers", "1", "--quiet"]) == 0
    assert files(Path("again")) == files(whole)


def test_runs_that_fail_are_counted_and_leave_no_hole_in_the_indices(here):
    # A bed of 3 x 4 has no room for a recording of a million seconds.
    durations = command(
        "--vary simulation.duration=0.08,0.1,1e6 --vary control.position_gain=100:1000"
    )
    options = "--samples 4 --workers 1 --metric rfd --quiet --out out"
    assert main(["study", "my.toml", *durations, *options.split()]) == 0
    found = rows(here / "out" / "points.csv")
    failed = [row for row in found if row["error"]]
    assert 0 < len(failed) < len(found) - 1
    assert f"| {len(failed)} | 0 |" in read_text(here / "out" / "study.md")
    assert all(row["index"] for row in rows(here / "out" / "indices.csv"))


@pytest.mark.parametrize("fingers, batches", [(1, True), (2, False)])
def test_the_time_a_study_takes_is_less_in_batches_where_there_are_some(
    fingers, batches, here, capsys
):
    bed, _, path = SCENE.partition("[trajectory]")
    fingers_of = "".join(f"[[finger]]\n[finger.trajectory]{path}" for _ in range(fingers))
    write_text(here / "my.toml", bed + fingers_of)
    ranges = command("--vary control.position_gain=100:1000 --vary contact.stiffness=200:300")
    options = command("--samples 4 --workers 1 --metric rfd --out out")
    assert main(["study", "my.toml", *ranges, *options]) == 0
    said = capsys.readouterr().out
    assert "16 runs: about" in said
    assert (("less in batches" in said), ("16 points run in 1 batch" in said)) == (batches, batches)
    # Each of the fingers has the stiffness of its point.
    assert len({row["contact.stiffness (N/m)"] for row in rows(here / "out" / "points.csv")}) > 8


def test_other_outputs_can_be_had_of_a_finished_study_and_one_that_no_run_has_is_omitted_and_told(
    whole, here, capsys
):
    shutil.copytree(whole, here / "out")
    assert main([*STUDY[:-1], "highest,relief", "--second", "--out", "out"]) == 0
    assert "No run that keeps the fingertip has the metric ridge_error." in capsys.readouterr().out
    assert {row["output"] for row in rows(here / "out" / "indices.csv")} == {"highest"}


@pytest.mark.parametrize(
    "words, message",
    [
        ("--samples 0", "digiclay study: argument --samples: must be a power of two"),
        ("--samples 100", "digiclay study: argument --samples: must be a power of two"),
        (f"--samples {'9' * 99}", "digiclay study: argument --samples: must be a power of two"),
        ("--samples 4096", "--samples must come to 10000 points at most (got 16384 points)."),
        ("--seed 0", "digiclay study: argument --seed: must be a whole number from 1 to"),
        (
            "--vary control.force_gain=1:2",
            "--vary control.force_gain must be given once (got 2 times).",
        ),
        ("--metric rdf", "--metric must be a known metric (got 'rdf')."),
        (
            "--set recorder=absent",
            "Metrics need a recorder, and the scene has recorder = 'absent'.",
        ),
        (
            "--set simulation.duration=1e6",
            "The unchanged scene fails: recorder.every must be at least",
        ),
        ("", "A study needs at least two --vary"),
        ("--method no", "--method: control.method must be one of"),
    ],
)
def test_a_mistake_is_told_in_one_line_and_leaves_no_point(words, message, here, refused):
    study = QUIET if words else ["study", "my.toml", *GAINS[:2], "--quiet", "--out", "out"]
    refused([*study, *words.split()], message)
    assert len(list(here.glob("out/points/*"))) <= 1


def test_a_folder_of_another_study_is_refused(whole, here, refused):
    shutil.copytree(whole, here / "out")
    before = files(here / "out")
    for change, said in (
        (command("--second --samples 4"), "samples 8"),
        (command("--second --seed 2"), "seed 1"),
        (["--second", "--set", "layout.pitch=2.9 mm"], "with another scene"),
        ([], "orders first, second"),
    ):
        refused(
            [*QUIET, *change],
            f"out holds another study ({said}): choose another folder with --out.\n",
        )
    assert files(here / "out") == before


@pytest.mark.parametrize("command, library", [("study", "SALib"), ("tune", "optuna")])
def test_a_missing_library_is_told_with_the_extra_that_has_it(
    command, library, monkeypatch, refused
):
    monkeypatch.setitem(sys.modules, library, None)  # as Python marks what cannot be imported
    said = f"digiclay {command} needs {library}: run 'pip install digiclay[study]'.\n"
    refused([command, "my.toml", *GAINS, "--out", "out"], said)


@pytest.mark.parametrize(
    "said, range_, words",
    [
        ("a.b=-1:2", Range("a.b", -1.0, 2.0), ["-1.0", "0.5", "2.0"]),
        ("a.b=1:100:log", Range("a.b", 1.0, 100.0, logarithmic=True), ["1.0", "10.0", "100.0"]),
        ("a.b=2 mm:4 mm", Range("a.b", 2.0, 4.0, "mm"), ["2.0 mm", "3.0 mm", "4.0 mm"]),
        ("a.b= x, y,z", Range("a.b", words=("x", "y", "z")), ["x", "y", "z"]),
    ],
)
def test_a_range_is_read_from_a_line_and_shares_of_it_are_values(said, range_, words):
    assert read_range(said) == range_
    assert [range_.find_word(share) for share in (0.0, 0.5, 1.0)] == words


def fit(*said, settings=()):
    return fit_ranges([read_range(one) for one in said], find("slow_press"), settings)


def test_a_range_of_a_part_that_the_scene_does_not_have_has_whole_numbers_and_units_too():
    sections, noise = fit("drive.sections=2:9", "sensors.force_noise=0 mN:4 mN")
    assert [sections.find_word(share) for share in (0.0, 0.4, 1.0)] == ["2", "5", "9"]
    assert (noise.si, noise.convert(noise.find_word(0.5))) == ("N", pytest.approx(2e-3))


def test_a_parameter_is_given_once_with_the_values_it_can_have():
    rows, stroke = fit("layout.rows=11:15", "valve.stroke=20 um:40 um")
    # Every whole number of a range has an equal share, and stays one in SI.
    words = [rows.find_word(share) for share in (0.0, 0.19, 0.21, 0.5, 0.79, 0.81, 1.0)]
    assert words == ["11", "11", "12", "13", "14", "15", "15"]
    assert repr(rows.convert("12")) == "12"
    assert (stroke.convert("30 um"), stroke.si) == (pytest.approx(30e-6, rel=1e-15), "m")
    with pytest.raises(ParameterError, match="must be given once"):
        fit("layout.pitch=1e-3:2e-3", "layout.pitch=2e-3:3e-3")
    with pytest.raises(ParameterError, match="must not be given to --set as well"):
        fit("layout.pitch=1e-3:2e-3", settings=(Setting("layout.pitch", "0.003"),))


@pytest.mark.parametrize(
    "said, rule",
    [
        ("a.b", "--vary must be KEY=LOW:HIGH, KEY=LOW:HIGH:log or KEY=A,B,C (got 'a.b')."),
        ("a.b=3", "--vary a.b must be LOW:HIGH, LOW:HIGH:log or at least two different values A,B"),
        (
            "a.b=1:2:5",
            "--vary a.b must be LOW:HIGH or LOW:HIGH:log, without a count (got '1:2:5').",
        ),
        ("a.b=2:1", "--vary a.b must have LOW below HIGH (got '2:1')."),
        (
            "a.b=2:2",
            "--vary a.b must have two different finite numbers at LOW and HIGH (got '2:2').",
        ),
        ("control.force_gian=1:2", "--vary: control.force_gian must be a known key (got 1.0)."),
        ("control=1:2", "--vary: control must be"),
        ("control.force_gain=-1:2", "--vary control.force_gain must be at least 0 1/N (got -1)."),
        (
            "control.force_gain=1:1e12",
            "--vary control.force_gain must be at most 1e+09 1/N (got 1e+12).",
        ),
        (
            "layout.rows=11:12.5",
            "--vary layout.rows must have whole numbers at LOW and HIGH (got 12.5).",
        ),
        ("layout.pitch=2 N:3 N", "--vary layout.pitch must be in m or a multiple of it (got 2 N)."),
        ("blister.profile=1:2", "--vary blister.profile must"),
        ("blister.profile=cone,con", "--vary: blister.profile must be one of"),
    ],
)
def test_what_is_no_range_of_the_parameter_is_refused_with_key_rule_and_value(said, rule):
    with pytest.raises(DigiclayError) as error:
        fit(said)
    assert str(error.value).startswith(rule)


def test_a_file_that_is_wrong_by_itself_is_told_first(tmp_path):
    write_text(tmp_path / "my.toml", "[layout]\nrows = 0\n")
    with pytest.raises(DigiclayError, match="rows"):
        fit_ranges([read_range("a.b=1:2")], tmp_path / "my.toml", ())


def test_a_study_has_bands_of_each_point_over_a_fitted_file_and_goes_on_after_a_stop(
    here, capsys, monkeypatch
):
    fitted(here, (1, 0))
    write_text(
        here / "my.toml", scene_text(3, 4, (0.0, 0.0405), (0.03, 0.038), parts=SMALL_BLISTER)
    )
    study = ["study", "my.toml", *GAINS, "--samples", "4", "--workers", "1", "--out", "out"]
    study += ["--uncertain", "fitted.toml", "--metric", "max_cell_force"]
    with monkeypatch.context() as patched:
        interrupt_after(20, patched)
        assert main([*study, "--quiet"]) == 130
    assert main(study) == 0
    said = capsys.readouterr().out
    assert "bands.csv: 40 members, seed 1" in said
    table, points = rows(here / "out/bands.csv"), rows(here / "out/points.csv")[1:]
    assert [row["point"] for row in table] == [row["point"] for row in points]
    assert len(points) == 4 * (2 + 2)
    inside = 0
    for row, point in zip(table, points, strict=True):
        low, high = (float(row[f"max_cell_force {end} (N)"]) for end in ("low", "high"))
        inside += low < float(point["max_cell_force (N)"]) < high
    assert inside == 16
    # Behind the 16 points are 40 members of each: those of the last one.
    last = [read_json(here / f"out/points/{16 + 15 * 40 + n:06d}.json") for n in range(1, 41)]
    settings = {f"{key} ({unit})": points[-1][f"{key} ({unit})"] for key, unit in KEYS}
    forces = []
    for record in last:
        values = record["values"]
        assert [float(values[key]) for key, _ in KEYS] == pytest.approx(
            [float(value) for value in settings.values()]
        )
        forces.append(record["figures"]["max_cell_force"])
    assert table[-1]["max_cell_force low (N)"] == repr(find_band(forces)[0])
    given = [Setting(key, str(value)) for key, value in last[-1]["values"].items()]
    parts = read_parts(here / "fitted.toml")
    alone = run(load(find("my.toml"), [*parts, *given])).metrics["max_cell_force"]
    assert forces[-1] == pytest.approx(alone, rel=1e-9)
    assert "--uncertain fitted.toml --members 40" in read_text(here / "out/study.md")
    fitted(here, (1, 0), covariance=[[1e-4, 0.0], [0.0, 1e-4]])
    assert main(study) == 2
    assert "out holds another study (with another uncertainty)" in capsys.readouterr().err


@pytest.mark.parametrize("more, said", [
    (["--vary", "contact.stiffness=200:400"], "must not be given to fitted.toml as well"),
    (["--vary", "relaxation.weights.1=0.1:0.2"], "must not be given to --uncertain as well"),
    (["--samples", "256"], "must come to 10000 points at most (got 41984 points)"),
])  # fmt: skip
def test_a_study_with_bands_that_cannot_be_is_refused(more, said, here, refused):
    fitted(here, (3, 0))
    refused(["study", "my.toml", *GAINS, "--uncertain", "fitted.toml", "--out", "out", *more], said)
