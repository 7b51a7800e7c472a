"""Following of a server: the fingertip of a session goes where that of `digiclay serve` is. No Blender.

A tick looks for datagrams and never waits for one. UDP suits that: a pose that is lost is not missed, since
the next one is newer, and a server that stalls leaves nothing half-read.
"""

from __future__ import annotations

import ipaddress
import math
import socket
import struct
from dataclasses import dataclass, replace

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


#: Poses a second asked for: some between two ticks.
RATE = 120.0
#: Time between two subscriptions, and that after which a server is silent, s: its end is told within 2 s.
RENEW, SILENT = 1.0, 1.5
#: What is told of a server whose port is closed, and of one that sends nothing.
ENDED = "No server at {}: it has ended, or is not started yet"
UNHEARD = "No pose from {}: is the server running, and the token right?"
#: Most datagrams read in a tick: more than a server sends meanwhile.
MOST = 1000


@dataclass(frozen=True, eq=False)
class Following:
    """Server that a session follows.

    Attributes
    ----------
    address : str
        As it was entered.
    door : socket
        Connected to the server and not blocking: what others send never arrives.
    asked : float
        When the last subscription was sent, s.
    heard : float or None
        When the last pose was read, or else the first look, s; None before that.
    pose : ndarray (7,) or None
        The newest; None before the first.
    silent : bool
        Whether it has been told that nothing comes.
    """

    address: str
    token: str
    door: socket.socket
    asked: float = -math.inf
    heard: float | None = None
    pose: Floats | None = None
    silent: bool = False


#: Followed servers by the uid of the session's bed: what this Blender is doing, not what a file holds.
_FOLLOWED: dict[int, Following] = {}


def find(uid: int) -> Following | None:
    """Return the server that the session of a bed follows, or None."""
    return _FOLLOWED.get(uid)


def begin(uid: int, address: str, token: str, *, online: bool) -> None:
    """Begin to follow a server; whatever was followed before is not any more.

    `uid`: `session_uid` of the bed; `address`: host and port of its OSC; `online`: whether other machines may
    be reached. Raises DigiclayError when the address is none, or may not be reached. Raises OSError when
    there is no way there.
    """
    host, port = parse_address(address, online=online)
    door = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
    try:
        door.setblocking(False)
        door.connect((host, port))
    except OSError:
        door.close()
        raise
    end(uid)
    _FOLLOWED[uid] = Following(address, token, door)


def end(uid: int) -> None:
    """Follow no server any more."""
    following = _FOLLOWED.pop(uid, None)
    if following is not None:
        following.door.close()


def follow(uid: int, now: float) -> tuple[Floats | None, str]:
    """Look for poses; return the newest one, None before the first, and what is to be told.

    `uid`: `session_uid` of the bed; `now`: by a clock that never goes back, s.
    """
    following = _FOLLOWED.get(uid)
    if following is None:
        return None, ""
    if now - following.asked >= RENEW:
        _send(following.door, pack_subscription(following.token, RATE))
        following = replace(following, asked=now)
    (pose, closed), told = _receive(following.door), ""
    heard = now if following.heard is None else following.heard
    if pose is not None:
        if following.silent:
            told = localize("The server at {} is heard again", following.address)
        following = replace(following, pose=pose, heard=now, silent=False)
    elif not following.silent and (closed or now - heard >= SILENT):
        following = replace(following, silent=True)
        told = localize(ENDED if closed else UNHEARD, following.address)
    else:
        following = replace(following, heard=heard)
    _FOLLOWED[uid] = following
    return following.pose, told


def _send(door: socket.socket, data: bytes) -> None:
    """Send a datagram; one that cannot be sent is repeated soon."""
    try:
        door.send(data)
    except OSError:  # nobody listens there now, or the network is busy
        return


def _receive(door: socket.socket) -> tuple[Floats | None, bool]:
    """Return the newest pose that has come, None for none; and whether nobody listens at the port."""
    newest, closed = None, False
    for _ in range(MOST):
        try:
            data = door.recv(2048)
        except BlockingIOError:
            break
        except OSError as error:
            closed = closed or isinstance(error, ConnectionError)
            continue
        pose = read_pose(data)
        newest = newest if pose is None else pose
    return newest, closed
