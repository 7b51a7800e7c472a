"""The live skin goes through every pin, stays between pins, and is the smooth skin of the exports inside."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.model.layout import Layout
from digiclay.core.surface import skins
from digiclay.core.surface.formed import Formed
from digiclay.device.instant import Instant
from digiclay.device.skin_lattice import KINDS, MOST_POINTS, choose_parts, interpolate, make_lattice

ARRANGEMENTS = ("aligned", "staggered", "hexagonal")
#: Heights are sums of a few numbers below 0.1 m.
EXACT = 1e-15


def bed(rows: int, columns: int, arrangement: str = "aligned") -> Instant:
    """Return a bed at rest."""
    return Instant.at_rest(Layout(rows=rows, columns=columns, arrangement=arrangement))


def rough(instant: Instant) -> np.ndarray:
    """Return heights with steps of several mm between neighbors, m."""
    return 0.04 + 0.005 * np.random.default_rng(3).standard_normal(len(instant.position))


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("parts", [2, 4])
def test_the_skin_goes_through_the_top_of_every_pin(arrangement: str, kind: str, parts: int) -> None:
    instant = bed(6, 7, arrangement)
    height = rough(instant)
    lattice = make_lattice(instant, parts)
    skin, top = interpolate(lattice, height, kind), ~lattice.sunk
    for pin, place in enumerate(instant.position):
        apart = np.hypot(*(lattice.place[top] - place).T)
        assert apart.min() < 1e-9
        # A point of the surface may have a second one for the sides, of the same height.
        np.testing.assert_allclose(skin[top][apart < 1e-9], height[pin], rtol=0, atol=EXACT)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("kind", KINDS)
def test_the_skin_lies_nowhere_above_or_below_all_pins_about_it(arrangement: str, kind: str) -> None:
    instant = bed(6, 7, arrangement)
    height = rough(instant)
    lattice = make_lattice(instant, 4)
    skin = interpolate(lattice, height, kind)
    # In the shifted arrangements the pins about a point are those of the two rows beside it.
    reach = 1.6 * instant.pitch
    for at in np.flatnonzero(~lattice.sunk):
        near = height[(np.abs(instant.position - lattice.place[at]) < reach).all(axis=1)]
        assert near.min() - EXACT <= skin[at] <= near.max() + EXACT


def test_inside_the_bed_it_is_the_smooth_skin_of_the_exports() -> None:
    instant, parts = bed(9, 8), 4
    height = rough(instant)
    lattice = make_lattice(instant, parts)
    shape = 8 * parts + 1 + 2 * (parts // 2), 7 * parts + 1 + 2 * (parts // 2)
    live = interpolate(lattice, height, "smooth")[: shape[0] * shape[1]].reshape(shape)
    rest = np.full_like(height, 0.04)
    formed = Formed(
        instant.position, height, rest, np.zeros(len(height)), np.zeros(len(height), np.int8), 9, 8
    )
    exported = skins.interpolate_skin(formed, height, "smooth", parts, 1e-3).reshape(
        8 * parts + 1, 7 * parts + 1
    )
    margin = parts // 2
    inside = live[margin:-margin, margin:-margin]
    # The two end the slopes at the outermost pins differently, which the next pin inside feels no more.
    cut = slice(parts, -parts)
    np.testing.assert_allclose(inside[cut, cut], exported[cut, cut], rtol=0, atol=1e-12)


def test_a_membrane_is_level_over_the_end_of_a_pin() -> None:
    instant = bed(2, 3)
    cap = instant.actuator.bore / 2
    lattice = make_lattice(instant, 4)
    height = rough(instant)
    skin = interpolate(lattice, height, "membrane")
    for pin, place in enumerate(instant.position):
        over = (np.abs(lattice.place - place) <= cap + 1e-12).all(axis=1) & ~lattice.sunk
        np.testing.assert_allclose(skin[over], height[pin], rtol=0, atol=EXACT)


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 5), (5, 1), (2, 2)])
def test_the_smallest_beds_have_a_skin_too(rows: int, columns: int) -> None:
    instant = bed(rows, columns)
    lattice = make_lattice(instant, 4)
    skin = interpolate(lattice, np.full(rows * columns, 0.04), "smooth")
    np.testing.assert_allclose(skin[~lattice.sunk], 0.04, rtol=0, atol=EXACT)
    assert (skin[lattice.sunk] == 0.0).all()


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_the_faces_of_the_top_cover_the_bed_once_and_face_upwards(arrangement: str) -> None:
    lattice = make_lattice(bed(4, 5, arrangement), 2)
    top = lattice.place[lattice.faces[~lattice.sunk[lattice.faces].any(axis=1)]]
    after = np.roll(top, -1, axis=1)
    area = 0.5 * (top[..., 0] * after[..., 1] - top[..., 1] * after[..., 0]).sum(axis=1)
    assert area.min() > 0.0
    assert area.sum() == pytest.approx(np.ptp(lattice.place, axis=0).prod(), rel=1e-9)


@pytest.mark.parametrize(("count", "parts"), [(625, 4), (10_000, 2), (100_000, 1)])
def test_a_skin_has_no_more_points_than_a_tick_has_time_for(count: int, parts: int) -> None:
    assert choose_parts(count) == parts
    assert parts**2 * count <= MOST_POINTS or parts == 1
