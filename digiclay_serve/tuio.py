"""Bundles of TUIO 1.1 and 2.0 of a touch pad, to fingertips on a bed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import ParameterError
from pythonosc.osc_packet import OscPacket

#: Time after which a pad is gone, s: one that is touched repeats itself each second.
GONE = 1.2
#: Pressure of a finger on a pad that has none.
USUAL = 0.5
#: Most contacts between two lists of those alive.
MOST = 256


@dataclass(frozen=True)
class Pad:
    """Pad that was heard; its middle is that of the bed."""

    #: m: of the clay at rest; side of the bed that the pad covers; depth of a finger at full pressure.
    height: float
    size: float
    depth: float
    #: Position from the upper left corner and pressure, 0 to 1, of each contact.
    contacts: dict[int, tuple[float, float, float] | None] = field(default_factory=dict)
    alive: tuple[int, ...] = ()
    #: s.
    heard: float = 0.0

    def take(self, data: bytes, now: float) -> Pad:
        """Take a datagram at a time, s. Raises ParameterError for one that is none."""
        try:
            messages = [(each.message.address, each.message.params) for each in OscPacket(data).messages]
            pad = self
            for address, values in messages:
                pad = pad._take_message(address, values)
        except Exception:  # python-osc raises errors of many kinds over bytes that are no OSC
            raise ParameterError("datagram", "", "must be TUIO 1.1 or 2.0", repr(data[:40])) from None
        return replace(pad, heard=now)

    def _take_message(self, address: str, values: list[Any]) -> Pad:
        kind = values[0] if address == "/tuio/2Dcur" else address
        if kind == "set":
            return self._touch(values[1], *values[2:4], USUAL)
        if kind == "/tuio2/ptr":
            return self._touch(values[0], *values[3:5], values[8] or USUAL)
        if kind in ("alive", "/tuio2/alv"):
            alive = tuple(int(one) % 2**32 for one in values if one != "alive")
            return replace(self, alive=alive, contacts={one: self.contacts.get(one) for one in alive})
        return self

    def _touch(self, identity: int, *touch: float) -> Pad:
        if len(self.contacts) > MOST or not np.isfinite(touch).all():
            raise ValueError
        x, y, pressure = np.clip(touch, 0.0, 1.0).tolist()
        return replace(self, contacts={**self.contacts, int(identity) % 2**32: (x, y, pressure)})

    def fingers(self, now: float) -> dict[int, Floats]:
        """Return the lowest points (3,), m, of the fingers that are there at a time, s, by identity."""
        there = {one: touch for one in self.alive if (touch := self.contacts.get(one))}
        size, height, depth = self.size, self.height, self.depth
        return {} if now - self.heard > GONE else {
            one: np.array([size * (x - 0.5), size * (0.5 - y), height - depth * pressure])
            for one, (x, y, pressure) in there.items()
        }  # fmt: skip
