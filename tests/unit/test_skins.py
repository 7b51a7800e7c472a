"""Skins between the pins beside SciPy's interpolators and solvers; the live skin beside that of exports."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse
from digiclay.core.base.spline import interpolate_monotone
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.surface import skins
from digiclay.core.surface.formed import Formed
from digiclay.core.surface.skins import SKINS, SurfaceGrid, fit_skin
from digiclay.device.instant import Instant
from digiclay.device.skin_lattice import KINDS, MOST_POINTS, choose_parts, interpolate, make_lattice
from scipy.interpolate import LinearNDInterpolator, PchipInterpolator, RegularGridInterpolator
from scipy.sparse.linalg import spsolve
from scipy.spatial import Delaunay

ARRANGEMENTS = ("aligned", "staggered", "hexagonal")
#: Radius of a pin's end: half the bore.
CAP = 1e-3
#: Rounding of some ten operations on heights below 0.1 m.
ROUNDING = 1e-15


def bed(arrangement: str = "aligned", rows: int = 7, columns: int = 9, seed: int = 1) -> Formed:
    """A bed with pins anywhere between 20 and 80 mm."""
    place = make_grid(Layout(rows=rows, columns=columns, arrangement=arrangement)).positions
    return Formed.of(place, np.random.default_rng(seed).uniform(0.02, 0.08, len(place)), 0.04, 0.0, 0)


def covered(formed: Formed, skin: str, parts: int) -> SurfaceGrid:
    return fit_skin(formed, skin, parts, CAP)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("skin", SKINS)
@pytest.mark.parametrize("parts", [1, 5])
def test_a_skin_passes_through_every_pin_top_to_a_micrometer(skin, arrangement, parts):
    formed = bed(arrangement)
    sheet = covered(formed, skin, parts)
    assert len(sheet.position) == (6 * parts + 1) * (8 * parts + 1)
    np.testing.assert_allclose(sheet.position[sheet.pins], formed.position, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(sheet.height[sheet.pins], formed.height, rtol=0.0, atol=1e-6)


def test_the_bilinear_skin_of_an_aligned_bed_is_scipys():
    formed = bed()
    sheet = covered(formed, "bilinear", 4)
    x, y = formed.position[:9, 0], formed.position[::9, 1]
    known = RegularGridInterpolator((y, x), formed.height.reshape(7, 9))
    # Points of the edge may be a rounding error outside.
    inside = np.clip(sheet.position, formed.position.min(axis=0), formed.position.max(axis=0))
    np.testing.assert_allclose(sheet.height, known(inside[:, ::-1]), rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("arrangement", ["staggered", "hexagonal"])
def test_the_bilinear_skin_of_a_shifted_bed_is_flat_on_the_triangles_of_delaunay(arrangement, mirrored):
    formed = bed(arrangement)
    place = formed.position * (-1.0 if mirrored else 1.0, 1.0)
    sheet = covered(Formed.of(place, formed.height, 0.04, 0.0, 0), "bilinear", 4)
    # In mm, because of Delaunay's own tolerances.
    known = LinearNDInterpolator(Delaunay(place * 1e3), formed.height)(sheet.position * 1e3)
    compared = np.isfinite(known)
    # At the zig-zag ends the hull has triangles that the bed has not, but no point of ours lies in them.
    assert compared.mean() > 0.95
    np.testing.assert_allclose(sheet.height[compared], known[compared], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_the_smooth_skin_is_scipys_monotone_splines_along_and_then_across_the_rows(arrangement):
    formed = bed(arrangement)
    sheet = covered(formed, "smooth", 3)
    x, y = formed.position[:, 0].reshape(7, 9), formed.position[::9, 1]
    height = formed.height.reshape(7, 9)
    # Beside the zig-zag ends of a shifted bed the skin is held between the pins, which SciPy's is not.
    within = (sheet.position[:, 0] >= x[:, 0].max()) & (sheet.position[:, 0] <= x[:, -1].min())
    points = np.flatnonzero(within)[::7]
    assert len(points) > 50
    for point in points:
        at_x, at_y = sheet.position[point]
        along = [PchipInterpolator(x[row], height[row])(at_x) for row in range(7)]
        assert sheet.height[point] == pytest.approx(PchipInterpolator(y, along)(at_y), abs=1e-14)


@pytest.mark.parametrize("falling", [False, True])
@pytest.mark.parametrize("count", [2, 3, 12])
def test_a_spline_may_have_its_knots_anywhere(falling, count):
    random = np.random.default_rng(5)
    knot = np.sort(random.uniform(0.0, 1.0, count))[:: -1 if falling else 1]
    # Some run level for a while, some rise and fall.
    value, at = random.integers(-2, 3, size=(count, 30)) * 1.0, np.linspace(knot.min(), knot.max(), 101)
    order = np.argsort(knot)
    known = PchipInterpolator(knot[order], value[order])(at)
    np.testing.assert_allclose(interpolate_monotone(knot, value, at), known, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("skin", SKINS)
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_skin_is_nowhere_above_or_below_the_pins_about_it(skin, arrangement):
    formed = bed(arrangement, rows=6, columns=6, seed=4)
    sheet = covered(formed, skin, 4)
    # The pins of the own cell and the cells beside it: a line between two shifted rows has its neighbors
    # in either of them.
    away = np.linalg.norm(sheet.position[:, None] - formed.position, axis=2)
    near = away <= 1.6 * formed.pitch
    lowest = np.where(near, formed.height, np.inf).min(axis=1)
    highest = np.where(near, formed.height, -np.inf).max(axis=1)
    assert (sheet.height - lowest).min() >= -1e-9  # the membrane stops at 1 nm a point
    assert (sheet.height - highest).max() <= 1e-9


def test_the_membrane_lies_on_the_flat_ends_and_is_harmonic_between_them():
    formed = bed(rows=4, columns=5)
    sheet = covered(formed, "membrane", 6)
    rows, columns = sheet.rows, sheet.columns
    away = np.linalg.norm(sheet.position[:, None] - formed.position, axis=2)
    pin = np.argmin(away, axis=1)
    fixed = away.min(axis=1) <= CAP * (1 + 1e-9)
    np.testing.assert_array_equal(sheet.height[fixed], formed.height[pin[fixed]])
    # The five-point stencil with mirrored edges, solved by SciPy.
    ends = [np.concatenate([[1.0], np.full(n - 2, 2.0), [1.0]]) for n in (rows, columns)]
    chains = [scipy.sparse.diags([-np.ones(len(d) - 1), d, -np.ones(len(d) - 1)], [-1, 0, 1]) for d in ends]
    halves = [scipy.sparse.diags(np.where(d == 1.0, 0.5, 1.0)) for d in ends]
    laplace = (scipy.sparse.kron(chains[0], halves[1]) + scipy.sparse.kron(halves[0], chains[1])).tocsr()
    free = ~fixed
    pull = -laplace[free][:, fixed] @ sheet.height[fixed]
    known = spsolve(laplace[free][:, free].tocsc(), pull)
    np.testing.assert_allclose(sheet.height[free], known, rtol=0.0, atol=1e-8)  # it stops at 1 nm a point


def test_force_is_straight_between_pins_and_a_mode_that_of_the_nearest():
    formed = bed(rows=2, columns=2)
    known = Formed.of(formed.position, formed.height, 0.04, [0.0, 1.0, 0.0, 1.0], [1, 2, 3, 4])
    values = covered(known, "smooth", 4).values()
    np.testing.assert_allclose(values["force"].reshape(5, 5), np.tile([0, 0.25, 0.5, 0.75, 1], (5, 1)))
    np.testing.assert_array_equal(
        values["mode"].reshape(5, 5)[[0, 1, 3, 4]][:, [0, 1, 3, 4]][0], [1, 1, 2, 2]
    )


def at_rest(rows: int, columns: int, arrangement: str = "aligned") -> Instant:
    """Return a at_rest at rest."""
    return Instant.at_rest(Layout(rows=rows, columns=columns, arrangement=arrangement))


def rough(instant: Instant) -> np.ndarray:
    """Return heights with steps of several mm between neighbors, m."""
    return 0.04 + 0.005 * np.random.default_rng(3).standard_normal(len(instant.position))


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("parts", [2, 4])
def test_the_skin_goes_through_the_top_of_every_pin(arrangement: str, kind: str, parts: int) -> None:
    instant = at_rest(6, 7, arrangement)
    height = rough(instant)
    lattice = make_lattice(instant, parts)
    skin, top = interpolate(lattice, height, kind), ~lattice.sunk
    for pin, place in enumerate(instant.position):
        apart = np.hypot(*(lattice.place[top] - place).T)
        assert apart.min() < 1e-9
        # A point of the surface may have a second one for the sides, of the same height.
        np.testing.assert_allclose(skin[top][apart < 1e-9], height[pin], rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("kind", KINDS)
def test_the_skin_lies_nowhere_above_or_below_all_pins_about_it(arrangement: str, kind: str) -> None:
    instant = at_rest(6, 7, arrangement)
    height = rough(instant)
    lattice = make_lattice(instant, 4)
    skin = interpolate(lattice, height, kind)
    # In the shifted arrangements the pins about a point are those of the two rows beside it.
    reach = 1.6 * instant.pitch
    for at in np.flatnonzero(~lattice.sunk):
        near = height[(np.abs(instant.position - lattice.place[at]) < reach).all(axis=1)]
        assert near.min() - ROUNDING <= skin[at] <= near.max() + ROUNDING


def test_inside_the_bed_it_is_the_smooth_skin_of_the_exports() -> None:
    instant, parts, margin = at_rest(9, 8), 4, 2
    height = rough(instant)
    shape = 8 * parts + 1 + 2 * margin, 7 * parts + 1 + 2 * margin
    live = interpolate(make_lattice(instant, parts), height, "smooth")[: shape[0] * shape[1]].reshape(shape)
    formed = Formed.of(instant.position, height, 0.04, 0.0, 0)
    exported = skins.interpolate_skin(formed, height, "smooth", parts, 1e-3)
    inside = live[margin:-margin, margin:-margin]
    # The two end the slopes at the outermost pins differently, which the next pin inside feels no more.
    cut = slice(parts, -parts)
    known = exported.reshape(inside.shape)[cut, cut]
    np.testing.assert_allclose(inside[cut, cut], known, rtol=0, atol=1e-12)


def test_a_membrane_is_level_over_the_end_of_a_pin() -> None:
    instant = at_rest(2, 3)
    cap = instant.actuator.bore / 2
    lattice = make_lattice(instant, 4)
    height = rough(instant)
    skin = interpolate(lattice, height, "membrane")
    for pin, place in enumerate(instant.position):
        over = (np.abs(lattice.place - place) <= cap + 1e-12).all(axis=1) & ~lattice.sunk
        np.testing.assert_allclose(skin[over], height[pin], rtol=0, atol=ROUNDING)


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 5), (5, 1), (2, 2)])
def test_the_smallest_beds_have_a_skin_too(rows: int, columns: int) -> None:
    lattice = make_lattice(at_rest(rows, columns), 4)
    skin = interpolate(lattice, np.full(rows * columns, 0.04), "smooth")
    np.testing.assert_allclose(skin, np.where(lattice.sunk, 0.0, 0.04), rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_the_faces_of_the_top_cover_the_bed_once_and_face_upwards(arrangement: str) -> None:
    lattice = make_lattice(at_rest(4, 5, arrangement), 2)
    top = lattice.place[lattice.faces[~lattice.sunk[lattice.faces].any(axis=1)]]
    after = np.roll(top, -1, axis=1)
    area = 0.5 * (top[..., 0] * after[..., 1] - top[..., 1] * after[..., 0]).sum(axis=1)
    assert area.min() > 0.0
    assert area.sum() == pytest.approx(np.ptp(lattice.place, axis=0).prod(), rel=1e-9)


@pytest.mark.parametrize("count", [625, 10_000, 100_000])
def test_a_skin_has_no_more_points_than_a_tick_has_time_for(count: int) -> None:
    parts = choose_parts(count)
    assert parts**2 * count <= MOST_POINTS or parts == 1
    assert parts == 4 or (2 * parts) ** 2 * count > MOST_POINTS
