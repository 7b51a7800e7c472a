"""A live session follows a server of poses: a socket that speaks its OSC, and `digiclay serve` itself."""

import importlib.util
import socket
import struct

import bpy
import numpy as np
import pytest
from digiclay.live import follow
from digiclay.live.follow import pack_subscription, parse_address, read_pose
from digiclay.roles import fingertip_of, fingertips_of
from digiclay.sessions import running

from tests.blender.at_hand import select
from tests.blender.session.live import FLOAT32, TICK, exact, started
from tests.timeouts import TIMEOUT

SERVES = pytest.mark.skipif(
    importlib.util.find_spec("websockets") is None, reason="digiclay[serve] is not installed"
)
TOKEN = "a-token-of-tests"
PRESS = (0.0, 0.0, 0.037, 1.0, 0.0, 0.0, 0.0)
#: What a place may be off that is read from Blender's floats and written again 200 times, m.
READ_AGAIN = 1e-4


@pytest.fixture
def server():
    """A socket of this machine that answers as a test has it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as door:
        door.bind(("127.0.0.1", 0))
        door.settimeout(TIMEOUT)
        yield door


def state(*pose):
    """Return a state as docs/serve.md describes it."""
    return b"/digiclay/state\0,hhddddddddd\0\0\0\0" + struct.pack(">qq9d", 1, 1, 0.5, 0.0, *pose)


def followed(bed, server, clock):
    """Start to follow; return the address of the session's socket."""
    started(bed)
    bpy.ops.digiclay.follow_server(address=f"127.0.0.1:{server.getsockname()[1]}", token=TOKEN)
    clock.tick()
    asked, address = server.recvfrom(2048)
    assert asked == pack_subscription(TOKEN, follow.RATE)
    return address


def arrived(server, address, *datagrams):
    """Send datagrams; on one machine they have arrived with the call."""
    for data in datagrams:
        server.sendto(data, address)


def pose_of(bed):
    """Return the pose of the session's fingertip."""
    session = running.find(bed)
    return list(session.pose)


def test_bed_and_fingertip_follow_the_poses(bed, clock, server):
    address = followed(bed, server, clock)
    for _ in range(10):
        arrived(server, address, state(0.0, 0.0, 0.045, 1.0, 0.0, 0.0, 0.0), state(*PRESS))
        assert clock.tick() == []
    assert pose_of(bed) == list(PRESS)
    # The empty is the ellipsoid's center, 8 mm above its lowest point.
    assert fingertip_of(bed).location.z == pytest.approx(0.45, abs=10 * FLOAT32)
    assert exact(bed).min() < 39.9e-3


def named(*fingers):
    """Return a frame of a server with several fingertips: identities, and heights at 10 mm times each."""
    values = [
        value for one, z in fingers for value in (one, 0.1, 0.01 * one, 0.0, z, 1.0, 0.0, 0.0, 0.0)
    ]
    tags = b",h" + len(fingers) * b"hdddddddd"
    head = b"/digiclay/fingers\0\0\0" + tags + bytes(4 - len(tags) % 4)
    return [
        state(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0),
        head + struct.pack(">q" + len(fingers) * "q8d", 1, *values),
    ]


def followed_by_two(bed, server, clock):
    """Return the address of a bed with two fingertips that follows a server."""
    select(bed)
    bpy.ops.digiclay.add_fingertip()
    select(bed)
    return followed(bed, server, clock)


def test_fingertips_follow_by_identity_and_lift_when_it_is_gone(bed, clock, server):
    address = followed_by_two(bed, server, clock)
    frames = [
        (named((2, 0.045)), [(20.0, 45.0), None]),
        (named((2, 0.044), (1, 0.05)), [(20.0, 44.0), (10.0, 50.0)]),
        # 7 finds none free.
        (
            named((1, 0.038), (2, 0.043), (7, 0.03)),
            [(20.0, 43.0), (10.0, 38.0)],
        ),
        (named((1, 0.039)), [(20.0, 1000.0), (10.0, 39.0)]),
        (named((7, 0.041), (1, 0.039)), [(70.0, 41.0), (10.0, 39.0)]),
        (named((7, float("nan")), (1, 0.04)), [(70.0, 1000.0), (10.0, 40.0)]),
        ([named((1, 0.02))[1][:-4], named((1, 0.041))[1] + b"\0"], [(70.0, 1000.0), (10.0, 40.0)]),
        (named((8, 0.042)), [(70.0, 1000.0), (80.0, 42.0)]),  # in the place of 1
        (named(), [(0.0, 1000.0), (80.0, 1000.0)]),
    ]
    for datagrams, places in frames:
        arrived(server, address, *datagrams)
        assert clock.tick() == []
        poses = running.find(bed).poses
        for pose, where in zip(poses, places, strict=True):
            if where is None:
                continue
            # As precise as the numbers of a matrix, some of which are large.
            np.testing.assert_allclose(pose[[0, 2]] * 1e3, where, 20 * FLOAT32, 1e3 * FLOAT32)


def test_a_server_of_one_finger_leaves_the_others_to_the_hand(bed, clock, server):
    address = followed_by_two(bed, server, clock)
    second = fingertips_of(bed)[2]
    second.rotation_mode, second.location.x = "XYZ", 0.1
    arrived(server, address, state(*PRESS))
    clock.tick(2)
    assert pose_of(bed) == list(PRESS)
    assert running.find(bed).poses[1, 0] == pytest.approx(0.01, abs=FLOAT32)
    assert second.rotation_mode == "XYZ"  # nothing has moved it


def test_a_server_of_one_finger_after_one_of_several_moves_the_first_and_the_others_lift(
    bed, clock, server
):
    address = followed_by_two(bed, server, clock)
    arrived(server, address, *named((1, 0.045), (2, 0.044)))
    clock.tick(200)
    np.testing.assert_allclose(running.find(bed).poses[:, 2], follow.LIFTED, 0, READ_AGAIN)
    arrived(server, address, state(*PRESS))
    clock.tick(2)
    assert pose_of(bed) == list(PRESS)
    assert running.find(bed).poses[1, 2] == pytest.approx(follow.LIFTED, abs=READ_AGAIN)


def test_garbage_and_poses_that_are_none_do_nothing(bed, clock, server):
    address = followed(bed, server, clock)
    arrived(server, address, state(*PRESS))
    clock.tick()
    nan, huge = float("nan"), 1e300
    wrong = [b"", b"x" * 2000, state(*PRESS)[:-1], state(*PRESS) + b"\0", b"/digiclay/state\0"]
    wrong += [
        state(nan, *PRESS[1:]),
        state(huge, *PRESS[1:]),
        state(*PRESS[:3], 0.0, 0.0, 0.0, 0.0),
    ]
    wrong += [state(*PRESS[:3], *[huge] * 4), state(*PRESS[:3], *[float("inf")] * 4)]
    arrived(server, address, *wrong)
    assert clock.tick(3) == []
    assert pose_of(bed) == list(PRESS)


def test_what_others_send_is_not_taken(bed, clock, server):
    address = followed(bed, server, clock)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.sendto(state(*PRESS), address)
        clock.tick(3)
    assert pose_of(bed) != list(PRESS)


def test_under_a_silent_server_the_fingertip_lifts_and_it_is_told_once_and_when_it_is_heard(
    bed, clock, server
):
    address = followed(bed, server, clock)
    arrived(server, address, state(*PRESS))
    clock.tick(3)
    notes = clock.tick(round(2.0 / TICK))
    assert ["No pose from" in note.message for note in notes] == [True]
    assert pose_of(bed)[:3] == [*PRESS[:2], follow.LIFTED]
    arrived(server, address, state(*PRESS))
    assert ["responds again" in note.message for note in clock.tick(2)] == [True]
    assert pose_of(bed) == list(PRESS)


@pytest.mark.parametrize("deleted", [False, True])
def test_the_subscription_is_renewed_and_ends(bed, clock, server, deleted):
    followed(bed, server, clock)
    uid = running.find(bed).uid
    clock.tick(40)
    assert server.recv(2048) == pack_subscription(TOKEN, follow.RATE)
    if deleted:
        bpy.data.objects.remove(bed)
        assert ["bed was deleted" in note.message for note in clock.tick()] == [True]
    else:
        bpy.ops.digiclay.session_stop()
    assert follow.find(uid) is None


def test_the_fingertip_is_the_hands_again_afterwards(bed, clock, server):
    address = followed(bed, server, clock)
    arrived(server, address, state(*PRESS))
    clock.tick(3)
    bpy.ops.digiclay.leave_server()
    fingertip_of(bed).location.z = 0.6
    clock.tick(3)
    assert pose_of(bed)[2] == pytest.approx(0.052, abs=FLOAT32)


def test_a_wrong_address_is_refused_in_one_line(bed):
    started(bed)
    for address in ("", "127.0.0.1", "example.org:80", "127.0.0.1:0", "127.0.0.1:99999", ":80"):
        with pytest.raises(RuntimeError, match="must be HOST:PORT"):
            bpy.ops.digiclay.follow_server(address=address, token=TOKEN)


def test_another_machine_needs_online_access():
    from digiclay.core.base.errors import DigiclayError

    with pytest.raises(DigiclayError, match="allow online access"):
        parse_address("192.0.2.1:8766", online=False)
    assert parse_address("192.0.2.1:8766", online=True) == ("192.0.2.1", 8766)
    assert parse_address("localhost:1", online=False) == ("127.0.0.1", 1)
    assert parse_address("[::1]:1", online=False) == ("::1", 1)


@SERVES
def test_the_session_follows_digiclay_serve(bed, clock, tmp_path):
    from digiclay_serve.protocol import Pose, pack_pose
    from tests.served import serve

    started(bed)
    with serve(tmp_path) as one, one.connect("?rate=0") as client:
        bpy.ops.digiclay.follow_server(address=f"127.0.0.1:{one.osc_port}", token=TOKEN)
        while not np.allclose(pose_of(bed), PRESS, rtol=0, atol=1e-12):
            client.send(pack_pose(Pose(PRESS)))
            clock.tick()
    assert read_pose(state(*PRESS)).tolist() == list(PRESS)


def test_a_servers_end_is_told_in_two_seconds_and_nothing_stalls(bed, clock, server):
    address = followed(bed, server, clock)
    arrived(server, address, state(*PRESS))
    clock.tick()
    server.close()
    notes, ended, period = [], clock.now, running.find(bed).state.period
    while not notes:
        notes = clock.tick()
    assert ["has ended" in note.message for note in notes] == [True]
    assert clock.now - ended < 2.0
    assert running.find(bed).state.period > period
