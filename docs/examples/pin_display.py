"""Show the heights of a `digiclay serve` session on a pin display at a serial line.

    pin_display.py ws://127.0.0.1:8765 /dev/ttyUSB0 --rate 30 --baud 1000000

The token is in DIGICLAY_SERVE_TOKEN. A frame is a body and its CRC-32, framed by SLIP (RFC 1055),
little-endian; docs/serve.md has the table. The display acknowledges each frame; at most four are on
their way, and none is repeated.
"""

import argparse
import json
import os
import struct
import termios
import time
import tty
import zlib
from collections import Counter
from contextlib import suppress
from typing import Any

import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from digiclay_serve.protocol import Frame, unpack_frame

VERSION, HEIGHTS, ACKNOWLEDGEMENT = 1, 1, 2
#: Version, kind, sequence number; of heights also the control period, stroke in m, and pins.
HEAD, BODY = struct.Struct("<BBH"), struct.Struct("<QfI")
#: Count of a pin at its stroke; frames on their way at most; time after which a frame is lost, s.
FULL, WINDOW, LOST = 65535, 4, 1.0
COUNTS = ("sent", "acknowledged", "late", "dropped", "skipped", "damaged")


def pack(body: bytes) -> bytes:
    """Return a body with its checksum, framed."""
    checked = body + struct.pack("<I", zlib.crc32(body))
    return checked.replace(b"\xdb", b"\xdb\xdd").replace(b"\xc0", b"\xdb\xdc") + b"\xc0"


def split(data: bytes) -> tuple[list[bytes | None], bytes]:
    """Return the bodies of whole frames, None for each that is damaged, and the bytes after the last."""
    *whole, rest = data.split(b"\xc0")
    bodies: list[bytes | None] = []
    for framed in filter(None, whole):
        checked = framed.replace(b"\xdb\xdc", b"\xc0").replace(b"\xdb\xdd", b"\xdb")
        body, check = checked[:-4], checked[-4:]
        bodies.append(body if check == struct.pack("<I", zlib.crc32(body)) else None)
    return bodies, rest


def pack_heights(sequence: int, period: int, stroke: float, heights: np.ndarray) -> bytes:
    """Return heights (n,), m, as a frame: each as a share of the stroke, in 65,535 counts."""
    counts = np.rint(np.clip(heights / stroke, 0.0, 1.0) * FULL).astype("<u2")
    head = HEAD.pack(VERSION, HEIGHTS, sequence) + BODY.pack(period, stroke, len(counts))
    return pack(head + counts.tobytes())


class Display:
    """Serial line of a display, which is never waited for, and the counts of its frames."""

    def __init__(self, path: str, baud: int, rate: float) -> None:
        speed = getattr(termios, f"B{baud}", None)
        if speed is None:
            raise SystemExit(
                f"--baud must be a speed of serial lines, such as 115200 (got {baud})."
            )
        try:
            self._line = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            tty.setraw(self._line)
            settings = termios.tcgetattr(self._line)
            settings[4] = settings[5] = speed
            termios.tcsetattr(self._line, termios.TCSANOW, settings)
        except (OSError, termios.error) as error:
            raise SystemExit(f"{path} must be a serial line: {error.args[-1]}.") from None
        self.counts = Counter(dict.fromkeys(COUNTS, 0))
        self._late_after, self._sequence = 1.0 / rate, 0
        self._waiting: dict[int, float] = {}
        self._unsent = self._unread = b""

    def show(self, frame: Frame, stroke: float) -> None:
        """Send the heights of a frame, unless the line is busy or too many frames are on their way."""
        self._read()
        self._write()
        if self._unsent or len(self._waiting) >= WINDOW:
            self.counts["skipped"] += 1
            return
        self._unsent = pack_heights(self._sequence, frame.period, stroke, frame.heights)
        self._waiting[self._sequence] = time.monotonic()
        self._sequence = (self._sequence + 1) % (FULL + 1)
        self.counts["sent"] += 1
        self._write()

    def close(self) -> None:
        """End: what is still on its way counts as dropped."""
        self._read()
        self.counts["dropped"] += len(self._waiting)
        os.close(self._line)

    def _write(self) -> None:
        """Write what the line takes now."""
        with suppress(BlockingIOError):
            self._unsent = self._unsent[os.write(self._line, self._unsent) :]

    def _read(self) -> None:
        """Count the acknowledgements that have come, and the frames that are lost."""
        with suppress(BlockingIOError):
            self._unread += os.read(self._line, 65536)
        now, (bodies, rest) = time.monotonic(), split(self._unread)
        self._unread = rest[-4096:]
        for body in bodies:
            *kind, sequence = HEAD.unpack(body) if body and len(body) == HEAD.size else (0, 0, 0)
            sent = self._waiting.pop(sequence, None) if kind == [VERSION, ACKNOWLEDGEMENT] else None
            self.counts["damaged" if sent is None else "acknowledged"] += 1
            self.counts["late"] += sent is not None and now - sent > self._late_after
        lost = [number for number, sent in self._waiting.items() if now - sent >= LOST]
        self.counts["dropped"] += len(lost)
        for number in lost:
            del self._waiting[number]


def main() -> None:
    """Show the heights until the server ends, or Ctrl-C."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("address", help="of the server, such as ws://127.0.0.1:8765")
    parser.add_argument("line", help="serial line of the display, such as /dev/ttyUSB0")
    parser.add_argument("--rate", type=float, default=30.0, help="frames a second; default: 30")
    parser.add_argument(
        "--baud", type=int, default=115200, help="speed of the line; default: 115200"
    )
    arguments = parser.parse_args()
    header = {"Authorization": f"Bearer {os.environ.get('DIGICLAY_SERVE_TOKEN', '')}"}
    address = f"{arguments.address}/?format=binary&rate={arguments.rate:g}"
    display = Display(arguments.line, arguments.baud, arguments.rate)
    with (
        suppress(KeyboardInterrupt, ConnectionClosed),
        connect(address, additional_headers=header) as server,
    ):
        bed: dict[str, Any] = json.loads(server.recv())
        for message in server:
            if isinstance(message, bytes):
                display.show(unpack_frame(message), bed["stroke"])
    display.close()
    print(", ".join(f"{name}: {count}" for name, count in display.counts.items()))


if __name__ == "__main__":
    main()
