"""Fingers with identities: requests; lines of a Quest and of touch pads."""

import asyncio
import json
import math

import numpy as np
import pytest
from digiclay.core.base.errors import OutputError, ParameterError
from numpy.testing import assert_allclose
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder

from digiclay_serve.door_link import DoorLink, FrequentError
from digiclay_serve.doors import LAYOUT, Order, make_slot, pack_order, unpack_order
from digiclay_serve.hands_command import read_packets
from digiclay_serve.hts import Hands
from digiclay_serve.osc_door import read_osc, read_request
from digiclay_serve.protocol import Bed, Poses, check_fingers, read_json
from digiclay_serve.tuio import Pad
from tests.assemble import assert_near, refused_in_a_line, table

LEVEL = (1.0, 0.0, 0.0, 0.0)
PLACE = (0.01, -0.02, 0.05)


# Requests


def osc(address, *values):
    """Return a message of OSC as other programs send it."""
    builder = OscMessageBuilder(address)
    for value in values:
        builder.add_arg(value, "d" if isinstance(value, float) else None)
    return bytes(builder.build().dgram)


def test_poses_are_the_same_in_all_formats():
    wanted = Poses(((7, (*PLACE, *LEVEL)), (3, (0.0, 0.0, 0.04, 0.0, 0.0, 0.0, 1.0))), (7, 3), 9)
    fingers = [
        {"id": 7, "position": list(PLACE)},
        {"id": 3, "position": [0, 0, 0.04], "orientation": [0, 0, 0, 2]},
    ]
    assert read_json(json.dumps({"type": "poses", "number": 9, "fingers": fingers})) == wanted
    sent = osc("/digiclay/poses", "token", 9, 7, *PLACE, 3, 0.0, 0.0, 0.04, 0.0, 0.0, 0.0, 2.0)
    assert read_request(*read_osc(sent)[1:]) == wanted
    # An identity that is alive without a pose stays where it was.
    said = json.dumps({"type": "poses", "fingers": fingers[:1], "alive": [7, 3]})
    assert read_json(said) == Poses(wanted.fingers[:1], (7, 3))
    assert read_request(*read_osc(osc("/digiclay/poses", "token", 9, 3))[1:]) == Poses((), (3,), 9)


BAD = {
    "NaN in one": ([(2, [0.0, 0.0, math.nan])], "Finger 2: pose must be finite numbers"),
    "two numbers": ([(2, [0.0, 0.0])], "Finger 2: pose must be 3 numbers"),
    "text": ([(2, ["a", 0.0, 0.0])], "Finger 2: pose must be numbers"),
    "a turn of length 0": ([(2, [0.0] * 7)], "Finger 2: pose must have a quaternion of length 1"),
    "two with one identity": (
        [(2, [*PLACE]), (2, [*PLACE])],
        "Finger 2: pose must be the only one",
    ),
    "no identity": ([(None, [*PLACE])], "Finger None: pose.identity must be a whole number"),
    "a negative identity": ([(-1, [*PLACE])], "Finger -1: pose.identity must be a whole number"),
    "two are wrong": ([(2, [math.inf] * 3), (-1, [*PLACE])], "And 1 more."),
}


@table("wrong, message", BAD)
def test_a_wrong_finger_is_told_and_the_others_go_on(wrong, message):
    read = check_fingers([(1, [*PLACE]), *wrong, (3, [*PLACE])], None, 5)
    assert [identity for identity, _ in read.fingers] == [1, 3]
    assert message in read.fault
    assert "\n" not in read.fault
    assert 2 not in [name for name, _ in wrong] or 2 in read.alive  # it stays where it was


@pytest.mark.parametrize(
    "said, message",
    [
        ({}, "fingers must be a list"),
        ({"fingers": 3}, "fingers must be a list"),
        ({"fingers": [3]}, "fingers must be a list"),
        ({"fingers": [{"id": 3, "pos": [0, 0, 0]}]}, "no other keys"),
        ({"fingers": [], "alive": 7}, "alive must be a list"),
        ({"fingers": [], "alive": ["a"]}, "alive must be a list"),
        ({"fingers": [], "position": [0, 0, 0]}, "no other keys"),
    ],
)
def test_a_message_that_is_none_is_refused_in_one_line(said, message):
    with refused_in_a_line(ParameterError, message):
        read_json(json.dumps({"type": "poses", **said}))


@pytest.mark.parametrize(
    "address, values, message",
    [
        ("pose", [0.0, 0.0], "pose must be 3 numbers"),
        ("pose", ["x", 0.0, 0.0], "pose must be numbers"),
        ("subscribe", ["state"], "subscription must be state or pins"),
        ("subscribe", ["all", 10.0], "subscription must be state or pins"),
        ("subscribe", ["state", "fast"], "subscription must be state or pins"),
        ("reset", [1], "address must be /digiclay/pose"),
    ],
)
def test_a_message_by_osc_that_is_none_is_refused_in_one_line(address, values, message):
    with refused_in_a_line(ParameterError, message):
        read_request(f"/digiclay/{address}", values)


def poses(*identities, alive=(), **given):
    """Return a request with fingers 10 mm apart."""
    fingers = tuple((one, (0.01 * one, 0.0, 0.05, *LEVEL)) for one in identities)
    return Poses(fingers, alive or identities, **given)


@pytest.mark.parametrize("fingers, identities", [(2, (5, 4, 3)), (32, tuple(range(33)))])
def test_the_first_that_appear_have_the_fingertips_and_33_are_told(fingers, identities):
    orders, path = make_slot(LAYOUT.size)
    path.unlink()
    link = DoorLink(Bed("", 1, 1, 1.0, 1.0, 1.0, (), fingers=fingers), orders, orders, "")

    async def order():
        link.order(poses(*identities), "me")

    with pytest.raises(FrequentError, match=f"at most {fingers}.*got 1 more"):
        asyncio.run(order())
    seen = unpack_order(orders.read() or b"")
    assert tuple(identity for identity, _ in seen.fingers) == identities[:fingers]


def test_an_order_keeps_what_is_alive_and_its_bytes_are_read_as_they_were_written():
    order, _ = Order().name(poses(1, 2), 2)
    order, more = order.name(poses(3, alive=(2, 3), number=2**32 - 1), 2)
    assert ([one for one, _ in order.fingers], more, order.named) == ([2, 3], 0, 2)
    assert unpack_order(pack_order(order)) == order
    order, _ = order.name(Poses((), ()), 2)
    assert order.fingers == ()


# Lines of a Quest

WRIST = "0.2502, 1.0635, 0.2540, 0.194, -0.116, 0.094, -0.970"
JOINTS = np.linspace(-0.05, 0.13, 63).round(4).reshape(21, 3)
JOINTS[[4, 8, 12, 16, 20], 0] = [-0.033, -0.012, 0.010, 0.028, 0.048]


def lines(side="Right", wrist=WRIST, joints=JOINTS, meta=""):
    """Return a packet as Hand Tracking Streamer writes it."""
    numbers = ", ".join(f"{value:.4f}" for value in np.ravel(joints))
    return f"{side} wrist{meta}:, {wrist}\n{side} landmarks{meta}:, {numbers}".encode()


def take(*packets):
    """Return the hands that packets show at 1 s."""
    hands = Hands(0.04)
    for packet in packets:
        hands = hands.take(packet, 1.0)
    return hands


def tips(*packets):
    """Return the fingertips that packets show."""
    return np.array(list(take(*packets).fingers(1.0).values()))


def middle(hands, time):
    """Return the mean x of the fingertips, m."""
    return np.mean([tip[0] for tip in hands.fingers(time).values()])


def test_fingertips_of_a_quest_are_in_axes_of_the_bed_whatever_the_place_in_the_room():
    found = tips(lines())
    assert_allclose(found[:, :2].mean(0), 0.0, atol=1e-12)
    assert found[:, 2].min() == pytest.approx(0.06)
    assert_allclose(tips(lines(wrist="1.2502, 0.0635, -0.746" + WRIST[22:])), found, atol=1e-12)
    # A hand that is not turned: Unity's x, z, y are the bed's x, y, z.
    plain = tips(lines(wrist="0, 0, 0, 0, 0, 0, 1"))
    assert_allclose(
        np.diff(plain, axis=0), np.diff(JOINTS[[4, 8, 12, 16, 20]], axis=0)[:, [0, 2, 1]]
    )
    # Turned by 90 degrees about Unity's y, clockwise from above, its fingers point to the right.
    turned = tips(lines(wrist="0, 0, 0, 0, 0.7071, 0, 0.7071"))
    assert_allclose(turned[:, :2], plain[:, [1, 0]] * [1.0, -1.0], atol=1e-4)
    assert list(take(lines(meta=" | f = 12 | t = 123456")).fingers(1.0)) == [5, 6, 7, 8, 9]


def test_the_left_hand_is_the_mirrored_right_one():
    x, y, z, a, b, c, w = (float(word) for word in WRIST.split(","))
    mirrored = lines(
        "Left", ", ".join(map(str, (-x, y, z, a, -b, -c, w))), JOINTS * [-1.0, 1.0, 1.0]
    )
    assert_allclose(tips(mirrored), tips(lines()) * [-1.0, 1.0, 1.0], atol=1e-12)
    assert list(take(mirrored, lines()).fingers(1.0)) == list(range(10))


def test_a_hand_is_gone_after_50_ms_and_after_a_second_begins_over_the_middle_again():
    hands = take(lines())
    assert len(hands.fingers(1.04)) == 5
    assert hands.fingers(1.06) == {}
    aside = "0.3502" + WRIST[6:]
    soon, late = (middle(hands.take(lines(wrist=aside), time), time) for time in (1.9, 2.1))
    assert (soon, late) == pytest.approx((0.1, 0.0), abs=1e-12)


@pytest.mark.parametrize("pause, seen", [(0.0, 5), (0.9, 5), (1.1, 0), (60.0, 0), (1e5, 0)])
def test_joints_are_put_on_a_wrist_of_a_second_ago_but_of_none_from_before_a_pause(pause, seen):
    hands = take(lines()).take(lines().split(b"\n")[1], 1.0 + pause)
    assert len(hands.fingers(1.0 + pause)) == seen
    # The next wrist places the hand over the middle.
    hands = hands.take(lines(wrist="0.3502" + WRIST[6:]), 1.03 + pause)
    assert middle(hands, 1.03 + pause) == pytest.approx(0.1 if seen else 0.0, abs=1e-12)


@pytest.mark.parametrize(
    "packet, message",
    [
        (b"Right wrist:, 0,2502, 1,0635, 0,2540, 0,194, -0,116, 0,094, -0,970", "decimal points"),
        (b"Right wrist:, nan, 1, 1, 0, 0, 0, 1", "must be 7 numbers"),
        (b"Right wrist:, 1e300, 1, 1, 0, 0, 0, 1", "must be 7 numbers"),
        (b"Right wrist:", "must be 7 numbers"),
        (b"Right wrist:, a, b, c, d, e, f, g", "must be 7 numbers"),
        (lines()[:-8], "must be 63 numbers"),
        (b"Left landmarks:, 1, 2, 3", "must be 63 numbers"),
    ],
)
def test_a_hostile_line_is_refused_in_one_line(packet, message):
    with refused_in_a_line(ParameterError, message):
        take(packet)


def test_other_lines_are_passed_over_and_a_hand_that_is_not_turned_at_all_does_no_harm():
    joints = lines().split(b"\n")[1]
    others = b"", b"\xff\xfe", b"Head pose:, 1, 2", b":::", joints, b"\n\n", b"wrist right:, 1"
    assert take(*others).fingers(1.0) == {}
    assert np.isfinite(tips(lines(wrist="0, 0, 0, 0, 0, 0, 0"))).all()


# Touch pads


def bundle(*messages):
    """Return messages as one datagram."""
    from pythonosc.osc_message import OscMessage

    builder = OscBundleBuilder(IMMEDIATELY)
    for message in messages:
        builder.add_content(OscMessage(message))
    return bytes(builder.build().dgram)


def touch(*fingers):
    """Return a frame of TUIO 1.1."""
    alive = osc("/tuio/2Dcur", "alive", *(one for one, *_ in fingers))
    sets = [osc("/tuio/2Dcur", "set", one, x, y, 0.0, 0.0, 0.0) for one, x, y in fingers]
    return bundle(alive, *sets, osc("/tuio/2Dcur", "fseq", 7))


def point(*fingers):
    """Return a frame of TUIO 2.0 with pressure."""
    pointers = [
        osc("/tuio2/ptr", one, 1, 0, x, y, 0.0, 0.0, 0.01, pressure)
        for one, x, y, pressure in fingers
    ]
    ends = osc("/tuio2/alv", *(one for one, *_ in fingers))
    return bundle(osc("/tuio2/frm", 1, 0, 0, "me"), *pointers, ends)


PAD = Pad(0.04, 0.08, 0.01)


def test_a_pads_corners_are_the_beds_and_pressure_is_depth():
    old = PAD.take(touch((4, 0.0, 0.0), (5, 1.0, 0.25)), 1.0).fingers(1.0)
    assert list(old) == [4, 5]
    assert_near([*old.values()], [[-0.04, 0.04, 0.035], [0.04, 0.02, 0.035]], 1e-9)
    new = PAD.take(point((4, 0.5, 1.0, 1.0), (5, 0.0, 0.0, 0.25), (6, 0.0, 0.0, 0.0)), 1.0).fingers(
        1.0
    )
    assert list(new) == [4, 5, 6]
    # The last one only just touches.
    assert_near(
        [*new.values()], [[0.0, -0.04, 0.03], [-0.04, 0.04, 0.0375], [-0.04, 0.04, 0.04]], 1e-9
    )
    light = PAD.take(point((6, 0.0, 0.0, 0.0)), 1.0)
    assert light.fingers(1.0)[6][2] == pytest.approx(0.035)  # a pad without pressure: half
    light = light.take(point((6, 0.0, 0.0, 0.5)), 1.1).take(point((6, 0.0, 0.0, 0.0)), 1.2)
    assert light.fingers(1.2)[6][2] == pytest.approx(0.04)
    beyond = PAD.take(touch((-1, 7.0, -7.0)), 1.0).fingers(1.0)
    assert beyond[2**32 - 1].tolist() == [0.04, 0.04, 0.035]  # it stays on the bed


def test_a_contact_that_rests_stays_and_ends_with_the_list_of_those_alive():
    pad = PAD.take(touch((4, 0.5, 0.5), (5, 0.6, 0.5)), 1.0)
    pad = pad.take(bundle(osc("/tuio/2Dcur", "alive", 5)), 1.5)
    assert list(pad.fingers(1.6)) == [5]
    assert pad.fingers(2.71) == {}
    assert PAD.take(point((4, 0.5, 0.5, 0.5)), 1.0).take(point(), 1.1).fingers(1.1) == {}


@pytest.mark.parametrize(
    "data",
    [
        b"", b"\xff" * 50, touch((4, 0.5, 0.5))[:-3], touch((4, math.nan, 0.5)), osc("/tuio2/alv", "a"),
        point((4, 0.5, 0.5, math.inf)), osc("/tuio/2Dcur", "set", 4), osc("/tuio2/ptr", 4, 1, 0, 0.5),
        osc("/tuio/2Dcur", "set", "a", 0.1, 0.1), osc("/tuio/2Dcur", "set", 4, "x", "y"),
        bundle(*[osc("/tuio/2Dcur", "set", one, 0.5, 0.5) for one in range(300)]),
    ],
)  # fmt: skip
def test_a_datagram_that_is_none_is_refused_and_changes_nothing(data):
    with pytest.raises(ParameterError, match=r"must be TUIO"):
        PAD.take(data, 1.0)


@pytest.mark.parametrize(
    "words, message",
    [
        ("--token short", "--token must have 8 to 128"),
        ("", "needs the token of the server"),
        ("--from quest --token=a-token-of-tests", "invalid choice"),
        ("--to http://x:1 --token=a-token-of-tests --play empty", "--to must be ws://HOST:PORT"),
        ("--to ws://x:1:2 --token=a-token-of-tests --play empty", "--to must be ws://HOST:PORT"),
        (
            "--to ws://127.0.0.1:1 --token=a-token-of-tests --play empty",
            "No server at ws://127.0.0.1:1",
        ),
        ("--size 0 --token=a-token-of-tests", "--size must be above 0 and at most 1000 mm (got 0)"),
        ("--depth=-3 --token=a-token-of-tests", "--depth must be above 0"),
        ("--play missing --token=a-token-of-tests", "must be a recording"),
        ("--play bad --token=a-token-of-tests", "must be a recording"),
        (
            "--record bad --to osc://127.0.0.1:1 --port 9123 --token=a-token-of-tests",
            "File exists: bad",
        ),
        ("--record new --to ws://127.0.0.1:1/ --token=a-token-of-tests", "has ended"),
    ],
)
def test_a_wrong_option_of_hands_is_refused_in_one_line(words, message, here, refused, monkeypatch):
    monkeypatch.delenv("DIGICLAY_SERVE_TOKEN", raising=False)
    for name, text in (("empty", ""), ("bad", "[1]\n")):
        (here / name).write_text(text, encoding="utf-8")
    refused(["hands", *words.split()], message)
    assert not (here / "new").exists()


GOES_BACK = "line 3: a time must be finite and not before that of the line above"


@pytest.mark.parametrize(
    "times, said",
    [
        (["1", "2", "3"], ""),
        (["1", "1", "1"], ""),
        (["-5", "-4", "0"], ""),
        (["1", "2", "1.9"], GOES_BACK),
        (["1", "2", "NaN"], GOES_BACK),
        (["1", "2", "1e999"], GOES_BACK),
        (["1", "2", "9" * 400], "line 3: "),
        (["1", "2", '"a"'], "line 3: "),
        (["1", "2", "null"], "line 3: "),
        (["1", "2", "[" * 9000], "line 3: "),
    ],
)
def test_a_recording_has_every_packet_in_the_order_of_its_times_or_is_refused_with_the_line(
    times, said, tmp_path
):
    path = tmp_path / "hands.txt"
    path.write_text("".join(f'[{at}, "{row}"]\n' for row, at in enumerate(times)), encoding="utf-8")
    if not said:
        packets = [(float(at), str(row).encode()) for row, at in enumerate(times)]
        assert list(read_packets(path)) == packets
        return
    with refused_in_a_line(OutputError, said) as caught:
        read_packets(path)
    assert len(str(caught.value).replace(str(path), "")) <= 400
