"""Folders of runs written by an older version: they are read, and their scenes give the same runs again.

How they were made is in tests/samples/README.md. Runs are compared with the tolerance of the golden run, for
its reason: other processors and other versions of numpy take sums in another order.
"""

from __future__ import annotations

import json
import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.core.metrics.summary import compute_metrics
from digiclay.core.scene.scene_source import load
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import run, save

from tests.renew import SAMPLES, run_again

RUNS = SAMPLES / "runs"
RECORDED = ("virtual_master", "cell_states_every_7")
ALL = (*RECORDED, "without_recorder")
#: Largest differences of what a run of the same scene records: N, m, and of a command, which a gain of 500
#: per meter makes of a height.
TOLERANCES = {"force": 1e-11, "total_force": 1e-10, "height": 1e-13, "command": 1e-9}
#: What says when, where and how quickly a run was made.
CIRCUMSTANCES = ("run_time", "real_time_factor", "versions")
#: Metrics that an older version did not have.
ADDED = {"force_oscillation", "rfd_jnd_least", "rfd_jnd_most", "ridge_unevenness_touch"}


def scene_of(name: str) -> Scene:
    """Return the scene that was run."""
    return load(RUNS / name / "scene.toml")


def history_of(name: str) -> dict[str, Any]:
    """Return what was recorded."""
    with np.load(RUNS / name / "history.npz", allow_pickle=False) as file:
        return dict(file)


def metrics_of(folder: Path) -> dict[str, Any]:
    """Return what was measured, without the circumstances and what an older version did not measure."""
    metrics: dict[str, Any] = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    for name in ADDED:
        metrics.get("units", {}).pop(name, None)
    return {name: value for name, value in metrics.items() if name not in {*CIRCUMSTANCES, *ADDED}}


def numbers(metrics: dict[str, Any]) -> Any:
    """Return the numbers among the metrics, to be compared with a tolerance."""
    return {name: value for name, value in metrics.items() if isinstance(value, float)}


def others(metrics: dict[str, Any]) -> dict[str, Any]:
    """Return what else there is, to be equal."""
    return {name: value for name, value in metrics.items() if not isinstance(value, float)}


@pytest.mark.parametrize("name", RECORDED)
def test_an_older_history_has_the_metrics_that_were_stored(name: str) -> None:
    stored = metrics_of(RUNS / name)
    computed = compute_metrics(history_of(name), scene_of(name).set_point)
    computed = {key: value for key, value in computed.items() if key not in ADDED}
    stored = {key: stored[key] for key in computed}
    assert others(computed) == others(stored)
    assert numbers(computed) == pytest.approx(numbers(stored), rel=1e-10)


@pytest.mark.parametrize("name", RECORDED)
def test_an_older_scene_gives_the_same_history(name: str) -> None:
    again = run(scene_of(name)).history
    assert again is not None
    older = history_of(name)
    assert list(again) == list(older)
    for key, array in older.items():
        assert again[key].dtype == array.dtype
        np.testing.assert_allclose(again[key], array, rtol=0.0, atol=TOLERANCES.get(key, 1e-15), err_msg=key)


@pytest.mark.parametrize("name", ALL)
def test_an_older_scene_gives_the_same_metrics_file(name: str, tmp_path: Path) -> None:
    scene = scene_of(name)
    stored = metrics_of(RUNS / name)
    save(run_again(scene, stored), tmp_path)
    again = metrics_of(tmp_path)
    assert list(again) == list(stored)
    assert others(again) == others(stored)
    # An estimated error is a difference of two heights or forces: its relative error is larger than theirs.
    assert numbers(again) == pytest.approx(numbers(stored), rel=1e-7)


@pytest.mark.parametrize("name", ALL)
def test_an_older_scene_is_written_with_the_same_values(name: str, tmp_path: Path) -> None:
    save(run(scene_of(name)), tmp_path)
    again, older = (tomllib.loads((at / "scene.toml").read_text("utf-8")) for at in (tmp_path, RUNS / name))
    assert again == older


@pytest.mark.parametrize("name", RECORDED)
@pytest.mark.parametrize(
    "command", [("export", "--format", "stl,3mf", "--kind", "features"), ("plot",)], ids=lambda c: c[0]
)
def test_commands_read_an_older_folder(name: str, command: tuple[str, ...], tmp_path: Path) -> None:
    assert main([command[0], str(RUNS / name), *command[1:], "--out", str(tmp_path), "--quiet"]) == 0
    written = {path.name for path in tmp_path.iterdir()}
    assert written == (
        {"session.png", "surface.png"} if command[0] == "plot" else {"features.stl", "features.3mf"}
    )


@pytest.mark.parametrize("name", RECORDED)
def test_the_features_of_an_older_folder_are_listed(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["features", str(RUNS / name), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [feature["kind"] for feature in found] == ["boss"]


@pytest.mark.parametrize("name", ALL)
def test_an_older_folder_is_a_scene_for_run_and_form(name: str, tmp_path: Path) -> None:
    assert main(["run", str(RUNS / name), "--no-errors", "--quiet", "--out", str(tmp_path / "run")]) == 0
    assert metrics_of(tmp_path / "run")["scene"] == "stroke"
    if name in RECORDED:
        form = ["form", "pyramid", "--scene", str(RUNS / name), "--quiet", "--out", str(tmp_path / "form")]
        assert main(form) == 0
        assert (tmp_path / "form" / "surface.stl").stat().st_size > 0


def test_a_newer_run_may_take_the_place_of_an_older_one(tmp_path: Path) -> None:
    shutil.copytree(RUNS / "virtual_master", tmp_path / "older")
    command = ["run", str(RUNS / "without_recorder"), "--quiet", "--out", str(tmp_path / "older")]
    assert main(command) != 0
    assert main([*command, "--overwrite"]) == 0
    assert not (tmp_path / "older" / "history.npz").exists()
