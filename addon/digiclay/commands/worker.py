"""Worker processes of a series on this machine: start and stop.

Each runs this program once more, and stops when its standard input ends: so it does when it is
asked to, and when the process that started it has died.
"""

import importlib.util
import math
import os
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Generic, Self, TypeVar

from ..core.base.errors import DigiclayError, explain_os_error
from ..core.studies.series import describe_error
from .refusals import PACKAGE, in_blender

#: Seconds that processes get to stop by themselves.
GRACE = 20.0
#: Seconds between two checks for ended processes.
PAUSE = 0.05
#: Where Blender keeps the extension when it was installed from a file.
EXTENSION = "bl_ext.user_default.digiclay"

Started = TypeVar("Started", bound="Process")
Piece = TypeVar("Piece")


def find_program(module: str = "") -> tuple[list[str], dict[str, str]]:
    """Return a command that runs this program once more, and the environment it needs.

    Inside Blender there is no separate Python: Blender itself is started, with this extension.
    """
    bpy: Any = sys.modules.get("bpy")
    if bpy is not None and bpy.app.binary_path:
        return start_blender(bpy.app.binary_path), {}
    folders = [str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")]
    bundled = importlib.util.find_spec("trimesh") if PACKAGE.startswith("bl_ext.") else None
    if bundled is not None and bundled.origin is not None:
        # What an extension brings along is elsewhere.
        folders.append(str(Path(bundled.origin).parents[1]))
    environment = {"PYTHONPATH": os.pathsep.join(filter(None, folders))}
    return [
        sys.executable,
        "-m",
        f"{Path(__file__).resolve().parents[1].name}{module}",
    ], environment


def start_blender(program: str) -> list[str]:
    """Return a command that runs the extension in a Blender, this one or another machine's."""
    package = PACKAGE if in_blender() else EXTENSION
    return [program, "--background", "--addons", package, "--command", "digiclay"]


def count_cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Process:
    """This program, or a module of it, in a process of its own; `streams` as `subprocess.Popen` has them."""

    def __init__(self, arguments: Sequence[str], module: str = "", **streams: Any) -> None:
        command, environment = find_program(module)
        # A group of its own: Ctrl-C on a terminal is for the process that started it.
        apart: dict[str, Any] = (
            {"creationflags": 0x200} if os.name == "nt" else {"start_new_session": True}
        )
        with explain_os_error("A process cannot be started", DigiclayError):
            self.process = subprocess.Popen(
                [*command, *arguments],
                stdin=subprocess.PIPE,
                env={**os.environ, **environment},
                **streams,
                **apart,
            )
        assert self.process.stdin is not None
        self.input = self.process.stdin

    def stop(self) -> None:
        """Request the process to stop."""
        with suppress(OSError):  # it may have ended, and what was meant for it be left over
            self.input.close()

    def kill(self) -> None:
        """End the process at once."""
        self.process.kill()
        self.wait()

    def wait(self) -> str:
        """Wait for the process to end, and return its outcome."""
        code = self.process.wait()
        self.stop()
        if self.process.stdout:
            self.process.stdout.close()
        return f"signal {-code}" if code < 0 else f"code {code}"


class Processes(Generic[Started]):
    """All processes of a series: stopped together when `stop` says so, and ended at the end of the block.

    `draw` is called again and again meanwhile.
    """

    def __init__(self, stop: Callable[[], bool], draw: Callable[[], None]) -> None:
        self._stop, self._draw = stop, draw
        self.alive: list[Started] = []
        self._deadline = math.inf

    def __enter__(self) -> Self:
        return self

    def stopping(self) -> bool:
        """Return whether they have been asked to stop."""
        return self._deadline < math.inf

    def stopped(self) -> bool:
        """Draw, and stop all on request; kill the remaining ones after some time."""
        self._draw()
        if self._stop():
            self._stop_all()
        return self._stop()

    def _stop_all(self) -> None:
        """Request all to stop, or kill them."""
        self._deadline = min(self._deadline, time.monotonic() + GRACE)
        for process in list(self.alive):
            process.kill() if time.monotonic() >= self._deadline else process.stop()

    def start(self, make: Callable[[], Started]) -> Started | None:
        """Start a process; None after a stop."""
        if self.stopping():
            return None
        process = make()
        self.alive.append(process)
        if self.stopping():  # since then: evaluators are started by several threads
            process.stop()
        return process

    def wait(self, process: Started) -> str:
        """Wait for a process to end, remove it, and return its outcome."""
        how = process.wait()
        self.alive.remove(process)
        return how

    def finish(
        self, count: int, pieces: Iterable[Piece], begin: Callable[[Piece], Started]
    ) -> Iterator[tuple[Piece, Started | str]]:
        """Run a process per piece, `count` at a time; yield those that ended, and why some did not begin."""
        waiting, running = deque(pieces), list[tuple[Piece, Started]]()
        while waiting or running:
            if self.stopped():
                waiting.clear()
            while waiting and len(running) < count:
                piece = waiting.popleft()
                try:
                    process = self.start(partial(begin, piece))
                except Exception as error:  # the other pieces are worth having
                    yield piece, describe_error(error)
                else:
                    running += [(piece, process)] if process else []
            ended = [pair for pair in running if pair[1].process.poll() is not None]
            for piece, process in ended:
                running.remove((piece, process))
                self.wait(process)
                yield piece, process
            time.sleep(0.0 if ended else PAUSE)

    def __exit__(self, *raised: object) -> None:
        self._stop_all()
        for process in list(self.alive):
            process.kill()
