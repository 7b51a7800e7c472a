"""Bosses and creases: found, measured, traced and called by their form, on surfaces with known figures."""

import itertools
import re

import numpy as np
import pytest
import trimesh
from digiclay.core.mesh_io.export_model import make_feature_solid
from digiclay.core.model.layout import ARRANGEMENTS, Layout, make_grid
from digiclay.core.surface.crest_network import measure_run
from digiclay.core.surface.features import Finding, find, make_table, summarize
from digiclay.core.surface.formed import Formed
from digiclay.core.surface.skins import fit_skin
from numpy.testing import assert_array_equal

LEVEL = 0.04


def formed(raised, arrangement="aligned", rows=41, columns=41, pitch=1e-3):
    """A bed formed from level to a function of x and y, mm in and mm out."""
    place = make_grid(
        Layout(rows=rows, columns=columns, pitch=pitch, arrangement=arrangement)
    ).positions
    height = LEVEL + 1e-3 * np.asarray(raised(*(place.T * 1e3)), float)
    return Formed.of(place, height, LEVEL, 0.0, 0)


def round_top(away, half):
    """A parabola 1 high, as wide as `half` to either side."""
    return np.clip(1.0 - (away / half) ** 2, 0.0, None)


def along(points):
    """How far it is to a line of straight pieces through points, (n, 2)."""
    ends = np.array([*itertools.pairwise(points)])[..., None]

    def away(x, y):
        (ax, ay), (dx, dy) = ends[:, 0].swapaxes(0, 1), (ends[:, 1] - ends[:, 0]).swapaxes(0, 1)
        u, v = np.ravel(x) - ax, np.ravel(y) - ay
        t = np.clip((u * dx + v * dy) / (dx * dx + dy * dy), 0.0, 1.0)
        return np.hypot(u - t * dx, v - t * dy).min(axis=0).reshape(np.shape(x))

    return away


def line(points):
    """How far it is to a line of straight pieces; its points in mm, as in SVG: "x,y x,y"."""
    return along(np.array([point.split(",") for point in points.split()], float))


def arc(y, start, end):
    """How far it is to an arc of 14 mm radius about a point of the y axis; angles in half turns."""
    turn = np.pi * np.linspace(start, end, 40)
    return along(np.column_stack([14 * np.cos(turn), y + 14 * np.sin(turn)]))


def circle(at, radius):
    """How far it is to a circle about a point of the x axis."""
    return lambda x, y: np.abs(np.hypot(x - at, y) - radius)


def ridges(height, half, *lines):
    """Round ridges along lines."""
    distances = [line(one) if isinstance(one, str) else one for one in lines]
    return lambda x, y: height * round_top(np.min([away(x, y) for away in distances], axis=0), half)


def mound(height, at, half):
    """A round mound about a point of the x axis."""
    return lambda x, y: height * round_top(np.hypot(x - at, y), half)


#: A round ridge 8 mm wide and 6 mm high about a line of 24 mm along x, with round ends.
ridge = ridges(6.0, 4.0, "-12,0 12,0")


def features(bed, finding=None, skin="bilinear", parts=1):
    return find(fit_skin(bed, skin, parts, 1e-3), finding)


def mesh_of(one):
    body = make_feature_solid(one)
    return trimesh.Trimesh(body.vertices, body.faces, process=False)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_dome_is_one_boss_with_the_area_and_volume_of_the_cap(arrangement):
    # A paraboloid 8 mm high and 12 mm in radius, of which the part above 0.5 mm counts.
    (dome,) = features(formed(mound(8.0, 0.0, 12.0), arrangement))
    cut = 144.0 * (1.0 - 0.5 / 8.0)
    assert (dome.kind, dome.name) == ("boss", "boss_1")
    # Pins 1 mm apart see a curve of 12 mm radius as chords: 1 % is a few times their sagitta.
    assert dome.area * 1e6 == pytest.approx(np.pi * cut, rel=0.01)
    assert dome.volume * 1e9 == pytest.approx(np.pi * cut * (0.5 + 8.0) / 2.0, rel=0.01)
    assert dome.extreme * 1e3 == pytest.approx(8.0, abs=0.05)  # the top may lie between pins
    assert (dome.crests, dome.crest_length) == ((), 0.0)


def test_a_crease_is_measured_as_the_boss_it_mirrors_and_a_slope_counts_in_the_crest():
    (up,), (down,) = (features(formed(ridges(height, 4.0, "-12,0 12,0"))) for height in (6.0, -6.0))
    assert (up.kind, down.kind, down.name) == ("boss", "crease", "crease_1")
    figures = ("volume", "extreme", "crest_length")
    assert [getattr(down, name) for name in figures] == pytest.approx(
        [getattr(up, name) for name in figures]
    )
    head, row = make_table([up])
    words = "feature, form, pins, area, mm², height or depth, mm, crest, mm, volume, mm³"
    assert (len(head), ", ".join(head)) == (len(row), words)
    assert (*row[:2], row[4]) == ("boss_1", "ridge", "6.00")
    (boss,) = features(formed(lambda x, y: ridge(x, y) / 6.0 * (9.0 + x / 2.0)))
    span = boss.crests[0][-1] - boss.crests[0][0]
    # From 3 mm high at one end to 15 mm at the other: along the slope it is longer than in plan.
    assert boss.crest_length >= np.linalg.norm(span) - 1e-9
    assert abs(span[2]) > 0.4 * abs(span[0])


def test_features_are_numbered_by_volume_bosses_first():
    small, deep = ridges(3.0, 4.0, "-12,12 12,12"), ridges(-6.0, 4.0, "-12,-12 12,-12")
    found = features(formed(total(small, ridge, deep)))
    assert [one.name for one in found] == ["boss_1", "boss_2", "crease_1"]
    assert found[0].volume > found[1].volume
    assert summarize(found) == "2 bosses and 1 crease"
    assert features(formed(lambda x, y: 0.0 * x)) == []


def test_features_are_measured_from_the_surface_as_it_was_and_put_it_right():
    bed = formed(ridge)
    before = LEVEL + bed.position @ (0.1, 0.2)
    moved = Formed.of(bed.position, before + bed.raised, before, 0.0, 0)
    (one,), (other,) = features(bed), features(moved)
    # Squares may be cut along their other diagonal, which moves the surface within them.
    assert other.volume == pytest.approx(one.volume, rel=1e-3)
    assert_array_equal(other.pins, one.pins)
    # What is formed is what was there, plus the boss, minus the crease, but for the rim below the
    # threshold.
    up, down = ridges(6.0, 4.0, "-12,8 12,8"), ridges(-4.0, 4.0, "-12,-8 12,-8")
    bed = formed(total(up, down))
    boss, crease = features(bed, Finding(threshold=1e-6))
    # A pin stands for 1 mm²; along the outline the skin is straight where the sum over pins has a
    # corner.
    assert boss.volume - crease.volume == pytest.approx(bed.raised.sum() * 1e-6, rel=5e-3)


@pytest.mark.parametrize("smallest, count", [(1, 2), (2, 1), (9, 1), (10, 0)])
def test_a_feature_of_too_few_pins_is_none(smallest, count):
    def bumps(x, y):
        return 2.0 * ((np.maximum(np.abs(x), np.abs(y)) < 1.5) | (np.hypot(x - 9, y) < 0.5))

    assert len(features(formed(bumps), Finding(smallest=smallest))) == count


def test_a_pin_exactly_at_the_threshold_does_not_belong_to_the_feature_nor_leave_a_triangle_without_area():
    height = np.zeros(25)
    height[[6, 7, 8, 9, 11, 14, 16, 17, 18, 19]] = 0.5
    height[[12, 13]] = 2.0
    place = make_grid(Layout(rows=5, columns=5)).positions
    (boss,) = features(Formed.of(place, height, 0.0, 0.0, 0), Finding(threshold=0.5, smallest=1))
    assert_array_equal(boss.pins, [12, 13])
    a, b, c = np.moveaxis(boss.region.position[boss.region.faces], 1, 0)
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    # Beside a corner of the contour stands a triangle of a thousandth of a pitch, and not of
    # rounding.
    assert area.min() > 1e-4 * 0.5 * 9e-6
    assert len(np.unique(boss.region.position, axis=0)) == len(boss.region.position)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_every_body_is_closed_and_of_the_volume_that_is_listed(arrangement):
    # Bosses and creases of every shape, pinched, holed and side by side.
    place = make_grid(Layout(rows=14, columns=13, arrangement=arrangement)).positions
    height = LEVEL + np.random.default_rng(1).integers(-2, 3, len(place)) * 0.5e-3
    found = features(Formed.of(place, height, LEVEL, 0.0, 0), Finding(threshold=0.3e-3, smallest=1))
    assert len(found) > 2
    for one in found:
        mesh = mesh_of(one)
        _, counts = np.unique(np.sort(mesh.edges, axis=1), axis=0, return_counts=True)
        assert set(counts) == {2}
        assert mesh.is_winding_consistent
        assert mesh.volume == pytest.approx(one.apart.volume, rel=1e-9)
        # Where it is divided, a strip as wide as 0.005 to 0.01 pitches is missing: 0.1 mm² under up
        # to 1 mm.
        assert mesh.volume == pytest.approx(
            one.volume, rel=1e-9 if one.apart is one.region else 0.01
        )
        assert len(np.unique(mesh.faces)) == len(mesh.vertices)


@pytest.mark.parametrize("skin", ["smooth", "membrane"])
def test_bodies_follow_the_skin_that_is_asked_for(skin):
    bed = formed(ridge, rows=21, columns=21, pitch=2e-3)
    (coarse,), (fine,) = features(bed), features(bed, skin=skin, parts=4)
    mesh = mesh_of(fine)
    assert mesh.is_watertight
    assert len(mesh.faces) > 8 * len(mesh_of(coarse).faces)
    # Top and bottom of every point are the skin now and before.
    assert mesh.bounds[0, 2] == pytest.approx(LEVEL, abs=1e-12)
    assert mesh.bounds[1, 2] == pytest.approx(LEVEL + fine.extreme, abs=1e-12)


#: Pitch in mm; three of a kind that no ridge here fits to.
BEDS = (
    ("aligned", 3.0),
    ("staggered", 3.0),
    ("hexagonal", 3.0),
    ("aligned", 2.3),
    ("staggered", 2.3),
)
#: A crest is as long as the line its shape was drawn along, to this share.
LENGTH = 0.05


def noise(seed, spread):
    return lambda x, y: np.random.default_rng(seed).normal(0.0, spread, np.shape(x))


def total(*parts):
    return lambda x, y: np.sum([part(x, y) for part in parts], axis=0)


def highest(*parts):
    return lambda x, y: np.max([part(x, y) for part in parts], axis=0)


#: An eight whose line crosses itself.
AROUND = np.linspace(0.0, 2.0 * np.pi, 100)
ACROSS = 34.0 * np.cos(AROUND) / (1.0 + np.sin(AROUND) ** 2)
EIGHT = along(np.column_stack([ACROSS, 1.6 * ACROSS * np.sin(AROUND)]))
CRATER = ridges(10, 7, circle(0, 16))
SLANTED = "-25,-6 25,8", "-4,-25 4,25"
#: Shapes: heights in mm over x and y in mm, and the forms to be found, with the lengths of crests
#: in plan.
SHAPES = {
    "ridge": (ridges(12, 7, "-18,-10 20,9"), "ridge 42.5"),
    "cross": (ridges(12, 7, "-25,0 25,0", "0,-25 0,25"), "2 ridges 50 50"),
    "slanted cross": (ridges(12, 7, *SLANTED), "2 ridges 51.9 50.6"),
    "valleys that cross": (ridges(-9, 7, *SLANTED), "2 valleys 51.9 50.6"),
    "X": (ridges(12, 6, "-25,-12 25,12", "-25,12 25,-12"), "2 ridges 55.5 55.5"),
    "ring": (ridges(10, 6, circle(0, 20)), "ring 125.7"),
    "eight of two circles": (ridges(10, 6, circle(-19, 19), circle(19, 19)), "ring 238.8"),
    "eight": (ridges(10, 6, EIGHT), "ring 220.8"),
    "L": (ridges(12, 7, "-20,20 -20,-18 18,-18"), "ridge 76"),
    "T": (ridges(12, 7, "-25,15 25,15", "0,15 0,-22"), "2 ridges 50 37"),
    "S": (ridges(10, 6, arc(14, 0.1, 1.5), arc(-14, -0.9, 0.5)), "ridge 123.2"),
    "H": (ridges(10, 6, "-14,-25 -14,25", "14,-25 14,25", "-14,0 14,0"), "3 ridges 50 50 28"),
    "crater": (total(CRATER, mound(-6, 0, 10)), "ring 100.5; hollow"),
    "crater above ground": (highest(CRATER, lambda x, y: 4.0 * (np.hypot(x, y) < 16)), "ring 100.5"),
    "plateau": (lambda x, y: 8.0 * ((np.abs(x) < 15) & (np.abs(y) < 13)), "plateau"),
    "dome": (mound(12, 1, 14), "mound"),
    "two domes": (highest(mound(12, -9.5, 11), mound(12, 9.5, 11)), "mound; mound"),
    "ridge to the edge": (ridges(12, 7, "-80,-6 10,9"), "ridge 52.7"),
    "ridge with a mound at its end": (
        highest(ridges(12, 7, "-24,0 20,0"), mound(24, 20, 9)), "mound; ridge 44",
    ),
    "two mounds on a ridge": (
        highest(ridges(10, 7, "-30,0 30,0"), mound(22, -14, 9), mound(22, 14, 9)), "mound; mound; ridge 60",
    ),
    "sloping ridge": (lambda x, y: ridges(1, 7, "-20,0 20,0")(x, y) * (9 + 0.2 * x), "ridge 40"),
    "eight of two small circles": (ridges(10, 6, circle(-16, 16), circle(16, 16)), "ring 201.1"),
    "zigzag": (ridges(10, 5, "-32,-8 -16,8 0,-8 16,8 32,-8"), "ridge 90.5"),
    "steep zigzag": (ridges(10, 5, "-24,-16 -8,16 8,-16 24,16"), "ridge 107.3"),
    "Y": (ridges(12, 6, "-22.5,13 0,0 22.5,13", "0,0 0,-26"), "2 ridges 52 26"),
    "V": (ridges(12, 6, "-16,20 0,-20 16,20"), "ridge 86.2"),
    "noise": (noise(1, 0.14), ""),
    "noisy cross": (total(ridges(12, 7, *SLANTED), noise(2, 0.2)), "2 ridges 51.9 50.6"),
}  # fmt: skip


def form_shape(name, arrangement, pitch, turn=0.0, at=(0.0, 0.0)):
    """A bed of 84 mm x 84 mm; for a turned shape, which may be 90 mm long, of 108 mm x 108 mm."""
    size = 108 if turn else 84
    spacing = pitch * (np.sqrt(0.75) if arrangement == "hexagonal" else 1.0)
    layout = Layout(int(size / spacing) + 1, int(size / pitch) + 1, pitch * 1e-3, arrangement)
    place = make_grid(layout).positions
    x, y = (place * 1e3 - at).T
    raised = SHAPES[name][0](
        np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
    )
    return Formed.of(place, 0.04 + 1e-3 * raised, 0.04, 0.0, 0)


def find_fault(name, found, slack=0.0):
    """Return what features have in place of the forms of a shape and the lengths of their crests."""
    wanted = sorted(re.findall(r"((?:\d )?[a-z]+)([\d. ]*)", SHAPES[name][1]))
    known = [float(length) for _, lengths in wanted for length in lengths.split()]
    ordered = sorted(found, key=lambda one: one.form)
    lengths = [measure_run(crest[:, :2])[-1] * 1e3 for one in ordered for crest in one.crests]
    near = [pytest.approx(length, abs=LENGTH * length + slack) for length in known]
    forms = [one.form for one in ordered]
    right = forms == [form for form, _ in wanted] and lengths == near
    return "" if right else f"{name}: {forms} with crests of {lengths} mm"


@pytest.mark.parametrize("arrangement, pitch", BEDS[::4])
@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_is_found_as_what_it_is(name, arrangement, pitch):
    found = features(form_shape(name, arrangement, pitch))
    # The crest of a ridge that runs to the edge ends at the outermost pins, up to a pitch inside
    # it.
    assert not find_fault(name, found, pitch if name == "ridge to the edge" else 0.0)


def test_of_the_shapes_turned_and_beside_the_middle_95_in_100_are_found_as_what_they_are():
    random, faults = np.random.default_rng(22), []
    for (name, _), (arrangement, pitch) in itertools.product(SHAPES.items(), BEDS[2:4]):
        if name != "ridge to the edge":  # how long it is then depends on the edge
            bed = form_shape(
                name,
                arrangement,
                pitch,
                random.uniform(0.1, 6.2),
                tuple(random.uniform(-6.0, 6.0, 2)),
            )
            faults.append(find_fault(name, features(bed)))
    assert sum(map(bool, faults)) <= 0.05 * len(faults), faults


@pytest.mark.parametrize("arrangement, pitch", BEDS)
def test_the_crests_of_a_cross_keep_to_its_lines(arrangement, pitch):
    (boss,) = features(form_shape("slanted cross", arrangement, pitch))
    for crest in boss.crests:
        x, y = crest[:, :2].T * 1e3
        assert min(line(one)(x, y).max() for one in SLANTED) < 0.5 * pitch
    first = boss.crests[0][0, :2] * 1e3
    assert np.argmin([line(one)(*first) for one in SLANTED]) == 0  # the longer one first


@pytest.mark.parametrize(
    "name, bed",
    [
        ("ridge with a mound at its end", BEDS[1]),
        ("two mounds on a ridge", BEDS[2]),
        ("two domes", BEDS[3]),
    ],
)
def test_the_parts_of_a_boss_share_its_pins_area_and_volume(name, bed):
    bed = form_shape(name, *bed)
    parts = features(bed)
    whole = np.flatnonzero(bed.raised > Finding().threshold)
    assert_array_equal(np.sort(np.concatenate([one.pins for one in parts])), whole)
    (undivided,) = features(bed, Finding(smallest=len(whole) // 2 + 1))
    # The smaller parts have too few pins then.
    assert sum(one.area for one in parts) == pytest.approx(undivided.area, rel=1e-9)
    assert sum(one.volume for one in parts) == pytest.approx(undivided.volume, rel=1e-9)


def test_a_mound_on_a_ridge_is_as_high_as_it_is_and_the_ridge_no_higher_than_its_foot():
    found = features(form_shape("ridge with a mound at its end", "aligned", 3.0))
    height = {one.form: one.extreme * 1e3 for one in found}
    assert height["mound"] == pytest.approx(24.0, abs=1.0)  # between the pins
    assert height["ridge"] < 16.0
    (crest,) = next(one.crests for one in found if one.form == "ridge")
    assert np.ptp(crest[:, 2]) < 1e-3  # it goes on under the mound, level
