"""The sidebar's tab in a real Blender window: every panel drawn, unfolded, and a bed rebuilt from it."""

from __future__ import annotations

from typing import Any

import pytest

from tests.window.blender_window import played


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once; that no panel failed to draw is what `played` looks at."""
    return played("look_at_panels.py", tmp_path_factory.mktemp("panels"))


def test_every_panel_is_drawn_unfolded_without_a_complaint(seen: dict[str, Any]) -> None:
    pictures = "start all device device_rest finger control control_rest stale"
    assert set(seen["colors"]) == {f"panels_{name}" for name in pictures.split()}
    # What Blender prints when a panel's draw fails, or asks for a property there is not.
    complaints = ("rna_uiItemR", "property not found", "AttributeError", "unknown operator")
    assert [word for word in complaints if word in seen["output"]] == []


def test_the_panels_differ_from_picture_to_picture(seen: dict[str, Any]) -> None:
    # Shaded pins have thousands of colors; the empty scene of the start has far fewer than a bed.
    assert seen["colors"]["panels_start"] < seen["colors"]["panels_all"]
    assert min(seen["colors"].values()) > 500


def test_rebuild_tells_what_does_not_go_together_and_then_rebuilds(seen: dict[str, Any]) -> None:
    assert "Pitch must be at least Actuator: Bore, 2 mm" in seen["rebuild refused"]
    assert (seen["rebuilt"], seen["pins"]) == (["FINISHED"], 500)
