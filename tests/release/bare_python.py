"""Pythons with nothing but the wheel and the libraries that it needs, and the tests that run in them."""

from __future__ import annotations

import ast
import functools
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from tests.timeouts import TIMEOUT

ROOT = Path(__file__).parents[2]
#: What the tests of the core may import; what has more needs more than the wheel brings along.
CORE_ONLY = ("numpy", "trimesh", "pytest", "hypothesis")
#: Tests whose need of more no import shows.
NEEDING_MORE = {
    "test_skin_mesh.py": "SciPy, which trimesh imports for it",
    "test_source_file.py": "Pillow",
    "test_speed_limits.py": "Pillow",
}
#: Folders of tests that are run with other versions of the libraries.
FOLDERS = ("unit", "regression")


@dataclass(frozen=True)
class BarePython:
    """Environment of a Python with the wheel.

    Attributes
    ----------
    folder : Path
        Of the environment.
    pins : dict
        Versions of the libraries that it was to have, by name.
    """

    folder: Path
    pins: dict[str, str]

    def run(
        self, *words: str | Path, cwd: Path, path: str = "", limit: float = TIMEOUT
    ) -> subprocess.CompletedProcess[str]:
        """Run a program of the environment, which imports nothing from elsewhere but from `path`."""
        environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        return subprocess.run(
            [self.folder / "bin" / words[0], *words[1:]],
            cwd=cwd, env=environment | {"PYTHONPATH": path}, capture_output=True, text=True, timeout=limit,
        )  # fmt: skip


def read_pins(name: str) -> dict[str, str]:
    """Return the versions that a file in requirements/ pins."""
    text = (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
    return dict(re.findall(r"^([\w-]+)==([\w.]+)$", text, re.MULTILINE))


def _carry_out(*command: str | Path) -> str:
    """Run a command, which must succeed; return what it printed."""
    environment = {**os.environ, "GOAL": "test-release", "PYTHONPATH": ""}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=TIMEOUT)
    assert done.returncode == 0, f"{done.stdout[-2000:]}{done.stderr[-2000:]}"
    return done.stdout


def make_bare(folder: Path, version: str, wheel: Path, pins: str) -> BarePython:
    """Make an environment of a Python (``3.12``); install the wheel, pinned by a file of requirements/."""
    variable = f"PYTHON{version.replace('.', '')}"
    python = _carry_out(ROOT / "tools" / "find-python", version, variable, os.environ.get(variable, ""))
    _carry_out(python.strip(), "-m", "venv", folder)
    limits = ("-c", ROOT / "requirements" / f"{pins}.txt") if pins else ()
    pip = (folder / "bin" / "python", "-m", "pip", "--disable-pip-version-check", "install", "--quiet")
    _carry_out(*pip, "--retries", "5", *limits, wheel)
    return BarePython(folder, read_pins(pins) if pins else {})


def install_pytest(bare: BarePython, folder: Path) -> None:
    """Install what runs tests beside an environment, which stays as it is."""
    pins = read_pins("test")
    words = [f"{name}=={pins[name]}" for name in ("pytest", "hypothesis")]
    pip = (bare.folder / "bin" / "python", "-m", "pip", "--disable-pip-version-check", "install", "--quiet")
    _carry_out(*pip, "--retries", "5", "--target", folder, *words)


@functools.cache
def _needed(path: Path) -> frozenset[str]:
    """Return the modules that a test needs, through the helpers of the tests too."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [node.module]
        for name in names:
            helper = ROOT / f"{name.replace('.', '/')}.py"
            if name.startswith("tests.") and helper.is_file():
                found |= _needed(helper)
            elif name.split(".")[0] not in sys.stdlib_module_names:
                found.add(name)
    return frozenset(found)


def find_core_tests() -> list[str]:
    """Return the files of tests that need the core and nothing that the wheel does not bring along."""

    def fits(path: Path) -> bool:
        names = _needed(path)
        others = [name for name in names if name.split(".")[0] not in CORE_ONLY]
        return any(names) and bool(others) and all(name.startswith("digiclay.core") for name in others)

    files = [path for folder in FOLDERS for path in sorted((ROOT / "tests" / folder).glob("test_*.py"))]
    kept = [path for path in files if path.name not in NEEDING_MORE and fits(path)]
    return [path.relative_to(ROOT).as_posix() for path in kept]
