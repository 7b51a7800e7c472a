"""Films by commands and in a batch; drawn in ranges of frames by several processes a film is the same."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import numpy as np
import pytest
from digiclay.cli import main
from digiclay.commands.gallery import WIDTH
from digiclay.commands.job_steps import Work, find_frames, is_done
from digiclay.commands.render import ARRAYS, stage_moving
from digiclay.compat import scratch
from digiclay.core.files.run_folder import lock_name
from digiclay.core.session.finished_run import read_run
from digiclay.core.session.render_settings import list_missing, name_frame
from digiclay.core.studies.job_table import read_outputs
from digiclay.pictures.film import draw_frames

from tests.blender.at_hand import film_strip, read_picture

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


RANGES = """
scenes = ["tap"]
errors = false
settings.short.simulation.duration = 0.4
[film]
width = 64
height = 40
rate = 10
"""
COUNT = 5
JOB, RUN = Path("two/jobs/tap-short"), Path("two/runs/tap-short")


@pytest.fixture
def job(here: Path) -> Path:
    """Work beside a job whose run is done and whose films are not."""
    Path("two.toml").write_text(RANGES, encoding="utf-8")
    assert main(["batch", "two.toml", "--prepare", "--quiet"]) == 0
    assert main(["job", str(JOB), "--only", "run", "--quiet"]) == 0
    return here


def test_frames_drawn_in_ranges_are_those_of_the_film(job: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, whole = find_frames(RUN, "film"), job / "whole"
    whole.mkdir()
    assert main(["job", str(JOB), "--only", "film", "--frames", "2-3", "--quiet"]) == 0
    assert list_missing(folder, range(COUNT)) == [0, 1, 4]
    outputs, found = read_outputs(JOB / "job.toml"), read_run(RUN, *ARRAYS)
    with stage_moving(found.scene, found.history, outputs.film) as shots:
        assert shots.count == COUNT
        assert draw_frames(shots, range(COUNT), whole, job / "film.mp4")
    for frame in (2, 3):
        np.testing.assert_array_equal(
            read_picture(name_frame(folder, frame)), read_picture(name_frame(whole, frame))
        )
        assert (read_picture(name_frame(whole, frame)) != read_picture(name_frame(whole, frame - 1))).any()
    # Another range draws no frame that is there, and again one that a copy cut off; a stop keeps those drawn.
    kept = name_frame(folder, 3).stat().st_mtime_ns
    name_frame(folder, 2).write_bytes(name_frame(folder, 3).read_bytes()[:-4])
    asked = iter([False, True])
    with pytest.raises(KeyboardInterrupt):
        Work(JOB, RUN, outputs, lambda: next(asked), lambda step, share: None).make_frames("film", "2-4")
    assert list_missing(folder, range(COUNT)) == [0, 1, 4]
    assert name_frame(folder, 3).stat().st_mtime_ns == kept
    np.testing.assert_array_equal(read_picture(name_frame(folder, 2)), read_picture(name_frame(whole, 2)))
    # A second process on the same frames is refused, and frames that the film does not have.
    with lock_name(folder / "3-4"):
        assert main(["job", str(JOB), "--only", "film", "--frames", "3-4", "--quiet"]) == 2
    assert "3-4 is being written by another digiclay" in capsys.readouterr().err
    assert main(["job", str(JOB), "--only", "film", "--frames", "0-5", "--quiet"]) == 2
    assert capsys.readouterr().err == "--frames must be within 0-4, first frame first (got 0-5).\n"
    # The job as a whole keeps its run, draws what is missing, and makes the film.
    assert not is_done(JOB, RUN)
    before = (RUN / "history.npz").stat().st_mtime_ns
    assert main(["job", str(JOB), "--quiet"]) == 0
    with scratch():
        _, count = film_strip(bpy.data.scenes.new("reading"), RUN / "film.mp4")
    assert (count, folder.exists(), is_done(JOB, RUN)) == (COUNT, False, True)
    assert (RUN / "history.npz").stat().st_mtime_ns == before
    timing = json.loads((RUN / "timing.json").read_text(encoding="utf-8"))
    assert timing["files"]["film.mp4"] == (RUN / "film.mp4").stat().st_size
    made = (RUN / "film.mp4").stat().st_mtime_ns
    for part in (["--only", "film"], ["--only", "film", "--frames", "0-3"], []):
        assert main(["job", str(JOB), *part]) == 0
        assert " already" in capsys.readouterr().out
    assert (RUN / "film.mp4").stat().st_mtime_ns == made
