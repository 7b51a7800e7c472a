"""Messages of the server are read as they were written, and anything else is refused in one line."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.errors import DigiclayError
from hypothesis import given, settings
from hypothesis import strategies as st
from pythonosc.osc_message import OscMessage

from digiclay_serve import protocol
from digiclay_serve.osc_door import format_osc_frame, read_osc, read_request
from digiclay_serve.websocket_door import read_wishes
from tests.served import load_example

numbers = st.floats(allow_nan=False, allow_infinity=False)
poses = st.lists(numbers, min_size=7, max_size=7).filter(
    lambda one: 1e-6 < math.hypot(*one[3:]) < math.inf
)
whole = st.integers(0, 2**32 - 1)
heights = st.lists(st.floats(0.0, 0.09375, width=32), min_size=1, max_size=30)


def frame_of(pose, values, flags, who):
    pins, fingers = np.array(values, np.float32), tuple((one, 0.25, tuple(pose)) for one in who)
    return protocol.Frame(
        2**40, 2**32 - 1, 12.5, 0.75, np.array(pose), pins, 2 * pins, flags, fingers
    )


def refusal(read, data):
    try:
        read(data)
    except DigiclayError as error:
        return str(error)
    return ""


@given(poses, whole)
def test_a_pose_is_read_as_it_was_written_in_both_formats(values, number):
    wanted = protocol.Pose(protocol.check_pose(values), number)
    said = {"type": "pose", "position": values[:3], "orientation": values[3:], "number": number}
    assert protocol.read_json(json.dumps(said)) == wanted
    assert protocol.read_binary(protocol.pack_pose(protocol.Pose(tuple(values), number))) == wanted
    assert math.hypot(*wanted.pose[3:]) == pytest.approx(1.0)


who = st.lists(whole | st.just(-1), max_size=32)


@given(
    st.builds(frame_of, poses, heights, st.integers(0, 2**31 - 1), who),
    st.none() | st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1e300)),
)
def test_a_frame_is_read_as_it_was_written_in_all_formats(frame, errors):
    packed = protocol.pack_frame(frame)
    # Of a server that knew no errors.
    older = protocol.unpack_frame(packed[: -protocol.ERRORS.size])
    assert (older.errors, older.fingers, older.time) == (None, frame.fingers, frame.time)
    frame = replace(frame, errors=errors)
    read = protocol.unpack_frame(protocol.pack_frame(frame))
    assert read.errors == errors
    said = json.loads(protocol.format_frame(frame))
    datagrams = [OscMessage(one) for one in format_osc_frame(frame, "pins")]
    told = {one.address.removeprefix("/digiclay/"): one.params for one in datagrams}
    assert (
        next(iter(told.items()))
        == ("flags", [2**40, frame.flags])
        == ("flags", [2**40, read.flags])
    )
    assert (said["height_error"], said["force_error"]) == (errors or (None, None))
    assert told.get("errors", [2**40])[1:] == list(errors or ())
    there = [finger for finger in frame.fingers if finger[0] >= 0]  # -1: nobody has it
    assert read.fingers == frame.fingers
    assert told.get("fingers", [2**40])[1:] == [
        value for one, *rest in there for value in (one, rest[0], *rest[1])
    ]
    named = [
        (one["id"], one["force"], (*one["position"], *one["orientation"]))
        for one in said.get("fingers", [])
    ]
    assert named == there
    assert said["flags"] == [flag.name.lower() for flag in protocol.Flag if frame.flags & flag]
    state = told["state"]
    scalars = [said[name] for name in ("period", "number", "time", "total_force")]
    plain = (*scalars, *said["position"], *said["orientation"])
    for found in (
        (read.period, read.number, read.time, read.total_force, *read.pose),
        plain,
        tuple(state),
    ):
        assert found == (2**40, 2**32 - 1, 12.5, 0.75, *frame.pose)
    np.testing.assert_array_equal(read.heights, frame.heights)
    np.testing.assert_array_equal(read.forces, frame.forces)
    np.testing.assert_array_equal(np.array(said["heights"], np.float32), frame.heights)
    np.testing.assert_array_equal(np.frombuffer(told["forces"][1], ">f4"), frame.forces)


leaves = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
anything = leaves | st.lists(leaves | st.lists(leaves, max_size=2), max_size=8)
keys = st.sampled_from(["type", "version", "position", "orientation", "number", "x"])


@settings(max_examples=50)
@given(
    st.one_of(st.binary(max_size=100), st.binary(max_size=80).map(lambda end: b"DC\1\2" + end)),
    st.one_of(
        st.text(max_size=30), st.dictionaries(keys, anything | st.just("pose")).map(json.dumps)
    ),
)
def test_any_bytes_text_or_address_is_a_request_or_refused_in_one_line(data, text):
    readers = (
        protocol.read_binary,
        protocol.unpack_frame,
        lambda data: read_request(*read_osc(data)[1:]),
    )
    said = [refusal(read, data) for read in readers]
    said += [refusal(protocol.read_json, text)]
    said += [refusal(check_rate, address) for address in (text, f"/?{text}", f"/?rate={text}")]
    assert not any("\n" in one for one in said)


def check_rate(address):
    assert 0.0 <= read_wishes(address).rate <= 1000.0


@pytest.mark.skipif("sys.platform == 'win32'", reason="the example is for Linux and macOS")
@given(st.integers(0, 65535), heights, st.binary(max_size=20), st.data())
def test_heights_survive_the_line_of_a_display_to_within_half_a_count_or_are_refused(
    sequence, values, noise, data
):
    display = load_example("pin_display")
    sent = display.pack_heights(sequence, 9, 0.1, np.array(values))
    assert sent.count(b"\xc0") == 1
    bodies, rest = display.split(noise.replace(b"\xc0", b"") + b"\xc0" + sent + sent[:5])
    assert rest == sent[:5]
    start = display.HEAD.size + display.BODY.size
    assert display.HEAD.unpack_from(bodies[-1]) == (1, 1, sequence)
    assert display.BODY.unpack_from(bodies[-1], display.HEAD.size)[::2] == (9, len(values))
    # Half a count of the stroke, and what 32 bits round.
    read = np.frombuffer(bodies[-1], "<u2", offset=start) / 65535 * 0.1
    np.testing.assert_allclose(read, values, rtol=0, atol=0.1 / 65535 / 2 + 1e-8)
    damaged = bytearray(sent)
    damaged[data.draw(st.integers(0, len(sent) - 2))] ^= data.draw(st.integers(1, 255))
    assert not any(display.split(bytes(damaged))[0])
