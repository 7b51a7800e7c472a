"""Lines of Hand Tracking Streamer, of 21 joints a hand in left-handed axes, to fingertips over a bed."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import ParameterError

#: Identity of a hand's thumb; rows of fingertips; numbers of a line: place and x, y, z, w of a
#: turn; joints.
HANDS, TIPS, LINES = {"left": 0, "right": 5}, [4, 8, 12, 16, 20], {"wrist": 7, "landmarks": 63}
#: Time after which a hand is gone; after which a wrist is too old for joints, and both hands are
#: put over the bed anew, s; height there, m.
GONE, ANEW, OVER = 0.05, 1.0, 20e-3


@dataclass(frozen=True)
class Hands:
    """Hands that were seen; when they come they are over the middle of the bed, 20 mm over the clay."""

    #: m: of the clay at rest.
    height: float
    #: When each was seen, s, and the numbers of its wrist (7,).
    wrists: dict[str, tuple[float, Floats]] = field(default_factory=dict)
    #: When each was seen, s, and its fingertips (5, 3) in axes of the bed, m.
    tips: dict[str, tuple[float, Floats]] = field(default_factory=dict)
    #: (3,), m: of the bed's frame in the room.
    origin: Floats | float = 0.0

    def take(self, data: bytes, now: float) -> Hands:
        """Take a packet of lines at a time, s. Raises ParameterError for a line that is none."""
        hands = self
        for line in data.decode("utf-8", "replace").splitlines():
            side, kind, *_ = [*line.partition(":")[0].lower().split(), "", ""]
            if side in HANDS and kind in LINES:
                hands = hands._take_line(side, kind, line, now)
        return hands

    def _take_line(self, side: str, kind: str, line: str, now: float) -> Hands:
        rest, values = line.partition(":")[2], np.zeros(0)
        with suppress(ValueError):
            values = np.array([float(word) for word in rest.split(",") if word.strip()])
        if values.size != LINES[kind] or not (np.abs(values) < 100.0).all():
            rule = f"must be {LINES[kind]} numbers below 100 m, with decimal points"
            raise ParameterError("line", f"{side} {kind}", rule, repr(rest[:40]))
        if kind == "wrist":
            return replace(self, wrists={**self.wrists, side: (now, values)})
        seen, wrist = self.wrists.get(side, (-math.inf, values))
        if now - seen > ANEW:
            return self
        (place, axis, real), local = np.split(wrist, [3, 6]), values.reshape(21, 3)[TIPS]
        twice = 2.0 * np.cross(axis, local) / max(math.hypot(*axis, *real), 1e-3) ** 2
        room: Any = place + local + real * twice + np.cross(axis, twice)
        tips = room[:, [0, 2, 1]]  # Unity's y is up: the exchange also makes the axes right-handed
        middle = np.array([*tips[:, :2].mean(0), tips[:, 2].min() - OVER - self.height])
        origin = middle if all(now - time > ANEW for time, _ in self.tips.values()) else self.origin
        return replace(self, tips={**self.tips, side: (now, tips)}, origin=origin)

    def fingers(self, now: float) -> dict[int, Floats]:
        """Return the lowest points (3,), m, of the fingers that are there at a time, s, by identity."""
        return {
            HANDS[side] + row: tip
            for side, (time, tips) in self.tips.items()
            if now - time < GONE
            for row, tip in enumerate(tips - self.origin)
        }
