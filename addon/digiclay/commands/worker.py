"""A job's process: how it is started, what it says of itself, and how it is asked to stop.

It runs what ``digiclay job`` runs, writes what it has to say into a log file, and stops when its
standard input ends: so it does when it is asked to, and when whoever started it has died.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

from ..core.errors import one_line

__all__ = ["ERROR", "PROGRESS", "Worker", "cores", "follow"]

#: What the lines of a log start with that are meant for the process that started the job.
PROGRESS, ERROR = "@ ", "! "
#: Bytes at a log's end that are looked at for its last line.
TAIL = 4096
#: The package, as an extension in Blender or installed with pip.
PACKAGE = __name__.removesuffix(".commands.worker")


def same_program() -> tuple[list[str], dict[str, str]]:
    """Return a command that runs this program once more, and the environment it needs.

    Inside Blender there is no separate Python: Blender itself is started, with this extension.
    """
    bpy: Any = sys.modules.get("bpy")
    if bpy is not None and bpy.app.binary_path:
        return [bpy.app.binary_path, "--background", "--addons", PACKAGE, "--command", "digiclay"], {}
    folders = [str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")]
    bundled = importlib.util.find_spec("trimesh") if PACKAGE.startswith("bl_ext.") else None
    if bundled is not None and bundled.origin is not None:  # what an extension brings along is elsewhere
        folders.append(str(Path(bundled.origin).parents[1]))
    environment = {"PYTHONPATH": os.pathsep.join(filter(None, folders))}
    return [sys.executable, "-m", Path(__file__).resolve().parents[1].name], environment


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Worker:
    """A process that does one job.

    Parameters
    ----------
    arguments : list of str
        Of the command line.
    log : Path
        What the process says.
    """

    def __init__(self, arguments: list[str], log: Path) -> None:
        command, environment = same_program()
        self._log, self._asked = log, False
        with log.open("wb") as said:
            # A group of its own: Ctrl-C on a terminal is for the process that started it.
            apart: dict[str, Any] = (
                {"creationflags": 0x200} if os.name == "nt" else {"start_new_session": True}
            )
            self._process = subprocess.Popen(
                [*command, *arguments], stdin=subprocess.PIPE, stdout=said, stderr=subprocess.STDOUT,
                env={**os.environ, **environment}, **apart,
            )  # fmt: skip

    def ended(self) -> bool:
        """Tell whether the process has ended."""
        if self._process.poll() is None:
            return False
        self.stop()  # nobody reads it any more
        return True

    def fraction(self) -> float:
        """Return how much of the job is done, from 0 to 1."""
        for line in reversed(self._last_lines()):
            _, _, number = line.removeprefix(PROGRESS).partition(" ")
            if line.startswith(PROGRESS) and number:
                try:
                    return min(1.0, max(0.0, float(number)))
                except ValueError:
                    break  # a line that is being written
        return 0.0

    def error(self) -> str:
        """Return in one line why the job was not done."""
        lines = self._last_lines()
        told = [line.removeprefix(ERROR) for line in lines if line.startswith(ERROR)]
        if told:
            return one_line(told[-1])
        others = [line for line in lines if line.strip() and not line.startswith(PROGRESS)]
        said = f": {others[-1].strip()}" if others else ""
        code = self._process.returncode
        how = f"signal {-code}" if code < 0 else f"code {code}"
        return one_line(f"The process ended with {how}{said}")

    def stop(self) -> None:
        """Ask the process to stop."""
        if not self._asked and self._process.stdin is not None:
            self._asked = True
            self._process.stdin.close()

    def kill(self) -> None:
        """End the process at once."""
        self.stop()
        self._process.kill()
        self._process.wait()

    def wait(self, until: float) -> None:
        """Wait for the process to end, until a `time.monotonic`; then kill it."""
        try:
            self._process.wait(max(0.0, until - time.monotonic()))
        except subprocess.TimeoutExpired:
            self.kill()

    def _last_lines(self) -> list[str]:
        """Return the last lines of the log."""
        with self._log.open("rb") as file:
            file.seek(max(0, self._log.stat().st_size - TAIL))
            return file.read().decode("utf-8", errors="replace").splitlines()


def follow() -> threading.Event:
    """Return an event that is set when standard input ends."""
    ended = threading.Event()

    def watch() -> None:
        # Not sys.stdin: a thread that waits in it would keep Python from shutting down.
        while os.read(0, 1):
            pass
        ended.set()

    threading.Thread(target=watch, daemon=True).start()
    return ended
