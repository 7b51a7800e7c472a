"""A pen of the window system presses and leans as it is held: X events of a virtual tablet."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from digiclay.core.model.fingertip import LEVEL, make_matrices
from digiclay.press.pointer import FULL_TILT

from tests.window.blender_window import ON_DISPLAY, played
from tests.window.tablet.screen import pen_screen

pytestmark = pytest.mark.skipif(not ON_DISPLAY, reason="a screen with a pen needs DIGICLAY_BLENDER_DISPLAY")


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once on a screen with a pen."""
    with pen_screen(tmp_path_factory.mktemp("screen")) as display:
        out = tmp_path_factory.mktemp("pen")
        return played("press_by_pen.py", out, size=(800, 560), by_hand=True, display=display)


@pytest.mark.parametrize(("name", "depth"), [("firm", 4.0), ("light", 2.0), ("leaning", 4.0)])
def test_a_pen_presses_as_deep_as_its_pressure(seen: dict[str, Any], name: str, depth: float) -> None:
    # The surface is level to a hundredth of a millimeter where no stroke has been.
    assert 40.0 - seen[name]["lowest"] == pytest.approx(depth, abs=0.05)


def tops(seen: dict[str, Any], name: str) -> np.ndarray:
    """Return where the top of the finger pointed while it was pressed in: x, y and z of the bed."""
    return make_matrices(np.array(seen[name]["inside"]))[:, :, 2]


def test_the_finger_leans_to_the_right_with_the_pen_and_no_other_way(seen: dict[str, Any]) -> None:
    angle = 0.8 * FULL_TILT
    # The tablet's tilt has steps of a degree.
    wanted = np.broadcast_to([np.sin(angle), 0.0, np.cos(angle)], tops(seen, "leaning").shape)
    np.testing.assert_allclose(tops(seen, "leaning"), wanted, rtol=0, atol=0.02)


@pytest.mark.parametrize("name", ["firm", "light", "leaning"])
def test_the_finger_is_upright_after_each_stroke(seen: dict[str, Any], name: str) -> None:
    np.testing.assert_allclose(seen[name]["outside"], LEVEL, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", ["firm", "light"])
def test_an_upright_pen_holds_the_finger_upright(seen: dict[str, Any], name: str) -> None:
    np.testing.assert_allclose(tops(seen, name)[:, 2], 1.0, rtol=0, atol=1e-6)


def test_a_leaning_finger_leaves_another_valley(seen: dict[str, Any]) -> None:
    bed = 40.0 - np.array(seen["leaning"]["bed"])
    upright, leaning = bed[17:24, 8:17], bed[1:8, 8:17]
    assert np.abs(upright - leaning).max() > 0.3
