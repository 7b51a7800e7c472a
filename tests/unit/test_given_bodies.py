"""Undersides that are given: lines between times, kept in takes to the bit and in little space."""

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.errors import OutputError
from digiclay.core.engine.bodies import UNIT, GivenUndersides
from digiclay.core.engine.simulation import begin
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Presser
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import given_bodies, snapshot
from digiclay.core.session.take import Take, from_bytes, replay, to_bytes, to_scene
from digiclay.core.shapes.body import Body

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


def take(count=40):
    """Return a take in which two domes press the pins, one after the other."""
    knots = tuple(
        (period, np.stack([dome(45e-3 - 2e-4 * period), dome(50e-3 - 2e-4 * period, 0.02)]))
        for period in range(0, count + 1, 8)
    )
    poses = np.tile(np.array([0.0, 0.0, 0.2, *LEVEL]), (count + 1, 1, 1))
    return Take(
        SCENE, snapshot.dump(system := assemble(SCENE), begin(system)), poses, b"", knots=knots
    )


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


def test_a_take_keeps_the_undersides_and_replays_them_to_the_bit():
    first = take()
    again = from_bytes(to_bytes(first))
    assert again.scene == SCENE
    assert [period for period, _ in again.knots] == [period for period, _ in first.knots]
    for (_, under), (_, wanted) in zip(again.knots, first.knots, strict=True):
        np.testing.assert_array_equal(under, wanted)
    heights = [[state.row(0).copy() for state in replay(each)][-1] for each in (first, again)]
    np.testing.assert_array_equal(*heights)
    wanted = np.minimum(np.min(first.knots[-1][1], axis=0) * UNIT, 40e-3)
    # The spring of the contact gives 0.5 mm while pins are pushed at 40 mm/s.
    assert np.abs(heights[0] - wanted).max() < 0.6e-3
    assert np.count_nonzero(heights[0] < 39e-3) > 20
    with pytest.raises(OutputError, match="has pressers"):
        to_scene(first, "Dome")


@pytest.mark.parametrize(
    "name, spoil",
    [
        ("knots", lambda array: array[:0]),
        ("knots", lambda array: array[::-1]),
        ("knots", lambda array: array[1:]),
        ("undersides", lambda array: array[:9]),
        ("undersides", lambda array: np.zeros(9, np.uint8)),
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


def test_a_minute_of_a_body_that_presses_takes_three_megabytes():
    knots = tuple(
        (period, np.stack([dome(45e-3 - 5e-6 * period)] * 2)) for period in range(0, 1200, 7)
    )
    size = sum(array.nbytes for array in given_bodies.pack_bodies(SCENE, knots).values())
    values = len(knots) * 2 * SIDE**2
    # Of 10,000 pins at 30 Hz.
    assert size / values * 60 * 30 * 10_000 < 3e6
