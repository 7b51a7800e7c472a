"""OSC messages by which a session follows `digiclay serve`: a subscription out, states in. No Blender.

These two kinds are all that is needed; python-osc is not part of the extension. docs/serve.md describes them.
"""

from __future__ import annotations

import ipaddress
import struct

import numpy as np

from ..core.base.addresses import is_loopback
from ..core.base.arrays import Floats
from ..core.base.errors import DigiclayError
from ..ui_text import localize

SUBSCRIBE, STATE = "/digiclay/subscribe", "/digiclay/state"
#: Period, number, time, total force, pose.
VALUES = struct.Struct(">qq9d")
#: Names of this machine; others are not looked up, since that would wait for a network.
LOCAL = "localhost"
RULE = "The address must be HOST:PORT, such as 127.0.0.1:8766, with a numeric host (got {})."
OFFLINE = (
    "{} is another machine: allow online access in Preferences > System, or follow a server on this machine."
)


def parse_address(text: str, *, online: bool) -> tuple[str, int]:
    """Return host and port of an address.

    `online`: whether other machines may be reached. Raises DigiclayError when it is no address, or that of
    another machine that may not be reached.
    """
    host, _, port = text.strip().rpartition(":")
    host = "127.0.0.1" if host == LOCAL else host.removeprefix("[").removesuffix("]")
    try:
        ipaddress.ip_address(host)
    except ValueError:
        raise DigiclayError(localize(RULE, repr(text[:60]))) from None
    if not (port.isascii() and port.isdecimal() and len(port) < 6 and 0 < int(port) < 65536):
        raise DigiclayError(localize(RULE, repr(text[:60])))
    if not (is_loopback(host) or online):
        raise DigiclayError(localize(OFFLINE, host))
    return host, int(port)


def pack_subscription(token: str, rate: float) -> bytes:
    """Return the request for states. `token`: of the server; `rate`: states a second."""
    words = b"".join(_pad(word) for word in (SUBSCRIBE, ",ssf", token, "state"))
    return words + struct.pack(">f", rate)


def read_pose(data: bytes) -> Floats | None:
    """Return the pose (7,) in a state; None where there is none that can be used. `data`: a datagram."""
    head = _pad(STATE) + _pad(",hh" + 9 * "d")
    if not data.startswith(head) or len(data) != len(head) + VALUES.size:
        return None
    pose = np.array(VALUES.unpack_from(data, len(head))[4:])
    length = float(np.linalg.norm(pose[3:])) if np.abs(pose).max() < 1e100 else 0.0
    # A number that is none fails the comparisons.
    if not abs(length - 1.0) < 1e-6 or not np.isfinite(pose).all():
        return None
    return pose


def _pad(word: str) -> bytes:
    """Return a string of OSC: ended by zeros, to a multiple of four bytes."""
    data = word.encode("ascii", "replace")
    return data + bytes(4 - len(data) % 4)
