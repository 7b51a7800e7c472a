"""Sample scenes with bodies: what they leave is their undersides."""

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.scene.recorder import Recorder
from digiclay.core.scene.scene_source import find, load
from digiclay.core.session.run_scene import run

from tests.scenes.test_bodies import assert_formed


@pytest.mark.parametrize("name, held", [("hand_print", 1.5), ("face_cast", 2.3)])
def test_the_print_of_a_sample_body_is_its_underside(name, held):
    scene = load(find(name))
    assert scene.cells == 10_000
    assert scene.fingers[0].fingertip is None
    assert_formed(run(replace(scene, recorder=Recorder(every=1000))), held, 1400)


def test_a_ball_that_rolls_leaves_a_track_with_its_knobs():
    scene = load(find("ball_track"))
    done = run(replace(scene, recorder=Recorder(every=1000)))
    height, (x, y) = done.history["height"][-1], done.history["position"].T
    away = np.abs(y - 26e-3 * np.sin(np.pi * x / 62e-3))
    deep = scene.actuator.rest_height - height[(away < 3e-3) & (np.abs(x) < 55e-3)]
    # The ball is 11 mm deep, its knobs 3.5 mm deeper.
    assert 10e-3 < deep.min() < 11.5e-3
    assert 13e-3 < deep.max() < 14.6e-3
