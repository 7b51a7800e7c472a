"""A film drawn in ranges of frames, by several processes, is the film drawn in one."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import numpy as np
import pytest
from digiclay.cli import main
from digiclay.commands.job_steps import Work, find_frames, is_done, make_frames
from digiclay.commands.render import ARRAYS, stage_moving
from digiclay.compat import scratch, strips
from digiclay.core.files.run_folder import lock_name
from digiclay.core.session.finished_run import read_run
from digiclay.core.session.render_settings import list_missing, name_frame
from digiclay.core.studies.job_table import read_outputs
from digiclay.pictures.film import draw_frames

JOBS = """
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


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work beside a job whose run is done and whose films are not."""
    monkeypatch.chdir(tmp_path)
    Path("two.toml").write_text(JOBS, encoding="utf-8")
    assert main(["batch", "two.toml", "--prepare", "--quiet"]) == 0
    assert main(["job", str(JOB), "--only", "run", "--quiet"]) == 0
    return tmp_path


def pixels(folder: Path, frame: int) -> np.ndarray:
    """Read a frame."""
    with scratch():
        image = bpy.data.images.load(str(name_frame(folder, frame).resolve()))
        return np.array(image.pixels[:])


def count_frames(film: Path) -> int:
    """Return how many frames a film has."""
    with scratch():
        strip = strips(bpy.data.scenes.new("reading")).new_movie("film", str(film), channel=1, frame_start=1)
        return int(strip.duration if hasattr(strip, "duration") else strip.frame_final_duration)


def test_frames_drawn_in_ranges_are_those_of_the_film(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, whole = find_frames(RUN, "film"), here / "whole"
    whole.mkdir()
    assert main(["job", str(JOB), "--only", "film", "--frames", "2-3", "--quiet"]) == 0
    assert list_missing(folder, range(COUNT)) == [0, 1, 4]
    outputs, found = read_outputs(JOB / "job.toml"), read_run(RUN, *ARRAYS)
    with stage_moving(found.scene, found.history, outputs.film) as shots:
        assert shots.count == COUNT
        assert draw_frames(shots, range(COUNT), whole, here / "film.mp4")
    for frame in (2, 3):
        np.testing.assert_array_equal(pixels(folder, frame), pixels(whole, frame))
        assert (pixels(whole, frame) != pixels(whole, frame - 1)).any()
    # Another range draws no frame that is there, and again one that a copy cut off; a stop keeps those drawn.
    kept = name_frame(folder, 3).stat().st_mtime_ns
    name_frame(folder, 2).write_bytes(name_frame(folder, 3).read_bytes()[:-4])
    asked = iter([False, True])
    with pytest.raises(KeyboardInterrupt):
        make_frames(Work(JOB, RUN, outputs, lambda: next(asked), lambda step, share: None), "film", "2-4")
    assert list_missing(folder, range(COUNT)) == [0, 1, 4]
    assert name_frame(folder, 3).stat().st_mtime_ns == kept
    np.testing.assert_array_equal(pixels(folder, 2), pixels(whole, 2))
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
    assert (count_frames(RUN / "film.mp4"), folder.exists(), is_done(JOB, RUN)) == (COUNT, False, True)
    assert (RUN / "history.npz").stat().st_mtime_ns == before
    timing = json.loads((RUN / "timing.json").read_text(encoding="utf-8"))
    assert timing["files"]["film.mp4"] == (RUN / "film.mp4").stat().st_size
    made = (RUN / "film.mp4").stat().st_mtime_ns
    for part in (["--only", "film"], ["--only", "film", "--frames", "0-3"], []):
        assert main(["job", str(JOB), *part]) == 0
        assert " already" in capsys.readouterr().out
    assert (RUN / "film.mp4").stat().st_mtime_ns == made
