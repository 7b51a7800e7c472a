"""Skins between the pins, beside SciPy's interpolators and solvers."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse
from digiclay.core.formed import Formed
from digiclay.core.layout import Layout, grid
from digiclay.core.sheet import Sheet, stretched
from digiclay.core.skin_spline import natural
from digiclay.core.skins import SKINS
from scipy.interpolate import CubicSpline, LinearNDInterpolator, RegularGridInterpolator
from scipy.sparse.linalg import spsolve
from scipy.spatial import Delaunay

ARRANGEMENTS = ("aligned", "staggered", "hexagonal")
#: Radius of a pin's end: half the bore.
CAP = 1e-3
#: Rounding of some ten operations on heights below 0.1 m.
ROUNDING = 1e-15


def bed(arrangement: str = "aligned", rows: int = 7, columns: int = 9, seed: int = 1) -> Formed:
    """A bed with pins anywhere between 20 and 80 mm."""
    place = grid(Layout(rows=rows, columns=columns, arrangement=arrangement)).positions
    return Formed.of(place, np.random.default_rng(seed).uniform(0.02, 0.08, len(place)), 0.04, 0.0, 0)


def covered(formed: Formed, skin: str, parts: int) -> Sheet:
    return stretched(formed, skin, parts, CAP)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("skin", SKINS)
@pytest.mark.parametrize("parts", [1, 2, 5])
def test_a_skin_passes_through_every_pin_top_to_a_micrometre(skin, arrangement, parts):
    formed = bed(arrangement)
    sheet = covered(formed, skin, parts)
    assert len(sheet.place) == (6 * parts + 1) * (8 * parts + 1)
    np.testing.assert_allclose(sheet.place[sheet.pins], formed.position, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(sheet.height[sheet.pins], formed.height, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("skin", ["smooth", "bilinear"])
def test_a_skin_has_no_jump_beside_a_pin(skin, arrangement):
    # What passes through a pin could still be a needle there: a point away, the skin has moved by no more
    # than the steepest slope there is, some 60 mm a pitch of the random heights, doubled by overshoot.
    formed = bed(arrangement)
    sheet = covered(formed, skin, 60)
    height = sheet.height.reshape(sheet.rows, sheet.columns)
    for axis in (0, 1):
        assert np.abs(np.diff(height, axis=axis)).max() < 2.5 * 0.06 / 60


@pytest.mark.parametrize("skin", SKINS)
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_level_bed_has_a_level_skin(skin, arrangement):
    formed = bed(arrangement)
    level = Formed.of(formed.position, np.full(63, 0.04), 0.04, 0.0, 0)
    np.testing.assert_allclose(covered(level, skin, 4).height, 0.04, rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize("skin", ["bilinear", "smooth"])
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_tilted_bed_has_a_plane_skin(skin, arrangement):
    place = bed(arrangement).position
    tilted = Formed.of(place, 0.04 + place @ (0.3, -0.2), 0.04, 0.0, 0)
    sheet = covered(tilted, skin, 4)
    np.testing.assert_allclose(sheet.height, 0.04 + sheet.place @ (0.3, -0.2), rtol=0.0, atol=ROUNDING)


def test_the_bilinear_skin_of_an_aligned_bed_is_scipys():
    formed = bed()
    sheet = covered(formed, "bilinear", 4)
    x, y = formed.position[:9, 0], formed.position[::9, 1]
    known = RegularGridInterpolator((y, x), formed.height.reshape(7, 9))
    # Points of the edge may be a rounding error outside.
    inside = np.clip(sheet.place, formed.position.min(axis=0), formed.position.max(axis=0))
    np.testing.assert_allclose(sheet.height, known(inside[:, ::-1]), rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("arrangement", ["staggered", "hexagonal"])
def test_the_bilinear_skin_of_a_shifted_bed_is_flat_on_the_triangles_of_delaunay(arrangement, mirrored):
    formed = bed(arrangement)
    place = formed.position * (-1.0 if mirrored else 1.0, 1.0)
    sheet = covered(Formed.of(place, formed.height, 0.04, 0.0, 0), "bilinear", 4)
    # In mm, because of Delaunay's own tolerances.
    known = LinearNDInterpolator(Delaunay(place * 1e3), formed.height)(sheet.place * 1e3)
    compared = np.isfinite(known)
    # At the zig-zag ends the hull has triangles that the bed has not, but no point of ours lies in them.
    assert compared.mean() > 0.95
    np.testing.assert_allclose(sheet.height[compared], known[compared], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_the_smooth_skin_is_scipys_natural_splines_along_and_then_across_the_rows(arrangement):
    formed = bed(arrangement)
    sheet = covered(formed, "smooth", 3)
    x, y = formed.position[:, 0].reshape(7, 9), formed.position[::9, 1]
    height = formed.height.reshape(7, 9)
    for point in range(0, len(sheet.place), 11):
        at_x, at_y = sheet.place[point]
        along = []
        for row in range(7):
            spline = CubicSpline(x[row], height[row], bc_type="natural")
            nearest = np.clip(at_x, x[row, 0], x[row, -1])  # beyond its ends it goes on straight
            along.append(spline(nearest) + (at_x - nearest) * spline(nearest, 1))
        known = CubicSpline(y, along, bc_type="natural")(at_y)
        assert sheet.height[point] == pytest.approx(known, abs=1e-14)


@pytest.mark.parametrize("falling", [False, True])
def test_a_spline_may_have_its_knots_anywhere(falling):
    random = np.random.default_rng(5)
    knot = np.sort(random.uniform(0.0, 1.0, 12))[:: -1 if falling else 1]
    value, at = random.normal(size=(12, 3)), np.linspace(knot.min(), knot.max(), 101)
    order = np.argsort(knot)
    known = CubicSpline(knot[order], value[order], bc_type="natural")(at)
    np.testing.assert_allclose(natural(knot, value, at), known, rtol=0.0, atol=1e-10)  # values of 1e3


def test_the_membrane_lies_on_the_flat_ends_and_is_harmonic_between_them():
    formed = bed(rows=4, columns=5)
    sheet = covered(formed, "membrane", 6)
    rows, columns = sheet.rows, sheet.columns
    away = np.linalg.norm(sheet.place[:, None] - formed.position, axis=2)
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


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_the_membrane_is_nowhere_beyond_the_pins_about_it(arrangement):
    formed = bed(arrangement)
    sheet = covered(formed, "membrane", 4)
    assert sheet.height.min() >= formed.height.min() - 1e-9
    assert sheet.height.max() <= formed.height.max() + 1e-9


@pytest.mark.parametrize("skin", SKINS)
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_mirrored_bed_has_the_mirrored_skin(skin, arrangement):
    formed = bed(arrangement)
    mirrored = Formed.of(formed.position * (-1.0, 1.0), formed.height, 0.04, 0.0, 0)
    one, other = covered(formed, skin, 3), covered(mirrored, skin, 3)
    np.testing.assert_allclose(other.place, one.place * (-1.0, 1.0), rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(
        other.height, one.height, rtol=0.0, atol=5e-9
    )  # the membrane stops at 1 nm a point


def test_force_is_straight_between_pins_and_a_mode_that_of_the_nearest():
    formed = bed(rows=2, columns=2)
    known = Formed.of(formed.position, formed.height, 0.04, [0.0, 1.0, 0.0, 1.0], [1, 2, 3, 4])
    values = covered(known, "smooth", 4).values()
    np.testing.assert_allclose(values["force"].reshape(5, 5), np.tile([0, 0.25, 0.5, 0.75, 1], (5, 1)))
    np.testing.assert_array_equal(
        values["mode"].reshape(5, 5)[[0, 1, 3, 4]][:, [0, 1, 3, 4]][0], [1, 1, 2, 2]
    )
