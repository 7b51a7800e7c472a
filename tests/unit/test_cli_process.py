"""The command line in a process of its own: libraries that are missing, and signals."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from digiclay.cli import main

from tests.scene_files import SMALL_BLISTER, TOUCH, folder_with, left, scene_text
from tests.timeouts import TIMEOUT, wait_until

ADDON = Path(__file__).parents[2] / "addon"
SCENE = scene_text(3, 4, *TOUCH, parts=SMALL_BLISTER)


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder with one scene, my.toml."""
    return folder_with(SCENE, tmp_path, monkeypatch)


def process(*arguments: str, block: str = "") -> subprocess.Popen[str]:
    """Start the program in a process of its own, where a module may be missing."""
    script = f"import sys; sys.modules.update({{name: None for name in {block.split()!r}}})\n"
    script += "from digiclay.cli import console; console()"
    return subprocess.Popen(
        [sys.executable, "-c", script, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(ADDON)},
    )  # fmt: skip


@pytest.mark.parametrize(("said", "cores"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3")])
def test_the_program_works_on_one_core_unless_told_otherwise(said: dict[str, str], cores: str) -> None:
    script = (
        "import os, sys\n"
        "from digiclay import cli\n"
        "cli.main = lambda: print(os.environ['OPENBLAS_NUM_THREADS'], 'numpy' in sys.modules) or 0\n"
        "cli.console()\n"
    )
    known = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    told = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=TIMEOUT, check=True,
        env={**known, **said, "PYTHONPATH": str(ADDON)},
    ).stdout  # fmt: skip
    # Numpy reads it when it is imported, so that must not have happened before.
    assert told.split() == [cores, "False"]


@pytest.mark.parametrize(
    ("arguments", "missing", "install"),
    [
        (["run", "my.toml", "--render"], "bpy", "digiclay[blender]"),
        (["run", "my.toml", "--plots"], "matplotlib", "pip install digiclay[plots]"),
        (
            ["sweep", "my.toml", "--vary", "layout.rows=3,4", "--out", "o", "--scheduler", "tcp://a:1"],
            "distributed",
            "pip install digiclay[cluster]",
        ),
    ],
)
def test_a_missing_library_is_told_before_any_work(
    arguments: list[str], missing: str, install: str, here: Path
) -> None:
    started = process(*arguments, block=missing)
    _, err = started.communicate(timeout=TIMEOUT)
    assert (started.returncode, err.count("\n"), install in err, left(here)) == (2, 1, True, []), err


def test_a_job_of_a_batch_exports_without_any_library(here: Path) -> None:
    (here / "jobs.toml").write_text('scenes = ["my.toml"]\nexport = ["stl", "3mf"]\nerrors = false\n')
    assert main(["batch", "jobs.toml", "--prepare", "--quiet"]) == 0
    (job,) = (here / "jobs" / "jobs").iterdir()
    started = process("job", str(job), block="trimesh scipy matplotlib")
    _, err = started.communicate(timeout=TIMEOUT)
    assert started.returncode == 0, err
    made = here / "jobs" / "runs" / job.name
    assert (made / "surface.stl").is_file()
    assert (made / "surface.3mf").is_file()


LONG = ["run", "my.toml", "--set", "simulation.duration=1e4", "--set", "recorder.every=1000", "--quiet"]


def test_an_output_folder_that_cannot_be_used_is_told_before_any_work(here: Path) -> None:
    (here / "my").mkdir()
    (here / "my" / "metrics.json").touch()
    started = process(*LONG)
    try:
        _, err = started.communicate(timeout=TIMEOUT)  # the session itself would take hours
    finally:
        started.kill()
    assert (started.returncode, "is not empty" in err) == (2, True)


def interrupted(number: int, here: Path) -> tuple[int, str]:
    """Start a session of hours, send it a signal once it runs; return exit code and stderr."""
    ready = here / "ready"
    script = (
        "import itertools, pathlib\n"
        "from digiclay.commands import run\n"
        "begin, period = run.run, itertools.count()\n"
        "def told(*given, stopped, **more):\n"
        "    def asked():\n"
        "        if next(period) == 20:\n"
        f"            pathlib.Path({str(ready)!r}).touch()\n"
        "        return stopped()\n"
        "    return begin(*given, stopped=asked, **more)\n"
        "run.run = told\n"
        "from digiclay.cli import console; console()\n"
    )
    started = subprocess.Popen(
        [sys.executable, "-c", script, *LONG], stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(ADDON)},
    )  # fmt: skip
    try:
        wait_until(ready.exists)
        ready.unlink()
        started.send_signal(number)
        _, err = started.communicate(timeout=TIMEOUT)
    finally:
        started.kill()
    return started.returncode, err


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_keeps_an_incomplete_run_and_exits_with_130(number: int, here: Path) -> None:
    code, err = interrupted(number, here)
    metrics = json.loads((here / "my" / "metrics.json").read_text(encoding="utf-8"))
    assert (code, err, metrics["incomplete"], left(here)) == (130, "", True, ["my"])


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_what_an_interrupted_run_kept_can_be_exported(here: Path) -> None:
    interrupted(signal.SIGINT, here)
    assert main(["export", "my", "--quiet"]) == 0
