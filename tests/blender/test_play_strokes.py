"""Play Strokes: a script forms recorded strokes on a bed, without a window."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.live import beds
from digiclay.roles import fingertip_of
from digiclay.sessions import running

from tests.blender.at_hand import new_bed

pytestmark = pytest.mark.usefixtures("extension")
PRESS = "[[stroke]]\ndepth = 0.003\nwidth = 0.012\nmoves = [[0, -0.006, 0], [0.2, 0.006, 0]]\n"


@pytest.fixture
def bed() -> Any:
    """A small bed, active."""
    return new_bed(rows=9, columns=11)


def heights(bed: Any) -> Any:
    """Return how far the pins drawn are below rest, mm."""
    return 40.0 - 1e3 * bridge.read_cells(bed.data)["height"].reshape(9, 11)


def test_strokes_are_formed_and_kept_by_the_bed(bed: Any, tmp_path: Path) -> None:
    file = tmp_path / "press.toml"
    file.write_text(PRESS, encoding="utf-8")
    assert bpy.ops.digiclay.play_strokes(filepath=str(file)) == {"FINISHED"}
    assert heights(bed)[4, 5] > 1.5
    assert running.find(bed) is None
    assert beds.read_snapshot(bed) is not None
    # Its fingertip is above the bed again, of its own size.
    assert bridge.finger_of(fingertip_of(bed)).width == pytest.approx(8e-3)
    assert bridge.pose(fingertip_of(bed))[2] > 40e-3


@pytest.mark.parametrize(("text", "said"), [("[[stroke", "line 1"), (f"{PRESS}wide = 3", "known key")])
def test_a_wrong_file_leaves_the_bed_as_it_was(bed: Any, tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(RuntimeError, match=said) as caught:
        bpy.ops.digiclay.play_strokes(filepath=str(file))
    assert "Traceback" not in str(caught.value)
    assert np.abs(heights(bed)).max() < 1e-3
    assert running.find(bed) is None


def test_strokes_that_the_method_cannot_form_leave_the_bed_as_it_was(tmp_path: Path) -> None:
    bpy.ops.mesh.digital_clay_add(rows=9, columns=11, method="elastic")
    bed, file = bpy.context.object, tmp_path / "raise.toml"
    file.write_text(f'{PRESS}{PRESS}brush = "raise"\n', encoding="utf-8")
    with pytest.raises(RuntimeError, match=r"Stroke 2 \(raise\) needs a method with a blister"):
        bpy.ops.digiclay.play_strokes(filepath=str(file))
    assert np.abs(heights(bed)).max() < 1e-3
    assert running.find(bed) is None
