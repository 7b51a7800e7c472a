"""Sizes by F, symmetric strokes, lines and rings, drawn by a hand in a real window."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.window.blender_window import played
from tests.window.press_sizes import MIRRORED, RADIUS, WIDER

REST = 40.0
#: A pin that a finger of 4 mm depth has passed is down by more than this, mm.
FORMED = 1.0


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once; return what stood in the scene after each of its steps."""
    return played("press_sizes.py", tmp_path_factory.mktemp("sizes"), size=(800, 560), by_hand=True)


def down(seen: dict[str, Any], name: str) -> np.ndarray:
    """Return how far the pins are down, mm, rows by columns."""
    return REST - np.array(seen[name]["bed"])


def sizes(seen: dict[str, Any], name: str) -> tuple[float, float, float]:
    """Return the size that is set, drawn and simulated, mm."""
    found = seen[name]
    return found["size"], found["drawn size"], found["simulated"]


def test_the_rim_follows_the_mouse_and_the_session_takes_the_size_up(seen: dict[str, Any]) -> None:
    # A pixel is 0.3 mm of the bed.
    assert sizes(seen, "larger") == pytest.approx([16.0 + 2.0 * WIDER] * 3, abs=1.2)
    assert np.ptp(sizes(seen, "larger")) < 1e-3
    assert seen["larger"]["blister"] == pytest.approx(15.0 / 16.0 * seen["larger"]["size"], rel=1e-5)


@pytest.mark.parametrize("name", ["undone", "escaped"])
def test_ctrl_z_and_esc_leave_the_size_before_and_the_session_goes_on(
    seen: dict[str, Any], name: str
) -> None:
    assert sizes(seen, name) == pytest.approx([16.0] * 3, abs=1e-4)
    assert seen[name]["sessions"] == 1
    assert seen[name]["period"] > seen["begun"]["period"]


def test_a_value_is_typed_in_mm_or_with_a_unit(seen: dict[str, Any]) -> None:
    assert sizes(seen, "typed") == pytest.approx([24.0] * 3, abs=1e-4)
    assert sizes(seen, "typed cm") == pytest.approx([10.0] * 3, abs=1e-4)


def test_brackets_make_the_fingertip_larger_and_smaller(seen: dict[str, Any]) -> None:
    assert sizes(seen, "brackets") == pytest.approx([11.0] * 3, abs=1e-3)


def test_depth_and_strength_have_keys_of_their_own(seen: dict[str, Any]) -> None:
    assert seen["begun"]["depth"] == pytest.approx(4.0)
    assert seen["deeper"]["depth"] == pytest.approx(6.0, abs=0.2)
    assert (seen["strength"]["depth"], seen["strength"]["strength"]) == pytest.approx((4.0, 0.5), abs=1e-6)


def test_a_symmetric_stroke_forms_its_images_and_is_one_undo_step(seen: dict[str, Any]) -> None:
    (start, y), (end, _) = MIRRORED
    columns = np.arange(round(start / 3) + 12, round(end / 3) + 13)
    for row in (12 + round(y / 3), 12 - round(y / 3)):
        for side in (columns, 24 - columns):
            assert (down(seen, "symmetric")[row, side] > FORMED).mean() >= 0.95
    assert np.abs(down(seen, "symmetric undone")).max() < 1e-3


def test_a_line_and_the_line_of_a_shift_click_cover_all_their_pins(seen: dict[str, Any]) -> None:
    formed = down(seen, "lines") > FORMED
    assert formed[4, 3:22].mean() >= 0.95
    assert formed[4:22, 21].mean() >= 0.95
    # The blister reaches 15 mm to the side.
    assert not formed[10:22, 3:15].any()


def test_a_ring_covers_its_circumference_and_leaves_its_middle(seen: dict[str, Any]) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    rows, columns = (
        np.rint(12.0 + RADIUS / 3.0 * part).astype(int) for part in (np.sin(angle), np.cos(angle))
    )
    formed = down(seen, "ring") > FORMED
    assert formed[rows, columns].mean() >= 0.95
    assert not formed[11:14, 11:14].any()


def test_a_stabilized_stroke_reaches_its_end(seen: dict[str, Any]) -> None:
    assert (down(seen, "stabilized")[12, 3:22] > FORMED).mean() >= 0.95
