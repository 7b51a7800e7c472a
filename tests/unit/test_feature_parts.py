"""What a person would call a ridge, a mound, a ring, a crossing: shapes with known answers."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.surface.features import Feature, Finding, find
from digiclay.core.surface.formed import Formed
from digiclay.core.surface.skins import fit_skin

#: Pitch in mm; three of a kind that no ridge here fits to.
BEDS = (("aligned", 3.0), ("staggered", 3.0), ("hexagonal", 3.0), ("aligned", 2.3), ("staggered", 2.3))
#: A crest is as long as the line its shape was drawn along, to this share.
LENGTH = 0.05
Heights = Callable[[np.ndarray, np.ndarray], np.ndarray]


def round_top(away: np.ndarray, half: float) -> np.ndarray:
    """A parabola 1 high, as wide as `half` to either side."""
    return np.clip(1.0 - (away / half) ** 2, 0.0, None)


def line(*points: tuple[float, float]) -> Heights:
    """How far it is to a line of straight pieces."""
    ends = np.array([*itertools.pairwise(points)], float)[..., None]

    def away(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        (ax, ay), (dx, dy) = ends[:, 0].swapaxes(0, 1), (ends[:, 1] - ends[:, 0]).swapaxes(0, 1)
        u, v = np.ravel(x) - ax, np.ravel(y) - ay
        t = np.clip((u * dx + v * dy) / (dx * dx + dy * dy), 0.0, 1.0)
        return np.hypot(u - t * dx, v - t * dy).min(axis=0).reshape(np.shape(x))

    return away


def arc(x: float, y: float, radius: float, start: float, end: float) -> Heights:
    """How far it is to an arc; angles in half turns."""
    turn = np.pi * np.linspace(start, end, 40)
    points = np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])
    return line(*map(tuple, points))


def ridges(height: float, half: float, *lines: Heights) -> Heights:
    """Round ridges along lines."""
    return lambda x, y: height * round_top(np.min([one(x, y) for one in lines], axis=0), half)


def disc(x: np.ndarray, y: np.ndarray, at: float, half: float) -> np.ndarray:
    """A round mound 1 high about a point of the x axis."""
    return round_top(np.hypot(x - at, y), half)


def circle(at: float, radius: float) -> Heights:
    """How far it is to a circle about a point of the x axis."""
    return lambda x, y: np.abs(np.hypot(x - at, y) - radius)


def lemniscate() -> np.ndarray:
    """An eight whose line crosses itself."""
    t = np.linspace(0.0, 2.0 * np.pi, 100)
    across = 34.0 * np.cos(t) / (1.0 + np.sin(t) ** 2)
    return np.column_stack([across, 1.6 * across * np.sin(t)])


EIGHT = lemniscate()
SLANTED = line((-25, -6), (25, 8)), line((-4, -25), (4, 25))
ON_RIDGE = line((-30, 0), (30, 0))
#: Shapes: heights in mm over x and y in mm, and what is to be found: kind, form, lengths of crests in plan.
Known = list[tuple[str, str, list[float]]]
SHAPES: dict[str, tuple[Heights, Known]] = {
    "ridge": (ridges(12, 7, line((-18, -10), (20, 9))), [("boss", "ridge", [42.5])]),
    "cross": (
        ridges(12, 7, line((-25, 0), (25, 0)), line((0, -25), (0, 25))), [("boss", "2 ridges", [50, 50])],
    ),
    "slanted cross": (ridges(12, 7, *SLANTED), [("boss", "2 ridges", [51.9, 50.6])]),
    "valleys that cross": (ridges(-9, 7, *SLANTED), [("crease", "2 valleys", [51.9, 50.6])]),
    "X": (
        ridges(12, 6, line((-25, -12), (25, 12)), line((-25, 12), (25, -12))),
        [("boss", "2 ridges", [55.5, 55.5])],
    ),
    "ring": (ridges(10, 6, circle(0, 20)), [("boss", "ring", [125.7])]),
    "eight of two circles": (ridges(10, 6, circle(-19, 19), circle(19, 19)), [("boss", "ring", [238.8])]),
    "eight": (
        ridges(10, 6, line(*map(tuple, EIGHT))),
        [("boss", "ring", [float(np.hypot(*np.diff(EIGHT, axis=0).T).sum())])],
    ),
    "L": (ridges(12, 7, line((-20, 20), (-20, -18), (18, -18))), [("boss", "ridge", [76])]),
    "T": (
        ridges(12, 7, line((-25, 15), (25, 15)), line((0, 15), (0, -22))), [("boss", "2 ridges", [50, 37])],
    ),
    "S": (
        ridges(10, 6, arc(0, 14, 14, 0.1, 1.5), arc(0, -14, 14, -0.9, 0.5)), [("boss", "ridge", [123.2])],
    ),
    "H": (
        ridges(10, 6, line((-14, -25), (-14, 25)), line((14, -25), (14, 25)), line((-14, 0), (14, 0))),
        [("boss", "3 ridges", [50, 50, 28])],
    ),
    "crater": (
        lambda x, y: 10 * round_top(np.hypot(x, y) - 16, 7) - 6 * round_top(np.hypot(x, y), 10),
        [("boss", "ring", [100.5]), ("crease", "hollow", [])],
    ),
    "crater above ground": (
        lambda x, y: np.maximum(10 * round_top(np.hypot(x, y) - 16, 7), 4.0 * (np.hypot(x, y) < 16)),
        [("boss", "ring", [100.5])],
    ),
    "plateau": (lambda x, y: 8.0 * ((np.abs(x) < 15) & (np.abs(y) < 13)), [("boss", "plateau", [])]),
    "dome": (lambda x, y: 12 * disc(x, y, 1, 14), [("boss", "mound", [])]),
    "two domes": (
        lambda x, y: 12 * np.maximum(disc(x, y, -9.5, 11), disc(x, y, 9.5, 11)), [("boss", "mound", [])] * 2,
    ),
    "ridge to the edge": (ridges(12, 7, line((-80, -6), (10, 9))), [("boss", "ridge", [52.7])]),
    "ridge with a mound at its end": (
        lambda x, y: np.maximum(ridges(12, 7, line((-24, 0), (20, 0)))(x, y), 24 * disc(x, y, 20, 9)),
        [("boss", "mound", []), ("boss", "ridge", [44])],
    ),
    "two mounds on a ridge": (
        lambda x, y: np.maximum(
            ridges(10, 7, ON_RIDGE)(x, y), 22 * np.maximum(disc(x, y, -14, 9), disc(x, y, 14, 9))
        ),
        [("boss", "mound", [])] * 2 + [("boss", "ridge", [60])],
    ),
    "sloping ridge": (
        lambda x, y: round_top(line((-20, 0), (20, 0))(x, y), 7) * (9 + 0.2 * x), [("boss", "ridge", [40])],
    ),
    "eight of two small circles": (
        ridges(10, 6, circle(-16, 16), circle(16, 16)), [("boss", "ring", [201.1])],
    ),
    "zigzag": (
        ridges(10, 5, line((-32, -8), (-16, 8), (0, -8), (16, 8), (32, -8))), [("boss", "ridge", [90.5])],
    ),
    "steep zigzag": (
        ridges(10, 5, line((-24, -16), (-8, 16), (8, -16), (24, 16))), [("boss", "ridge", [107.3])],
    ),
    "Y": (
        ridges(12, 6, line((-22.5, 13), (0, 0), (22.5, 13)), line((0, 0), (0, -26))),
        [("boss", "2 ridges", [52, 26])],
    ),
    "V": (ridges(12, 6, line((-16, 20), (0, -20), (16, 20))), [("boss", "ridge", [86.2])]),
    "noise": (lambda x, y: np.random.default_rng(1).normal(0.0, 0.14, np.shape(x)), []),
    "noisy cross": (
        lambda x, y: ridges(12, 7, *SLANTED)(x, y) + np.random.default_rng(2).normal(0.0, 0.2, np.shape(x)),
        [("boss", "2 ridges", [51.9, 50.6])],
    ),
}  # fmt: skip


def formed(
    name: str, arrangement: str, pitch: float, turn: float = 0.0, at: tuple[float, float] = (0.0, 0.0)
) -> Formed:
    """A bed of 84 mm x 84 mm; for a turned shape, which may be 90 mm long, of 108 mm x 108 mm."""
    size = 108 if turn else 84
    spacing = pitch * (np.sqrt(0.75) if arrangement == "hexagonal" else 1.0)
    layout = Layout(int(size / spacing) + 1, int(size / pitch) + 1, pitch * 1e-3, arrangement)
    place = make_grid(layout).positions
    x, y = (place * 1e3 - at).T
    raised = SHAPES[name][0](np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x)
    return Formed.of(place, 0.04 + 1e-3 * raised, 0.04, 0.0, 0)


def in_plan(crest: np.ndarray) -> float:
    """Length of a crest seen from above, mm."""
    return float(np.hypot(*np.diff(crest[:, :2], axis=0).T).sum()) * 1e3


def find_faults(name: str, found: list[Feature], slack: float = 0.0) -> list[str]:
    """Return what is not as it should be, in words."""
    wanted = SHAPES[name][1]
    forms = sorted((one.kind, one.form) for one in found)
    if forms != sorted((kind, form) for kind, form, _ in wanted):
        return [f"{name}: {forms}"]
    faults = []
    for kind, form, lengths in wanted:
        if lengths:
            (one,) = [one for one in found if (one.kind, one.form) == (kind, form)]
            measured = [in_plan(crest) for crest in one.crests]
            if measured != [pytest.approx(length, abs=LENGTH * length + slack) for length in lengths]:
                faults.append(f"{name}: {form} of {measured}")
    return faults


@pytest.mark.parametrize(("arrangement", "pitch"), BEDS[::2])
@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_is_found_as_what_it_is(name: str, arrangement: str, pitch: float) -> None:
    bed = formed(name, arrangement, pitch)
    found = find(fit_skin(bed, "bilinear", 1, 1e-3))
    # The crest of a ridge that runs to the edge ends at the outermost pins, up to a pitch inside it.
    assert not find_faults(name, found, pitch if name == "ridge to the edge" else 0.0)


def test_of_the_shapes_turned_and_beside_the_middle_95_in_100_are_found_as_what_they_are() -> None:
    random, faults, count = np.random.default_rng(22), [], 0
    for (name, _), (arrangement, pitch) in itertools.product(SHAPES.items(), BEDS[1:4]):
        if name != "ridge to the edge":  # how long it is then depends on the edge
            bed = formed(
                name, arrangement, pitch, random.uniform(0.1, 6.2), tuple(random.uniform(-6.0, 6.0, 2))
            )
            faults += find_faults(name, find(fit_skin(bed, "bilinear", 1, 1e-3)))[:1]
            count += 1
    assert len(faults) <= 0.05 * count, faults


@pytest.mark.parametrize(("arrangement", "pitch"), BEDS)
def test_the_crests_of_a_cross_keep_to_its_lines(arrangement: str, pitch: float) -> None:
    (boss,) = find(fit_skin(formed("slanted cross", arrangement, pitch), "bilinear", 1, 1e-3))
    for crest in boss.crests:
        x, y = crest[:, :2].T * 1e3
        assert min(one(x, y).max() for one in SLANTED) < 0.5 * pitch
    assert np.argmin([one(*(boss.crests[0][0, :2] * 1e3)) for one in SLANTED]) == 0  # the longer one first


@pytest.mark.parametrize("name", ["ridge with a mound at its end", "two mounds on a ridge", "two domes"])
@pytest.mark.parametrize(("arrangement", "pitch"), BEDS[1:4])
def test_the_parts_of_a_boss_share_its_pins_area_and_volume(name, arrangement, pitch):
    bed = formed(name, arrangement, pitch)
    parts = find(fit_skin(bed, "bilinear", 1, 1e-3))
    whole = np.flatnonzero(bed.raised > Finding().threshold)
    np.testing.assert_array_equal(np.sort(np.concatenate([one.pins for one in parts])), whole)
    (undivided,) = find(fit_skin(bed, "bilinear", 1, 1e-3), Finding(smallest=len(whole) // 2 + 1))
    # The smaller parts have too few pins then.
    assert sum(one.area for one in parts) == pytest.approx(undivided.area, rel=1e-9)
    assert sum(one.volume for one in parts) == pytest.approx(undivided.volume, rel=1e-9)


def test_a_mound_on_a_ridge_is_as_high_as_it_is_and_the_ridge_no_higher_than_its_foot() -> None:
    found = find(fit_skin(formed("ridge with a mound at its end", "aligned", 3.0), "bilinear", 1, 1e-3))
    height = {one.form: one.extreme * 1e3 for one in found}
    assert height["mound"] == pytest.approx(24.0, abs=1.0)  # between the pins
    assert height["ridge"] < 16.0
    (crest,) = next(one.crests for one in found if one.form == "ridge")
    assert np.ptp(crest[:, 2]) < 1e-3  # it goes on under the mound, level
