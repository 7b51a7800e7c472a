"""Frames of the serial line of a pin display: heights to it, acknowledgements from it, and their accounts.

A frame is a body and its CRC-32, framed by SLIP (RFC 1055): the byte 0xC0 ends it, and 0xC0 and 0xDB in it
are escaped. What is damaged fails the checksum, and the next end begins anew. A frame of heights that gets
lost is not repeated: the next one is newer.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
