"""OSC messages of the server; docs/serve.md is their table.

Each request has the token as its first argument.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from digiclay.core.base.errors import ParameterError
from pythonosc import osc_bundle, osc_message
from pythonosc.osc_message_builder import OscMessageBuilder

from .protocol import Frame, Pose, Reset, check_pose

#: What can be subscribed to: the pose and the total force, or every pin's height and force besides.
PARTS = ("state", "pins")
#: Most pins whose heights fit into a datagram.
MOST_PINS = 16_000


@dataclass(frozen=True)
class Subscription:
    """Request: frames to the sender's address.

    Attributes
    ----------
    part : {"state", "pins"}
    rate : float
        Frames a second at most.
    """

    part: str
    rate: float


def read_osc(data: bytes) -> tuple[object, Pose | Reset | Subscription | ParameterError]:
    """Read a datagram; return the token in it, and the request or what is wrong with it.

    The request of a client without the token is never looked at, so it is checked after that.

    Raises ParameterError when it is no OSC message with a token.
    """
    rule = "must be an OSC message with the token as its first argument"
    try:
        if osc_bundle.OscBundle.dgram_is_bundle(data):
            raise ParameterError("datagram", "", rule, "a bundle")
        message = osc_message.OscMessage(data)
        address, parameters = message.address, message.params
    except ParameterError:
        raise
    except Exception:  # python-osc raises errors of many kinds over bytes that are no OSC
        raise ParameterError("datagram", "", rule, repr(data[:16])) from None
    if not parameters:
        raise ParameterError("datagram", "", rule, "no argument")
    token, *rest = parameters
    try:
        return token, _read_request(address, rest)
    except ParameterError as error:
        return token, error


def _read_request(address: str, rest: list[object]) -> Pose | Reset | Subscription:
    """Read what follows the token."""
    if address == "/digiclay/pose":
        number = rest.pop() if len(rest) in (4, 8) else 0
        if type(number) is not int or not 0 <= number < 2**31:
            raise ParameterError("pose", "number", "must be a whole number of 32 bits", repr(number)[:40])
        return Pose(check_pose(rest), number)
    if address == "/digiclay/reset" and not rest:
        return Reset()
    if address == "/digiclay/subscribe":
        part, rate = rest if len(rest) == 2 else (None, None)
        if part not in PARTS or not isinstance(rate, int | float) or not 0.0 < rate <= 1000.0:
            rule = "must be state or pins, and a rate of at most 1000 Hz"
            raise ParameterError("subscription", "", rule, repr(rest)[:60])
        return Subscription(str(part), float(rate))
    rule = "must be /digiclay/pose, /digiclay/reset or /digiclay/subscribe"
    raise ParameterError("address", "", rule, repr(address)[:40])


def format_osc_frame(frame: Frame, part: str) -> list[bytes]:
    """Write the datagrams of a frame, of a part of `PARTS`: its flags come first."""
    flags = OscMessageBuilder("/digiclay/flags")
    flags.add_arg(frame.period, OscMessageBuilder.ARG_TYPE_INT64)
    flags.add_arg(frame.flags, OscMessageBuilder.ARG_TYPE_INT)
    state = OscMessageBuilder("/digiclay/state")
    state.add_arg(frame.period, OscMessageBuilder.ARG_TYPE_INT64)
    state.add_arg(frame.number, OscMessageBuilder.ARG_TYPE_INT64)
    for value in (frame.time, frame.total_force, *frame.pose.tolist()):
        state.add_arg(value, OscMessageBuilder.ARG_TYPE_DOUBLE)
    made = [flags.build().dgram, state.build().dgram]
    if part == "pins" and len(frame.heights) <= MOST_PINS:
        for name, values in (("heights", frame.heights), ("forces", frame.forces)):
            builder = OscMessageBuilder(f"/digiclay/{name}")
            builder.add_arg(frame.period, OscMessageBuilder.ARG_TYPE_INT64)
            # OSC is big-endian.
            builder.add_arg(np.asarray(values, ">f4").tobytes(), OscMessageBuilder.ARG_TYPE_BLOB)
            made.append(builder.build().dgram)
    return made


def format_osc_error(message: str) -> bytes:
    """Write an error as a datagram."""
    builder = OscMessageBuilder("/digiclay/error")
    builder.add_arg(message.encode("ascii", "replace").decode(), OscMessageBuilder.ARG_TYPE_STRING)
    made: bytes = builder.build().dgram
    return made
