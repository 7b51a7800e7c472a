"""The command line in a process of its own: libraries that are missing, and signals."""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path
from typing import Any

import pytest
from digiclay.cli import main

from tests.other_process import PROGRAM, finish, start
from tests.scene_files import left
from tests.timeouts import wait_until

pytestmark = pytest.mark.usefixtures("here")


def process(*arguments: str, block: str = "") -> Any:
    """Start the program in a process of its own, where a module may be missing."""
    missing = f"import sys; sys.modules.update({{name: None for name in {block.split()!r}}})\n"
    return start(missing + PROGRAM, *arguments)


@pytest.mark.parametrize(("said", "cores"), [("", "1"), ("3", "3")])
def test_the_program_works_on_one_core_unless_told_otherwise(said: str, cores: str) -> None:
    script = (
        "import os, sys\n"
        f"os.environ['OPENBLAS_NUM_THREADS'] = {said!r}\n"
        "os.environ['OPENBLAS_NUM_THREADS'] or os.environ.pop('OPENBLAS_NUM_THREADS')\n"
        "from digiclay import cli\n"
        "cli.main = lambda: print(os.environ['OPENBLAS_NUM_THREADS'], 'numpy' in sys.modules) or 0\n"
        "cli.console()\n"
    )
    # Numpy reads it when it is imported, so that must not have happened before.
    assert finish(start(script))[1].split() == [cores, "False"]


@pytest.mark.parametrize(
    ("line", "missing", "install"),
    [
        ("run my.toml --render", "bpy", "digiclay[blender]"),
        ("run my.toml --plots", "matplotlib", "pip install digiclay[plots]"),
        ("sweep my.toml --vary seed=3,4 --out o --scheduler tcp://a:1", "distributed", "digiclay[cluster]"),
    ],
)  # fmt: skip
def test_a_missing_library_is_told_before_any_work(
    line: str, missing: str, install: str, here: Path, refused: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == missing]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(sys.modules, "digiclay.compat", raising=False)
    monkeypatch.setitem(sys.modules, missing, None)  # as Python marks what cannot be imported
    refused(line.split(), install)
    assert left(here) == []


def test_a_job_of_a_batch_exports_without_any_library(here: Path) -> None:
    (here / "jobs.toml").write_text('scenes = ["my.toml"]\nexport = ["stl", "3mf"]\nerrors = false\n')
    assert main(["batch", "jobs.toml", "--prepare", "--quiet"]) == 0
    code, _, err = finish(process("job", "jobs/jobs/my", block="trimesh scipy matplotlib"))
    assert code == 0, err
    assert {"surface.stl", "surface.3mf"} <= {path.name for path in (here / "jobs/runs/my").iterdir()}


LONG = ["run", "my.toml", "--set", "simulation.duration=1e4", "--set", "recorder.every=1000", "--quiet"]


def test_an_output_folder_that_cannot_be_used_is_told_before_any_work(here: Path, refused: Any) -> None:
    (here / "my").mkdir()
    (here / "my" / "metrics.json").touch()
    refused(LONG, "is not empty")  # the session itself would take hours


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
    )
    started = start(script + PROGRAM, *LONG)
    wait_until(lambda: ready.exists() or started.poll() is not None)
    ready.unlink()
    started.send_signal(number)
    code, _, err = finish(started)
    return code, err


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_keeps_an_incomplete_run_that_can_be_exported_and_exits_with_130(
    number: int, here: Path
) -> None:
    code, err = interrupted(number, here)
    metrics = json.loads((here / "my" / "metrics.json").read_text(encoding="utf-8"))
    assert (code, err, metrics["incomplete"], left(here)) == (130, "", True, ["my"])
    assert main(["export", "my", "--quiet"]) == 0
