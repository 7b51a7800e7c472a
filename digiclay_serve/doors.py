"""Doors of a session: the process that serves clients, and the two slots it shares with the session."""

from __future__ import annotations

import json
import mmap
import os
import select
import struct
import subprocess
import sys
import tempfile
import zlib
from contextlib import AbstractContextManager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import digiclay
import numpy as np
from digiclay.core.base.errors import OutputError
from digiclay.core.files.tables import Record

from .protocol import MOST_FINGERS, Bed, Poses

#: Bytes before the value: number of the value, twice that and one more while it is written; its
#: checksum.
HEAD = 16
#: Times that a value overwritten during reading is read again; later ones are read at the next
#: look.
TRIES = 3
#: Memory that is no disk, where there is one.
MEMORY = Path("/dev/shm")


class LatestSlot:
    """Slot for values of one size in memory that two processes share; neither ever waits.

    A reader that stalls misses values; a writer that stalls leaves the last one. Nothing is queued,
    so that neither can fill the memory of the other. `memory`: `HEAD` bytes, 0 at first, and those
    of a value.
    """

    def __init__(self, memory: mmap.mmap) -> None:
        self._memory = memory
        #: Pipe that is told of each value by a line, and does not block; None: there is none.
        self.bell: int | None = None
        # One aligned machine word: it is written and read as a whole.
        self._head = np.frombuffer(memory, np.uint64, 2)
        self._seen = 0

    def write(self, value: bytes) -> None:
        """Put a value in the place of the last one. Raises ValueError when it has another size.

        Raises BrokenPipeError when nobody listens to the bell any more.
        """
        size = len(self._memory) - HEAD
        if len(value) != size:
            raise ValueError(f"a value must have {size} bytes (got {len(value)})")
        number = int(self._head[0])
        self._head[0] = number + 1
        self._memory[HEAD:] = value
        self._head[1] = zlib.crc32(value)
        self._head[0] = number + 2
        if self.bell is not None:
            with suppress(BlockingIOError):  # it rings for earlier ones: the newest will be read
                os.write(self.bell, b"\n")

    def read(self) -> bytes | None:
        """Return the newest value; None when there is none that was not read already."""
        for _ in range(TRIES):
            number = int(self._head[0])
            if number == self._seen:
                return None
            value, check = self._memory[HEAD:], int(self._head[1])
            # The checksum holds on processors that reorder writes, too.
            if number % 2 == 0 and number == int(self._head[0]) and zlib.crc32(value) == check:
                self._seen = number
                return value
        return None


def make_slot(size: int) -> tuple[LatestSlot, Path]:
    """Return a new slot for values of a multiple of 8 bytes, and its file for the other process to open."""
    folder = MEMORY if MEMORY.is_dir() else None
    with tempfile.NamedTemporaryFile(prefix="digiclay_", dir=folder, delete=False) as file:
        file.write(bytes(HEAD + size))
        file.flush()
        return LatestSlot(mmap.mmap(file.fileno(), HEAD + size)), Path(file.name)


def open_slot(path: Path) -> LatestSlot:
    """Return the slot of another process."""
    with path.open("r+b") as file:
        return LatestSlot(mmap.mmap(file.fileno(), 0))


#: Pose, its number, whether there is one, resets, messages with fingers, how many they are; each.
LAYOUT = struct.Struct("<7d5Q" + MOST_FINGERS * "Q7d")


class Order(NamedTuple):
    """Newest requests of the clients."""

    #: Lowest point, m, and unit quaternion; None: none was asked for since the last reset.
    pose: tuple[float, ...] | None = None
    #: Of that pose.
    number: int = 0
    #: Since the start.
    resets: int = 0
    #: Messages with fingers since the last reset.
    named: int = 0
    #: Identities and poses of those alive, in order of appearance.
    fingers: tuple[tuple[int, tuple[float, ...]], ...] = ()

    def name(self, request: Poses, most: int) -> tuple[Order, int]:
        """Return the order after fingers were named, and how many there are beyond `most`."""
        newest = {**dict(self.fingers), **dict(request.fingers)}
        alive = set(request.alive)
        there = [identity for identity in newest if identity in alive]
        fingers = tuple((identity, newest[identity]) for identity in there[:most])
        order = self._replace(
            pose=None, number=request.number, named=self.named + 1, fingers=fingers
        )
        return order, len(there) - len(fingers)


def pack_order(order: Order) -> bytes:
    """Write an order for `LatestSlot`."""
    pose = order.pose or (0.0,) * 7
    counts = order.number, order.pose is not None, order.resets, order.named, len(order.fingers)
    fingers = [value for identity, finger in order.fingers for value in (identity, *finger)]
    return LAYOUT.pack(*pose, *counts, *fingers, *[0] * (8 * MOST_FINGERS - len(fingers)))


def unpack_order(data: bytes) -> Order:
    """Read an order."""
    values = LAYOUT.unpack(data)
    number, there, resets, named, count = values[7:12]
    fingers = tuple((values[at], values[at + 1 : at + 8]) for at in range(12, 12 + 8 * count, 8))
    return Order(values[:7] if there else None, number, resets, named, fingers)


#: Time for the process to open the doors; to tell its counts, and then to end; to heed a signal, s.
OPENING, ENDING, HEEDING = 60.0, 4.0, 1.0


class Doors(AbstractContextManager["Doors"]):
    """Process of the doors, from the start of the block to its end.

    Parameters
    ----------
    frame_size : int
        Bytes of a packed frame.
    settings
        ``host``, ``port`` and ``osc_port``, 0: chosen by the system, and ``token`` of the clients.

    Raises
    ------
    OutputError
        On entry, when an address cannot be used.
    """

    def __init__(self, bed: Bed, frame_size: int, **settings: str | int) -> None:
        self._orders, orders = make_slot(LAYOUT.size)
        self._frames, frames = make_slot(-(-frame_size // 8) * 8)
        self._files = [orders, frames]
        self._settings = {
            **settings,
            "slots": [str(path) for path in self._files],
            "bed": asdict(bed),
        }
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
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            env={**os.environ, "PYTHONPATH": path},
            start_new_session=True,  # Ctrl-C on a terminal is for the session
        )
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        self._input, self._output = stdin, stdout
        with suppress(BrokenPipeError):  # its answer says why
            stdin.write(json.dumps(self._settings).encode() + b"\n")
            stdin.flush()
        answer = self._read_line(OPENING)
        if "port" not in answer:
            self._end(HEEDING)
            raise OutputError(answer.get("error", "The process of the doors has ended: see above."))
        self.port, self.osc_port = int(answer["port"]), int(answer["osc_port"])
        self._frames.bell = stdin.fileno()
        os.set_blocking(self._frames.bell, False)

    def wait(self, time: float) -> None:
        """Wait for an order, for a time at most, s."""
        if select.select([self._output], [], [], time)[0]:
            os.read(self._output.fileno(), 65536)

    def read_order(self) -> Order:
        """Return the newest order."""
        read = self._orders.read()
        if read is not None:
            self._order = unpack_order(read)
        return self._order

    def show(self, frame: bytes) -> None:
        """Show a packed frame to the clients. Raises OutputError when the process of the doors has ended."""
        try:
            self._frames.write(frame)
        except OSError:
            raise OutputError("The process of the doors has ended.") from None

    def close(self) -> Record:
        """Close the doors, and return what they have counted."""
        self._input.close()
        answer = self._read_line(ENDING)
        # A process that has not answered is stopped, or hangs.
        self._end(ENDING if answer else 0.0)
        return dict(answer.get("counts", {"doors that did not answer": 1}))

    def __exit__(self, *raised: object) -> None:
        self._end(HEEDING)

    def _read_line(self, patience: float) -> Record:
        """Read a line of JSON; an empty answer when there is none in time, s."""
        line = b"\n"
        while line == b"\n" and select.select([self._output], [], [], patience)[0]:
            # Bells come before it.
            line = self._output.readline()
        return dict(json.loads(line)) if line.strip() else {}

    def _end(self, patience: float) -> None:
        """Have the process end, by itself within a time, s, or by signals."""
        for stream in (self._input, self._output):
            with suppress(OSError):
                stream.close()
        for insist in (self._process.terminate, self._process.kill):
            try:
                self._process.wait(patience)
            except subprocess.TimeoutExpired:
                insist()
                patience = HEEDING
        self._process.wait()
