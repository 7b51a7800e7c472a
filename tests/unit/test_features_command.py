"""``digiclay features`` and the options of ``digiclay export``, on one short run."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from digiclay.cli import main

from tests.scene_files import SMALL_BLISTER, left, scene_text

SCENE = scene_text(9, 9, (0.0, 0.041), (0.2, 0.036), (0.3, 0.036), parts=SMALL_BLISTER)


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that pressed the middle in."""
    folder = tmp_path_factory.mktemp("features")
    (folder / "my.toml").write_text(SCENE, encoding="utf-8")
    assert main(["run", str(folder / "my.toml"), "--out", str(folder / "run"), "--quiet", "--no-errors"]) == 0
    return folder / "run"


@pytest.fixture
def run(pressed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it in the folder one works in."""
    shutil.copytree(pressed, tmp_path / "run")
    monkeypatch.chdir(tmp_path)
    return tmp_path / "run"


def listed(capsys: pytest.CaptureFixture[str], *options: str) -> list[dict]:
    assert main(["features", "run", "--json", *options]) == 0
    return json.loads(capsys.readouterr().out)


def test_features_are_listed_in_a_table_and_none_at_the_start(run, capsys):
    assert main(["features", "run"]) == 0
    counted, head, _, row = capsys.readouterr().out.splitlines()
    assert counted == "0 bosses and 1 crease"
    assert (head.split()[:3], row.split()[0]) == (["feature", "form", "pins"], "crease_1")
    assert main(["features", "run", "--time", "0"]) == 0
    assert capsys.readouterr().out == "0 bosses and 0 creases\n"


def test_json_is_in_si_units_from_any_former_surface(run, capsys):
    (found,), (rest,) = listed(capsys), listed(capsys, "--former", "0.1")
    with np.load(run / "history.npz") as history:
        deepest = float((history["height"][0] - history["height"][-1]).max())
    assert found["kind"] == "crease"
    assert found["depth"] == pytest.approx(deepest, rel=1e-12)
    assert 40 in found["pins"]  # the middle of 9 x 9
    assert rest["depth"] < found["depth"]
    assert listed(capsys, "--former", "rest")[0]["depth"] == pytest.approx(deepest, rel=1e-9)


def test_a_threshold_is_in_millimeters_or_with_a_unit(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert listed(capsys, "--threshold", "1") == listed(capsys, "--threshold", "1000 um")
    assert listed(capsys, "--threshold", "1") != listed(capsys)
    assert listed(capsys, "--smallest", "81") == []


@pytest.mark.parametrize(
    ("options", "names"),
    [
        ([], ["surface.stl"]),
        (["--kind", "surface"], ["skin.stl"]),
        (["--kind", "pins", "--format", "stl_ascii,3mf"], ["pins.3mf", "pins.ascii.stl"]),
        (["--kind", "features"], ["features.stl"]),
        (["--kind", "features", "--separate"], ["crease_1.stl"]),
    ],
)
def test_each_kind_has_its_file(run: Path, options: list[str], names: list[str]) -> None:
    assert main(["export", "run", "--out", "made", "--quiet", *options]) == 0
    assert sorted(path.name for path in Path("made").iterdir()) == names


def test_a_skin_and_its_resolution_can_be_chosen(run: Path) -> None:
    options = ["--skin", "smooth", "--resolution", "3", "--base-thickness", "5"]
    assert main(["export", "run", "--quiet", *options]) == 0
    made = trimesh.load_mesh(run / "surface.stl")
    assert len(made.faces) == 4 * 24 * 24 + 4 * 2 * 24
    with np.load(run / "history.npz") as history:
        lowest = float(history["height"][-1].min()) * 1e3
    assert made.bounds[0, 2] == pytest.approx(lowest - 5.0, abs=0.2)  # the spline goes a little lower


@pytest.mark.parametrize("said", ["0.8", "800um"])
def test_a_length_is_in_millimeters_or_has_a_unit_behind_it(said: str, run: Path) -> None:
    assert main(["export", "run", "--base-thickness", said, "--format", "obj", "--up", "z", "--quiet"]) == 0
    lines = (run / "surface.obj").read_text().splitlines()
    heights = [float(line.split()[3]) for line in lines if line.startswith("v ")]
    with np.load(run / "history.npz") as history:
        lowest = float(history["height"][-1].min()) * 1e3
    assert min(heights) == pytest.approx(lowest - 0.8, abs=1e-5)  # digits of the file


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["export", "run", "--separate"], "--separate needs --kind features."),
        (["export", "run", "--base-thickness", "0"], "--base-thickness must be above 0 m (got 0 m)."),
        (["export", "run", "--base-thickness", "thick"], "argument --base-thickness: must be a number"),
        (["export", "run", "--kind", "features", "--time", "0"], "There is no feature of at least 3 pins"),
        (["features", "run", "--threshold", "-1"], "--threshold must be at least 1e-06 m (got -0.001 m)."),
        (["features", "run", "--threshold", "1 furlong"], "--threshold: must have a unit known here"),
        (["features", "run", "--threshold", "1 N"], "argument --threshold: must be in m or a multiple of it"),
        (["features", "run", "--smallest", "0"], "--smallest must be at least 1 (got 0)."),
        (["features", "run", "--former", "99"], "--former must be between 0 s and"),
        (["features", "run", "--former", "soon"], "--former must be a time or 'rest'"),
        (["features", "nowhere"], "nowhere is no run's folder"),
    ],
)
def test_a_mistake_is_one_line_and_no_file(run, refused, arguments, said):
    before = left(run)
    refused(arguments, said)
    assert left(run) == before
