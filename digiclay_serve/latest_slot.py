"""Latest-value slot in memory that two processes share: one writes, one reads, and neither ever waits.

A reader that stalls misses values; a writer that stalls leaves the last one. Nothing is queued, so neither
can fill the memory of the other.
"""

from __future__ import annotations

import mmap
import struct
import tempfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

#: Bytes before the value: number of the value, twice that and one more while it is written; its checksum.
HEAD = 16
#: Times that a value overwritten during reading is read again; later ones are read at the next look.
TRIES = 3
#: Memory that is no disk, where there is one.
MEMORY = Path("/dev/shm")


class LatestSlot:
    """Slot for values of one size.

    Parameters
    ----------
    memory : mmap
        `HEAD` bytes and those of a value; zero before the first value.
    """

    def __init__(self, memory: mmap.mmap) -> None:
        self._memory = memory
        # One aligned machine word: it is written and read as a whole.
        self._head = np.frombuffer(memory, np.uint64, 2)
        self._seen = 0

    @property
    def size(self) -> int:
        """Bytes of a value."""
        return len(self._memory) - HEAD

    def write(self, value: bytes) -> None:
        """Put a value in the place of the last one. Raises ValueError when it has another size."""
        if len(value) != self.size:
            raise ValueError(f"a value must have {self.size} bytes (got {len(value)})")
        number = int(self._head[0])
        self._head[0] = number + 1
        self._memory[HEAD:] = value
        self._head[1] = zlib.crc32(value)
        self._head[0] = number + 2

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
    """Return a new slot, and the file by which another process opens it; remove that file then.

    `size`: bytes of a value, a multiple of 8.
    """
    place = MEMORY if MEMORY.is_dir() else None
    with tempfile.NamedTemporaryFile(prefix="digiclay_", dir=place, delete=False) as file:
        file.write(bytes(HEAD + size))
        file.flush()
        return LatestSlot(mmap.mmap(file.fileno(), HEAD + size)), Path(file.name)


def open_slot(path: Path) -> LatestSlot:
    """Return the slot of another process."""
    with path.open("r+b") as file:
        return LatestSlot(mmap.mmap(file.fileno(), 0))


#: Pose, its number, whether there is one, resets.
LAYOUT = struct.Struct("<7dQQQ")
ORDER_SIZE = LAYOUT.size


@dataclass(frozen=True)
class Order:
    """Newest requests of the clients.

    Attributes
    ----------
    pose : tuple of 7 floats or None
        Lowest point, m, and unit quaternion; None: none was asked for since the last reset.
    number : int
        Of that pose.
    resets : int
        Since the start.
    """

    pose: tuple[float, ...] | None = None
    number: int = 0
    resets: int = 0

    @property
    def target(self) -> NDArray[np.float64] | None:
        """The pose as an array (7,)."""
        return None if self.pose is None else np.array(self.pose)


def pack_order(order: Order) -> bytes:
    """Write an order for `LatestSlot`."""
    pose = order.pose or (0.0,) * 7
    return LAYOUT.pack(*pose, order.number, order.pose is not None, order.resets)


def unpack_order(data: bytes) -> Order:
    """Read an order."""
    *pose, number, there, resets = LAYOUT.unpack(data)
    return Order(tuple(pose) if there else None, number, resets)
