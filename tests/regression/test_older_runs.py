"""Folders of runs written by an older version: they are read, and their scenes give the same runs again.

How they were made is in tests/samples/README.md. Runs are compared with the tolerance of the golden
run, for its reason: other processors and other versions of numpy take sums in another order.
"""

import json
import shutil
import tomllib

import digiclay
import numpy as np
import pytest
from digiclay.cli import main
from digiclay.core.metrics.summary import compute_metrics
from digiclay.core.scene.scene_source import load
from digiclay.core.session.run_scene import save

from tests.renew import REMEDY, SAMPLES, run_again

RUNS = SAMPLES / "runs"
RECORDED = ("virtual_master", "cell_states_every_7")
ALL = (*RECORDED, "without_recorder")
#: Largest differences of what a run of the same scene records: N, m, and of a command, which a gain
#: of 500 per meter makes of a height.
TOLERANCES = {"force": 1e-11, "total_force": 1e-10, "height": 1e-13, "command": 1e-9}
#: What says when, where and how quickly a run was made.
CIRCUMSTANCES = ("run_time", "real_time_factor", "versions")


def scene_of(name):
    """Return the scene that was run."""
    return load(RUNS / name / "scene.toml")


def history_of(name):
    """Return what was recorded."""
    with np.load(RUNS / name / "history.npz", allow_pickle=False) as file:
        return dict(file)


def metrics_of(folder):
    """Return what was measured, without the circumstances."""
    metrics = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    return {name: value for name, value in metrics.items() if name not in CIRCUMSTANCES}


def check_metrics(found, stored, rounding):
    """Check that metrics are the stored ones, numbers but for rounding; a newer version may have more."""
    assert [name for name in found if name in stored] == list(stored), (
        "metrics of older runs keep their names"
    )
    for name, value in stored.items():
        # Versions estimate errors by other references: each is within a few hundredths of the true
        # one's 4/3.
        near = 0.1 if name.endswith("_error") else rounding
        wanted = pytest.approx(value, rel=near) if isinstance(value, float) else value
        if name == "units":
            assert value.items() <= found[name].items()
        else:
            assert found[name] == wanted, f"{name}. {REMEDY}"


@pytest.mark.parametrize("name", ALL)
def test_an_older_scene_gives_the_same_folder(name, tmp_path):
    scene, stored = scene_of(name), metrics_of(RUNS / name)
    again = run_again(scene, stored)
    save(again, tmp_path)
    # An estimated error is a difference of two heights or forces: its relative error is larger than
    # theirs.
    check_metrics(metrics_of(tmp_path), stored, 1e-7)
    texts = [
        tomllib.loads((at / "scene.toml").read_text("utf-8")) for at in (tmp_path, RUNS / name)
    ]
    assert texts[0] == texts[1], "scenes of older runs are read as they were"
    if name not in RECORDED:
        return
    older = history_of(name)
    # A newer version may have more arrays.
    assert older.keys() <= again.history.keys(), "arrays of older runs keep their names"
    for key, array in older.items():
        assert again.history[key].dtype == array.dtype
        tolerance = TOLERANCES.get(key, 1e-15)
        np.testing.assert_allclose(
            again.history[key], array, rtol=0.0, atol=tolerance, err_msg=f"{key}. {REMEDY}"
        )
    computed = compute_metrics(older, scene.set_point)
    check_metrics(computed, {key: stored[key] for key in computed if key in stored}, 1e-10)


@pytest.mark.parametrize("name", ALL)
def test_python_reads_an_older_folder(name):
    run = digiclay.load(RUNS / name)
    assert run.scene == scene_of(name)
    stored = json.loads((RUNS / name / "metrics.json").read_text(encoding="utf-8"))
    assert run.metrics == stored
    assert "s simulated in" in repr(run)
    if name in RECORDED:
        assert run.history.keys() == history_of(name).keys()
        # An older version counted no losses: they are counted in the history.
        assert [finger.losses for finger in run.fingers] == [0]


@pytest.mark.parametrize("name", RECORDED)
def test_commands_read_an_older_folder(name, tmp_path, capsys):
    export = ["export", str(RUNS / name), "--format", "stl,3mf", "--kind", "features", "--quiet"]
    assert main([*export, "--out", str(tmp_path / "export")]) == 0
    assert {path.name for path in (tmp_path / "export").iterdir()} == {
        "features.stl",
        "features.3mf",
    }
    assert main(["features", str(RUNS / name), "--json"]) == 0
    assert [feature["kind"] for feature in json.loads(capsys.readouterr().out)] == ["boss"]


def test_an_older_folder_is_plotted_and_its_pins_form_a_shape(tmp_path):
    name = RUNS / "cell_states_every_7"
    assert main(["plot", str(name), "--quiet", "--out", str(tmp_path / "plot")]) == 0
    files = {path.name for path in (tmp_path / "plot").iterdir()}
    assert files == {"session.png", "surface.png"}
    form = ["form", "pyramid", "--scene", str(name), "--quiet", "--out", str(tmp_path / "form")]
    assert main(form) == 0
    assert (tmp_path / "form" / "surface.stl").stat().st_size > 0


@pytest.mark.parametrize("name", ALL)
def test_an_older_folder_is_a_scene_for_run_and_may_be_replaced(name, tmp_path):
    older = tmp_path / "older"
    shutil.copytree(RUNS / name, older)
    command = ["run", str(RUNS / "without_recorder"), "--no-errors", "--quiet", "--out", str(older)]
    assert main(command) != 0
    assert main([*command, "--overwrite"]) == 0
    assert not (older / "history.npz").exists()
    assert metrics_of(older)["scene"] == "stroke"
