"""``blender --command digiclay`` in a real Blender that has the extension's zip installed."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.timeouts import TIMEOUT
from tests.window.blender_window import BLENDER

TOOL = Path(__file__).parents[2] / "tools" / "extension.py"

Command = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return an environment in which Blender has settings of its own."""
    return os.environ | {"BLENDER_USER_RESOURCES": str(tmp_path_factory.mktemp("settings"))}


@pytest.fixture(scope="module")
def command(tmp_path_factory: pytest.TempPathFactory, environment: dict[str, str]) -> Command:
    """Blender with the zip installed; a function that gives it a command."""
    folder = tmp_path_factory.mktemp("installed")

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        given = [BLENDER, "--command", *words]
        return subprocess.run(
            given, env=environment, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT
        )

    built = [sys.executable, str(TOOL), "--out", str(folder)]
    done = subprocess.run(built, capture_output=True, text=True, timeout=TIMEOUT)
    assert done.returncode == 0, done.stderr
    (archive,) = folder.glob("*.zip")
    done = run("extension", "validate", str(archive))
    assert done.returncode == 0, done.stdout + done.stderr
    done = run("extension", "install-file", "-r", "user_default", "--enable", str(archive))
    assert done.returncode == 0, done.stdout + done.stderr
    return run


@pytest.fixture(scope="module")
def run(command: Command, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run made through Blender, its name with a blank and an umlaut."""
    out = tmp_path_factory.mktemp("runs") / "a täp"
    done = command("digiclay", "run", "tap", "--out", str(out))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return out


def test_a_scene_is_described(command: Command) -> None:
    done = command("digiclay", "describe", "tap")
    assert (done.returncode, "11 x 11 = 121 cells" in done.stdout) == (0, True)


def test_a_scene_is_run(run: Path) -> None:
    assert {"history.npz", "metrics.json", "scene.toml"} <= {file.name for file in run.iterdir()}


def test_a_run_is_exported(command: Command, run: Path, tmp_path: Path) -> None:
    done = command("digiclay", "export", str(run), "--format", "stl,obj", "--out", str(tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr
    assert {".stl", ".obj"} <= {file.suffix for file in tmp_path.iterdir()}


def test_a_run_is_rendered(command: Command, run: Path, tmp_path: Path) -> None:
    picture = tmp_path / "still.png"
    size = ("--size", "160x100", "--engine", "workbench")
    done = command("digiclay", "render", str(run), *size, "--out", str(picture))
    assert done.returncode == 0, done.stdout + done.stderr
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("words", [("run", "nothing"), ("render", "nowhere"), ("stroke",), ()])
def test_what_cannot_be_done_is_told_in_one_line(words: tuple[str, ...], command: Command) -> None:
    done = command("digiclay", *words)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert done.stderr.strip()


def test_a_batch_starts_blender_once_more_for_each_job(command: Command, tmp_path: Path) -> None:
    jobs = tmp_path / "erste Übung.toml"
    jobs.write_text(
        'scenes = ["tap"]\nmethods = ["virtual_master", "cell_states"]\nerrors = false\nexport = ["stl"]\n'
        "settings.short.simulation.duration = 0.3\n[film]\nwidth = 160\nheight = 100\nrate = 10\n",
        encoding="utf-8",
    )
    done = command("digiclay", "batch", str(jobs), "--out", str(tmp_path / "out"), "--jobs", "2")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 of 2 jobs done" in done.stdout
    for run in (tmp_path / "out" / "runs").iterdir():
        assert {"film.mp4", "surface.stl", "metrics.json"} <= {file.name for file in run.iterdir()}


def test_a_series_for_a_farm_is_run_by_blender(
    command: Command, environment: dict[str, str], tmp_path: Path
) -> None:
    said = """
        scenes = ["tap"]
        errors = false
        settings.a.simulation.duration = 0.1
        [film]
        width = 64
        height = 40
        rate = 20
    """
    (tmp_path / "two.toml").write_text(said, encoding="utf-8")
    out = tmp_path / "a färm"
    words = ("batch", str(tmp_path / "two.toml"), "--out", str(out), "--submit", "openjd")
    done = command("digiclay", *words, "--program", str(BLENDER))
    assert done.returncode == 0, done.stdout + done.stderr
    # As the line that was printed says.
    assert f"-p Blender={BLENDER}" in done.stdout
    run = ["run", str(out / "openjd.json"), "-p", f"Blender={BLENDER}"]
    done = subprocess.run(
        [sys.executable, "-m", "openjd", *run],
        env=environment, capture_output=True, text=True, timeout=TIMEOUT,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert (out / "runs" / "tap-a" / "film.mp4").read_bytes()[4:8] == b"ftyp"
    assert "1 of 1 jobs done." in (out / "index.html").read_text(encoding="utf-8")
