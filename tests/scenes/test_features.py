"""The paper's session has formed what it says it forms: a ridge with a mound, and a valley."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from digiclay.core.scene.scene_source import find as sample
from digiclay.core.scene.scene_source import load
from digiclay.core.session.run_scene import run
from digiclay.core.surface.features import Feature, find
from digiclay.core.surface.formed import make_formed
from digiclay.core.surface.skins import fit_skin


@pytest.fixture(scope="module")
def history() -> dict[str, Any]:
    """The session's history."""
    result = run(load(sample("ridge_mound_valley")))
    assert result.history is not None
    return dict(result.history)


def features(history: dict[str, Any], time: float, former: float) -> list[Feature]:
    """Return what was formed between two times, s."""
    row, before = (int(np.argmin(np.abs(history["time"] - moment))) for moment in (time, former))
    return find(fit_skin(make_formed(history, row, before), "bilinear", 1, 1e-3))


def test_at_the_end_there_are_a_ridge_a_mound_and_a_valley_along_the_ways_of_the_finger(history):
    at_end = features(history, 26.5, 0.0)
    wanted = [("boss", "mound"), ("boss", "ridge"), ("crease", "valley")]
    assert sorted((one.kind, one.form) for one in at_end) == wanted
    found = {one.form: one for one in at_end}
    # The finger went from x = -21 to 21 mm, at y = -21 mm for the ridge, y = 21 mm for the valley.
    for form, y in (("ridge", -21e-3), ("valley", 21e-3)):
        (line,) = found[form].crests
        assert np.abs(line[:, 1] - y).max() <= 3e-3  # a pitch
        assert np.ptp(line[:, 0]) == pytest.approx(42e-3, abs=4e-3)  # a pitch, and the pulp's yield


def test_the_mound_stands_where_the_finger_was_lifted_and_the_ridge_is_as_high_as_before(history):
    found = {one.form: one for one in features(history, 26.5, 0.0)}
    (before,) = features(history, 10.3, 0.0)
    middle = found["mound"].region.position.mean(axis=0)
    assert np.linalg.norm(middle - (21e-3, -21e-3)) < 6e-3
    assert found["mound"].extreme > 24e-3
    # Its crest goes on under the mound, as high as it was: 15 mm, and the pulp over it.
    ((crest,), (crest_before,)) = found["ridge"].crests, before.crests
    assert np.median(crest[:, 2]) == pytest.approx(np.median(crest_before[:, 2]), abs=0.5e-3)
    assert np.ptp(crest[:, 2]) < 3e-3


def test_the_ridge_stands_before_the_mound_and_the_mound_at_its_end(history):
    (ridge,) = features(history, 10.3, 0.0)
    (mound,) = features(history, 14.0, 10.3)
    assert ridge.extreme == pytest.approx(15e-3, abs=2e-3)  # drawn up by 15 mm, and the pulp over it
    (line,) = ridge.crests
    assert np.ptp(line[:, 2]) < 2e-3
    middle = mound.region.position.mean(axis=0)
    assert np.linalg.norm(middle - (21e-3, -21e-3)) < 6e-3
    assert mound.extreme == pytest.approx(10e-3, abs=3e-3)
