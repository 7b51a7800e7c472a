"""Bosses and creases found, measured and traced, on surfaces whose figures are known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import ParameterError
from digiclay.core.mesh_io.export_model import make_feature_solid
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.surface.features import Feature, Finding, find, make_table, summarize
from digiclay.core.surface.formed import Formed
from digiclay.core.surface.skins import fit_skin

ARRANGEMENTS = ("aligned", "staggered", "hexagonal")
LEVEL = 0.04


def formed(
    raised, arrangement: str = "aligned", rows: int = 41, columns: int = 41, pitch: float = 1e-3
) -> Formed:
    """A bed formed from level to a function of x and y, mm in and mm out."""
    place = make_grid(Layout(rows=rows, columns=columns, pitch=pitch, arrangement=arrangement)).positions
    height = LEVEL + 1e-3 * np.asarray(raised(*(place.T * 1e3)), float)
    return Formed.of(place, height, LEVEL, 0.0, 0)


def features(bed, finding: Finding | None = None, skin: str = "bilinear", parts: int = 1) -> list[Feature]:
    return find(fit_skin(bed, skin, parts, 1e-3), finding)


def ridge(x, y, half: float = 12.0, height: float = 6.0, angle: float = 0.0):
    """A round ridge 2 x 4 mm wide about a straight line, with round ends."""
    along = x * np.cos(angle) + y * np.sin(angle)
    across = y * np.cos(angle) - x * np.sin(angle)
    away = np.hypot(np.clip(np.abs(along) - half, 0.0, None), across)
    return height * np.clip(1.0 - (away / 4.0) ** 2, 0.0, None)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_dome_is_one_boss_with_the_area_and_volume_of_the_cap(arrangement):
    # A paraboloid 8 mm high and 12 mm in radius, of which the part above 0.5 mm counts.
    cap = lambda x, y: np.clip(8.0 * (1.0 - (x * x + y * y) / 144.0), 0.0, None)  # noqa: E731
    (dome,) = features(formed(cap, arrangement))
    cut = 144.0 * (1.0 - 0.5 / 8.0)
    assert (dome.kind, dome.name) == ("boss", "boss_1")
    # Pins 1 mm apart see a curve of 12 mm radius as chords: 1 % is a few times their sagitta.
    assert dome.area * 1e6 == pytest.approx(np.pi * cut, rel=0.01)
    assert dome.volume * 1e9 == pytest.approx(np.pi * cut * (0.5 + 8.0) / 2.0, rel=0.01)
    assert dome.extreme * 1e3 == pytest.approx(8.0, abs=0.05)  # the top may lie between pins
    assert (dome.crests, dome.crest_length) == ((), 0.0)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("angle", [0, 20, 130])
def test_a_ridge_has_a_crest_as_long_as_its_spine(arrangement, angle):
    (boss,) = features(formed(lambda x, y: ridge(x, y, angle=np.radians(angle)), arrangement))
    assert len(boss.crests) == 1
    # Its ends may be off by two pins in all, of 24 mm, and an oblique line of pins is up to 3 % too long.
    assert boss.crest_length * 1e3 == pytest.approx(24.0, abs=2.7)
    away = boss.crests[0][:, :2] @ (-np.sin(np.radians(angle)), np.cos(np.radians(angle)))
    assert np.abs(away).max() <= 1e-3  # a pitch off the spine at most


def test_a_flat_topped_ridge_has_its_crest_in_the_middle():
    (boss,) = features(formed(lambda x, y: 5.0 * ((np.abs(y - 3.0) < 3.5) & (np.abs(x) < 15.5))))
    (crest,) = boss.crests
    # The ends are the half width short of the region's, where the flat top falls off on three sides.
    assert np.abs(crest[:, 1] - 3e-3).max() <= 1e-3
    assert 24.0 <= boss.crest_length * 1e3 <= 31.0


def test_a_slope_along_the_crest_counts_in_its_length():
    (boss,) = features(formed(lambda x, y: ridge(x, y) / 6.0 * (9.0 + x / 2.0)))
    span = boss.crests[0][-1] - boss.crests[0][0]
    # From 3 mm high at one end to 15 mm at the other: along the slope it is longer than in plan.
    assert boss.crest_length >= np.linalg.norm(span) - 1e-9
    assert abs(span[2]) > 0.4 * abs(span[0])


def test_a_crease_is_measured_as_the_boss_it_mirrors_and_listed_in_millimeters():
    (up,), (down,) = (features(formed(lambda x, y, way=way: way * ridge(x, y))) for way in (1.0, -1.0))
    assert (up.kind, down.kind, down.name) == ("boss", "crease", "crease_1")
    figures = ("volume", "extreme", "crest_length")
    assert [getattr(down, name) for name in figures] == pytest.approx([getattr(up, name) for name in figures])
    head, row = make_table([up])
    assert head == ("feature", "form", "pins", "area, mm²", "height or depth, mm", "crest, mm", "volume, mm³")
    assert (*row[:2], row[4]) == ("boss_1", "ridge", "6.00")


def test_features_are_numbered_by_volume_bosses_first():
    three = lambda x, y: ridge(x, y - 12.0, height=3.0) + ridge(x, y) - ridge(x, y + 12.0)  # noqa: E731
    found = features(formed(three))
    assert [one.name for one in found] == ["boss_1", "boss_2", "crease_1"]
    assert found[0].volume > found[1].volume
    assert summarize(found) == "2 bosses and 1 crease"
    assert features(formed(lambda x, y: 0.0 * x)) == []


def test_features_are_measured_from_the_surface_as_it_was():
    bed = formed(lambda x, y: ridge(x, y))
    before = LEVEL + bed.position @ (0.1, 0.2)
    moved = Formed.of(bed.position, before + bed.raised, before, 0.0, 0)
    (one,), (other,) = features(bed), features(moved)
    # Squares may be cut along their other diagonal, which moves the surface within them.
    assert other.volume == pytest.approx(one.volume, rel=1e-3)
    np.testing.assert_array_equal(other.pins, one.pins)


@pytest.mark.parametrize(("smallest", "count"), [(1, 2), (2, 1), (9, 1), (10, 0)])
def test_a_feature_of_too_few_pins_is_none(smallest, count):
    def bumps(x, y):
        return 2.0 * ((np.maximum(np.abs(x), np.abs(y)) < 1.5) | (np.hypot(x - 9, y) < 0.5))

    assert len(features(formed(bumps), Finding(smallest=smallest))) == count


def of_25(height) -> Feature:
    """The only feature above 0.5 of a bed of 5 x 5 pins."""
    place = make_grid(Layout(rows=5, columns=5)).positions
    (boss,) = features(Formed.of(place, height, 0.0, 0.0, 0), Finding(threshold=0.5, smallest=1))
    return boss


def test_a_pin_exactly_at_the_threshold_does_not_belong_to_the_feature():
    height = np.zeros(25)
    height[[11, 12]] = 0.5, 1.0
    np.testing.assert_array_equal(of_25(height).pins, [12])


def test_neighbors_exactly_at_the_threshold_leave_no_triangle_without_area():
    height = np.zeros(25)
    height[[6, 7, 8, 9, 11, 14, 16, 17, 18, 19]] = 0.5
    height[[12, 13]] = 2.0
    boss = of_25(height)
    a, b, c = np.moveaxis(boss.region.position[boss.region.faces], 1, 0)
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    # Beside a corner of the contour stands a triangle of a thousandth of a pitch, and not of rounding.
    assert area.min() > 1e-4 * 0.5 * 9e-6
    assert len(np.unique(boss.region.position, axis=0)) == len(boss.region.position)


@pytest.mark.parametrize(
    ("name", "bad"),
    [("threshold", bad) for bad in (0.0, -1e-3, np.nan, np.inf, "wide")]
    + [("smallest", bad) for bad in (0, -1, 2.5)],
)
def test_criteria_that_make_no_sense_are_refused(name, bad):
    with pytest.raises(ParameterError, match=rf"^Finding\.{name} must be"):
        Finding(**{name: bad})


def rough(seed: int, arrangement: str) -> Formed:
    """Bosses and creases of every shape, pinched, holed and side by side."""
    place = make_grid(Layout(rows=14, columns=13, arrangement=arrangement)).positions
    random = np.random.default_rng(seed)
    return Formed.of(place, LEVEL + random.integers(-2, 3, len(place)) * 0.5e-3, LEVEL, 0.0, 0)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("seed", range(2))
def test_every_body_is_closed_and_of_the_volume_that_is_listed(arrangement, seed):
    found = features(rough(seed, arrangement), Finding(threshold=0.3e-3, smallest=1))
    assert len(found) > 2
    for one in found:
        body = make_feature_solid(one)
        mesh = trimesh.Trimesh(body.vertices, body.faces, process=False)
        _, counts = np.unique(np.sort(mesh.edges, axis=1), axis=0, return_counts=True)
        assert set(counts) == {2}
        assert mesh.is_winding_consistent
        assert mesh.volume == pytest.approx(one.apart.volume, rel=1e-9)
        # Where it is divided, a strip as wide as 0.005 to 0.01 pitches is missing: 0.1 mm² under up to 1 mm.
        assert mesh.volume == pytest.approx(one.volume, rel=1e-9 if one.apart is one.region else 0.01)
        assert len(np.unique(body.faces)) == len(body.vertices)


@pytest.mark.parametrize("skin", ["smooth", "membrane"])
def test_bodies_follow_the_skin_that_is_asked_for(skin):
    bed = formed(lambda x, y: ridge(x, y), rows=21, columns=21, pitch=2e-3)
    (coarse,), (fine,) = features(bed), features(bed, skin=skin, parts=4)
    mesh = trimesh.Trimesh(make_feature_solid(fine).vertices, make_feature_solid(fine).faces, process=False)
    assert mesh.is_watertight
    assert len(mesh.faces) > 8 * len(make_feature_solid(coarse).faces)
    # Top and bottom of every point are the skin now and before.
    assert mesh.bounds[0, 2] == pytest.approx(LEVEL, abs=1e-12)
    assert mesh.bounds[1, 2] == pytest.approx(LEVEL + fine.extreme, abs=1e-12)


def test_a_boss_and_a_crease_put_the_former_surface_right():
    # What is formed is what was there, plus the boss, minus the crease, but for the rim below the threshold.
    bed = formed(lambda x, y: ridge(x, y - 8.0) - ridge(x, y + 8.0, height=4.0))
    boss, crease = features(bed, Finding(threshold=1e-6))
    # A pin stands for 1 mm²; along the outline the skin is straight where the sum over pins has a corner.
    assert boss.volume - crease.volume == pytest.approx(bed.raised.sum() * 1e-6, rel=5e-3)
