"""A copy of the package that a test may change: a new part is written into it and run."""

import shutil
import sys
from filecmp import dircmp
from pathlib import Path

from tests.other_process import carry_out

ROOT = Path(__file__).parents[1]


def copy_package(folder):
    """Copy the package into a folder; return it."""
    name = "addon/digiclay"
    shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def run_python(copy, *arguments):
    """Run Python on the copy; return what it printed."""
    environment = {"PYTHONPATH": str(copy / "addon"), "PATH": ""}
    return carry_out(sys.executable, *arguments, env=environment)


def find_changes(copy):
    """Return the Python files of the copied package that are new or differ, sorted by name."""
    return sorted(_compare(dircmp(ROOT / "addon" / "digiclay", copy / "addon" / "digiclay")))


def _compare(compared):
    """Return the files that are new or differ in the second of two folders."""
    names = [*compared.right_only, *compared.diff_files]
    return [
        *(name for name in names if name.endswith(".py")),
        *(name for inner in compared.subdirs.values() for name in _compare(inner)),
    ]
