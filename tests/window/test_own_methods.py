"""Control methods of one's own in a real Blender window: panel and preferences without a complaint."""

from __future__ import annotations

from pathlib import Path

from tests.window.blender_window import played


def test_panel_and_preferences_are_drawn_with_the_method_and_without(tmp_path: Path) -> None:
    seen = played("look_at_own_methods.py", tmp_path)
    names = ("own_method", "own_method_missing", "own_method_preferences")
    assert set(seen["colors"]) == set(names)
    complaints = ("rna_uiItemR", "property not found", "AttributeError", "unknown operator", "current value")
    assert [word for word in complaints if word in seen["output"]] == []
