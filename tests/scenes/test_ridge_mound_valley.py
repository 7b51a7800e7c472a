"""The paper's session forms what its name says, and never loses the finger while it does."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.scene.scene_source import find, load
from digiclay.core.session.run_scene import Result, run
from numpy.typing import NDArray

MM = 1e-3


@pytest.fixture(scope="module")
def session() -> Result:
    """Return the session, run once."""
    return run(load(find("ridge_mound_valley")))


def array(session: Result, name: str) -> NDArray[np.float64]:
    """Return an array of the session's history."""
    assert session.history is not None
    return session.history[name]


def profile(session: Result, y: float) -> NDArray[np.float64]:
    """Return the final heights of the row of cells at y, from left to right, over the rest height, m."""
    row = np.abs(array(session, "position")[:, 1] - y) < 0.1 * MM
    return array(session, "height")[-1, row] - session.scene.actuator.rest_height


def test_the_finger_touches_twice_and_is_never_lost_in_between(session: Result) -> None:
    touching = array(session, "total_force") > 0.0
    changes = array(session, "time")[1:][np.diff(touching)]
    # Down near the start, up after the mound; down for the valley, up at its end.
    assert np.allclose(changes, [0.4, 13.3, 15.7, 25.5], atol=0.1)


def test_the_ridge_is_15_mm_high_and_has_no_holes(session: Result) -> None:
    # From where the blister was lifted to where the mound's flank begins; 1 mm for the finger's give.
    ridge = profile(session, -21 * MM)[5:16]
    assert np.allclose(ridge, 15 * MM, atol=1 * MM)


def test_the_mound_rises_10_mm_above_the_ridge(session: Result) -> None:
    heights = profile(session, -21 * MM)
    # The master goes on for the 50 ms it takes to miss the finger, at up to 24 mm/s: 1.2 mm.
    assert heights.max() - np.median(heights[5:16]) == pytest.approx(10 * MM, abs=1.2 * MM)


def test_the_valley_lies_below_the_surface_from_side_to_side(session: Result) -> None:
    valley = profile(session, 21 * MM)[5:20]
    assert valley.max() < -6 * MM


def test_the_middle_of_the_bed_is_left_as_it_was(session: Result) -> None:
    # 21 mm to either path: outside both blisters (15 mm).
    assert np.abs(profile(session, 0.0)).max() == 0.0


def test_the_force_stays_near_its_set_point_while_shaping(session: Result) -> None:
    # A rise of 6 mm/s takes a force 0.1 N below the set point (K_f = 5 1/N); the rest is less.
    assert session.metrics["rfd_shaping"] < 0.1


def test_a_lift_off_leaves_no_lump(session: Result) -> None:
    heights = array(session, "height").reshape(-1, 25, 25)
    # The finger leaves the valley's end at 25.5 s; pins end where it was last felt, but for a servo's lag.
    before = heights[int(25.49 / 5e-3), 19, 19]
    assert abs(heights[-1, 19, 19] - before) < 0.5 * MM
