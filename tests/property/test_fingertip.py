"""Where the finger can be met at all: its reach, and the window of cells that may touch it."""

from __future__ import annotations

import numpy as np
from digiclay.core.model.fingertip import JOIN, Fingertip, compute_reach, compute_reaches
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.model.touch import trace_finger
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.assemble import under

BED = make_grid(Layout(15, 15, arrangement="staggered"))
axes = st.floats(1e-3, 20e-3)
fingers = st.builds(Fingertip, length=axes, width=axes, height=axes)
unit = st.floats(-1.0, 1.0)
turns = st.tuples(unit, unit, unit, unit).filter(lambda q: np.hypot.reduce(q) > 0.1)
spots = st.tuples(st.floats(-30e-3, 30e-3), st.floats(-30e-3, 30e-3), st.floats(0.0, 60e-3))
peaks = st.floats(0.0, 0.1)
Spot = tuple[float, ...]


def pose(spot: tuple[float, ...], turn: tuple[float, ...]) -> NDArray[np.float64]:
    """Return a pose (7,)."""
    return np.array([*spot, *(np.array(turn) / np.linalg.norm(turn))])


@given(fingers, spots, turns, peaks, st.floats(0.0, 6.3), st.floats(1.0, 3.0))
def test_beyond_its_reach_the_underside_is_above_the_peak(
    finger: Fingertip, spot: Spot, turn: tuple[float, ...], peak: float, angle: float, farther: float
) -> None:
    outline = finger.outline(pose(spot, turn)[None])
    disc = compute_reach((0.0, 0.0, 0.0, *compute_reaches(outline)[0].tolist()), peak)
    radius = (disc[2] if disc else 0.0) * farther + 1e-9
    x, y = outline[0, 0] + radius * np.cos(angle), outline[0, 1] + radius * np.sin(angle)
    # Rounding of heights, which grow with the square of the distance.
    assert under(outline, np.array([x]), np.array([y]))[0, 0] >= peak - 1e-9


@given(fingers, spots, turns, st.floats(0.0, 6.3), st.floats(0.0, 0.1))
def test_no_point_of_the_underside_is_below_the_position(
    finger: Fingertip, spot: tuple[float, ...], turn: tuple[float, ...], angle: float, radius: float
) -> None:
    outline = finger.outline(pose(spot, turn)[None])
    # A disc-like finger tilted so far that it stands on its rim: there the paraboloid has taken over.
    dx, dy = spot[0] - outline[0, 0], spot[1] - outline[0, 1]
    assume(outline[0, 3] * dx * dx + 2 * outline[0, 4] * dx * dy + outline[0, 5] * dy * dy < JOIN)
    x, y = spot[0] + radius * np.cos(angle), spot[1] + radius * np.sin(angle)
    # Rounding; in a flat and steep ellipsoid, slopes of 20 multiply that of the position.
    assert under(outline, np.array([x]), np.array([y]))[0, 0] >= spot[2] - 1e-12


@given(fingers, spots, turns, spots, spots)
def test_the_window_has_every_cell_the_finger_could_touch_within_a_period(
    finger: Fingertip, start: Spot, turn: tuple[float, ...], middle: Spot, end: Spot
) -> None:
    poses = np.array([pose(spot, turn) for spot in (start, middle, end)])
    outline, peak = finger.outline(poses), 40e-3
    disc = compute_reach(trace_finger(finger, poses[None]).at(0).window, peak)
    cells = BED.disc(*disc) if disc else np.empty(0, int)
    touchable = np.flatnonzero((under(outline, BED.x, BED.y) < peak).any(axis=0))
    assert np.isin(touchable, cells).all()
