"""The wheel: the package and the paper's reproduction, and no benchmark."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.timeouts import TIMEOUT

ROOT = Path(__file__).parents[2]
#: All that a wheel is built from, and the benchmarks, which must not get into it.
SOURCES = (
    "addon",
    "benchmarks",
    "digiclay_paper",
    "digiclay_serve",
    "digiclay_study",
    "pyproject.toml",
    "README.md",
    "LICENSE",
    "LICENSES",
)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from a copy, so that nothing is left in the checkout."""
    copy = tmp_path_factory.mktemp("checkout")
    for name in SOURCES:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, copy / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
        else:
            shutil.copy(source, copy / name)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--quiet"]
    command = [*pip, "--no-deps", "--no-build-isolation", "--wheel-dir", "dist", "."]
    done = subprocess.run(command, cwd=copy, capture_output=True, text=True, timeout=TIMEOUT)
    assert done.returncode == 0, done.stderr
    (found,) = (copy / "dist").glob("*.whl")
    return found


def test_the_wheel_has_the_package_the_paper_and_the_studies_and_no_benchmark(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as zipped:
        names = set(zipped.namelist())
    packages = {name.split("/")[0] for name in names if ".dist-info/" not in name}
    assert packages == {"digiclay", "digiclay_paper", "digiclay_serve", "digiclay_study"}
    beside = [
        path
        for name in ("digiclay_paper", "digiclay_serve", "digiclay_study")
        for path in (ROOT / name).glob("*.py")
    ]
    assert len(beside) > 25
    assert {f"{path.parent.name}/{path.name}" for path in beside} - names == set()
    shipped = {"digiclay/manual/guide.html", "digiclay/sample_shapes/sessions/tap.toml"}
    assert {"digiclay/core/scene/schema.py", *shipped} <= names


def test_the_paper_is_reproduced_from_the_wheel(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as zipped:
        zipped.extractall(tmp_path / "installed")
    # Without the checkout's path: all there is of digiclay is what the wheel brought.
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "installed")}
    command = [sys.executable, "-P", "-m", "digiclay", "paper", "--help"]
    done = subprocess.run(
        command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=TIMEOUT
    )
    assert (done.returncode, "reproduce the paper" in done.stdout.lower()) == (0, True), done.stderr
