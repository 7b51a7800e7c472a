"""Folders of sweeps and batches that an older version made are shown, and gone on with."""

import csv
import shutil
from pathlib import Path

import pytest
from digiclay.cli import main

SAMPLES = Path(__file__).parents[1] / "samples" / "series"
SWEEP = [
    "sweep",
    "my.toml",
    "--vary",
    "control.force_gain=1:5:5",
    "--vary",
    "layout.rows=3,4",
    "--metric",
    "rfd,lag,height_error",
    "--out",
    "sweep",
    "--quiet",
]
BATCH = ["batch", "jobs.toml", "--out", "batch", "--quiet"]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """Work beside copies of the samples, as the version that made them."""
    shutil.copytree(SAMPLES, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    for module in ("sweep", "batch_folder"):
        monkeypatch.setattr(f"digiclay.commands.{module}.__version__", "0.1.0")
    return tmp_path


def times(pattern):
    """Return when each file of a pattern was written, ns."""
    return {path: path.stat().st_mtime_ns for path in Path().glob(pattern)}


def numbers(table):
    """Return the first columns of a sweep's table, those of older ones, of which no point has failed."""
    with table.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))[1:]
    assert [row[-1] for row in rows] == [""] * len(rows)
    return [[float(value) for value in row[:5]] for row in rows]


def test_an_older_sweep_that_is_done_is_shown_as_it_was():
    before, known = times("sweep/points/*"), numbers(Path("sweep/sweep.csv"))
    Path("sweep/sweep.csv").unlink()
    assert main(SWEEP) == 0
    assert (times("sweep/points/*"), numbers(Path("sweep/sweep.csv"))) == (before, known)
    assert sorted(path.stem for path in Path("sweep").glob("*.png")) == [
        "height_error",
        "lag_mean",
        "rfd",
    ]


def test_an_older_sweep_of_another_scene_is_refused(refused):
    before = times("sweep/points/*")
    refused([*SWEEP, "--set", "contact.stiffness=300"], "sweep holds another sweep (10 points over")
    assert times("sweep/points/*") == before


def test_an_older_sweep_that_was_stopped_goes_on_to_the_same_table():
    assert main([*SWEEP, "--workers", "1", "--out", "anew"]) == 0
    anew, stored = numbers(Path("anew/sweep.csv")), numbers(Path("sweep/sweep.csv"))
    for index in range(1, 10, 2):  # the beds of four rows, which make one stack
        Path(f"sweep/points/{index:06d}.json").unlink()
    Path("sweep/sweep.csv").unlink()
    before = times("sweep/points/*")
    assert main([*SWEEP, "--workers", "1"]) == 0
    assert before.items() <= times("sweep/points/*").items()
    expected = [(anew if index % 2 else stored)[index] for index in range(10)]
    for row, values in zip(numbers(Path("sweep/sweep.csv")), expected, strict=True):
        assert row == pytest.approx(values, rel=1e-9, abs=1e-12)


def test_an_older_batch_that_is_done_is_shown_and_one_that_was_stopped_goes_on():
    before = times("batch/runs/*/*")
    Path("batch/index.html").unlink()
    assert main(BATCH) == 0
    assert times("batch/runs/*/*") == before
    page = Path("batch/index.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 2
    assert 'href="runs/my-soft/surface.stl"' in page
    shutil.rmtree("batch/runs/my-firm")
    before = times("batch/runs/my-soft/*")
    assert main(BATCH) == 0
    assert times("batch/runs/my-soft/*") == before
    soft, firm = (
        {path.name for path in Path("batch/runs", name).iterdir()}
        for name in ("my-soft", "my-firm")
    )
    assert soft == firm
