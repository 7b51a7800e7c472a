"""The paper's session has formed what it says it forms: a ridge with a mound, and a valley."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from digiclay.core.features import Feature, find
from digiclay.core.formed import of_history
from digiclay.core.scene_file import find as sample
from digiclay.core.scene_file import load
from digiclay.core.session import run
from digiclay.core.sheet import stretched


@pytest.fixture(scope="module")
def history() -> dict[str, Any]:
    """The session's history."""
    result = run(load(sample("ridge_mound_valley")))
    assert result.history is not None
    return dict(result.history)


def features(history: dict[str, Any], time: float, former: float) -> list[Feature]:
    """Return what was formed between two times, s."""
    row, before = (int(np.argmin(np.abs(history["time"] - moment))) for moment in (time, former))
    return find(stretched(of_history(history, row, before), "bilinear", 1, 1e-3))


def test_at_the_end_there_is_one_boss_and_one_crease(history):
    assert [one.name for one in features(history, 26.5, 0.0)] == ["boss_1", "crease_1"]


def test_their_crests_are_the_ways_of_the_finger(history):
    boss, crease = features(history, 26.5, 0.0)
    # The finger went from x = -21 to 21 mm, at y = -21 mm for the ridge, y = 21 mm for the valley.
    for feature, y in ((boss, -21e-3), (crease, 21e-3)):
        (line,) = feature.crests
        assert np.abs(line[:, 1] - y).max() <= 3e-3  # a pitch
        # A pitch at each end, and rounding, where the ridge rounds off; the boss's climbs its mound besides.
        assert np.ptp(line[:, 0]) == pytest.approx(42e-3, abs=6.1e-3)


def test_the_ridge_stands_before_the_mound_and_the_mound_at_its_end(history):
    (ridge,) = features(history, 10.3, 0.0)
    (mound,) = features(history, 14.0, 10.3)
    assert ridge.extreme == pytest.approx(15e-3, abs=2e-3)  # drawn up by 15 mm, and the pulp over it
    (line,) = ridge.crests
    assert np.ptp(line[:, 2]) < 2e-3
    middle = mound.region.place.mean(axis=0)
    assert np.linalg.norm(middle - (21e-3, -21e-3)) < 6e-3
    assert mound.extreme == pytest.approx(10e-3, abs=3e-3)
