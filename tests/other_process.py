"""Other processes, for tests of what they do and leave behind."""

import os
import subprocess
import sys
from pathlib import Path

from tests.timeouts import TIMEOUT

ROOT = Path(__file__).parents[1]
#: Where the packages of this checkout are, also when another one is installed.
PACKAGES = os.pathsep.join([str(ROOT / "addon"), str(ROOT)])
#: The command line as a script.
PROGRAM = "from digiclay.cli import console; console()"


def carry_out(*command, stderr=subprocess.PIPE, **options):
    """Run a command, which ends well; return what it printed."""
    done = subprocess.run(
        [str(word) for word in command],
        stdout=subprocess.PIPE,
        stderr=stderr,
        encoding="utf-8",
        errors="replace",
        timeout=TIMEOUT,
        **options,
    )
    assert done.returncode == 0, f"{done.stdout[-4000:]}{done.stderr}"
    return done.stdout


def dead():
    """Return the number of a process that has ended."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait(TIMEOUT)
    return process.pid


def start(script, *arguments, env=None, **options):
    """Start Python on a script that may import the package."""
    return subprocess.Popen(
        [sys.executable, "-c", script, *arguments],
        encoding="utf-8",
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": PACKAGES, **(env or {})},
        **options,
    )


def finish(process):
    """Wait for a process; return exit code, stdout and stderr."""
    try:
        out, err = process.communicate(timeout=TIMEOUT)
    finally:
        process.kill()
    return process.returncode, out, err
