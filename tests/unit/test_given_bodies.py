"""Bodies that are given: undersides are lines between times, kept in takes to the bit and in little space."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import OutputError
from digiclay.core.engine.bodies import UNIT, GivenUndersides, PlacedMesh, find_given
from digiclay.core.engine.simulation import begin
from digiclay.core.files.tables import parse_tables
from digiclay.core.model.fingertip import LEVEL, find_quaternions
from digiclay.core.model.underside import Mesh
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Presser
from digiclay.core.scene.toml_table import format_scene, resolve
from digiclay.core.session import accuracy, given_bodies, snapshot
from digiclay.core.session.live_session import LiveSession, follow_path, start_recording
from digiclay.core.session.run_scene import run
from digiclay.core.session.take import (
    Take,
    from_bytes,
    make_take,
    play,
    refine,
    replay,
    to_bytes,
    to_scene,
)
from digiclay.core.shapes.body import Body
from scipy.spatial.transform import Rotation

SIDE = 20
PLAIN = resolve({"layout": {"rows": SIDE, "columns": SIDE}, "control": {"method": "plastic"}})
SCENE = replace(
    PLAIN, bodies=(Presser(Body(stiffness=300.0, cap=1e-3), PLAIN.fingers[0].trajectory),) * 2
)


def dome(z, x=0.0):
    """Return the underside of a dome over the bed, its lowest point at z, in units."""
    grid = assemble(PLAIN).grid
    height = z + ((grid.x - x) ** 2 + grid.y**2) / 0.05
    return np.rint(np.minimum(height, SCENE.ceiling) / UNIT).astype(np.int32)


SPHERE = trimesh.creation.icosphere(3, radius=12.0)
#: In millimeters, rounded as Blender has it.
BALL = Mesh(SPHERE.vertices.astype(np.float32).astype(np.float64), np.array(SPHERE.faces))


def ball(z, x=0.0):
    """Return a ball of 12 mm over the bed, its lowest point at z."""
    return PlacedMesh(BALL, np.eye(3, 4, dtype=np.float32) * 1e-3 + shift(x, 0.0, z + 12e-3))


def shift(*position):
    """Return the last column of a place, the others 0."""
    return np.pad(np.array(position, np.float32)[:, None], ((0, 0), (3, 0)))


def take(count=40):
    """Return a take in which a ball and a dome press the pins, one after the other."""
    knots = tuple(
        (period, (ball(45e-3 - 2e-4 * period), dome(50e-3 - 2e-4 * period, 0.02)))
        for period in range(0, count + 1, 8)
    )
    poses = np.tile(np.array([0.0, 0.0, 0.2, *LEVEL]), (count + 1, 1, 1))
    return Take(SCENE, rest(SCENE), poses, b"", knots=knots)


def rest(scene):
    """Return the state of a bed at rest."""
    system = assemble(scene)
    return snapshot.dump(system, begin(system))


def test_between_two_times_undersides_are_lines_and_before_and_after_they_stand_still():
    given = GivenUndersides([(1, 0.0)], assemble(PLAIN).grid, np.array([2e-3, 5e-3]), 0.1)
    none = round(0.1 / UNIT)
    given.give(
        [(4, np.array([[100, none, none]], np.int32)), (6, np.array([[300, none, 500]], np.int32))]
    )
    pins = np.arange(3)
    for period, parts in (
        (0, (0.0, 0.0)),
        (4, (0.2, 0.5)),
        (5, (0.7, 1.0)),
        (6, (1.0, 1.0)),
        (99, (1.0, 1.0)),
    ):
        stretch = given.find(period)
        under = stretch.at(0, pins) / UNIT
        np.testing.assert_allclose(under[:, 0], 100 + 200 * np.array(parts), rtol=1e-12)
        assert (under[:, 1] > none - 1).all()
        assert np.isinf(stretch.low[0, 1])
    np.testing.assert_array_equal(given.find_lowest(4)[0] / UNIT, [100, np.inf, 500])


def test_a_take_keeps_meshes_and_undersides_and_replays_them_to_the_bit():
    first, given = take(), find_given(assemble(SCENE))
    again = from_bytes(to_bytes(first))
    assert again.scene == SCENE
    assert [period for period, _ in again.knots] == [period for period, _ in first.knots]
    for (_, bodies), (_, wanted) in zip(again.knots, first.knots, strict=True):
        np.testing.assert_array_equal(bodies[0].matrix, wanted[0].matrix)
        np.testing.assert_array_equal(given.measure(bodies), given.measure(wanted))
    assert len({id(bodies[0].mesh) for _, bodies in again.knots}) == 1
    heights = [[state.row(0).copy() for state in replay(each)][-1] for each in (first, again)]
    np.testing.assert_array_equal(*heights)
    wanted = np.minimum(np.min(given.measure(first.knots[-1][1]), axis=0) * UNIT, 40e-3)
    # The spring of the contact gives 0.5 mm while pins are pushed at 40 mm/s.
    assert np.abs(heights[0] - wanted).max() < 0.6e-3
    assert np.count_nonzero(heights[0] < 39e-3) > 10
    with pytest.raises(OutputError, match="has a presser that deforms"):
        to_scene(first, "Dome")


def tilted(period, size=1.0):
    """Return a ball that is made an ellipsoid and mirrored, and turns while it presses."""
    turn = trimesh.transformations.euler_matrix(0.3, 0.01 * period, 0.02 * period)[:3, :3]
    matrix = turn @ np.diag([-1.5, 1.0, 0.8]) * size
    position = 1e-4 * period, 0.0, 55e-3 - 1e-4 * period
    return PlacedMesh(
        BALL, (np.pad(matrix * 1e-3, ((0, 0), (0, 1))) + shift(*position)).astype("f4")
    )


def test_a_take_of_rigid_bodies_is_a_scene_that_runs_alike():
    one = replace(SCENE, bodies=SCENE.bodies[:1])
    knots = tuple((period, (tilted(period),)) for period in range(0, 81, 3))
    poses = np.tile(np.array([0.0, 0.0, 0.2, *LEVEL]), (81, 1, 1))
    pressed = Take(one, rest(one), poses, b"", knots=knots)
    *_, state = replay(pressed)
    scene = resolve(parse_tables(format_scene(to_scene(pressed, "Tilted"))))
    (body,) = scene.bodies
    assert (body.body.stiffness, body.body.cap) == (300.0, 1e-3)
    height = run(scene).history["height"][-1]
    assert np.count_nonzero(height < 39e-3) > 20
    # Undersides are computed at other times, as much as 1.5 mm of motion sideways apart.
    assert np.abs(height - state.row(0)).max() < 0.1e-3


def test_rotation_matrices_become_the_quaternions_of_scipy():
    turns = Rotation.random(200, random_state=1)
    found = find_quaternions(np.concatenate([turns.as_matrix(), np.eye(3)[None]]))
    wanted = [*turns.as_quat()[:, [3, 0, 1, 2]], LEVEL]
    assert np.abs(np.einsum("ki,ki->k", found, wanted)) == pytest.approx(1.0, abs=1e-12)


def test_a_take_of_a_body_that_grows_is_no_scene():
    one = replace(SCENE, bodies=SCENE.bodies[:1])
    knots = tuple((period, (tilted(period, 1.0 + 1e-3 * period),)) for period in (0, 40))
    with pytest.raises(OutputError, match="changes its size"):
        to_scene(replace(take(), scene=one, start=rest(one), knots=knots), "Grows")


@pytest.mark.parametrize(
    "name, spoil",
    [
        ("knots", lambda array: array[:0]),
        ("knots", lambda array: array[::-1]),
        ("knots", lambda array: array[1:]),
        ("undersides", lambda array: np.zeros(9, np.uint8)),
        ("sizes", lambda array: array[:0]),
        ("sizes", lambda array: array + 1),
        ("vertices", lambda array: array[:-9]),
        ("triangles", lambda array: given_bodies._pack([np.full((1280, 3), 642)])),
        ("places", lambda array: given_bodies._pack([np.full((6, 12), -1)])),
        ("bodies", lambda array: array[:-1]),
        ("bodies", lambda array: np.frombuffer(b'[{"cap": -1}, {}]', np.uint8)),
        ("bodies", lambda array: np.frombuffer(b'[{"size": 1}, {}]', np.uint8)),
    ],
)
def test_a_damaged_take_of_bodies_is_refused_in_a_line(monkeypatch, name, spoil):
    packed = given_bodies.pack_bodies(SCENE, take().knots)
    monkeypatch.setattr(
        "digiclay.core.session.take.pack_bodies",
        lambda *given: {**packed, name: spoil(packed[name])},
    )
    damaged = to_bytes(take())
    with pytest.raises(OutputError, match="damaged"):
        from_bytes(damaged)


def test_the_monitor_of_a_session_finds_the_error_under_bodies():
    # The truth, of the first stretch: the same periods at a twentieth of the step. The commands
    # differ by what the errors before them changed: the right size is asked for.
    scene = replace(SCENE, bodies=SCENE.bodies[:1])
    system, poses, heights = assemble(scene), np.array([[0.0, 0.0, 0.2, *LEVEL]]), []
    session = LiveSession(
        scene=scene, system=system, state=begin(system), poses=poses, monitor=accuracy.start(scene)
    )
    session = start_recording(session, snapshot.dump(system, session.state))
    for tick in range(accuracy.STRETCH + 1):  # four periods each: the reference lags behind
        session = replace(session, aim=(ball(40e-3 - 5e-4 * tick, 2e-4 * tick),))
        path = np.repeat(poses[None], 5, axis=0)
        session = follow_path(
            session, path, watch=lambda state: heights.append(state.row(0).copy())
        )
    take = make_take(scene, session.recording, snapshot.dump(system, session.state))
    *_, (_, state) = play(take)
    assert snapshot.dump(system, state) == take.end
    fine = [state.row(0).copy() for _, state in play(take, refine(scene, 20))]
    error = np.abs(np.array(fine[1 : accuracy.STRETCH + 1]) - heights[: accuracy.STRETCH]).max()
    assert 1e-9 < error < session.errors.height < 3.0 * error


def test_a_minute_of_a_rigid_body_takes_its_mesh_and_less_than_200_kilobytes():
    still, turning = (
        sum(array.nbytes for array in given_bodies.pack_bodies(SCENE, knots).values())
        for knots in ([(0, (ball(45e-3),) * 2)], [(3 * row, roll(row)) for row in range(3600)])
    )
    assert turning - still < 2 * 200e3


def roll(row):
    """Return two balls that roll and lift, their places rounded as Blender has them."""
    turn = trimesh.transformations.euler_matrix(0.02 * row, 0.3 * np.sin(0.03 * row), 0.1)[:3, :3]
    matrix = (np.pad(turn * 1e-3, ((0, 0), (0, 1)))).astype(np.float32)
    return tuple(
        PlacedMesh(BALL, matrix + shift(x + 1e-2 * np.sin(0.01 * row), 0.0, 5e-2))
        for x in (0, 0.02)
    )


def test_a_mesh_that_deforms_is_recorded_by_its_underside():
    given, other = find_given(assemble(SCENE)), BALL._replace(vertices=BALL.vertices * 0.9)
    first = ball(45e-3), ball(45e-3)
    bodies = ball(40e-3), replace(ball(40e-3), mesh=other)
    rigid, deformed = given.condense(bodies, first)
    assert rigid is bodies[0]
    np.testing.assert_array_equal(deformed, given.measure(bodies)[1])
    # The nearest pins are 2 mm beside the middle.
    assert deformed.min() * UNIT == pytest.approx(40e-3 + 1.2e-3, abs=3e-4)


def test_a_minute_of_a_body_that_presses_takes_three_megabytes():
    knots = tuple(
        (period, np.stack([dome(45e-3 - 5e-6 * period)] * 2)) for period in range(0, 1200, 7)
    )
    size = sum(array.nbytes for array in given_bodies.pack_bodies(SCENE, knots).values())
    values = len(knots) * 2 * SIDE**2
    # Of 10,000 pins at 30 Hz.
    assert size / values * 60 * 30 * 10_000 < 3e6
