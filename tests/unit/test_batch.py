"""Batches while they run: what is kept, what is done again, what fails, and what the page says."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from digiclay.cli import main
from digiclay.commands.batch import JobProcess
from digiclay.commands.batch_folder import Folder, open_batch
from digiclay.core.base.errors import OutputError
from digiclay.core.studies.job_table import read_jobs

from tests.other_process import dead
from tests.timeouts import TIMEOUT, wait_until

ADDON = Path(__file__).parents[2] / "addon"

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


def runs(out: str = "two") -> list[str]:
    """Return what lies in the folder of runs, hidden things too."""
    return sorted(path.name for path in Path(out, "runs").iterdir())


def started(*arguments: str) -> subprocess.Popen[str]:
    """Start the program in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "digiclay", "batch", *arguments], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(ADDON)},
        start_new_session=True,
    )  # fmt: skip


def test_every_job_leaves_a_whole_folder_and_the_page_links_to_it(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_finished_jobs_are_kept_and_only_changed_ones_are_done_again() -> None:
    jobs(TWO)
    main(["batch", "two.toml", "--quiet"])
    before = {name: Path("two/runs", name, "history.npz").stat().st_mtime_ns for name in runs()}
    jobs(TWO.replace("0.2", "0.3") + "other.simulation.duration = 0.1\n")
    assert main(["batch", "two.toml", "--quiet"]) == 0
    after = {name: Path("two/runs", name, "history.npz").stat().st_mtime_ns for name in runs()}
    assert after["tap-quick"] == before["tap-quick"]
    assert after["tap-slow"] > before["tap-slow"]
    assert list(after) == ["tap-other", "tap-quick", "tap-slow"]
    metrics = json.loads(Path("two/runs/tap-slow/metrics.json").read_text(encoding="utf-8"))
    assert metrics["simulated"] == pytest.approx(0.3, abs=1e-9)


def test_a_failing_job_is_told_of_and_the_rest_goes_on(capsys: pytest.CaptureFixture[str]) -> None:
    # One fails when its scene is read, one when it is run: its history fits into no memory.
    jobs(TWO + 'narrow.layout.pitch = "1 mm"\nendless.simulation.duration = 1e6\n')
    assert main(["batch", "two.toml"]) == 1
    assert runs() == ["tap-quick", "tap-slow"]
    out, err = capsys.readouterr()
    assert "failed: tap-narrow: settings.narrow: layout.pitch must be at least" in out
    assert "failed: tap-endless: recorder.every must be at least" in out
    assert err.startswith("2 of 4 jobs failed; the first one: tap-narrow: ")
    assert err.count("\n") == 1
    page = Path("two/index.html").read_text(encoding="utf-8")
    assert page.count('class="failed"') == 2
    assert "recorder.every must be at least" in page


def test_a_folder_that_was_half_written_does_not_count() -> None:
    jobs(TWO)
    main(["batch", "two.toml", "--quiet"])
    Path("two/runs/tap-slow/job.toml").unlink()  # as if it had not come so far
    leftover = Path(f"two/runs/.tap-quick.{dead()}.part")
    shutil.move("two/runs/tap-quick", leftover)
    assert main(["batch", "two.toml", "--quiet"]) == 0
    assert runs() == ["tap-quick", "tap-slow"]
    assert Path("two/runs/tap-slow/job.toml").is_file()


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_ctrl_c_ends_all_processes_and_leaves_nothing_half_done() -> None:
    jobs(HOURS)
    process = started("two.toml", "--jobs", "2")
    wait_until(lambda: len(list(Path("two/runs").glob(".*.part"))) == 2)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    out, err = process.communicate(timeout=TIMEOUT)
    assert (process.returncode, err) == (130, "")
    assert "Stopped: what is done is kept, and the same command goes on from there." in out
    assert runs() == []


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_when_a_batch_is_killed_its_processes_end_and_the_next_one_goes_on() -> None:
    jobs(HOURS)
    process = started("two.toml", "--jobs", "2")
    wait_until(lambda: len(list(Path("two/runs").glob(".*.part"))) == 2)
    process.kill()
    process.communicate(timeout=TIMEOUT)
    # The processes notice that nobody is there, and take back what they have begun.
    wait_until(lambda: runs() == [])
    jobs(TWO)
    assert main(["batch", "two.toml", "--quiet"]) == 0


def test_a_process_that_dies_is_told_by_its_signal() -> None:
    jobs(HOURS)
    main(["batch", "two.toml", "--prepare", "--quiet"])
    worker = JobProcess(["job", "two/jobs/tap-a", "--follow"], Path("log.txt"))
    wait_until(lambda: list(Path("two/runs").glob(".*.part")))
    worker.kill()
    assert worker.read_error().startswith("The process ended with signal 9")


def test_a_job_can_be_done_elsewhere_from_its_files_alone(here: Path) -> None:
    jobs(TWO)
    assert main(["batch", "two.toml", "--prepare", "--quiet"]) == 0
    assert runs() == []
    far = here.parent / "a farm"
    shutil.copytree("two/jobs/tap-slow", far / "jobs" / "tap-slow")
    assert main(["job", str(far / "jobs" / "tap-slow"), "--quiet"]) == 0
    shutil.copytree(far / "runs" / "tap-slow", "two/runs/tap-slow")
    shutil.rmtree("two/jobs")
    assert main(["batch", "two.toml", "--quiet"]) == 0
    # Its time says that it was not done again.
    assert json.loads(Path("two/runs/tap-slow/timing.json").read_text(encoding="utf-8"))["start_up"] is None


def test_two_batches_cannot_work_in_one_folder() -> None:
    jobs(TWO)
    made, busy = read_jobs(Path("two.toml")), "being worked in by another digiclay"
    with open_batch(Path("two"), made), pytest.raises(OutputError, match=busy), open_batch(Path("two"), made):
        pass


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
def test_a_mistake_is_refused_in_one_line_before_any_work(
    arguments: list[str], said: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    jobs(said)
    assert main(["batch", "two.toml", *arguments]) == 2
    _, err = capsys.readouterr()
    assert told in err
    assert err.count("\n") == 1
    assert [path.name for path in Path().iterdir()] == ["two.toml"]
