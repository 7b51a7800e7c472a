"""The paper's session forms what its name says, never loses the finger, and its features are found."""

import numpy as np
import pytest
from digiclay.core.scene.scene_source import find as sample
from digiclay.core.scene.scene_source import load
from digiclay.core.session.run_scene import run
from digiclay.core.surface.features import find
from digiclay.core.surface.formed import make_formed
from digiclay.core.surface.skins import fit_skin

MM = 1e-3


@pytest.fixture(scope="module")
def session():
    return run(load(sample("ridge_mound_valley")))


def profile(session, y):
    """Return the final heights of the row of cells at y, from left to right, over the rest height, m."""
    row = np.abs(session.history["position"][:, 1] - y) < 0.1 * MM
    return session.history["height"][-1, row] - session.scene.actuator.rest_height


def features(session, time, former=0.0):
    """Return what was formed between two times, s, by its form."""
    row, before = (
        int(np.argmin(np.abs(session.history["time"] - moment))) for moment in (time, former)
    )
    found = find(fit_skin(make_formed(dict(session.history), row, before), "bilinear", 1, 1e-3))
    assert len(found) == len({one.form for one in found})
    return {one.form: one for one in found}


def test_the_valley_lies_below_the_surface_from_side_to_side_without_a_lump_at_its_end(session):
    assert profile(session, 21 * MM)[5:20].max() < -6 * MM
    # 21 mm to either path: outside both blisters (15 mm).
    assert np.abs(profile(session, 0.0)).max() == 0.0
    heights = session.history["height"].reshape(-1, 25, 25)
    # The finger leaves the valley's end at 25.5 s; pins end where it was last felt, but for a
    # servo's lag.
    assert abs(heights[-1, 19, 19] - heights[int(25.49 / 5e-3), 19, 19]) < 0.5 * MM


def test_at_the_end_there_are_a_ridge_a_mound_and_a_valley_along_the_ways_of_the_finger(session):
    found = features(session, 26.5)
    kinds = {form: one.kind for form, one in found.items()}
    assert kinds == {"mound": "boss", "ridge": "boss", "valley": "crease"}
    # The finger went from x = -21 to 21 mm, at y = -21 mm for the ridge, y = 21 mm for the valley.
    for form, y in (("ridge", -21e-3), ("valley", 21e-3)):
        (line,) = found[form].crests
        assert np.abs(line[:, 1] - y).max() <= 3e-3  # a pitch
        assert np.ptp(line[:, 0]) == pytest.approx(42e-3, abs=4e-3)  # a pitch, and the pulp's yield


def test_the_mound_stands_where_the_finger_was_lifted_and_the_ridge_is_as_high_as_before(session):
    found = features(session, 26.5)
    before = features(session, 10.3)
    grown = features(session, 14.0, 10.3)
    assert (before.keys(), grown.keys()) == ({"ridge"}, {"mound"})
    for mound in (found["mound"], grown["mound"]):
        assert np.linalg.norm(mound.region.position.mean(axis=0) - (21e-3, -21e-3)) < 6e-3
    assert found["mound"].extreme > 24e-3
    assert grown["mound"].extreme == pytest.approx(10e-3, abs=3e-3)
    assert before["ridge"].extreme == pytest.approx(15e-3, abs=2e-3)  # drawn up by 15 mm
    # Its crest goes on under the mound, as high as it was: 15 mm, and the pulp over it.
    ((crest,), (crest_before,)) = found["ridge"].crests, before["ridge"].crests
    assert np.median(crest[:, 2]) == pytest.approx(np.median(crest_before[:, 2]), abs=0.5e-3)
    assert np.ptp(crest[:, 2]) < 3e-3
    assert np.ptp(crest_before[:, 2]) < 2e-3
