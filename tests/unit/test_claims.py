"""Folders are claimed: one process writes at a time, and what a killed one leaves goes away."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from digiclay.cli import main
from digiclay.core.base.errors import OutputError
from digiclay.core.files.file_lock import find_host
from digiclay.core.files.run_folder import (
    claim_files,
    claim_folder,
    find_lock,
    remove_abandoned,
    resolve_inside,
    write_folder,
)

from tests.other_process import dead
from tests.scene_files import SMALL_BLISTER, TOUCH, folder_with, scene_text
from tests.timeouts import TIMEOUT, wait_until

ADDON = Path(__file__).parents[2] / "addon"
SCENE = scene_text(3, 4, *TOUCH, parts=SMALL_BLISTER)
#: A session of hours.
HOURS = ["--set", "simulation.duration=1e4", "--set", "recorder.every=1000", "--quiet"]
#: What the second process says.
REFUSED = "o is being {} by another digiclay: choose another place with --out, or wait.\n"
JOBS = 'scenes = ["my.toml"]\nerrors = false\n'


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder with one scene, my.toml."""
    return folder_with(SCENE, tmp_path, monkeypatch)


def started(*arguments: str) -> subprocess.Popen[str]:
    """Start the program in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "digiclay", *arguments], text=True, stdin=subprocess.PIPE,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(ADDON)},
    )  # fmt: skip


@contextmanager
def running(*arguments: str, sign: str) -> Iterator[subprocess.Popen[str]]:
    """Keep a process that works for hours, from the time a file of it is there; then kill it."""
    process = started(*arguments)
    try:
        wait_until(lambda: process.poll() is not None or list(Path().glob(sign)))
        assert process.poll() is None, process.communicate()
        yield process
    finally:
        process.kill()
        process.communicate(timeout=TIMEOUT)


def names(folder: Path = Path()) -> list[str]:
    """Return what lies in a folder, hidden things too."""
    return sorted(path.name for path in folder.iterdir())


def test_a_folder_that_is_being_written_is_refused_at_once_by_every_command(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("jobs.toml").write_text(JOBS, encoding="utf-8")
    assert main(["batch", "jobs.toml", "--out", "b", "--prepare", "--quiet"]) == 0
    with running("run", "my.toml", "--out", "o", *HOURS, sign=".o.lock"):
        for command in (
            ["run", "my.toml"],
            ["form", "dome"],
            ["compare", "my.toml"],
            ["paper"],
            ["job", "b/jobs/my"],
            ["sweep", "my.toml", "--vary", "layout.rows=3,4"],
            ["batch", "jobs.toml"],
        ):
            before = time.monotonic()
            assert main([*command, "--out", "o", "--quiet"]) == 2
            said = capsys.readouterr().err
            assert said == REFUSED.format("written")
            assert time.monotonic() - before < 60.0  # the session takes hours
        assert not Path("o").exists()
    # The process was killed, and nothing is in the way of the next one.
    assert main(["run", "my.toml", "--out", "o", "--quiet"]) == 0
    assert names() == ["b", "jobs.toml", "my.toml", "o"]


def test_a_run_that_is_being_replaced_takes_in_no_mesh_and_no_plot(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["run", "my.toml", "--out", "o", "--quiet", "--no-errors"]) == 0
    before = names(Path("o"))
    with running("run", "my.toml", "--out", "o", "--overwrite", *HOURS, sign=".o.lock"):
        for command in (["export", "o"], ["plot", "o"], ["run", "my.toml", "--out", "o", "--overwrite"]):
            assert main([*command, "--quiet"]) == 2
            assert "o is being written by another digiclay" in capsys.readouterr().err
        assert main(["export", "o", "--out", "elsewhere", "--quiet"]) == 0
    assert names(Path("o")) == before
    assert main(["export", "o", "--quiet"]) == 0


@pytest.mark.parametrize("series", ["sweep", "batch"])
def test_a_second_series_in_one_folder_is_refused_at_once(
    series: str, capsys: pytest.CaptureFixture[str]
) -> None:
    said = f"{JOBS}[settings]\nlong = {{ simulation.duration = 1e4, recorder.every = 1000 }}\n"
    Path("jobs.toml").write_text(said, encoding="utf-8")
    sweep = ["sweep", "my.toml", "--vary", "layout.rows=3,4", "--workers", "1", *HOURS, "--out", "o"]
    batch = ["batch", "jobs.toml", "--quiet", "--out", "o"]
    with running(*(sweep if series == "sweep" else batch), sign=f"o/{series}.json"):
        wait_until(lambda: not Path(".o.lock").exists())  # the folder is made
        assert main(sweep if series == "sweep" else batch) == 2
        told = capsys.readouterr().err
        assert told == REFUSED.format("worked in")
        assert main(["run", "my.toml", "--out", "o", "--quiet"]) == 2
        assert "o holds other things than a run" in capsys.readouterr().err


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_what_a_killed_job_leaves_is_taken_away_by_the_next_and_its_lock_with_it() -> None:
    Path("jobs.toml").write_text(JOBS, encoding="utf-8")
    main(["batch", "jobs.toml", "--prepare", "--quiet"])
    scene = Path("jobs/jobs/my/scene.toml")
    short = scene.read_text(encoding="utf-8")
    hours = re.sub(r"(?m)^duration = \S+", "duration = 1e4", re.sub(r"(?m)^every = 1", "every = 1000", short))
    scene.write_text(hours, encoding="utf-8")
    with running("job", "jobs/jobs/my", "--quiet", sign="jobs/runs/.my.*.part") as process:
        (part,) = Path("jobs/runs").glob(".my.*.part")
        # As long as it lives, nobody takes away what it has begun.
        remove_abandoned(Path("jobs/runs"))
        assert part.is_dir()
        process.kill()
        process.wait(TIMEOUT)
    assert names(Path("jobs/runs")) == [part.name, ".my.lock"]
    scene.write_text(short, encoding="utf-8")
    assert main(["job", "jobs/jobs/my", "--quiet"]) == 0
    assert names(Path("jobs/runs")) == ["my"]


def test_an_older_run_that_was_moved_aside_when_its_process_was_killed_is_put_back(
    capsys: pytest.CaptureFixture[str],
) -> None:
    main(["run", "my.toml", "--out", "o", "--quiet", "--no-errors"])
    shutil.move("o", f".o.{dead()}@{find_host()}.old")
    assert main(["run", "my.toml", "--out", "o", "--quiet"]) == 2
    assert "o is not empty" in capsys.readouterr().err
    assert names() == ["my.toml", "o"]


def test_what_comes_in_between_is_not_replaced_at_the_end() -> None:
    def interfere() -> None:
        with write_folder(Path("o"), overwrite=False):
            Path("o").mkdir()
            Path("o/thesis.doc").touch()

    with pytest.raises(OutputError, match="o holds other things"):
        interfere()
    assert names(Path("o")) == ["thesis.doc"]


def test_a_claim_ends_with_its_block_and_leaves_no_folder() -> None:
    with claim_folder(Path("a/b/o"), overwrite=False):
        with pytest.raises(OutputError, match="being written"), claim_folder(Path("a/b/o"), overwrite=False):
            pass
        with claim_folder(Path("a/b/other"), overwrite=False):
            pass
    with claim_folder(Path("a/b/o"), overwrite=False) as claim, claim.write():
        pass
    assert names(Path("a/b")) == ["o"]
    with pytest.raises(ZeroDivisionError), claim_folder(Path("c/d/o"), overwrite=False):
        raise ZeroDivisionError
    assert names() == ["a", "my.toml"]


def test_one_folder_by_two_names_is_one_claim() -> None:
    Path("real").mkdir()
    Path("link").symlink_to("real")
    with (
        claim_folder(Path("real/o"), overwrite=False),
        pytest.raises(OutputError, match="being written"),
        claim_folder(Path("link/../link/o"), overwrite=False),
    ):
        pass


def test_whoever_waits_gets_the_claim_when_the_other_one_ends() -> None:
    script = (
        "import sys, time\n"
        "from pathlib import Path\n"
        "from digiclay.core.files.run_folder import claim_folder\n"
        "with claim_folder(Path('o'), overwrite=False):\n"
        "    print('here', flush=True)\n"
        "    sys.stdin.readline()\n"
        "    time.sleep(0.3)\n"
    )
    other = subprocess.Popen(
        [sys.executable, "-c", script], text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(ADDON)},
    )  # fmt: skip
    assert other.stdout is not None
    assert other.stdout.readline() == "here\n"
    other.communicate("go\n", timeout=TIMEOUT)
    with claim_folder(Path("o"), overwrite=False, patience=TIMEOUT):
        assert find_lock(Path("o")).exists()
    assert names() == ["my.toml"]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no fork")
def test_a_process_that_was_started_does_not_keep_the_claim() -> None:
    with claim_folder(Path("o"), overwrite=False):
        child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    with claim_folder(Path("o"), overwrite=False):
        child.communicate(b"\n", timeout=TIMEOUT)
    assert child.returncode == 0


def test_two_exports_do_not_write_one_file_at_once() -> None:
    Path("o").mkdir()
    with claim_files([Path("o/a.stl"), Path("o/b.stl")]):
        with claim_files([Path("o/c.stl")]):
            pass
        with pytest.raises(OutputError, match=r"b\.stl is being written"), claim_files([Path("o/b.stl")]):
            pass
    assert names(Path("o")) == []


def test_a_path_that_leads_out_of_a_folder_is_refused(here: Path) -> None:
    (here / "o" / "runs").mkdir(parents=True)
    (here / "elsewhere").mkdir()
    (here / "o" / "link").symlink_to(here / "elsewhere")
    assert resolve_inside(Path("o"), "runs", "a") == Path("o/runs/a")
    for parts in (("..",), ("runs", "..", ".."), ("",), ("link", "a"), (str(here / "elsewhere"),)):
        with pytest.raises(OutputError, match="leads out of o"):
            resolve_inside(Path("o"), *parts)
