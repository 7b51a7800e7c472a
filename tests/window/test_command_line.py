"""``blender --command digiclay`` in a real Blender that has the extension's zip installed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.timeouts import TIMEOUT
from tests.window.blender_window import BLENDER

TOOL = Path(__file__).parents[2] / "tools" / "extension.py"


@pytest.fixture(scope="module")
def execute(tmp_path_factory):
    """A function that runs a program where Blender has settings of its own, and requires its status."""
    environment = os.environ | {"BLENDER_USER_RESOURCES": str(tmp_path_factory.mktemp("settings"))}
    folder = tmp_path_factory.mktemp("installed")

    def execute(*words, status=0):
        done = subprocess.run(
            words,
            env=environment,
            cwd=folder,
            capture_output=True,
            encoding="utf-8",
            timeout=TIMEOUT,
        )
        assert (done.returncode, "Traceback" in done.stderr) == (status, False), (
            done.stdout + done.stderr
        )
        return done

    return execute


@pytest.fixture(scope="module")
def command(execute, tmp_path_factory):
    folder = tmp_path_factory.mktemp("built")
    execute(sys.executable, str(TOOL), "--out", str(folder))
    (archive,) = folder.glob("*.zip")
    extension = (BLENDER, "--command", "extension")
    execute(*extension, "validate", str(archive))
    execute(*extension, "install-file", "-r", "user_default", "--enable", str(archive))
    return lambda *words, **kept: execute(BLENDER, "--command", "digiclay", *words, **kept)


@pytest.fixture(scope="module")
def run(command, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "a täp"
    command("run", "tap", "--out", str(out))
    return out


def test_a_scene_is_described_and_run(command, run):
    assert "11 x 11 = 121 cells" in command("describe", "tap").stdout
    assert {"history.npz", "metrics.json", "scene.toml"} <= {file.name for file in run.iterdir()}


def test_a_run_is_exported_and_rendered(command, run, tmp_path):
    command("export", str(run), "--format", "stl,obj", "--out", str(tmp_path))
    assert {".stl", ".obj"} <= {file.suffix for file in tmp_path.iterdir()}
    picture = tmp_path / "still.png"
    command("render", str(run), "--size", "160x100", "--engine", "workbench", "--out", str(picture))
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("words", [("render", "nowhere"), ()])
def test_what_cannot_be_done_is_told_in_one_line(words, command):
    assert command(*words, status=2).stderr.strip()


def test_a_batch_starts_blender_once_more_for_each_job(command, tmp_path):
    jobs = tmp_path / "erste Übung.toml"
    jobs.write_text(
        'scenes = ["tap"]\nmethods = ["virtual_master", "cell_states"]\nerrors = false\nexport = ["stl"]\n'
        "settings.short.simulation.duration = 0.3\n[film]\nwidth = 160\nheight = 100\nrate = 10\n",
        encoding="utf-8",
    )
    done = command("batch", str(jobs), "--out", str(tmp_path / "out"), "--jobs", "2")
    assert "2 of 2 jobs done" in done.stdout
    for run in (tmp_path / "out" / "runs").iterdir():
        assert {"film.mp4", "surface.stl", "metrics.json"} <= {file.name for file in run.iterdir()}


def test_a_series_for_a_farm_is_run_by_blender(command, execute, tmp_path):
    jobs, out, blender = tmp_path / "two.toml", tmp_path / "a färm", f"Blender={BLENDER}"
    jobs.write_text(
        'scenes = ["tap"]\nerrors = false\nsettings.a.simulation.duration = 0.1\n'
        "[film]\nwidth = 64\nheight = 40\nrate = 20\n",
        encoding="utf-8",
    )
    done = command(
        "batch", str(jobs), "--out", str(out), "--submit", "openjd", "--program", str(BLENDER)
    )
    assert f"-p {blender}" in done.stdout
    # As the line that was printed says.
    execute(sys.executable, "-m", "openjd", "run", str(out / "openjd.json"), "-p", blender)
    assert (out / "runs" / "tap-a" / "film.mp4").read_bytes()[4:8] == b"ftyp"
    assert "1 of 1 jobs done." in (out / "index.html").read_text(encoding="utf-8")
