"""A batch with pictures, drawn by processes that start this Blender once more."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import pytest
from digiclay.cli import main
from digiclay.commands.gallery import WIDTH

JOBS = """
scenes = ["tap"]
methods = ["cell_states"]
errors = false
settings.short.simulation.duration = 0.3
[still]
width = 160
height = 100
engine = "cycles"
samples = 1
[turntable]
width = 64
height = 40
frames = 2
[film]
width = 160
height = 100
rate = 5
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short run."""
    folder = tmp_path_factory.mktemp("short") / "run"
    settings = ["--set", "simulation.duration=0.2", "--no-errors", "--quiet"]
    assert main(["run", "tap", "--out", str(folder), *settings]) == 0
    return folder


def test_a_run_is_filmed_and_turned_by_commands(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    small = ["--size", "64x40", "--rate", "5", "--quiet"]
    assert main(["render", str(run), "--film", "--speed", "0.5", "--color", "force", *small]) == 0
    assert main(["render", str(run), "--turntable", "--frames", "2", *small]) == 0
    assert {path.name for path in run.glob("*.mp4")} == {"film.mp4", "turntable.mp4"}
    assert capsys.readouterr().out == ""


def test_a_batch_draws_what_is_asked_for_and_shows_it_on_its_page(capfd: pytest.CaptureFixture[str]) -> None:
    Path("drawn.toml").write_text(JOBS, encoding="utf-8")
    assert main(["batch", "drawn.toml", "--jobs", "2"]) == 0, capfd.readouterr().out
    page = Path("drawn/index.html").read_text(encoding="utf-8")
    folder = Path("drawn/runs/tap-cell_states-short")
    drawn = {"still.png", "thumbnail.jpg", "turntable.mp4", "film.mp4"}
    assert drawn <= {path.name for path in folder.iterdir()}
    # An MP4 file says so at its start.
    assert all((folder / film).read_bytes()[4:8] == b"ftyp" for film in ("turntable.mp4", "film.mp4"))
    assert f'href="runs/{folder.name}/film.mp4"' in page
    timing = json.loads((folder / "timing.json").read_text(encoding="utf-8"))
    # Blender's module needs some tenths of a second to come up, on any machine.
    assert 0.2 < timing["start_up"] < 60.0
    image = bpy.data.images.load(str((folder / "thumbnail.jpg").resolve()))
    assert tuple(image.size) == (WIDTH, WIDTH * 100 // 160)
    assert page.count("data:image/jpeg;base64,") == 1


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--film", "--size", "65x40"], "--size must be an even number"),
        (["--film", "--rate", "0"], "--rate must be at least 1"),
        (["--film", "--start", "7"], "--start must be between 0 s and"),
        (["--film", "--time", "0"], "--time must not be given with --film"),
        (["--speed", "2"], "--speed must be given with --film only"),
        (["--film", "--frames", "9"], "--frames must be given with --turntable only"),
        (["--film", "--turntable"], "not allowed with argument"),
    ],
)
def test_options_that_do_not_go_together_are_told_in_one_line(
    arguments: list[str], told: str, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["render", str(run), *arguments]) == 2
    _, err = capsys.readouterr()
    assert told in err
    assert err.count("\n") == 1
