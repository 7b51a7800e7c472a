"""A pen of the window system presses and leans as it is held: X events of a virtual tablet."""

import numpy as np
import pytest
from digiclay.core.model.fingertip import LEVEL, make_matrices
from digiclay.press.pointer import FULL_TILT

from tests.assemble import assert_near
from tests.window.blender_window import ON_DISPLAY, played
from tests.window.tablet.screen import pen_screen

pytestmark = pytest.mark.skipif(
    not ON_DISPLAY, reason="a screen with a pen needs DIGICLAY_BLENDER_DISPLAY"
)


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    with pen_screen(tmp_path_factory.mktemp("screen")) as display:
        out = tmp_path_factory.mktemp("pen")
        return played("press_by_pen.py", out, size=(800, 560), by_hand=True, display=display)


@pytest.mark.parametrize(
    "name, depth, angle",
    [("firm", 4.0, 0.0), ("light", 2.0, 0.0), ("leaning", 4.0, 0.8 * FULL_TILT)],
)
def test_a_pen_presses_as_deep_as_its_pressure_and_the_fingertip_leans_with_it_meanwhile(
    seen, name, depth, angle
):
    # The surface is level to a hundredth of a millimeter where no stroke has been.
    assert 40.0 - seen[name]["formed"] == pytest.approx(depth, abs=0.05)
    # Where its top points, along x, y and z of the bed; the tablet's tilt has steps of a degree.
    tops = make_matrices(np.array(seen[name]["inside"]))[:, :, 2]
    wanted = np.broadcast_to([np.sin(angle), 0.0, np.cos(angle)], tops.shape)
    assert_near(tops, wanted, 0.02 if angle else 1e-6)
    assert_near(seen[name]["outside"], LEVEL, 1e-6)
