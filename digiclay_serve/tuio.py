"""Bundles of TUIO 1.1 and 2.0 of a touch pad, to fingertips on a bed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import ParameterError
from pythonosc.osc_packet import OscPacket

#: Time after which a pad is gone, s: one that is touched repeats itself each second. Pressure of
#: one that has none. Most contacts between two lists of those alive.
GONE, USUAL, MOST = 1.2, 0.5, 256


@dataclass(frozen=True)
class Pad:
    """Pad that was heard; its middle is that of the bed."""

    #: m: of the clay at rest; side of the bed that the pad covers; depth of a finger at full
    #: pressure.
    height: float
    size: float
    depth: float
    #: Position from the upper left corner and pressure, 0 to 1, of those alive; None before the
    #: first.
    contacts: dict[int, list[float] | None] = field(default_factory=dict)
    heard: float = 0.0  # s
    senses: bool = False  # pressure

    def take(self, data: bytes, now: float) -> Pad:
        """Take a datagram at a time, s. Raises ParameterError for one that is none."""
        contacts = self.contacts
        try:
            for each in OscPacket(data).messages:
                contacts = _take_message(contacts, each.message.address, each.message.params)
        except Exception:  # python-osc raises errors of many kinds over bytes that are no OSC
            raise ParameterError(
                "datagram", "", "must be TUIO 1.1 or 2.0", repr(data[:40])
            ) from None
        senses = self.senses or any(touch and touch[2] for touch in contacts.values())
        return replace(self, contacts=contacts, heard=now, senses=bool(senses))

    def fingers(self, now: float) -> dict[int, Floats]:
        """Return the lowest points (3,), m, of the fingers that are there at a time, s, by identity."""
        corner = (-0.5 * self.size, 0.5 * self.size, self.height)
        scale = (self.size, -self.size, -self.depth)
        there = self.contacts.items() if now - self.heard <= GONE else ()
        usual = not self.senses and USUAL
        return {
            identity: corner + np.add(touch, (0.0, 0.0, usual)) * scale
            for identity, touch in there
            if touch
        }


def _take_message(contacts: dict[int, Any], address: str, values: list[Any]) -> dict[int, Any]:
    """Return the contacts after a message; raise an error of any kind over anything that is none."""
    kind = values[0] if address == "/tuio/2Dcur" else address
    if kind in ("alive", "/tuio2/alv"):
        alive = (int(identity) % 2**32 for identity in values if identity != "alive")
        return {identity: contacts.get(identity) for identity in alive}
    if kind not in ("set", "/tuio2/ptr"):
        return contacts
    name, *touch = [*values[1:4], 0.0] if kind == "set" else [*values[:1], *values[3:5], values[8]]
    x, y, pressure = np.clip(touch, 0.0, 1.0).tolist()
    if len(contacts) > MOST or not np.isfinite(touch).all():
        raise ValueError
    return {**contacts, int(name) % 2**32: [x, y, pressure]}
