"""Other processes, for tests of what they leave behind."""

from __future__ import annotations

import subprocess
import sys

from tests.timeouts import TIMEOUT


def dead() -> int:
    """Return the number of a process that has ended."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait(TIMEOUT)
    return process.pid
