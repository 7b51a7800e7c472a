"""Pin display on a serial line: heights at a rate, without ever waiting for the line."""

from __future__ import annotations

import asyncio
import os
from contextlib import suppress
from dataclasses import asdict, replace
from typing import Any

from digiclay.core.base.errors import OutputError

from .door_link import DoorLink
from .pin_frames import Ledger, acknowledge, expire, pack_heights, send, split_frames

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
    link : DoorLink
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
