"""Pin display on a serial line: its frames, and heights at a rate without ever waiting for the line."""

from __future__ import annotations

import asyncio
import os
import struct
import zlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from digiclay.core.base.errors import OutputError
from numpy.typing import NDArray

from .door_link import DoorLink

VERSION = 1
HEIGHTS, ACKNOWLEDGEMENT = 1, 2
END, ESCAPE = b"\xc0", b"\xdb"
ESCAPED_END, ESCAPED_ESCAPE = b"\xdb\xdc", b"\xdb\xdd"
#: Version, kind, sequence number.
HEAD = struct.Struct("<BBH")
#: Control period, stroke in m, pins.
BODY = struct.Struct("<QfI")
CHECK = struct.Struct("<I")
#: Largest count: a pin at its stroke.
FULL = 65535
#: Frames on their way at most.
WINDOW = 4
#: Time after which a frame that is not acknowledged is lost, s.
LOST = 1.0


def _frame(body: bytes) -> bytes:
    """Return a body with its checksum, framed."""
    checked = body + CHECK.pack(zlib.crc32(body))
    return checked.replace(ESCAPE, ESCAPED_ESCAPE).replace(END, ESCAPED_END) + END


def split_frames(data: bytes) -> tuple[list[bytes | None], bytes]:
    """Return the bodies of whole frames, None for each that is damaged, and what is left for later.

    `data`: what was left before, and what has come since.
    """
    *whole, rest = data.split(END)
    bodies: list[bytes | None] = []
    for one in filter(None, whole):
        checked = one.replace(ESCAPED_END, END).replace(ESCAPED_ESCAPE, ESCAPE)
        body, check = checked[: -CHECK.size], checked[-CHECK.size :]
        sound = len(body) >= HEAD.size and check == CHECK.pack(zlib.crc32(body))
        bodies.append(body if sound else None)
    return bodies, rest


def pack_heights(sequence: int, period: int, stroke: float, heights: NDArray[np.floating[Any]]) -> bytes:
    """Write heights as a frame: each as a share of the stroke, in 65,535 counts.

    `sequence`: from 0 to 65,535; `stroke`, m; `heights` (n,), m.
    """
    counts = np.rint(np.clip(heights / stroke, 0.0, 1.0) * FULL).astype("<u2")
    head = HEAD.pack(VERSION, HEIGHTS, sequence) + BODY.pack(period, stroke, len(counts))
    return _frame(head + counts.tobytes())


def read_heights(body: bytes) -> tuple[int, int, NDArray[np.float64]] | None:
    """Return sequence number, period and heights, m, of the body of a frame; None when it has none."""
    start = HEAD.size + BODY.size
    if len(body) < start or body[:2] != bytes([VERSION, HEIGHTS]):
        return None
    sequence = HEAD.unpack_from(body)[2]
    period, stroke, pins = BODY.unpack_from(body, HEAD.size)
    if len(body) != start + 2 * pins:
        return None
    return sequence, period, np.frombuffer(body, "<u2", offset=start) / FULL * stroke


def pack_acknowledgement(sequence: int) -> bytes:
    """Write the acknowledgement of a frame of heights."""
    return _frame(HEAD.pack(VERSION, ACKNOWLEDGEMENT, sequence))


def read_acknowledgement(body: bytes) -> int | None:
    """Return the sequence number that a body acknowledges; None when it does not."""
    if len(body) != HEAD.size or body[:2] != bytes([VERSION, ACKNOWLEDGEMENT]):
        return None
    return int(HEAD.unpack(body)[2])


@dataclass(frozen=True)
class Ledger:
    """Account of the frames of a line.

    Attributes
    ----------
    late_after : float
        Time after which an acknowledgement is late, s.
    next : int
        Sequence number of the next frame.
    waiting : mapping
        Instants, s, of frames that are not acknowledged, by sequence number; oldest first.
    sent, acknowledged, late, dropped, skipped, damaged : int
        Frames: written; acknowledged, the late ones included; lost on their way; not written, since the
        line was busy; and from the display with a wrong checksum, or an acknowledgement of nothing.
    """

    late_after: float
    next: int = 0
    waiting: Mapping[int, float] = field(default_factory=dict)
    sent: int = 0
    acknowledged: int = 0
    late: int = 0
    dropped: int = 0
    skipped: int = 0
    damaged: int = 0


def send(ledger: Ledger, now: float, *, busy: bool) -> tuple[int | None, Ledger]:
    """Return the sequence number of a frame to write now, None for none, and the account after it.

    `now`, s; `busy`: whether the line still has bytes to write.
    """
    ledger = expire(ledger, now)
    if busy or len(ledger.waiting) >= WINDOW:
        return None, replace(ledger, skipped=ledger.skipped + 1)
    waiting = {**ledger.waiting, ledger.next: now}
    after = replace(ledger, next=(ledger.next + 1) % (FULL + 1), waiting=waiting, sent=ledger.sent + 1)
    return ledger.next, after


def expire(ledger: Ledger, now: float) -> Ledger:
    """Return the account with frames that were not acknowledged in time as dropped. `now`, s."""
    left = {number: at for number, at in ledger.waiting.items() if now - at < LOST}
    return replace(ledger, waiting=left, dropped=ledger.dropped + len(ledger.waiting) - len(left))


def acknowledge(ledger: Ledger, body: bytes | None, now: float) -> Ledger:
    """Return the account after a frame from the display. `body`: from `split_frames`; `now`, s."""
    sequence = None if body is None else read_acknowledgement(body)
    if sequence is None or sequence not in ledger.waiting:
        return replace(ledger, damaged=ledger.damaged + 1)
    waiting = dict(ledger.waiting)
    late = now - waiting.pop(sequence) > ledger.late_after
    return replace(ledger, waiting=waiting, acknowledged=ledger.acknowledged + 1, late=ledger.late + late)


#: Bytes that a display may send without the end of a frame, before they are thrown away.
MOST_UNREAD = 4096


def open_display(link: DoorLink, path: str, rate: float, baud: int) -> Display:
    """Open the serial line of a display, and begin to send.

    `path`: of the device; `rate`: frames a second; `baud`: bits a second. Raises OutputError when it is no
    serial line, or has no such speed.
    """
    import termios
    import tty

    speed = getattr(termios, f"B{baud}", None)
    if speed is None:
        raise OutputError(f"--display-baud must be a speed of serial lines, such as 115200 (got {baud}).")
    try:
        line = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        raise OutputError(f"--display {path} cannot be opened: {error.strerror}.") from None
    try:
        tty.setraw(line)
        settings = termios.tcgetattr(line)
        settings[4] = settings[5] = speed
        termios.tcsetattr(line, termios.TCSANOW, settings)
    except termios.error:
        os.close(line)
        raise OutputError(f"--display must be a serial line ({path} is none).") from None
    return Display(link, line, rate)


class Display:
    """Serial line that is being sent to.

    Parameters
    ----------
    line : int
        Its descriptor, raw and not blocking.
    rate : float
        Frames a second.
    """

    def __init__(self, link: DoorLink, line: int, rate: float) -> None:
        self._link, self._line, self._rate = link, line, rate
        self.ledger = Ledger(late_after=1.0 / rate)
        self._unsent = self._unread = b""
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(line, self._read)
        self._sending = asyncio.ensure_future(self._send())
        self.ended = ""

    def close(self) -> dict[str, Any]:
        """End; return the account. What is still on its way counts as dropped."""
        self._stop()
        ledger = replace(self.ledger, dropped=self.ledger.dropped + len(self.ledger.waiting), waiting={})
        figures = {name: value for name, value in asdict(ledger).items() if name not in ("next", "waiting")}
        return {**figures, "ended": self.ended}

    def _stop(self, why: str = "") -> None:
        """Close the line, once."""
        if self._line >= 0:
            self.ended = why
            self._loop.remove_reader(self._line)
            self._loop.remove_writer(self._line)
            with suppress(OSError):
                os.close(self._line)
            self._line = -1
            self._sending.cancel()

    async def _send(self) -> None:
        """Send the newest heights again and again."""
        every, due = max(1, round(1.0 / (self._link.bed.period * self._rate))), 0
        while True:
            await self._link.next_frame()
            frame = self._link.read_frame()
            if frame is None or due - every < frame.period < due:
                continue
            due = frame.period + every
            number, self.ledger = send(self.ledger, self._loop.time(), busy=bool(self._unsent))
            if number is not None:
                self._unsent = pack_heights(number, frame.period, self._link.bed.stroke, frame.heights)
                self._write()
            self._note()

    def _write(self) -> None:
        """Write what the line takes; the rest follows when it takes more."""
        try:
            self._unsent = self._unsent[os.write(self._line, self._unsent) :]
        except BlockingIOError:
            pass
        except OSError as error:
            self._stop(error.strerror or str(error))
            return
        if self._unsent:
            self._loop.add_writer(self._line, self._write)
        else:
            self._loop.remove_writer(self._line)

    def _read(self) -> None:
        """Take in acknowledgements."""
        try:
            read = os.read(self._line, 65536)
        except BlockingIOError:
            return
        except OSError as error:
            self._stop(error.strerror or str(error))
            return
        if not read:
            self._stop("the line was closed")
            return
        bodies, self._unread = split_frames(self._unread + read)
        if len(self._unread) > MOST_UNREAD:
            self._unread, bodies = b"", [*bodies, None]
        now = self._loop.time()
        self.ledger = expire(self.ledger, now)
        for body in bodies:
            self.ledger = acknowledge(self.ledger, body, now)
        self._note()

    def _note(self) -> None:
        """Note the account among the counts of the doors."""
        for name in ("sent", "acknowledged", "late", "dropped", "skipped", "damaged"):
            self._link.counts[f"display frames {name}"] = getattr(self.ledger, name)
