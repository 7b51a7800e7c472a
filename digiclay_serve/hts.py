"""Lines of Hand Tracking Streamer, of 21 joints a hand in left-handed axes, to fingertips over a bed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import ParameterError

#: Identities of a hand's fingers begin here, thumb first; rows of its fingertips.
HANDS, TIPS = {"left": 0, "right": 5}, [4, 8, 12, 16, 20]
#: Numbers of a line: wrist x, y, z, qx, qy, qz, qw; joints from the wrist.
LINES = {"wrist": 7, "landmarks": 63}
#: Time after which a hand is gone; after which both are put over the bed anew, s; height there, m.
GONE, ANEW, OVER = 0.1, 1.0, 20e-3


@dataclass(frozen=True)
class Hands:
    """Hands that were seen; when they come they are over the middle of the bed, 20 mm over the clay."""

    #: m: of the clay at rest.
    height: float
    wrists: dict[str, Floats] = field(default_factory=dict)
    #: When each was seen, s, and its fingertips (5, 3) in axes of the bed, m.
    tips: dict[str, tuple[float, Floats]] = field(default_factory=dict)
    #: (3,), m, of the bed's frame in the room.
    origin: Floats | None = None

    def take(self, data: bytes, now: float) -> Hands:
        """Take a packet of lines at a time, s. Raises ParameterError for a line that is none."""
        hands = self
        for line in data.decode("utf-8", "replace").splitlines():
            label, _, rest = line.partition(":")
            side, kind, *_ = [*label.lower().split(), "", ""]
            if side in HANDS and kind in LINES:
                hands = hands._take_line(side, kind, rest, now)
        return hands

    def _take_line(self, side: str, kind: str, rest: str, now: float) -> Hands:
        try:
            values = np.array([float(word) for word in rest.split(",") if word.strip()])
        except ValueError:
            values = np.empty(0)
        if values.size != LINES[kind] or not (np.abs(values) < 100.0).all():
            rule = f"must be {LINES[kind]} numbers below 100 m, with decimal points"
            raise ParameterError("line", f"{side} {kind}", rule, repr(rest[:40]))
        if kind == "wrist":
            return replace(self, wrists={**self.wrists, side: values})
        if side not in self.wrists:
            return self
        place, axis, real = np.split(self.wrists[side], [3, 6])
        local, length = values.reshape(21, 3)[TIPS], max(math.hypot(*axis, *real), 1e-3)
        twice = 2.0 * np.cross(axis, local) / length**2
        room = place + local + real * twice + np.cross(axis, twice)
        tips = room[:, [0, 2, 1]]  # Unity's y is up: the exchange also makes the axes right-handed
        origin, last = self.origin, max((time for time, _ in self.tips.values()), default=-math.inf)
        if origin is None or now - last > ANEW:
            origin = np.array([*tips[:, :2].mean(0), tips[:, 2].min() - OVER - self.height])
        return replace(self, tips={**self.tips, side: (now, tips)}, origin=origin)

    def fingers(self, now: float) -> dict[int, Floats]:
        """Return the lowest points (3,), m, of the fingers that are there at a time, s, by identity."""
        if self.origin is None:
            return {}
        seen = {side: tips - self.origin for side, (time, tips) in self.tips.items() if now - time < GONE}
        return {HANDS[side] + row: tip for side, tips in seen.items() for row, tip in enumerate(tips)}
