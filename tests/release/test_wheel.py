"""The wheel: the package, the paper's reproduction, studies and the server, and no benchmark."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

from tests.timeouts import TIMEOUT

ROOT = Path(__file__).parents[2]
BESIDE = ("digiclay_paper", "digiclay_serve", "digiclay_study")


def test_the_wheel_has_the_package_and_those_beside_it_and_no_benchmark(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"digiclay", *BESIDE}
    beside = {f"{name}/{path.name}" for name in BESIDE for path in (ROOT / name).glob("*.py")}
    shipped = {"digiclay/manual/guide.html", "digiclay/sample_shapes/sessions/tap.toml"}
    assert (beside | shipped) - names == set()
    assert len(beside) > 20


def test_the_paper_is_found_in_the_wheel(wheel: Path, tmp_path: Path) -> None:
    zipfile.ZipFile(wheel).extractall(tmp_path / "installed")
    # Without the checkout's path: all there is of digiclay is what the wheel brought.
    done = subprocess.run(
        [sys.executable, "-P", "-m", "digiclay", "paper", "--help"],
        env=os.environ | {"PYTHONPATH": str(tmp_path / "installed")},
        cwd=tmp_path, capture_output=True, text=True, timeout=TIMEOUT,
    )  # fmt: skip
    assert (done.returncode, "reproduce the paper" in done.stdout.lower()) == (0, True), done.stderr
