"""Following of a server: fingertips of a session are where those of `digiclay serve` are. No Blender.

A tick looks for datagrams and never waits for one. UDP suits that: a pose that is lost is not
missed, since the next one is newer, and a server that stalls leaves nothing half-read.
"""

import ipaddress
import math
import socket
import struct
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from ..core.base.addresses import is_loopback
from ..core.base.arrays import Floats
from ..core.base.errors import DigiclayError
from ..ui_text import localize

SUBSCRIBE, STATE, FINGERS = "/digiclay/subscribe", "/digiclay/state", "/digiclay/fingers"
#: Period, number, time, total force, pose; identity, force and pose of a finger.
VALUES, FINGER = struct.Struct(">qq9d"), struct.Struct(">q8d")
#: Height of a fingertip whose identity, or server, is gone, m.
LIFTED = 1.0
#: Name of this machine; others are not looked up, since that would wait for a network.
LOCAL = "localhost"
RULE = "The address must be HOST:PORT, such as 127.0.0.1:8766, with a numeric host (got {})."
OFFLINE = (
    "{} is another machine: allow online access in Preferences > System, "
    "or follow a server on this machine."
)


def parse_address(text: str, *, online: bool) -> tuple[str, int]:
    """Return host and port; raise DigiclayError for a wrong address, or another machine if not `online`."""
    host, _, port = text.strip().rpartition(":")
    host = "127.0.0.1" if host == LOCAL else host.removeprefix("[").removesuffix("]")
    try:
        ipaddress.ip_address(host)
        valid = port.isascii() and port.isdecimal() and len(port) < 6 and 0 < int(port) < 65536
    except ValueError:
        valid = False
    if not valid:
        raise DigiclayError(localize(RULE, repr(text[:60])))
    if not (is_loopback(host) or online):
        raise DigiclayError(localize(OFFLINE, host))
    return host, int(port)


def pack_subscription(token: str, rate: float) -> bytes:
    """Return the request for states, at a rate, 1/s, with the token of the server."""
    words = b"".join(_pad(word) for word in (SUBSCRIBE, ",ssf", token, "state"))
    return words + struct.pack(">f", rate)


def read_pose(data: bytes) -> Floats | None:
    """Return the pose (7,) in the datagram of a state; None where there is no usable one."""
    head = _pad(STATE) + _pad(",hh" + 9 * "d")
    if not data.startswith(head) or len(data) != len(head) + VALUES.size:
        return None
    return _check_pose(VALUES.unpack_from(data, len(head))[4:])


def read_fingers(data: bytes) -> dict[int, Floats] | None:
    """Return the poses (7,) of fingers by identity in a datagram; None where there are no usable ones."""
    count = data[len(_pad(FINGERS)) :].partition(b"\0")[0].count(b"d") // 8
    head = _pad(FINGERS) + _pad(",h" + count * "hdddddddd")
    if not data.startswith(head) or len(data) != len(head) + 8 + count * FINGER.size:
        return None
    poses = {
        identity: _check_pose(pose)
        for identity, _, *pose in FINGER.iter_unpack(data[len(head) + 8 :])
    }
    return {identity: pose for identity, pose in poses.items() if pose is not None}


def _check_pose(values: Sequence[float]) -> Floats | None:
    """Return a pose (7,); None for one that is none."""
    pose = np.array(values)
    length = float(np.linalg.norm(pose[3:])) if np.abs(pose).max() < 1e100 else 0.0
    # NaN fails the comparisons.
    return pose if abs(length - 1.0) < 1e-6 and np.isfinite(pose).all() else None


def _pad(word: str) -> bytes:
    """Return a string of OSC: ended by zeros, to a multiple of four bytes."""
    data = word.encode("ascii", "replace")
    return data + bytes(4 - len(data) % 4)


#: Poses a second asked for: some between two ticks.
RATE = 120.0
#: Time between two subscriptions, and that after which a server is silent, s: its end is reported
#: within 2 s.
RENEW, SILENT = 1.0, 1.5
#: Words about a server whose port is closed, and about one that sends nothing.
ENDED = "No server at {}: it has ended, or is not started yet"
UNHEARD = "No pose from {}: is the server running, and the token right?"
#: Most datagrams read in a tick: more than a server sends meanwhile.
MOST = 1000


@dataclass(frozen=True, eq=False)
class Following:
    """Server that a session follows, by the address that was entered."""

    address: str
    token: str
    #: Connected to the server and not blocking: what others send never arrives.
    door: socket.socket
    #: When the last subscription was sent, s.
    asked: float = -math.inf
    #: When the last pose was read, or else the first look, s; None before that.
    heard: float | None = None
    #: The newest one (7,); None before the first.
    pose: Floats | None = None
    #: The newest ones by identity, of a server with several fingertips; and the identity of each
    #: fingertip of the bed, () before.
    fingers: Mapping[int, Floats] = field(default_factory=dict)
    seats: tuple[int | None, ...] = ()
    #: Whether its silence has been reported.
    silent: bool = False


@dataclass(frozen=True)
class Servers:
    """Followed servers of this Blender by the uid of the session's bed; no file holds them."""

    by_bed: dict[int, Following] = field(default_factory=dict)


SERVERS = Servers()


def find(uid: int) -> Following | None:
    """Return the server that the session of a bed follows, or None."""
    return SERVERS.by_bed.get(uid)


def begin(uid: int, address: str, token: str, *, online: bool) -> None:
    """Follow a server in place of another; raise DigiclayError as `parse_address`, OSError without a way."""
    host, port = parse_address(address, online=online)
    door = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
    try:
        door.setblocking(False)
        door.connect((host, port))
    except OSError:
        door.close()
        raise
    end(uid)
    SERVERS.by_bed[uid] = Following(address, token, door)


def end(uid: int) -> None:
    """End the following of a session."""
    following = SERVERS.by_bed.pop(uid, None)
    if following is not None:
        following.door.close()


def follow(uid: int, now: float) -> tuple[Floats | None, str]:
    """Look for poses; return the newest (7,), None before the first, and a message. `now`: monotonic, s."""
    following = find(uid)
    if following is None:
        return None, ""
    if now - following.asked >= RENEW:
        with suppress(OSError):
            # The port is closed now, or the network is busy: it is repeated soon.
            following.door.send(pack_subscription(following.token, RATE))
        following = replace(following, asked=now)
    (pose, fingers, closed), words = _receive(following), ""
    heard = now if following.heard is None else following.heard
    if pose is not None:
        if following.silent:
            words = localize("The server at {} responds again", following.address)
        following = replace(following, pose=pose, fingers=fingers, heard=now, silent=False)
    elif not following.silent and (closed or now - heard >= SILENT):
        # Nobody presses on when the server is gone.
        gone = (
            None
            if following.pose is None
            else np.array([*following.pose[:2], LIFTED, *following.pose[3:]])
        )
        following = replace(following, pose=gone, fingers={}, silent=True)
        words = localize(ENDED if closed else UNHEARD, following.address)
    else:
        following = replace(following, heard=heard)
    SERVERS.by_bed[uid] = following
    return following.pose, words


def place(uid: int, poses: Floats) -> Floats:
    """Return the poses (f, 7) of a bed's fingertips with those of the server: one for each identity.

    An identity that appears gets that of one that is gone, whose place it may have taken, or else
    the first that has none; the fingertip of one that is gone is lifted.
    """
    following, placed = SERVERS.by_bed[uid], poses.copy()
    before = (*following.seats, *[None] * len(poses))[: len(poses)]
    seats = [identity if identity in following.fingers else None for identity in before]
    for name in following.fingers:
        free = [row for row, seat in enumerate(seats) if seat is None]
        if name not in seats and free:
            seats[min(free, key=lambda row: before[row] is None)] = name
    for row, (was, now) in enumerate(zip(before, seats, strict=True)):
        if now is not None:
            placed[row] = following.fingers[now]
        elif was is not None:
            placed[row, 2] = LIFTED
    if following.pose is not None and not following.fingers:
        placed[0] = following.pose
    if following.fingers or following.seats:
        SERVERS.by_bed[uid] = replace(following, seats=tuple(seats))
    return placed


def _receive(following: Following) -> tuple[Floats | None, Mapping[int, Floats], bool]:
    """Return the newest pose that has come, None for none; the newest fingers; whether the port is closed."""
    newest, fingers, closed = None, following.fingers, False
    for _ in range(MOST):
        try:
            data = following.door.recv(4096)
        except BlockingIOError:
            break
        except OSError as error:
            closed = closed or isinstance(error, ConnectionError)
            continue
        pose, named = read_pose(data), read_fingers(data)
        newest = newest if pose is None else pose
        fingers = fingers if named is None else named
    return newest, fingers, closed
