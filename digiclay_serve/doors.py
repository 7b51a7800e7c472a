"""Doors of a session: the process that serves clients, and the two slots it shares with the session."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
from contextlib import AbstractContextManager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import digiclay
from digiclay.core.base.errors import OutputError

from .door_link import Bed
from .latest_slot import ORDER_SIZE, Order, make_slot, unpack_order

#: Bytes of the length in front of the settings.
LENGTH = 8
#: Time for the process to open the doors; to tell its counts, and then to end; to heed a signal, s.
OPENING, ENDING, HEEDING = 60.0, 4.0, 1.0


@dataclass(frozen=True)
class DoorSettings:
    """Addresses of the doors, and the token of their clients.

    Attributes
    ----------
    port, osc_port : int
        0: chosen by the system.
    display : dict or None
        Serial line of a pin display: path, rate in Hz, baud.
    """

    host: str
    port: int
    osc_port: int
    token: str
    display: dict[str, Any] | None = None


class Doors(AbstractContextManager["Doors"]):
    """Process of the doors, from the start of the block to its end.

    Parameters
    ----------
    frame_size : int
        Bytes of a packed frame.

    Raises
    ------
    OutputError
        On entry, when an address or the serial line cannot be used.
    """

    def __init__(self, settings: DoorSettings, bed: Bed, frame_size: int) -> None:
        self.settings, self._bed = settings, bed
        self._orders, orders = make_slot(ORDER_SIZE)
        self._frames, frames = make_slot(-(-frame_size // 8) * 8)
        self._files = [orders, frames]
        self._order = Order()

    def __enter__(self) -> Doors:
        try:
            self._start()
        finally:
            for path in self._files:
                path.unlink(missing_ok=True)
        return self

    def _start(self) -> None:
        """Start the process, and wait until its doors are open."""
        folders = {str(Path(file).parents[1]) for file in (str(digiclay.__file__), __file__)}
        path = os.pathsep.join(filter(None, [*sorted(folders), os.environ.get("PYTHONPATH", "")]))
        self._process = subprocess.Popen(
            [sys.executable, "-m", f"{__package__}.door_process"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": path},
            start_new_session=True,  # Ctrl-C on a terminal is for the session
        )  # fmt: skip
        assert self._process.stdin is not None
        settings = {**asdict(self.settings), "slots": [str(path) for path in self._files]}
        said = json.dumps({**settings, "bed": asdict(self._bed)}).encode()
        with suppress(BrokenPipeError):  # its answer says why
            self._process.stdin.write(len(said).to_bytes(LENGTH, "little") + said)
            self._process.stdin.flush()
        answer = self._read_line(OPENING)
        if "port" not in answer:
            self._end(HEEDING)
            raise OutputError(answer.get("error", "The process of the doors has ended: see above."))
        self.port, self.osc_port = int(answer["port"]), int(answer["osc_port"])
        self._wake = self._process.stdin.fileno()
        os.set_blocking(self._wake, False)

    def read_order(self) -> Order:
        """Return the newest order."""
        read = self._orders.read()
        if read is not None:
            self._order = unpack_order(read)
        return self._order

    def show(self, frame: bytes) -> None:
        """Show a packed frame to the clients. Raises OutputError when the process of the doors has ended."""
        self._frames.write(frame)
        try:
            os.write(self._wake, b".")
        except BlockingIOError:  # it has been told of earlier ones, and will look at the newest
            pass
        except OSError:
            raise OutputError("The process of the doors has ended.") from None

    def close(self) -> dict[str, Any]:
        """Close the doors, and return what they have counted."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        answer = self._read_line(ENDING)
        # A process that has not answered is stopped, or hangs.
        self._end(ENDING if answer else 0.0)
        return dict(answer.get("counts", {"doors that did not answer": 1}))

    def __exit__(self, *raised: object) -> None:
        self._end(HEEDING)

    def _read_line(self, patience: float) -> dict[str, Any]:
        """Read a line of JSON; an empty answer when there is none in time, s."""
        stdout = self._process.stdout
        assert stdout is not None
        line = stdout.readline() if select.select([stdout], [], [], patience)[0] else b""
        return dict(json.loads(line)) if line else {}

    def _end(self, patience: float) -> None:
        """Have the process end, by itself within a time, s, or by signals."""
        for stream in (self._process.stdin, self._process.stdout):
            if stream:
                with suppress(OSError):
                    stream.close()
        for insist in (self._process.terminate, self._process.kill):
            try:
                self._process.wait(patience)
            except subprocess.TimeoutExpired:
                insist()
                patience = HEEDING
        self._process.wait()
