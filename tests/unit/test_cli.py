"""The command line: exit codes, one line for each mistake, and no folder left behind."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digiclay import __version__
from digiclay.cli import main

from tests.scene_files import left

pytestmark = pytest.mark.usefixtures("here")


def test_a_run_is_written_to_a_folder_called_like_the_scene_and_says_so(
    here: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "my.toml"]) == 0
    out, err = capfd.readouterr()
    summary, where = out.splitlines()
    assert summary.startswith("0.1 s simulated in ")
    # No progress is shown where there is no terminal.
    assert (where, err) == ("written to my", "")
    assert {path.name for path in (here / "my").iterdir()} == {"history.npz", "metrics.json", "scene.toml"}
    versions = json.loads((here / "my" / "metrics.json").read_text())["versions"]
    assert versions["digiclay"] == __version__
    assert main(["run", "my.toml", "--quiet", "--out", "first"]) == 0
    assert capfd.readouterr() == ("", "")


def test_settings_and_stepper_reach_the_run_which_can_be_run_again_from_its_folder(here: Path) -> None:
    main(["run", "my.toml", "--quiet", "--set", "layout.rows=2", "--stepper", "runge_kutta_4"])
    assert json.loads((here / "my" / "metrics.json").read_text())["stepper"] == "runge_kutta_4"
    main(["run", "my", "--quiet", "--out", "second"])
    with np.load(here / "my" / "history.npz") as one, np.load(here / "second" / "history.npz") as other:
        assert one["height"].shape == (21, 8)
        assert [name for name in one.files if not np.array_equal(one[name], other[name])] == []


MISTAKES: dict[str, tuple[list[str], str]] = {
    "value": (["run", "my.toml", "--set", "fluid.density=0"], "--set: fluid.density must be above 0 kg/m3"),
    "key": (["run", "my.toml", "--set", "fluid.densty=1"], "Did you mean fluid.density?"),
    "setting": (["run", "my.toml", "--set", "nothing"], "must be KEY=VALUE (got 'nothing')"),
    "stepper": (["run", "my.toml", "--stepper", "leapfrog"], "--stepper: simulation.stepper must be one of"),
    "method": (["run", "my.toml", "--method", "hand"], "--method: control.method must be one of"),
    "memory": (["run", "my.toml", "--set", "simulation.duration=1e6"], "free memory"),
    "file": (["run", "other.toml"], "other.toml: there is no such file."),
    "name": (["run", "ridge_mound_vally"], "Did you mean ridge_mound_valley?"),
    "format": (["run", "my.toml", "--export", "stp"], "known are stl, stl_ascii, obj, ply, glb, 3mf"),
    "surface": (["run", "my.toml", "--set", "layout.rows=1", "--export", "stl"], "at least 2 x 2 cells"),
    "no record": (["run", "my.toml", "--set", "recorder=absent", "--plots"], "--plots needs a recorder"),
    "folder": (["run", "my.toml", "--out", "my.toml"], "my.toml is a file"),
    "no command": ([], "the following arguments are required: COMMAND"),
    "command": (["walk"], "invalid choice: 'walk'"),
    "no scene": (["run"], "the following arguments are required: SCENE"),
    "description": (["describe", "my.toml", "--set", "layout.rows=0"], "layout.rows must be at least 1"),
    "export of nothing": (["export", "nowhere"], "nowhere is no run's folder"),
    "render of nothing": (["render", "my.toml", "--size", "3"], "must be WIDTHxHEIGHT"),
    "benchmark": (["benchmark", "session", "--help"], "run from a checkout: 'python -m benchmarks --help'"),
}  # fmt: skip


@pytest.mark.parametrize(("arguments", "said"), MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_is_one_line_exit_code_2_and_no_folder(
    arguments: list[str], said: str, here: Path, refused: Any
) -> None:
    refused(arguments, said)
    assert left(here) == []


def test_a_run_can_have_meshes_and_plots_and_is_replaced_only_when_asked(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("digiclay.plots.bed.fit_relief", lambda *given: None)  # takes seconds
    main(["run", "my.toml", "--quiet", "--export", "stl,obj", "--plots"])
    added = {path.name for path in (here / "my").iterdir()}
    assert {"surface.stl", "surface.obj", "session.png", "surface.png"} <= added
    before = (here / "my" / "metrics.json").read_bytes()
    assert (main(["run", "my.toml", "--quiet"]), (here / "my" / "metrics.json").read_bytes()) == (2, before)
    main(["run", "my.toml", "--quiet", "--overwrite"])
    assert [*left(here), (here / "my" / "session.png").exists()] == ["my", False]


def test_export_writes_the_surface_of_a_run_in_a_unit_at_an_instant_and_refuses_what_is_damaged(
    here: Path, capsys: pytest.CaptureFixture[str], refused: Any
) -> None:
    main(["run", "my.toml", "--quiet"])
    main(["export", "my", "--format", "ply,glb"])
    made = [os.path.join("my", f"surface.{kind}") for kind in ("ply", "glb")]
    assert capsys.readouterr().out.split() == made
    options = "--format obj --unit m --time 0 --up z --out meshes --quiet"
    main(["export", "my", *options.split()])
    # At rest all pins are 40 mm high; OBJ files are written to 1e-8.
    assert highest(here / "meshes" / "surface.obj") == pytest.approx(0.04, abs=1e-8)
    for when in ("-1", "0.2", "nan", "1 mm", "soon"):
        refused(["export", "my", f"--time={when}"], "--time")
    scene, history = here / "my" / "scene.toml", here / "my" / "history.npz"
    scene.write_text(scene.read_text(encoding="utf-8").replace("rows = 3", "rows = 4"), encoding="utf-8")
    refused(["export", "my"], "height must have the shape (21, 16) of its scene (got (21, 12))")
    history.write_bytes(history.read_bytes()[:1000])
    refused(["export", "my"], "cannot be read as a run's history")


def highest(path: Path) -> float:
    """Return the highest z of an OBJ file."""
    return max(float(line.split()[3]) for line in path.read_text().splitlines() if line.startswith("v "))


def test_describe_tells_what_is_left_out_and_counts_cells_periods_and_bytes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    main(["describe", "my.toml", "--set", "conduit=absent"])
    out = capsys.readouterr().out
    lines = [line.split() for line in out.splitlines()]
    assert [line[0] for line in lines if line[1:] == ["left", "out"]] == ["conduit", "sensors"]
    # Height, three filters, the valve, two commands on their way, target, force: 9 float64.
    counts = ("3 x 4 = 12 cells", "20 control periods", "9 rows", "72 bytes")
    assert [part for part in counts if part not in out] == []


@pytest.mark.parametrize("command", [[], ["run"], ["describe"], ["export"], ["render"], ["paper"]])
def test_help_comes_with_an_example(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    code, out = main([*command, "--help"]), capsys.readouterr().out
    assert (code, f"  digiclay {' '.join(command)}" in out.partition("examples:")[2]) == (0, True)
    assert (main(["--version"]), capsys.readouterr().out) == (0, f"digiclay {__version__}\n")
