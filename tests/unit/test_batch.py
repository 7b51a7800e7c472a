"""Batches while they run: what is kept, what is done again, what fails, and what the page says."""

from __future__ import annotations

import base64
import json
import os
import re
import shutil
import signal
import time
from collections import Counter
from html import unescape
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from digiclay.cli import main
from digiclay.commands.batch import JobProcess
from digiclay.commands.batch_folder import Folder
from digiclay.commands.gallery import Card, height_map, page
from digiclay.core.files.formats import encode_png

from tests.other_process import PROGRAM, dead, finish, start
from tests.timeouts import TIMEOUT, wait_until

TWO = """
scenes = ["tap"]
export = ["stl"]
errors = false
[settings]
quick = { simulation.duration = 0.1 }
slow = { simulation.duration = 0.2 }
"""
#: Sessions of hours: for being stopped.
HOURS = """
scenes = ["tap"]
[settings]
a = { simulation.duration = 1e4, recorder.every = 1000 }
b = { simulation.duration = 1e4, recorder.every = 1000 }
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder, with a blank and an umlaut in its path."""
    folder = tmp_path / "schöne Tasten"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def jobs(said: str) -> None:
    """Write the JOBS file."""
    Path("two.toml").write_text(said, encoding="utf-8")


def started() -> Any:
    """Start a batch of sessions of hours in a process of its own; return it when both have begun."""
    jobs(HOURS)
    process = start(PROGRAM, "batch", "two.toml", "--jobs", "2", start_new_session=True)
    wait_until(lambda: len(list(Path("two/runs").glob(".*.part"))) == 2)
    return process


def runs(out: str = "two") -> list[str]:
    """Return what lies in the folder of runs, hidden things too."""
    return sorted(path.name for path in Path(out, "runs").iterdir())


def test_every_job_leaves_a_whole_folder_and_the_page_links_to_it(capsys, monkeypatch):
    jobs(TWO)
    pages: list[str] = []
    write = Folder.write_index

    def read(*given: Any) -> Path:
        pages.append((path := write(*given)).read_text(encoding="utf-8"))
        return path

    monkeypatch.setattr(Folder, "write_index", read)
    started = time.time()
    assert main(["batch", "two.toml", "--jobs", "2"]) == 0
    took = time.time() - started
    assert runs() == ["tap-quick", "tap-slow"]
    files = {path.name for path in Path("two/runs/tap-slow").iterdir()}
    wanted = "history.npz job.toml metrics.json scene.toml surface.stl thumbnail.png timing.json"
    assert files == set(wanted.split())
    out, err = capsys.readouterr()
    assert err == ""
    assert "2 of 2 jobs done; 2 of them now, in" in out
    # A process that imports numpy needs a tenth of a second at the very least, on any machine.
    timing = json.loads(Path("two/runs/tap-slow/timing.json").read_text(encoding="utf-8"))
    assert 0.1 < timing["start_up"] < took
    assert "s to start" in out
    # It is written when the first job has ended, and in the end.
    during, page = pages[0], pages[-1]
    assert "1 of 2 jobs ended so far." in during
    assert during.count("not done yet") == during.count('http-equiv="refresh"')
    assert 'http-equiv="refresh"' not in page
    assert 'href="runs/tap-slow/surface.stl"' in page
    assert page.count("start of its process") == page.count("data:image/png;base64,") == 2


def test_finished_jobs_are_kept_also_from_elsewhere_and_changed_or_half_written_ones_are_done_again(here):
    jobs(TWO)
    assert main(["batch", "two.toml", "--prepare", "--quiet"]) == 0
    assert runs() == []
    far = here.parent / "a farm"
    shutil.copytree("two/jobs/tap-quick", far / "jobs" / "tap-quick")
    for folder in (far / "jobs/tap-quick", "two/jobs/tap-slow"):  # in this process: others take seconds
        assert main(["job", str(folder), "--quiet"]) == 0
    shutil.copytree(far / "runs" / "tap-quick", "two/runs/tap-quick")
    shutil.rmtree("two/jobs")
    before = {name: Path("two/runs", name, "history.npz").stat().st_mtime_ns for name in runs()}
    jobs(TWO.replace("0.2", "0.3"))
    shutil.copytree("two/runs/tap-quick", f"two/runs/.tap-quick.{dead()}.part")
    assert main(["batch", "two.toml", "--quiet"]) == 0
    after = {name: Path("two/runs", name, "history.npz").stat().st_mtime_ns for name in runs()}
    assert (after["tap-quick"] == before["tap-quick"], after["tap-slow"] > before["tap-slow"]) == (True, True)
    assert list(after) == ["tap-quick", "tap-slow"]
    metrics = json.loads(Path("two/runs/tap-slow/metrics.json").read_text(encoding="utf-8"))
    assert metrics["simulated"] == pytest.approx(0.3, abs=1e-9)


def test_a_failing_job_is_told_of_and_the_rest_goes_on(capsys: pytest.CaptureFixture[str]) -> None:
    # One fails when its scene is read, one when it is run: its history fits into no memory.
    one, _, _ = TWO.partition("slow")
    jobs(one + 'narrow.layout.pitch = "1 mm"\nendless.simulation.duration = 1e6\n')
    assert main(["batch", "two.toml"]) == 1
    assert runs() == ["tap-quick"]
    out, err = capsys.readouterr()
    assert "failed: tap-narrow: settings.narrow: layout.pitch must be at least" in out
    assert "failed: tap-endless: recorder.every must be at least" in out
    assert err.startswith("2 of 3 jobs failed; the first one: tap-narrow: ")
    assert err.count("\n") == 1
    page = Path("two/index.html").read_text(encoding="utf-8")
    assert page.count('class="failed"') == 2
    assert "recorder.every must be at least" in page


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_ctrl_c_ends_all_processes_and_leaves_nothing_half_done() -> None:
    process = started()
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    code, out, err = finish(process)
    assert (code, err, runs()) == (130, "", [])
    assert "Stopped: what is done is kept, and the same command goes on from there." in out


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_when_a_batch_is_killed_its_processes_end_and_a_process_that_dies_is_told_by_its_signal() -> None:
    process = started()
    process.kill()
    process.communicate(timeout=TIMEOUT)
    # The processes notice that nobody is there, and take back what they have begun.
    wait_until(lambda: runs() == [])
    worker = JobProcess(["job", "two/jobs/tap-a", "--follow"], Path("log.txt"))
    wait_until(lambda: list(Path("two/runs").glob(".*.part")))
    worker.kill()
    assert worker.read_error().startswith("The process ended with signal 9")


@pytest.mark.parametrize(
    ("arguments", "said", "told"),
    [
        ([], 'scenes = ["tap"]\nexport = ["doc"]', "export: "),
        ([], 'scenes = ["tap"]\nexport = ["stl"]\nsettings.a.recorder = "absent"', "need a recorder"),
        (["--out", "two.toml"], TWO, "two.toml is a file"),
        (["--out", "."], TWO, ". holds other things than a batch"),
        (["--jobs", "0"], TWO, "--jobs"),
        (["--out", "two", "secnod"], TWO, "unrecognized arguments: secnod"),
    ],
)
def test_a_mistake_is_refused_in_one_line_before_any_work(arguments, said, told, refused):
    jobs(said)
    refused(["batch", "two.toml", *arguments], told)
    assert [path.name for path in Path().iterdir()] == ["two.toml"]


# The index page needs nothing but itself


def read(made: str) -> list[str]:
    """Return what a page refers to; its tags are closed."""
    tags = re.findall(r"<(/?)(\w+)", made)
    opened, closed = (Counter(tag for end, tag in tags if end == kind) for kind in ("", "/"))
    assert opened - Counter(dict.fromkeys(("meta", "img", "br"), len(tags))) == closed
    return [unescape(found) for found in re.findall(r'(?:src|href)="([^"]*)"', made)]


def test_the_page_refers_to_nothing_but_files_beside_it_and_holds_its_thumbnails() -> None:
    picture = encode_png(np.full((3, 5, 3), 77, np.uint8))
    done = Card("a", picture, [("lag", "1 mm")], [("film", "runs/a b/film #1.mp4")], leads="f.mp4")
    failed = Card("b", error="it broke", links=[("log", "l")])
    leads, shown, *links = read(page("Batch", "1 of 2 jobs done.", [done, failed]))
    kind, _, data = shown.partition(",")
    assert (kind, base64.b64decode(data)) == ("data:image/png;base64", picture)
    assert [leads, *links] == ["f.mp4", "runs/a%20b/film%20%231.mp4", "l"]


def test_names_and_errors_are_shown_as_they_are_and_never_as_html() -> None:
    nasty = '<script>alert("x")</script> & Söhne'
    made = page(nasty, nasty, [Card(nasty, facts=[(nasty, nasty)]), Card(nasty, error=nasty)])
    assert read(made) == []
    assert "<script" not in made
    assert unescape(made).count(nasty) == 8  # the title stands in the head as well


@pytest.mark.parametrize("shape", [(1, 1), (7, 3), (40, 61)])
def test_a_png_is_read_back_by_another_program_as_it_was(shape: tuple[int, int]) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (*shape, 3), np.uint8)
    back = matplotlib.image.imread(BytesIO(encode_png(pixels)), format="png")
    np.testing.assert_array_equal(np.round(back[..., :3] * 255.0).astype(np.uint8), pixels)


def test_a_map_of_heights_has_about_the_width_asked_for_and_shows_high_pins_bright_far_ones_above() -> None:
    for shape in ((1, 1), (25, 25), (3, 40), (1000, 700)):
        rows, columns, channels = height_map(np.zeros(shape), 320).shape
        assert (channels, 160 < max(rows, columns) <= 320) == (3, True)
    height = np.zeros((4, 4))
    height[3, 0] = 1.0  # far, left
    shown = height_map(height, 4).astype(int).sum(axis=2)
    assert np.unravel_index(shown.argmax(), shown.shape) == (0, 0)
