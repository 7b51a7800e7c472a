"""Export and Make Mesh in a real Blender window: the panel, the redo of an undo, and the file browser."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import pytest

from tests.window.blender_window import played


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("export")


@pytest.fixture(scope="module")
def seen(out: Path) -> dict[str, Any]:
    """Play the script once."""
    return played("export_a_form.py", out)


def test_the_panel_lists_what_was_formed(seen: dict[str, Any]) -> None:
    lines = seen["listed"].splitlines()
    assert lines[0] == "1 boss and 1 crease"
    assert lines[1].startswith("boss_1: 14.0 mm high, crest ")
    assert lines[3].startswith("crease_1: 9.0 mm deep")


def test_no_panel_and_no_dialog_complains(seen: dict[str, Any]) -> None:
    complaints = ("rna_uiItemR", "property not found", "AttributeError", "unknown operator", "not found in")
    assert [word for word in complaints if word in seen["output"]] == []


def test_made_meshes_have_the_features_as_vertex_groups_and_undo_takes_them_back(
    seen: dict[str, Any],
) -> None:
    assert seen["groups"] == ["boss_1", "crease_1"]
    assert seen["undone"] == 2  # the two bodies, in one step


def test_the_file_browser_writes_the_file_with_the_ending_of_its_format(
    seen: dict[str, Any], out: Path
) -> None:
    assert seen["files"] == ["für später.3mf"]
    assert zipfile.ZipFile(out / seen["files"][0]).testzip() is None
