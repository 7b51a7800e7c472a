"""The fingertip's underside beside the ellipsoid itself, its reach; where cells are, which are in a disc."""

import math

import numpy as np
import pytest
from digiclay.core.model.fingertip import JOIN, Fingertip, compute_reach, compute_reaches
from digiclay.core.model.layout import Layout, encloses, join_discs, make_grid, widen_disc
from digiclay.core.model.touch import trace_finger
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.assemble import under

AXES = np.array([10e-3, 8e-3, 8e-3])
RANDOM = np.random.default_rng(2)
AROUND = np.linspace(0, 2 * np.pi, 12, endpoint=False)


def random_poses(count):
    turns = RANDOM.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    return np.column_stack(
        [RANDOM.uniform(-20e-3, 20e-3, (count, 2)), RANDOM.uniform(0, 0.1, count), turns]
    )


def cut(pose, axes, x, y):
    """Return the lower height at which the vertical cuts (p - c)ᵀ A (p - c) = 1, which SciPy turns."""
    turn = Rotation.from_quat(pose[[4, 5, 6, 3]]).as_matrix()
    squared = turn @ np.diag(axes**2) @ turn.T
    center, a = pose[:3] + squared[:, 2] / np.sqrt(squared[2, 2]), np.linalg.inv(squared)
    dx, dy = x - center[0], y - center[1]
    roots = np.roots(
        [a[2, 2], 2.0 * (a[0, 2] * dx + a[1, 2] * dy),
         a[0, 0] * dx * dx + 2.0 * a[0, 1] * dx * dy + a[1, 1] * dy * dy - 1.0]
    )  # fmt: skip
    assert np.isreal(roots).all()
    return center[2] + roots.real.min()


def within(outline, square, angle):
    """Return points (x, y) at a squared reduced radius, in directions `angle`."""
    s_xx, s_xy, s_yy = outline[3:6]
    cos, sin = np.cos(angle), np.sin(angle)
    radius = np.sqrt(square / (s_xx * cos * cos + 2.0 * s_xy * cos * sin + s_yy * sin * sin))
    return outline[0] + radius * cos, outline[1] + radius * sin


@pytest.mark.parametrize("axes", [AXES, np.array([12e-3, 5e-3, 3e-3])], ids=["default", "flat"])
def test_the_underside_is_where_a_vertical_ray_meets_the_ellipsoid(axes):
    finger, poses = Fingertip(*axes), random_poses(40)
    for pose, outline in zip(poses, finger.outline(poses), strict=True):
        for square in (0.0, 0.3, 0.8, 0.95):
            x, y = within(outline, square, RANDOM.uniform(0, 2 * np.pi, 3))
            rays = [cut(pose, axes, *point) for point in zip(x, y, strict=True)]
            # Rounding of 0.1 m.
            assert under(outline[None], x, y)[0] == pytest.approx(rays, abs=1e-14)
    # Opposite quaternions are the same finger.
    assert np.array_equal(finger.outline(poses), finger.outline(poses * [1, 1, 1, -1, -1, -1, -1]))
    assert np.isfinite(
        under(finger.outline(poses), np.array([1.0, -100.0]), np.array([0.0, 100.0]))
    ).all()


def test_height_and_slope_are_continuous_at_the_join_and_beyond_it_the_underside_rises_on():
    for outline in Fingertip().outline(random_poses(20)):
        x, y = within(outline, JOIN, AROUND)
        # Over 2 nm/1000 a slope of 1/sqrt(1 - r²), 5 to 10, moves the underside 2e-11 m.
        inside, before, at, after, outside = (
            under(outline[None], x + offset * np.cos(AROUND), y + offset * np.sin(AROUND))[0]
            for offset in (-1e-12, -1e-9, 0.0, 1e-9, 1e-12)
        )
        assert np.abs(outside - inside).max() < 5e-11
        # Curvature near the rim, some 1e5 1/m, times 1 nm; rounding 1e-17/1e-9.
        assert np.abs(after - at - (at - before)).max() < 1e-3 * np.abs(at - before).max()
        dx, dy = x - outline[0], y - outline[1]
        rays = [
            under(outline[None], outline[0] + s * dx, outline[1] + s * dy)[0]
            for s in (1.5, 2, 3, 5)
        ]
        assert np.diff(rays, axis=0).min() > 0.0


BED = make_grid(Layout(15, 15, arrangement="staggered"))
axes = st.floats(1e-3, 20e-3)
fingers = st.builds(Fingertip, length=axes, width=axes, height=axes)
unit = st.floats(-1.0, 1.0)
turns = st.tuples(unit, unit, unit, unit).filter(lambda q: np.hypot.reduce(q) > 0.1)
spots = st.tuples(st.floats(-30e-3, 30e-3), st.floats(-30e-3, 30e-3), st.floats(0.0, 60e-3))
peaks = st.floats(0.0, 0.1)


def pose(spot, turn):
    return np.array([*spot, *(np.array(turn) / np.linalg.norm(turn))])


@given(fingers, spots, turns, peaks, st.floats(0.0, 6.3), st.floats(1.0, 3.0))
def test_beyond_its_reach_the_underside_is_above_the_peak(finger, spot, turn, peak, angle, farther):
    outline = finger.outline(pose(spot, turn)[None])
    disc = compute_reach((0.0, 0.0, 0.0, *compute_reaches(outline)[0].tolist()), peak)
    radius = (disc[2] if disc else 0.0) * farther + 1e-9
    x, y = outline[0, 0] + radius * np.cos(angle), outline[0, 1] + radius * np.sin(angle)
    # Rounding of heights, which grow with the square of the distance.
    assert under(outline, np.array([x]), np.array([y]))[0, 0] >= peak - 1e-9


@given(fingers, spots, turns, spots, spots)
def test_the_window_has_every_cell_the_finger_could_touch_within_a_period(
    finger, start, turn, middle, end
):
    poses = np.array([pose(spot, turn) for spot in (start, middle, end)])
    outline, peak = finger.outline(poses), 40e-3
    disc = compute_reach(trace_finger(finger, poses[None]).at(0).window, peak)
    cells = BED.disc(*disc) if disc else np.empty(0, int)
    touchable = np.flatnonzero((under(outline, BED.x, BED.y) < peak).any(axis=0))
    assert np.isin(touchable, cells).all()


#: Distance of rows and shift of odd ones, in pitches.
ARRANGEMENTS = {
    "aligned": (1.0, 0.0),
    "staggered": (1.0, 0.5),
    "hexagonal": (math.sqrt(3) / 2, 0.5),
}


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_the_cells_stand_row_by_row_a_pitch_apart(arrangement):
    spacing, shift = 3e-3 * np.array(ARRANGEMENTS[arrangement])
    table = make_grid(Layout(5, 4, 3e-3, arrangement)).positions.reshape(5, 4, 2)
    assert np.diff(table[:, :, 0], axis=1) == pytest.approx(3e-3, abs=1e-17)
    assert np.ptp(table[:, :, 1], axis=1).max() == 0.0
    assert np.diff(table[:, 0, 1]) == pytest.approx(spacing, abs=1e-17)
    assert table[:, 0, 0] - table[0, 0, 0] == pytest.approx(
        [0.0, shift, 0.0, shift, 0.0], abs=1e-17
    )


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("shape", [(1, 1), (1, 6), (6, 1), (5, 4), (6, 7)])
def test_the_bed_is_centered_on_the_origin(arrangement, shape):
    positions = make_grid(Layout(*shape, 3e-3, arrangement)).positions
    assert positions.min(axis=0) + positions.max(axis=0) == pytest.approx([0.0, 0.0], abs=1e-16)


@pytest.mark.parametrize(
    "arrangement, corners, farthest",
    [
        ("aligned", True, 1.5),
        ("aligned", False, 1.1),
        ("staggered", True, 1.2),
        ("hexagonal", False, 1.1),
    ],
)
def test_neighbors_are_the_nearest_cells_counter_clockwise(arrangement, corners, farthest):
    layout = Layout(5, 6, 3e-3, arrangement)
    x, y = make_grid(layout).positions.T
    for cell, beside in enumerate(layout.find_neighbors(corners=corners)):
        near = [other for other in beside if other >= 0]
        away = np.hypot(x - x[cell], y - y[cell])
        assert sorted([cell, *near]) == np.flatnonzero(away < farthest * 3e-3).tolist()
        assert np.all(
            np.diff(np.arctan2(y[near] - y[cell], x[near] - x[cell]) % (2.0 * np.pi)) > 0.0
        )


SMALL, LARGE, ASIDE = (1e-3, 0.0, 2e-3), (0.0, 0.0, 3e-3), (2e-3, 0.0, 2e-3)


@pytest.mark.parametrize(
    "outer, inner, holds",
    [
        (LARGE, SMALL, True),  # from inside it touches the rim
        (LARGE, ASIDE, False),
        (SMALL, LARGE, False),
        (None, SMALL, False),
        (SMALL, None, True),
        (None, None, True),
    ],
)
def test_a_disc_holds_another_alone_and_in_a_batch(outer, inner, holds):
    assert encloses(outer, inner) == holds
    assert encloses(join_discs([LARGE, outer]), join_discs([SMALL, inner])) == holds
    assert encloses(None, join_discs([inner])) is False
    assert math.isinf(join_discs([None])[2][0])


layouts = st.builds(
    Layout,
    rows=st.integers(1, 12),
    columns=st.integers(1, 12),
    pitch=st.sampled_from([1e-3, 2.6e-3, 3e-3]),
    arrangement=st.sampled_from(["aligned", "staggered", "hexagonal"]),
)
places = st.floats(-40e-3, 40e-3)


@given(layouts, places, places, st.floats(0.0, 40e-3))
def test_a_disc_has_all_cells_within_its_radius_and_bounds_hold_it_closely(layout, x, y, radius):
    bed = make_grid(layout)
    # On the rim itself rounding may decide either way; a disc widened by 1e-9 has those too.
    distance = np.hypot(bed.x - x, bed.y - y)
    surely, perhaps = distance <= radius * (1 - 1e-12), distance <= radius * (1 + 2e-9) + 1e-17
    disc, cells = bed.disc(x, y, radius), bed.box(x, y, radius)
    # Of a batch a run may have none.
    none, covered = bed.covered(widen_disc(join_discs([None, (x, y, radius)]), 1e-9 * radius)).T
    assert not none.any()
    for found in (np.isin(np.arange(bed.count), disc), covered):
        assert np.all(found >= surely)
        assert np.all(found <= perhaps)
    several = join_discs([(x, y, radius), (-y, x, radius / 3), None])
    both = np.union1d(disc, bed.disc(-y, x, radius / 3))
    assert np.array_equal(np.flatnonzero(bed.cover(several)), both)
    assert np.isin(disc, cells).all()
    assert np.all(np.diff(cells) > 0)
    # Rows that are shifted share the columns of those that are not: half a pitch more.
    slack = radius + layout.pitch / 2 + 1e-9
    assert np.all(np.maximum(np.abs(bed.x[cells] - x), np.abs(bed.y[cells] - y)) <= slack)
