"""Messages of the server, version 1: JSON and binary, little-endian; docs/serve.md is their table.

A request is a pose of the fingertip, poses of several, or a reset. A frame is the state after a
period.
"""

import hmac
import json
import math
import os
import re
import secrets
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntFlag
from typing import Any

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.engine.system import System
from digiclay.core.files.tables import Record
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.touch import MOST_FORCE
from digiclay.core.scene.schema import Scene
from numpy.typing import NDArray

#: Environment variable with the token.
VARIABLE = "DIGICLAY_SERVE_TOKEN"
#: What stands in an address and in a header without quotes.
ALLOWED = re.compile(r"[A-Za-z0-9._~-]{8,128}")


def choose_token(given: str | None) -> tuple[str, bool]:
    """Return the token, and whether it was made just now: from the option, the environment, or at random.

    Raises OutputError when a given one is none.
    """
    token, source = (
        (given, "--token") if given is not None else (os.environ.get(VARIABLE), VARIABLE)
    )
    if token is None:
        return secrets.token_urlsafe(18), True
    if not ALLOWED.fullmatch(token):
        # The token itself is not shown: messages are kept in logs.
        rule = "must have 8 to 128 letters, digits or . _ ~ -"
        raise OutputError(f"{source} {rule} (got {len(token)} characters).")
    return token, False


def is_token(given: object, token: str) -> bool:
    """Return whether a client's token is the server's, in a time that does not depend on where it differs."""
    return isinstance(given, str) and hmac.compare_digest(
        given.encode("utf-8", "replace"), token.encode()
    )


VERSION = 1
MARK = b"DC"
STATE, POSE, RESET = 1, 2, 3
#: Mark, version, kind, and the pins of a frame or the number of a request.
HEAD = struct.Struct("<2sBBI")
#: Period, number of the last pose taken up, flags, time, total force, pose.
BODY = struct.Struct("<QII9d")
POSITION = struct.Struct("<7d")
#: Identity, force and pose of a finger in a frame.
FINGER = struct.Struct("<q8d")
#: Estimated errors at the end of a frame, that of a height and of a pin's force; NaN: not
#: estimated.
ERRORS = struct.Struct("<2d")
#: Most fingers of a session.
MOST_FINGERS = 32
#: No request is larger, bytes.
LARGEST_REQUEST = 8192
#: Shortest quaternion whose direction counts.
SHORTEST = 1e-6


@dataclass(frozen=True)
class Pose:
    """Request: where the fingertip is to be."""

    #: Lowest point, m, and unit quaternion w, x, y, z.
    pose: tuple[float, ...]
    #: The client's own, which the frames name once the pose has been taken up.
    number: int = 0


@dataclass(frozen=True)
class Poses:
    """Request: where fingertips with identities are to be; a wrong one does not hold up the others."""

    #: Identities and poses, as that of `Pose`.
    fingers: tuple[tuple[int, tuple[float, ...]], ...]
    #: Identities that are there; those without a pose stay.
    alive: tuple[int, ...]
    number: int = 0
    #: What was refused of it.
    fault: str = ""


@dataclass(frozen=True)
class Reset:
    """Request: the bed at rest."""


@dataclass(frozen=True)
class Status:
    """Request: counts of connections, refusals and frames."""


class Flag(IntFlag):
    """What a client has to know of a frame before it believes it."""

    #: The contact law does not hold: `core.model.touch`.
    BEYOND_A_FINGER = 1
    #: A finger's force was larger, and all are reduced by one factor: no finger has more than the
    #: ceiling.
    FORCE_LIMITED = 2
    #: The fingertip is on its way to the pose asked for, at its largest speed.
    POSE_LIMITED = 4
    #: No pose has come yet, or none for so long that its fingertip lifts.
    NO_POSE = 8
    #: Control periods were left out within the last second: the session was late.
    LEFT_OUT = 16


@dataclass(frozen=True)
class Limits:
    """Limits of what a session hands out to clients that may drive a motor; docs/serve.md has the sources."""

    #: Largest force of a finger, N: up to it fingerpads were measured. The paper's pins, 0.157 N
    #: each at the pressure of their reservoir, reach it with 13, more than lie under the contact of
    #: a fingertip.
    force: float = MOST_FORCE
    #: Largest speed of a point of the fingertip, m/s: that of a robot's tool with people beside it,
    #: by ISO 10218-1, and about three times that of fingers that explore a surface.
    speed: float = 0.25
    #: Time without a pose after which the fingertip lifts, s.
    silence: float = 2.0


LIMITS = Limits()


#: Most pins whose positions are sent: libraries refuse messages of a megabyte.
MOST_POSITIONS = 10_000


@dataclass(frozen=True)
class Bed:
    """Bed of the session, sent to a client once."""

    #: Of the scene.
    name: str
    rows: int
    columns: int
    #: m.
    pitch: float
    stroke: float
    #: Control period, s.
    period: float
    #: Of the pins, m; none of a bed of more than 10,000.
    positions: tuple[tuple[float, float], ...]
    #: Largest force of a finger handed out, N, and largest speed of the fingertip, m/s.
    most_force: float = LIMITS.force
    most_speed: float = LIMITS.speed
    #: Number of fingertips.
    fingers: int = 1


def describe_bed(scene: Scene, system: System, limits: Limits) -> Bed:
    """Return the description of the bed of a scene for clients."""
    layout, grid = scene.layout, system.grid
    listed = grid.positions if grid.count <= MOST_POSITIONS else grid.positions[:0]
    return Bed(
        scene.name,
        layout.rows,
        layout.columns,
        layout.pitch,
        system.cell.actuator.stroke,
        system.period,
        tuple((float(x), float(y)) for x, y in listed),
        limits.force,
        limits.speed,
        system.fingers,
    )


@dataclass(frozen=True, eq=False)
class Frame:
    """State after a control period."""

    #: Control periods since the start of the server or the last reset.
    period: int
    #: Of the last pose taken up; 0 before the first.
    number: int
    #: Simulated, s.
    time: float
    #: N.
    total_force: float
    #: (7,), the fingertip's.
    pose: Floats
    #: (n,), of the pins, m and N.
    heights: NDArray[np.float32]
    forces: NDArray[np.float32]
    #: Of `Flag`.
    flags: int = 0
    #: Identity, -1 for none, force, N, and pose (7,) of each of several fingertips.
    fingers: tuple[tuple[int, float, tuple[float, ...]], ...] = ()
    #: Estimated errors of the session so far: of a height, m, and of a pin's force, N; None: not
    #: yet.
    errors: tuple[float, float] | None = None


def check_pose(values: Sequence[object]) -> tuple[float, ...]:
    """Return a pose of 7 numbers, its quaternion of length 1, from 3 (level) or 7; refuse anything else."""
    if len(values) not in (3, 7):
        rule = "must be 3 numbers, the lowest point in m, or 7 with a quaternion w, x, y, z"
        raise ParameterError("pose", "", rule, f"{len(values)} values")
    numbers = []
    for value in values:
        try:
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise ValueError
            numbers.append(float(value))
        except (ValueError, OverflowError):
            raise ParameterError("pose", "", "must be numbers", repr(value)[:40]) from None
    position, turn = numbers[:3], numbers[3:] or list(LEVEL)
    length = math.hypot(*turn)
    if not all(map(math.isfinite, numbers)) or not math.isfinite(length):
        raise ParameterError("pose", "", "must be finite numbers, in m and 1", str(numbers)[:80])
    if length < SHORTEST:
        raise ParameterError("pose", "", "must have a quaternion of length 1", str(turn))
    return (*position, *(part / length for part in turn))


def check_fingers(
    given: Sequence[tuple[object, Sequence[object]]], alive: object, number: int
) -> Poses:
    """Return the request for fingers by identity, 3 or 7 numbers each, and those alive; none: those given.

    A finger that is wrong is left out, and told; it stays where it was. Raises ParameterError.
    """
    fingers: dict[int, tuple[float, ...]] = {}
    faults, seen = [], []
    for name, values in given:
        try:
            identity = check_number(name, field="identity")
            seen.append(identity)
            if seen.count(identity) > 1:
                fingers.pop(identity, None)
                raise ParameterError("pose", "", "must be the only one of its identity", "two")
            if values:
                fingers[identity] = check_pose(values)
        except ParameterError as error:
            faults.append(f"Finger {str(name)[:12]}: {error}")
    living = seen if alive is None else alive
    if not isinstance(living, list) or any(type(identity) is not int for identity in living):
        raise ParameterError("poses", "alive", "must be a list of identities", repr(alive)[:40])
    more = f" And {len(faults) - 1} more." if len(faults) > 1 else ""
    return Poses(
        tuple(fingers.items()), tuple(dict.fromkeys(living)), number, "".join(faults[:1]) + more
    )


def read_json(text: str) -> Pose | Poses | Reset | Status:
    """Read a request in JSON. Raises ParameterError when it is none."""
    try:
        message: Any = json.loads(text)
    except (ValueError, RecursionError):
        raise ParameterError("message", "", "must be JSON", repr(text[:40])) from None
    if not isinstance(message, dict):
        raise ParameterError(
            "message", "", 'must be an object, such as {"type": "reset"}', repr(text[:40])
        )
    _check_version(message.get("version", VERSION))
    kind = message.get("type")
    if not isinstance(kind, str) or kind not in KEYS:
        raise ParameterError(
            "message", "type", f"must be one of {', '.join(KEYS)}", repr(kind)[:40]
        )
    _check_keys(message, {"type", "version", *KEYS[kind]})
    if kind in ("reset", "status"):
        return Reset() if kind == "reset" else Status()
    number = check_number(message.get("number", 0))
    if kind == "pose":
        values = []
        for name, usual, count in (("position", None, 3), ("orientation", list(LEVEL), 4)):
            value = message.get(name, usual)
            if not isinstance(value, list) or len(value) != count:
                raise ParameterError("pose", name, f"must be {count} numbers", repr(value)[:40])
            values += value
        return Pose(check_pose(values), number)
    fingers = message.get("fingers")
    if not isinstance(fingers, list) or not all(isinstance(finger, dict) for finger in fingers):
        rule = 'must be a list such as [{"id": 1, "position": [0, 0, 0.05]}]'
        raise ParameterError("poses", "fingers", rule, repr(fingers)[:40])
    for finger in fingers:
        _check_keys(finger, {"id", "position", "orientation"})
    return check_fingers(
        [(finger.get("id"), _list_numbers(finger)) for finger in fingers],
        message.get("alive"),
        number,
    )


def _list_numbers(finger: Record) -> list[object]:
    """Return what a finger has for numbers of a pose, as it stands: `check_fingers` refuses it alone."""
    position, turn = finger.get("position", []), finger.get("orientation", [])
    whole = isinstance(position, list) and isinstance(turn, list) and len(position) in (0, 3)
    return [*position, *turn] if whole else [position]


#: Keys of requests beside type and version.
KEYS = {
    "pose": ("position", "orientation", "number"),
    "poses": ("fingers", "alive", "number"),
    "reset": (),
    "status": (),
}


def _check_keys(message: Record, allowed: set[str]) -> None:
    """Refuse unknown keys."""
    if unknown := sorted(set(message) - allowed):
        rule = f"must have no other keys than {', '.join(sorted(allowed))}"
        raise ParameterError("message", "", rule, repr(unknown[0])[:40])


def read_binary(data: bytes) -> Pose | Reset:
    """Read a request in binary. Raises ParameterError when it is none."""
    if len(data) < HEAD.size or data[:2] != MARK:
        raise ParameterError("message", "", f"must begin with {MARK.decode()}", repr(data[:8]))
    _, version, kind, number = HEAD.unpack_from(data)
    _check_version(version)
    if kind == RESET and len(data) == HEAD.size:
        return Reset()
    if kind != POSE or len(data) != HEAD.size + POSITION.size:
        rule = f"must be a pose, kind {POSE} of {HEAD.size + POSITION.size} bytes, or a reset, kind {RESET}"
        raise ParameterError("message", "", rule, f"kind {kind} of {len(data)} bytes")
    return Pose(check_pose(POSITION.unpack_from(data, HEAD.size)), number)


def pack_pose(request: Pose) -> bytes:
    """Write a pose in binary."""
    return HEAD.pack(MARK, VERSION, POSE, request.number) + POSITION.pack(*request.pose)


def pack_frame(frame: Frame) -> bytes:
    """Write a frame in binary."""
    head = (frame.period, frame.number, frame.flags, frame.time, frame.total_force)
    body = BODY.pack(*head, *frame.pose.tolist())
    pins = (np.asarray(values, "<f4").tobytes() for values in (frame.heights, frame.forces))
    fingers = (FINGER.pack(identity, force, *pose) for identity, force, pose in frame.fingers)
    errors = ERRORS.pack(*(frame.errors or (math.nan, math.nan)))
    return b"".join(
        [HEAD.pack(MARK, VERSION, STATE, len(frame.heights)), body, *pins, *fingers, errors]
    )


def unpack_frame(data: bytes) -> Frame:
    """Read a frame in binary, of an older server too. Raises ParameterError when it is none."""
    start = HEAD.size + BODY.size
    mark, version, kind, pins = HEAD.unpack_from(data) if len(data) >= start else (b"", 0, 0, 0)
    end = start + 8 * pins
    last = len(data) - (len(data) - end) % FINGER.size
    whole = len(data) >= end and len(data) - last in (0, ERRORS.size)
    if (mark, version, kind) != (MARK, VERSION, STATE) or not whole:
        rule = f"must be a state, kind {STATE} of version {VERSION}"
        raise ParameterError("frame", "", rule, f"kind {kind} of {len(data)} bytes")
    period, number, flags, time, force, *pose = BODY.unpack_from(data, HEAD.size)
    heights, forces = np.frombuffer(data, "<f4", 2 * pins, start).reshape(2, pins)
    fingers = tuple((each[0], each[1], each[2:]) for each in FINGER.iter_unpack(data[end:last]))
    height, each = ERRORS.unpack(data[last:]) if data[last:] else (math.nan, math.nan)
    errors = None if math.isnan(height) else (height, each)
    return Frame(
        period, number, time, force, np.array(pose), heights, forces, flags, fingers, errors
    )


def name_flags(flags: int) -> list[str]:
    """Return the names of the flags of a frame; those of newer servers have none."""
    return [flag.name.lower() for flag in Flag if flag & flags and flag.name]


def format_message(kind: str, **fields: Any) -> str:
    """Write a message of the server in JSON."""
    return json.dumps({"version": VERSION, "type": kind, **fields}, allow_nan=False)


def format_frame(frame: Frame) -> str:
    """Write a frame in JSON."""
    fingers = [
        {"id": identity, "force": force, "position": pose[:3], "orientation": pose[3:]}
        for identity, force, pose in frame.fingers
        if identity >= 0
    ]
    return format_message(
        "state",
        period=frame.period,
        number=frame.number,
        time=frame.time,
        total_force=frame.total_force,
        position=frame.pose[:3].tolist(),
        orientation=frame.pose[3:].tolist(),
        heights=frame.heights.tolist(),
        forces=frame.forces.tolist(),
        flags=name_flags(frame.flags),
        **({"fingers": fingers} if frame.fingers else {}),
        **dict(zip(("height_error", "force_error"), frame.errors or (None, None), strict=True)),
    )


def _check_version(version: object) -> None:
    """Refuse another version."""
    if type(version) is not int or version != VERSION:
        raise ParameterError("message", "version", f"must be {VERSION}", repr(version)[:40])


def check_number(number: object, bits: int = 32, field: str = "number") -> int:
    """Return the number of a request, below 2**bits; refuse anything else."""
    if type(number) is not int or not 0 <= number < 2**bits:
        raise ParameterError("pose", field, "must be a whole number of 32 bits", repr(number)[:40])
    return number
