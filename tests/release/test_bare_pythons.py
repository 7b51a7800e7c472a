"""The wheel in Pythons that have nothing else: lowest, usual and highest versions of its libraries."""

import functools
import json
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from digiclay import __version__
from digiclay.cli import main

from tests.form.test_architecture import imports
from tests.other_process import carry_out
from tests.scene_files import command, read_text
from tests.timeouts import TIMEOUT

ROOT = Path(__file__).parents[2]
#: What the tests of the core may import; what has more needs more than the wheel brings along.
CORE_ONLY = ("numpy", "trimesh", "pytest", "hypothesis")
#: Tests whose need of more no import shows.
NEEDING_MORE = {"test_source_file.py": "Pillow", "test_speed_limits.py": "Pillow"}
#: Folders of tests that are run with other versions of the libraries.
FOLDERS = ("unit", "regression")
#: Python and the file of requirements/ that pins its libraries, empty for what pip chooses.
KINDS = {"3.11": "lowest", "3.12": "", "3.13": "highest"}
#: Difference of heights between versions of numpy, m: its sums have another order, and valves
#: amplify that.
ROUNDING = 1e-12


@dataclass(frozen=True)
class BarePython:
    folder: Path
    pins: dict[str, str]

    def run(self, *words, cwd, path="", limit=TIMEOUT):
        """Run a program of the environment, which imports nothing from elsewhere but from `path`."""
        environment = {
            name: value for name, value in os.environ.items() if not name.startswith("PYTHON")
        }
        return subprocess.run(
            [self.folder / "bin" / words[0], *words[1:]],
            cwd=cwd,
            env=environment | {"PYTHONPATH": path},
            capture_output=True,
            encoding="utf-8",
            timeout=limit,
        )


def read_pins(name):
    text = read_text(ROOT / "requirements" / f"{name}.txt")
    return dict(re.findall(r"^([\w-]+)==([\w.]+)$", text, re.MULTILINE))


def _carry_out(*words):
    environment = {**os.environ, "GOAL": "test-release", "PYTHONPATH": ""}
    return carry_out(*words, cwd=ROOT, env=environment)


def _install(environment, *words):
    pip = command("-m pip --disable-pip-version-check install --quiet --retries 5")
    _carry_out(environment / "bin" / "python", *pip, *words)


def make_bare(folder, version, wheel, pins):
    """Make an environment of a Python (``3.12``); install the wheel, pinned by a file of requirements/."""
    variable = f"PYTHON{version.replace('.', '')}"
    python = _carry_out(
        ROOT / "tools" / "find-python", version, variable, os.environ.get(variable, "")
    )
    _carry_out(python.strip(), "-m", "venv", folder)
    limits = ("-c", ROOT / "requirements" / f"{pins}.txt") if pins else ()
    _install(folder, *limits, wheel)
    return BarePython(folder, read_pins(pins) if pins else {})


def install_pytest(bare, folder):
    pins = read_pins("test")
    _install(
        bare.folder,
        "--target",
        folder,
        *(f"{name}=={pins[name]}" for name in ("pytest", "hypothesis")),
    )


@functools.cache
def _needed(path):
    found = set()
    for _, name, _ in imports(path):
        helper = ROOT / f"{name.replace('.', '/')}.py"
        if name.startswith("tests.") and helper.is_file():
            found |= _needed(helper)
        elif name.split(".")[0] not in {"", *sys.stdlib_module_names}:
            found.add(name)
    return frozenset(found)


def find_core_tests():
    """Return the files of tests that need the core and nothing that the wheel does not bring along."""

    def fits(path):
        others = [name for name in _needed(path) if name.split(".")[0] not in CORE_ONLY]
        return others and all(name.startswith("digiclay.core") for name in others)

    files = [
        path for folder in FOLDERS for path in sorted((ROOT / "tests" / folder).glob("test_*.py"))
    ]
    kept = [path for path in files if path.name not in NEEDING_MORE and fits(path)]
    return [path.relative_to(ROOT).as_posix() for path in kept]


@pytest.fixture(scope="module", params=KINDS)
def bare(request, wheel, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bare") / request.param
    return make_bare(folder, request.param, wheel, KINDS[request.param])


@pytest.fixture(scope="module")
def tap(bare, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    done = bare.run("digiclay", "run", "tap", "--out", "tap", cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert "0.5 s simulated" in done.stdout
    assert {path.name for path in (folder / "tap").iterdir()} == {
        "history.npz",
        "metrics.json",
        "scene.toml",
    }
    return folder / "tap"


@pytest.fixture(scope="module")
def tap_here(tmp_path_factory):
    folder = tmp_path_factory.mktemp("here") / "tap"
    assert main(["run", "tap", "--out", str(folder), "--quiet"]) == 0
    return folder


def test_nothing_is_installed_but_the_package_and_its_libraries(bare, tmp_path):
    done = bare.run("python", "-m", "pip", "list", "--format", "json", cwd=tmp_path)
    found = {one["name"]: one["version"] for one in json.loads(done.stdout)}
    assert set(found) - {"pip", "setuptools"} == {"digiclay", "numpy", "trimesh"}
    assert found["digiclay"] == __version__
    assert {name: found[name] for name in bare.pins} == bare.pins
    assert bare.run("python", "-m", "pip", "check", cwd=tmp_path).returncode == 0


def test_the_run_is_the_same_as_with_our_versions(tap, tap_here):
    runs = [np.load(folder / "history.npz") for folder in (tap, tap_here)]
    assert set(runs[0].files) == set(runs[1].files)
    heights = [run["height"] for run in runs]
    assert np.ptp(heights[0]) > 1e-4
    np.testing.assert_allclose(heights[0], heights[1], rtol=0, atol=ROUNDING)


def test_runs_are_exported_and_shapes_formed_without_another_library(bare, tap):
    formats = ("stl", "obj", "ply", "glb", "3mf")
    done = bare.run("digiclay", "export", "tap", "--format", ",".join(formats), cwd=tap.parent)
    assert done.returncode == 0, done.stderr
    assert {path.suffix[1:] for path in tap.iterdir()} >= set(formats)
    done = bare.run("digiclay", "describe", "ridge_mound_valley", cwd=tap.parent)
    assert (done.returncode, "25 x 25 = 625 cells" in done.stdout) == (0, True), done.stderr


def test_a_missing_library_is_one_line(bare, tap):
    done = bare.run("digiclay", "plot", "tap", cwd=tap.parent)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "pip install digiclay[plots]" in done.stderr


def test_the_tests_of_the_core_pass(bare, tmp_path):
    if not bare.pins:
        return  # between the lowest and the highest versions, which are tested
    files = find_core_tests()
    install_pytest(bare, tmp_path / "pytest")
    # Not with the checkout's addon/ on the path: what is tested is the wheel.
    words = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "-o", "pythonpath=.", *files)
    done = bare.run("python", *words, cwd=ROOT, path=str(tmp_path / "pytest"), limit=5 * TIMEOUT)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-1000:]
    passed = re.search(r"(\d+) passed", done.stdout)
    assert int(passed[1]) > 1000
