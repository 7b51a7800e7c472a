"""Panels in a real Blender window: all unfolded, with a control method of one's own, and an export."""

from __future__ import annotations

import zipfile

import pytest

from tests.window.blender_window import Seen, played

PLAYED = {"script": "look_at_panels.py"}
#: What Blender prints when a panel's draw fails, or asks for a property or a value there is not.
COMPLAINTS = (
    "rna_uiItemR", "property not found", "AttributeError", "unknown operator", "current value", "not found in"
)  # fmt: skip


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    """What was seen of features, meshes and the file browser."""
    return played("export_a_form.py", tmp_path_factory.mktemp("export"))


def test_every_panel_is_drawn_unfolded_without_a_complaint(seen: Seen, exported: Seen) -> None:
    pictures = "start all device device_rest finger control control_rest stale own own_missing preferences"
    assert set(seen["colors"]) == {f"panels_{name}" for name in pictures.split()}
    assert set(exported["colors"]) == {f"export_{name}" for name in ("features", "meshes", "browser")}
    assert [word for word in COMPLAINTS if word in seen["output"] + exported["output"]] == []


def test_a_bed_makes_the_picture_richer(seen: Seen) -> None:
    # Shaded pins have thousands of colors.
    assert 500 < seen["colors"]["panels_start"] < seen["colors"]["panels_all"]


def test_rebuild_tells_what_does_not_go_together_and_then_rebuilds(seen: Seen) -> None:
    assert "Pitch must be at least Actuator: Bore, 2 mm" in seen["rebuild refused"]
    assert (seen["rebuilt"], seen["pins"]) == (["FINISHED"], 500)


def test_the_panel_lists_what_was_formed_and_the_made_meshes_have_it_as_vertex_groups(exported: Seen) -> None:
    lines = exported["listed"].splitlines()
    assert lines[0] == "1 boss and 1 crease"
    assert lines[1].startswith("boss_1: 14.0 mm high, crest ")
    assert lines[3].startswith("crease_1: 9.0 mm deep")
    assert exported["groups"] == ["boss_1", "crease_1"]
    assert exported["undone"] == 2  # the two bodies, in one step


def test_the_file_browser_writes_the_file_with_the_ending_of_its_format(exported: Seen) -> None:
    assert exported["files"] == ["für später.3mf"]
    assert zipfile.ZipFile(exported["folder"] / exported["files"][0]).testzip() is None
